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

from foresee_dsl.drivers.bundled import NO_FUTURES, BundledDriver, Memory
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion
from foresee_dsl.drivers.pdm.route import DriverRoute, build_route
from foresee_dsl.drivers.pdm.situation import ego_record, read_situation, signal_brakings, write_state
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.compiling import direct
from foresee_dsl.kernels.pdm.decision import decide, hold, steer
from foresee_dsl.kernels.pdm.prediction import TIMES_S


class _Decision(NamedTuple):
    """A decision: the time of its object list, the lateral offset to reach and the acceleration; and its input."""

    measured_s: float
    offset_m: float
    acceleration_mps2: float
    observation: Observation
    tracks: Tracks
    signals: Mapping[str, SignalColour]


class _PdmState:
    """The state of the driver from one `reset` to the next.

    It holds the route, the ego's record [1] and the memory of that record as floats, the tracks and the signals.

    Attributes:
        route: the route that it follows.
        tracker: tracks the other actors.
    """

    route: DriverRoute

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None:
        self.follow(build_route(mission, vehicle))
        self._egos = ego_record(vehicle)
        self._numbers, self._strongest_mps2 = self._egos.view(np.float64).data, float(self._egos["strongest"][0])
        self.tracker, self._signals, self._memory = memory.tracker, memory.signals, memory
        self._last: _Decision | None = None
        self._vehicle = vehicle
        self._braking = signal_brakings(self.route, self._strongest_mps2, {})
        self._decide, self._hold = direct(decide), direct(hold)
        self._explained: tuple[_Decision | None, tuple[Reason, ...]] = (None, ())

    def follow(self, route: DriverRoute) -> None:
        """Follow this route from the next step on; its junctions are those of the mission."""
        self.route = route
        self._road = route.points, route.coarse, route.foes, route.paths, route.junctions

    def step(self, observation: Observation) -> Control:
        """Decide again if the object list is new, otherwise continue the last decision.

        The standard sensors give a new list every second step, which fits PDM's planning at 10 Hz.
        """
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        route, egos, last = self.route, self._egos, self._last
        write_state(self._numbers, observation.ego)
        if last is not None and measured_s == last.measured_s:
            return Control(*self._hold(egos, route.points, route.coarse, last.offset_m, last.acceleration_mps2))
        tracks, signals = self.tracker.update(observation), self._signals.update(observation)
        if last is None or signals != last.signals:
            self._braking = signal_brakings(route, self._strongest_mps2, signals)
        futures = self._memory.futures(tracks, TIMES_S)
        offset, acceleration, answer = self._decide(egos, tracks.table, *self._road, self._braking, futures)
        self._last = _Decision(measured_s, offset, acceleration, observation, tracks, signals)
        return Control(*answer)

    def planned(self) -> PlannedMotion | None:
        """Return the acceleration of the decision in force, and the wheel angle that leads to its offset."""
        if self._last is None:
            return None
        angle = float(steer(self._egos, self.route.points, self._last.offset_m))
        return PlannedMotion(self._last.acceleration_mps2, angle)

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer: decide once more for each signal and object alone (`reasons`)."""
        # Imported here, because driving does not need it.
        from foresee_dsl.drivers.pdm.reasons import Wish, reasons_alone

        last, route = self._last, self.route
        if last is None:
            return ()
        if self._explained[0] is last:  # the object list is not new, so the last decision stays in force
            return self._explained[1]
        tracks = last.tracks
        now = read_situation(route, self._vehicle, last.observation, tracks, last.signals)

        def decided(others: Tracks, colours: Mapping[str, SignalColour]) -> Wish:
            braking = signal_brakings(route, self._strongest_mps2, colours)
            egos = now.egos.copy()  # a decision writes the ego's position into it
            offset, acceleration, _ = decide(egos, others.table, *self._road, braking, NO_FUTURES)
            return Wish(acceleration, offset)

        self._explained = last, reasons_alone(now, tracks, decided)
        return self._explained[1]


class PdmDriver(BundledDriver[_PdmState]):
    """IDM proposals along the route, scored against constant-velocity predictions (after PDM-Closed, 2023).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` has no effect.
    """

    name = "pdm"
    version = "2"
    state_type = _PdmState
    parts = tuple(DriverPart)
