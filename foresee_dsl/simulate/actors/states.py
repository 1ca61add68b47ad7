"""The current state of an actor, in a form that is the same for all kinds of actors during a run."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import Box, Mover
from foresee_dsl.simulate.actors.dynamics import BicycleState, centre_of_front
from foresee_dsl.simulate.trace import FIELDS

IntArray = NDArray[np.int32]

_ON_NONE = -1


class SimulatedActor:
    """The current footprint and motion of an actor; the modules that move actors change it in place.

    The values lie in an array of their own or, once the actor has joined a `StateTable`, in a row of that table.

    Attributes:
        id: its name. placed: the actor as the scene describes it. length, width: size of the footprint, m.
    """

    __slots__ = ("_along", "_lane", "_number", "_present", "_row", "_state_table", "id", "length", "placed", "width")

    def __init__(self, actor: PlacedActor) -> None:
        """Place the actor as the scene says."""
        self.placed = actor
        self.id = actor.id
        self.length = actor.model.length_m
        self.width = actor.model.width_m
        x, y = actor.x, actor.y
        # The scene gives the position of the front bumper; the state holds the position of the centre.
        if actor.control in ("ego", "sumo"):
            x, y = centre_of_front(x, y, actor.heading_rad, self.length)
        self._row = np.array(
            (x, y, actor.heading_rad, actor.speed_mps, actor.acceleration_mps2, 0.0, actor.steer_rad), dtype=np.float64
        )
        self._lane, self._along, self._present = actor.lane, math.nan, True
        self._state_table: StateTable | None = None
        self._number = 0

    @property
    def x(self) -> float:
        """x of the footprint's centre, m."""
        return self._row.item(0)

    @property
    def y(self) -> float:
        """y of the footprint's centre, m."""
        return self._row.item(1)

    @property
    def heading(self) -> float:
        """Heading, rad, counter-clockwise from east."""
        return self._row.item(2)

    @property
    def speed(self) -> float:
        """Speed along the heading, m/s."""
        return self._row.item(3)

    @speed.setter
    def speed(self, mps: float) -> None:
        self._row[3] = mps

    @property
    def acceleration(self) -> float:
        """Acceleration along the heading, m/s^2."""
        return self._row.item(4)

    @property
    def yaw_rate(self) -> float:
        """Yaw rate, rad/s, left positive."""
        return self._row.item(5)

    @property
    def steer(self) -> float:
        """Angle of the front wheels, rad, left positive."""
        return self._row.item(6)

    @property
    def lane(self) -> str:
        """SUMO's id of the lane that the actor is on; "" if it is on no lane."""
        return self._lane

    @lane.setter
    def lane(self, lane: str) -> None:
        if lane != self._lane:
            self._lane = lane
            if self._state_table is not None:
                self._state_table.set_lane(self._number, lane)

    @property
    def along(self) -> float:
        """Length along the actor's path, m; NaN if it follows no path."""
        return self._along

    @along.setter
    def along(self, along_m: float) -> None:
        self._along = along_m
        if self._state_table is not None:
            self._state_table.along[self._number] = along_m

    @property
    def present(self) -> bool:
        """Whether the actor is in the world: False before it enters and after it has left."""
        return self._present

    @present.setter
    def present(self, present: bool) -> None:
        if present == self._present:
            return
        self._present = present
        if self._state_table is not None:
            self._state_table.set_present(self._number, present, self._lane)

    @property
    def front(self) -> tuple[float, float]:
        """The middle of the front bumper, m."""
        x, y, heading, *_ = self._row.tolist()
        half = self.length / 2
        return x + half * math.cos(heading), y + half * math.sin(heading)

    @property
    def box(self) -> Box:
        """The footprint."""
        x, y, heading, *_ = self._row.tolist()
        return Box(x, y, heading, self.length, self.width)

    @property
    def mover(self) -> Mover:
        """The footprint together with the speed."""
        x, y, heading, speed, *_ = self._row.tolist()
        return Mover(x, y, heading, speed, self.length, self.width)

    def row(self) -> list[float]:
        """Return the current state: the columns of `Trace.states`. One call is cheaper than several properties."""
        values: list[float] = self._row.tolist()
        return values

    def bicycle(self) -> BicycleState:
        """Return the current state as a bicycle's state."""
        return BicycleState(*self._row.tolist())

    def move(
        self, x: float, y: float, heading: float, speed: float, acceleration: float = 0.0, yaw_rate: float = 0.0
    ) -> None:
        """Set position and motion; the steering angle stays."""
        row = self._row  # set one by one, because assigning a slice takes numpy twice as long
        row[0], row[1], row[2], row[3], row[4], row[5] = x, y, heading, speed, acceleration, yaw_rate

    def set_state(self, state: BicycleState) -> None:
        """Set the state to that of a bicycle."""
        heading = math.remainder(state.heading, math.tau)
        self._row[:] = state.x, state.y, heading, state.speed, state.acceleration, state.yaw_rate, state.steer

    def join(self, state_table: StateTable, number: int, row: FloatArray) -> None:
        """Keep the actor's state in this row of a table from now on, and write its lane and presence there."""
        self._row, self._state_table, self._number = row, state_table, number
        state_table.set_lane(number, self._lane)
        state_table.along[number] = self.along
        if not self._present:
            state_table.set_present(number, False, "")


class StateTable:
    """The states of all actors of a run as tables, so that one call moves all actors or records a frame.

    Attributes:
        states: [A, 7] the columns of `Trace.states`, also of absent actors.
        lanes: [A] index into `lane_ids`, -1 off the lanes; each change of lane replaces the array by a new array.
        lane_ids: every lane that an actor has been on, with its index.
        along: [A] length along the actor's path, m; NaN without a path.
    """

    def __init__(self, actors: Sequence[SimulatedActor]) -> None:
        """Gather these actors; their rows become the tables' rows, in this order."""
        self.states = np.array([actor._row for actor in actors]).reshape(-1, len(FIELDS))
        self.lanes: IntArray = np.full(len(actors), _ON_NONE, dtype=np.int32)
        self.along: FloatArray = np.full(len(actors), math.nan)
        self._absent: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self.lane_ids: dict[str, int] = {}
        for number, actor in enumerate(actors):
            actor.join(self, number, self.states[number])

    def set_lane(self, number: int, lane: str) -> None:
        """Set the lane of an actor."""
        self.lanes = self.lanes.copy()
        self.lanes[number] = self.lane_ids.setdefault(lane, len(self.lane_ids)) if lane else _ON_NONE

    def set_present(self, number: int, present: bool, lane: str) -> None:
        """Set whether an actor is present, and its lane if it is."""
        others = self._absent[self._absent != number]
        self._absent = others if present else np.append(others, number)
        self.set_lane(number, lane if present else "")
        if not present:
            self.along[number] = math.nan

    def frame(self) -> tuple[FloatArray, IntArray, FloatArray]:
        """Return copies of `states`, `lanes` and `along`, in which absent actors have NaN and -1."""
        states, lanes, along = self.states.copy(), self.lanes, self.along.copy()
        if self._absent.size:
            states[self._absent] = math.nan
        return states, lanes, along
