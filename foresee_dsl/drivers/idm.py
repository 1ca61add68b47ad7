"""The driver `idm`: follows its route with the Intelligent Driver Model, gives way, and brakes in an emergency.

It is the baseline for other drivers: it never changes lanes, and predicts constant speeds only. Route, tracker, signals
and steering are those of `pdm`.

The model is that of Treiber, Hennecke, Helbing 2000, Physical Review E 62, equations 2 and 3. Its constants are ours,
for city traffic: those of the paper (table I) are for motorways, where acceleration to 50 km/h with 0.73 m/s^2 takes
half a minute. They are meant to be those of Treiber and Kesting 2013, Traffic Flow Dynamics, table 11.2, which could
not be looked up. A decision is one kernel (`kernels.idm`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.bundled import BundledDriver, Memory
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion
from foresee_dsl.drivers.pdm.route import DriverRoute, build_route
from foresee_dsl.drivers.pdm.situation import ego_record, read_situation, signal_brakings, write_state
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.compiling import direct
from foresee_dsl.kernels.idm import decide


class _Decision(NamedTuple):
    """The last decision: what it was made from, and the planned motion."""

    observation: Observation
    tracks: Tracks
    signals: Mapping[str, SignalColour]
    plan: PlannedMotion


class _IdmState:
    """The state of the driver from one `reset` to the next.

    Attributes:
        route: the route that it follows.
        tracker: tracks the other actors.
    """

    route: DriverRoute

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None:
        self._decide = direct(decide)
        self.follow(build_route(mission, vehicle))
        self._vehicle = vehicle
        self._egos = ego_record(vehicle)
        self._numbers = self._egos.view(np.float64).data
        self._strongest_mps2 = float(self._egos["strongest"][0])
        self.tracker, self._signals = memory.tracker, memory.signals
        self._last: _Decision | None = None

    def follow(self, route: DriverRoute) -> None:
        """Follow this route from the next step on."""
        self.route = route
        self._road = route.points, route.coarse, route.foes, route.paths, route.junctions

    def step(self, observation: Observation) -> Control:
        """Answer an observation: keep the middle of the lane, with the model's acceleration."""
        tracks, signals = self.tracker.update(observation), self._signals.update(observation)
        write_state(self._numbers, observation.ego)
        braking = signal_brakings(self.route, self._strongest_mps2, signals)
        steering, throttle, brake, angle, acceleration = self._decide(self._egos, tracks.table, *self._road, braking)
        self._last = _Decision(observation, tracks, signals, PlannedMotion(acceleration, angle))
        return Control(steering, throttle, brake)

    def planned(self) -> PlannedMotion | None:
        """Return the model's acceleration and the wheel angle of the last step."""
        return None if self._last is None else self._last.plan

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer: decide once more for each signal and object alone
        (`drivers.pdm.reasons`).
        """
        # Imported here, because driving does not need it.
        from foresee_dsl.drivers.pdm.reasons import Wish, reasons_alone

        last = self._last
        if last is None:
            return ()
        now = read_situation(self.route, self._vehicle, last.observation, last.tracks, last.signals)

        def decided(others: Tracks, colours: Mapping[str, SignalColour]) -> Wish:
            braking = signal_brakings(self.route, self._strongest_mps2, colours)
            *_, acceleration = self._decide(now.egos.copy(), others.table, *self._road, braking)
            return Wish(acceleration)

        return reasons_alone(now, last.tracks, decided)


class IdmDriver(BundledDriver[_IdmState]):
    """Follows its lane with the Intelligent Driver Model, gives way, emergency brake (the floor).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` has no effect.
    """

    name = "idm"
    version = "1"
    state_type = _IdmState
    parts = (DriverPart.PERCEPTION, DriverPart.TRACKING, DriverPart.RULES, DriverPart.CONTROL)
