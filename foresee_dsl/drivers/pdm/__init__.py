"""The bundled driver `pdm`: proposals of the Intelligent Driver Model, rolled out, scored, and the best one tracked.

In the manner of PDM-Closed (Dauner et al. 2023), on sensed objects. Between steps it keeps its tracker (the others'
places and speeds, smoothed) and the colours of signals for a second, both made of what it saw since `reset`. Its
decisions keep nothing: a run taken up again in the middle goes on in the same way as soon as the tracker has settled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm.decision import decide
from foresee_dsl.drivers.pdm.route import Route, build_route
from foresee_dsl.drivers.pdm.rules import signal_brakings
from foresee_dsl.drivers.pdm.signals import SignalMemory
from foresee_dsl.drivers.pdm.situation import Car, car_of, classes
from foresee_dsl.drivers.pdm.tracking import go_on
from foresee_dsl.drivers.protocol import Control, EgoState, FloatArray, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker
from foresee_dsl.errors import DriverError


class _Task(NamedTuple):
    """What holds for a whole run; `numbers` are those of the `car`, as the kernels take them."""

    route: Route
    car: Car
    numbers: FloatArray


class _Plan(NamedTuple):
    """What was decided on an object list of `measured_s`: the offset to steer for, m, and the acceleration."""

    measured_s: float
    offset_m: float
    acceleration_mps2: float


class PdmDriver:
    """IDM proposals along the route, scored against constant-velocity predictions (after PDM-Closed, 2023).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` changes nothing.
    """

    name = "pdm"
    version = "2"

    def __init__(self) -> None:
        self._task: _Task | None = None
        self._tracker, self._signals = Tracker(), SignalMemory()
        self._plan: _Plan | None = None

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and take up a new mission; the seed is not used."""
        car = car_of(vehicle)
        self._task = _Task(build_route(mission, vehicle), car, np.array(car))
        self._tracker, self._signals = Tracker(), SignalMemory()
        self._plan = None

    def step(self, observation: Observation) -> Control:
        """Answer one observation: decide where its object list is new (the standard sensors make one every second step,
        and PDM plans at 10 Hz), and steer.

        Raises:
            DriverError: `reset` was not called.
        """
        task, plan, ego = self._task, self._plan, observation.ego
        if task is None:
            raise DriverError("the driver pdm was stepped before reset")
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        if plan is None or measured_s != plan.measured_s:
            offset, wish, answer = self._decide(task, observation, ego)
            self._plan = _Plan(measured_s, offset, wish)
        else:
            route = task.route
            answer = go_on(
                ego.x,
                ego.y,
                ego.heading_rad,
                ego.speed_mps,
                ego.acceleration_mps2,
                task.numbers,
                route.coarse,
                route.table,
                route.origin_s,
                plan.offset_m,
                plan.acceleration_mps2,
            )
        return Control(*answer)

    def _decide(
        self, task: _Task, observation: Observation, ego: EgoState
    ) -> tuple[float, float, tuple[float, float, float]]:
        """Return the offset and the acceleration of the best proposal, and what to do for them now."""
        route, foes = task.route, task.route.foe_table
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        pedestrian, obstacle, speeds_up = classes(tracks.kinds)
        return decide(
            ego.x,
            ego.y,
            ego.heading_rad,
            ego.speed_mps,
            ego.acceleration_mps2,
            task.numbers,
            route.coarse,
            route.table,
            route.origin_s,
            foes.numbers,
            foes.walking,
            foes.points,
            foes.first,
            foes.junctions,
            foes.first_of,
            signal_brakings(route, task.car.strongest, signals),
            tracks.table,
            pedestrian,
            obstacle,
            speeds_up,
        )
