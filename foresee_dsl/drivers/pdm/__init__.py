"""The bundled driver `pdm`: proposals of the Intelligent Driver Model, rolled out, scored, and the best one tracked.

In the manner of PDM-Closed (Dauner et al. 2023), on sensed objects. Between steps it keeps its tracker (the others'
places and speeds, smoothed) and the colours of signals for a second, both made of what it saw since `reset`. Its
decisions keep nothing: a run resumed in the middle continues in the same way as soon as the tracker has settled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm.route import Route, build_route
from foresee_dsl.drivers.pdm.situation import ego_record, signal_brakings, write_state
from foresee_dsl.drivers.protocol import Control, FloatArray, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.tracking import SignalMemory, Tracker
from foresee_dsl.errors import DriverError
from foresee_dsl.kernels.pdm.control import go_on
from foresee_dsl.kernels.pdm.decision import decide
from foresee_dsl.kernels.pdm.records import Records


class _Task(NamedTuple):
    """What holds for a whole run: the route, the ego's record [1] and that as floats, and its strongest braking."""

    route: Route
    egos: Records
    numbers: FloatArray
    strongest_mps2: float


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
        egos = ego_record(vehicle)
        self._task = _Task(build_route(mission, vehicle), egos, egos.view(np.float64), float(egos["strongest"][0]))
        self._tracker, self._signals = Tracker(), SignalMemory()
        self._plan = None

    def step(self, observation: Observation) -> Control:
        """Answer one observation: decide where its object list is new (the standard sensors make one every second step,
        and PDM plans at 10 Hz), and steer.

        Raises:
            DriverError: `reset` was not called.
        """
        task, plan = self._task, self._plan
        if task is None:
            raise DriverError("the driver pdm was stepped before reset")
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        route, egos = task.route, task.egos
        write_state(task.numbers, observation.ego)
        if plan is not None and measured_s == plan.measured_s:
            return Control(*go_on(egos, route.points, route.coarse, plan.offset_m, plan.acceleration_mps2))
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        braking = signal_brakings(route, task.strongest_mps2, signals)
        road = route.points, route.coarse, route.foes, route.paths, route.junctions
        offset, wish, answer = decide(egos, tracks.table, *road, braking)
        self._plan = _Plan(measured_s, offset, wish)
        return Control(*answer)
