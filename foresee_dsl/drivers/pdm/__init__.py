"""The bundled driver `pdm`: it simulates several proposals of the Intelligent Driver Model, scores them, and follows
the best one.

It follows PDM-Closed (Dauner et al. 2023), on sensed objects. Between steps it keeps its tracker (the smoothed
positions and speeds of the others) and, for a second, the colours of signals. A decision does not depend on earlier
ones: a run resumed in the middle continues in the same way as soon as the tracker has settled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.bundled import BundledDriver
from foresee_dsl.drivers.ideal import NO_FUTURES, Memory
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import ego_record, read_situation, signal_brakings, write_state
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.pdm.decision import decide, hold, steer
from foresee_dsl.kernels.pdm.prediction import TIMES_S


class _Plan(NamedTuple):
    """The decision that follows from the object list of `measured_s`: the lateral offset to reach, m, and the
    acceleration, m/s^2.
    """

    measured_s: float
    offset_m: float
    acceleration_mps2: float


class _Basis(NamedTuple):
    """The input from which the last decision was computed."""

    observation: Observation | None = None
    tracks: Tracks | None = None
    signals: Mapping[str, SignalColour] | None = None


class _State:
    """The state of the driver from one `reset` to the next.

    It holds the route, the ego's record [1] and the view of that record as floats, the tracks and the signals.
    """

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None:
        route = self._route = build_route(mission, vehicle)
        self._egos = ego_record(vehicle)
        self._numbers, self._strongest_mps2 = self._egos.view(np.float64), float(self._egos["strongest"][0])
        self._tracker, self._signals, self._memory = memory.tracker, memory.signals, memory
        self._plan: _Plan | None = None
        self._vehicle, self._basis = vehicle, _Basis()
        self._road = route.points, route.coarse, route.foes, route.paths, route.junctions
        self._braking = signal_brakings(route, self._strongest_mps2, {})
        self._explained: tuple[_Basis | None, tuple[Reason, ...]] = (None, ())

    def step(self, observation: Observation) -> Control:
        """Decide again if the object list is new, otherwise continue the last decision.

        The standard sensors give a new list every second step, which fits PDM's planning at 10 Hz.
        """
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        route, egos, plan = self._route, self._egos, self._plan
        write_state(self._numbers, observation.ego)
        if plan is not None and measured_s == plan.measured_s:
            return Control(*hold(egos, route.points, route.coarse, plan.offset_m, plan.acceleration_mps2))
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        if signals != self._basis.signals:
            self._braking = signal_brakings(route, self._strongest_mps2, signals)
        futures = self._memory.futures(tracks, TIMES_S)
        offset, acceleration, answer = decide(egos, tracks.table, *self._road, self._braking, futures)
        self._plan = _Plan(measured_s, offset, acceleration)
        self._basis = _Basis(observation, tracks, signals)
        return Control(*answer)

    def planned(self) -> PlannedMotion | None:
        """Return the acceleration of the decision in force, and the wheel angle that leads to its offset."""
        if self._plan is None:
            return None
        angle = float(steer(self._egos, self._route.points, self._plan.offset_m))
        return PlannedMotion(self._plan.acceleration_mps2, angle)

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer: decide once more for each signal and object alone (`reasons`)."""
        # Imported here, because driving does not need it.
        from foresee_dsl.drivers.pdm.reasons import Wish, ego_now, reasons_alone

        observation, tracks, signals = self._basis
        if observation is None or tracks is None:
            return ()
        if self._explained[0] is self._basis:  # the object list is not new, so the last decision stays in force
            return self._explained[1]
        route = self._route
        now = read_situation(route, self._vehicle, observation, tracks, signals)

        def decided(others: Tracks, colours: Mapping[str, SignalColour]) -> Wish:
            braking = signal_brakings(route, self._strongest_mps2, colours)
            offset, acceleration, _ = decide(ego_now(now), others.table, *self._road, braking, NO_FUTURES)
            return Wish(acceleration, offset)

        self._explained = self._basis, reasons_alone(now, tracks, decided)
        return self._explained[1]


class PdmDriver(BundledDriver[_State]):
    """IDM proposals along the route, scored against constant-velocity predictions (after PDM-Closed, 2023).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` has no effect.
    """

    name = "pdm"
    version = "2"
    state_type = _State
    parts = tuple(DriverPart)
