"""The driver `idm`: follows its route with the Intelligent Driver Model, gives way, and brakes in an emergency.

It is the baseline for other drivers: it never changes lanes, and predicts constant speeds only. Route, tracker, signals
and steering are those of `pdm`.

The model is that of Treiber, Hennecke, Helbing 2000, Physical Review E 62, equations 2 and 3. Its constants are ours,
for city traffic: those of the paper (table I) are for motorways, where acceleration to 50 km/h with 0.73 m/s^2 takes
half a minute. They are meant to be those of Treiber and Kesting 2013, Traffic Flow Dynamics, table 11.2, which could
not be looked up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from foresee_dsl.drivers.bundled import BundledDriver, Memory
from foresee_dsl.drivers.idm import traffic
from foresee_dsl.drivers.idm.traffic import ACCELERATION_MPS2, IdmLeader
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import RoadSituation, read_situation
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.decision import pedals, steer

TIME_GAP_S = 1.0
BRAKING_MPS2 = 1.5
EXPONENT = 4
LEAST_GAP_M = 0.1
"""Smallest gap with which the model computes, m. Ours: it avoids a division by zero."""

EMERGENCY_TTC_S = 1.5
"""Time to collision below which the driver brakes in an emergency, s: FHWA-HRT-08-051 (the Surrogate Safety Assessment
Model) counts a lower one as a conflict."""
PREVIEW_S = 0.5
"""The driver takes its desired speed from the place that it reaches after this time, s. Ours: drivetrain and brakes
respond 0.2 s late.
"""
SLOWEST_MPS = 0.5
"""Lowest desired speed, m/s. Ours: it avoids a division by zero."""


class _State:
    """The state of the driver from one `reset` to the next."""

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None:
        self._route, self._vehicle = build_route(mission, vehicle), vehicle
        self._tracker, self._signals = memory.tracker, memory.signals
        self._last: tuple[RoadSituation, Tracks] | None = None
        self._plan: PlannedMotion | None = None

    def step(self, observation: Observation) -> Control:
        """Answer an observation: keep the middle of the lane, with the model's acceleration."""
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        situation = read_situation(self._route, self._vehicle, observation, tracks, signals)
        self._last = situation, tracks
        angle, acceleration = steer(situation.egos, self._route.points, 0.0), _acceleration(situation)
        self._plan = PlannedMotion(acceleration, angle)
        return Control(*pedals(situation.egos, angle, acceleration))

    def planned(self) -> PlannedMotion | None:
        """Return the model's acceleration and the wheel angle of the last step."""
        return self._plan

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer: decide once more for each signal and object alone
        (`drivers.pdm.reasons`).
        """
        # Imported here, because driving does not need it.
        from foresee_dsl.drivers.pdm.reasons import Wish, reasons_alone, situation_of

        if self._last is None:
            return ()
        now, tracks = self._last

        def decided(others: Tracks, colours: Mapping[str, SignalColour]) -> Wish:
            return Wish(_acceleration(situation_of(now, others, colours)))

        return reasons_alone(now, tracks, decided)


class IdmDriver(BundledDriver[_State]):
    """Follows its lane with the Intelligent Driver Model, gives way, emergency brake (the floor).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` has no effect.
    """

    name = "idm"
    version = "1"
    state_type = _State
    parts = (DriverPart.PERCEPTION, DriverPart.TRACKING, DriverPart.RULES, DriverPart.CONTROL)


def _acceleration(situation: RoadSituation) -> float:
    """Return the acceleration that the driver wants, m/s^2."""
    ego, route = situation.ego, situation.route
    speed, others = ego.forward, traffic.read_others(situation)
    if speed > cfg.SENSED_STANDS_MPS and traffic.time_to_collision(others, speed) < EMERGENCY_TTC_S:
        return -ego.strongest
    allowed = float(route.between("profile", ego.s + PREVIEW_S * speed))
    desired = max(allowed, SLOWEST_MPS)
    # Brake for bends in time: the free term of the IDM has only one desired speed, and would begin to brake in the
    # bend.
    wish = min(free_acceleration(speed, desired), (allowed - speed) / PREVIEW_S)
    # A waiting place is treated as a standing leader. Because the IDM keeps a gap to a leader, this leader is put that
    # gap beyond the waiting place.
    waits = (
        (traffic.walkers(situation, others), 0.0),
        (traffic.stop_line(situation), cfg.MINIMUM_GAP_M),
        (traffic.giving_way(situation), cfg.MINIMUM_GAP_M),
    )
    places = [IdmLeader(gap + farther, 0.0) for gap, farther in waits if gap is not None]
    ahead = traffic.leader(others)
    for place in places if ahead is None else [ahead, *places]:
        wish = min(wish, idm_acceleration(speed, desired, place.gap_m, place.speed_mps))
    return max(wish, -ego.strongest)


def free_acceleration(speed_mps: float, desired_mps: float) -> float:
    """Return the acceleration on a free road, m/s^2: a (1 - (v / v0)^4)."""
    return ACCELERATION_MPS2 * (1.0 - (speed_mps / desired_mps) ** EXPONENT)


def desired_gap(speed_mps: float, closing_mps: float) -> float:
    """Return the desired gap, m: s0 + max(0, v T + v dv / (2 sqrt(a b))), with dv the driver's speed minus the
    leader's.
    """
    dynamic = speed_mps * (TIME_GAP_S + closing_mps / (2.0 * math.sqrt(ACCELERATION_MPS2 * BRAKING_MPS2)))
    return cfg.MINIMUM_GAP_M + max(0.0, dynamic)


def idm_acceleration(speed_mps: float, desired_mps: float, gap_m: float, leader_mps: float) -> float:
    """Return the IDM's acceleration, m/s^2: a (1 - (v / v0)^4 - (s* / s)^2); it has no lower bound.

    `desired_mps`: the desired speed v0, which must be above 0. `gap_m`: the gap s from bumper to bumper; infinite if
    there is no leader.
    """
    wish = desired_gap(speed_mps, speed_mps - leader_mps) / max(gap_m, LEAST_GAP_M)
    return free_acceleration(speed_mps, desired_mps) - ACCELERATION_MPS2 * wish * wish
