"""All vehicles that SUMO drives: moves their bodies after its steps, and slows them for bends before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.kernels.sumo_traffic import BENDS_S, BESIDE_S, follow, slow_for_bends
from foresee_dsl.simulate.actors.bend_speeds import LaneBends
from foresee_dsl.simulate.actors.bodies import SumoVehicle
from foresee_dsl.simulate.actors.states import StateTable
from foresee_dsl.simulate.lane_table import lane_table
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World

IntArray = NDArray[np.int64]


class SumoTraffic:
    """The vehicles that SUMO drives, until they leave or are taken over.

    Args:
        bodies: their bodies, which have joined the state_table. rows: of the state_table, by id.
        world: where they drive. network: their roads. friction: of the tyres on them.
        cruise_mps: what each drives where nothing hinders it, by id.
    """

    def __init__(
        self,
        bodies: Sequence[SumoVehicle],
        state_table: StateTable,
        rows: Mapping[str, int],
        world: World,
        network: RoadNetwork,
        friction: float,
        cruise_mps: Mapping[str, float],
    ) -> None:
        count = len(bodies)
        self._bodies, self._state_table, self._world = tuple(bodies), state_table, world
        self._numbers = {body.id: number for number, body in enumerate(bodies)}
        self._rows = np.array([rows[body.id] for body in bodies], dtype=np.int64)
        self._memory = np.array([body.memory for body in bodies]).reshape(count, 7)
        self._shape = np.array([body.shape for body in bodies]).reshape(count, 5)
        self._table = lane_table(network)
        self._lanes = np.full(count, -1, dtype=np.int64)
        self._bends = LaneBends(network, friction)
        self._begin, self._count = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        self._slowest = np.full(count, np.inf)
        self._cruise = np.array([cruise_mps[body.id] for body in bodies], dtype=np.float64)
        self._limit, self._told = np.full(count, np.inf), np.full(count, np.nan)
        self._changed = np.zeros(count, dtype=np.int64)
        self._driven = np.arange(count, dtype=np.int64)
        self._names: tuple[str, ...] = ()
        self._who = self._driven
        for number, body in enumerate(bodies):
            body.memory = self._memory[number]
            self._is_on(number, body.lane)

    def slow_for_bends(self) -> None:
        """Tell SUMO what each may drive in the next step: it knows only the bends inside junctions, not who tips."""
        told = self._told
        for number in self._look():
            self._world.limit_speed(self._bodies[number].id, told.item(number))

    def may_drive_mps(self) -> dict[str, float]:
        """Return what the bends allow each vehicle in the next step; infinite where they do not matter."""
        self._look()
        self._told[:] = np.nan  # nobody has been told
        return {body.id: float(limit) for body, limit in zip(self._bodies, self._limit, strict=True)}

    def cruises(self, vehicle: str, speed_mps: float) -> None:
        """Note that a vehicle drives another speed from now on where nothing hinders it."""
        number = self._numbers[vehicle]
        self._cruise[number], self._told[number] = speed_mps, np.nan

    def follow(self) -> tuple[str, ...]:
        """Move everybody to where SUMO has them after a step.

        Returns:
            The ids of those who have left the world.
        """
        names, places, speeds, changed = self._world.vehicles()
        left: tuple[str, ...] = ()
        if names is not self._names:
            left = self._gone(names)
        for vehicle, lane in changed:
            number = self._numbers[vehicle]
            if lane != self._bodies[number].lane:
                self._bodies[number].lane = lane
                self._is_on(number, lane)
        table = self._table
        follow(
            np.array(places), np.array(speeds), self._who, self._rows, self._state_table.states, self._memory,
            self._shape, self._lanes, table.first, table.x, table.y, table.marks, table.angles, STEP_S,
        )  # fmt: skip
        return left

    def drop(self, vehicle: str) -> None:
        """Leave a vehicle alone from now on: somebody else moves it."""
        self._driven = self._driven[self._driven != self._numbers[vehicle]]

    def _look(self) -> list[int]:
        """Find out what each may drive; return those for whom it is something else than they were told."""
        table, bends = self._table, self._bends
        found = slow_for_bends(
            self._driven, self._rows, self._state_table.states, self._memory, self._lanes, table.first, table.x,
            table.y, table.marks, self._begin, self._count, self._slowest, bends.marks, bends.speeds,
            self._cruise, self._limit, self._told, self._changed, STEP_S,
        )  # fmt: skip
        changed: list[int] = self._changed[:found].tolist()
        return changed

    def _is_on(self, number: int, lane: str) -> None:
        """Note that a vehicle is on another lane now."""
        body = self._bodies[number]
        if self._lanes[number] >= 0:  # where it was on the last one says nothing of this one
            self._memory[number, BESIDE_S] = np.nan
        self._memory[number, BENDS_S] = np.nan
        self._lanes[number] = self._table.numbers.get(lane, -1)
        ahead = self._bends.ahead(body.id, body.placed.model, lane, body.placed.route)
        self._begin[number], self._count[number], self._slowest[number] = ahead

    def _gone(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Take note of who is there; return those of the others who are not any more."""
        self._names = names
        self._who = np.array([self._numbers[name] for name in names], dtype=np.int64)
        here = set(names)
        left = tuple(self._bodies[k].id for k in self._driven.tolist() if self._bodies[k].id not in here)
        for name in left:
            self._bodies[self._numbers[name]].present = False
            self.drop(name)
        return left
