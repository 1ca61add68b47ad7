"""The driver `idm`: follows its route with the Intelligent Driver Model, gives way, and brakes in an emergency.

The lower bound that other drivers are compared with: no change of lane, nobody predicted beyond constant speed. Route,
tracker, signals and the steering are those of `pdm`; between steps it keeps no more than that does.

The model is that of Treiber, Hennecke, Helbing 2000, Physical Review E 62, equations 2 and 3. Its constants are ours,
for city traffic: those of the paper (table I) are for motorways, where 0.73 m/s^2 take half a minute to 50 km/h. They
are meant to be those of Treiber and Kesting 2013, Traffic Flow Dynamics, table 11.2, which could not be looked up.
"""

from __future__ import annotations

import math

from foresee_dsl.drivers.idm.traffic import (
    ACCELERATION_MPS2,
    STANDS_MPS,
    Leader,
    giving_way,
    leader,
    read_others,
    stop_line,
    time_to_collision,
    walkers,
)
from foresee_dsl.drivers.pdm.route import Route, build_route
from foresee_dsl.drivers.pdm.situation import Situation, read_situation
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.tracking import SignalMemory, Tracker
from foresee_dsl.errors import DriverError
from foresee_dsl.kernels.pdm.control import pedals, steer

TIME_GAP_S = 1.0
MINIMUM_GAP_M = 2.0
BRAKING_MPS2 = 1.5
EXPONENT = 4
LEAST_GAP_M = 0.1
"""Ours: nearer than this counts as this, so that nothing is divided by zero."""

EMERGENCY_TTC_S = 1.5
"""FHWA-HRT-08-051 (the Surrogate Safety Assessment Model): the time to collision under which it is a conflict."""
PREVIEW_S = 0.5
"""Ours: the speed profile is met this much ahead; drivetrain and brakes lag by 0.2 s."""
SLOWEST_MPS = 0.5
"""Ours: least desired speed, so that nothing is divided by zero."""


class IdmDriver:
    """Follows its lane with the Intelligent Driver Model, gives way, emergency brake (the floor).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` changes nothing.
    """

    name = "idm"
    version = "1"

    def __init__(self) -> None:
        self._route: Route | None = None
        self._vehicle: VehicleLimits | None = None
        self._tracker, self._signals = Tracker(), SignalMemory()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and take up a new mission; the seed is not used."""
        self._route = build_route(mission, vehicle)
        self._vehicle = vehicle
        self._tracker, self._signals = Tracker(), SignalMemory()

    def step(self, observation: Observation) -> Control:
        """Answer one observation.

        Raises:
            DriverError: `reset` was not called.
        """
        if self._route is None or self._vehicle is None:
            raise DriverError("the driver idm was stepped before reset")
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        situation = read_situation(self._route, self._vehicle, observation, tracks, signals)
        angle = steer(situation.egos, self._route.points, 0.0)
        return Control(*pedals(situation.egos, angle, _acceleration(situation)))


def _acceleration(situation: Situation) -> float:
    """Return the acceleration asked for, m/s^2."""
    ego, route = situation.ego, situation.route
    speed, others = ego.forward, read_others(situation)
    if speed > STANDS_MPS and time_to_collision(others, speed) < EMERGENCY_TTC_S:
        return -ego.strongest
    ahead = float(route.between("profile", ego.s + PREVIEW_S * speed))
    desired = max(ahead, SLOWEST_MPS)
    # Bends are met by braking in time: the IDM's free term knows one desired speed and would come too late.
    wish = min(free_acceleration(speed, desired), (ahead - speed) / PREVIEW_S)
    # A place to wait at is a leader that stands further on by the gap which the IDM keeps.
    places = [leader(others), _standing(walkers(situation, others))]
    places += [_standing(gap, MINIMUM_GAP_M) for gap in (stop_line(situation), giving_way(situation))]
    for place in places:
        if place is not None:
            wish = min(wish, idm_acceleration(speed, desired, place.gap_m, place.speed_mps))
    return max(wish, -ego.strongest)


def _standing(gap_m: float | None, further_m: float = 0.0) -> Leader | None:
    return None if gap_m is None else Leader(gap_m + further_m, 0.0)


def free_acceleration(speed_mps: float, desired_mps: float) -> float:
    """Return the acceleration on a free road, m/s^2: a (1 - (v / v0)^4)."""
    return ACCELERATION_MPS2 * (1.0 - (speed_mps / desired_mps) ** EXPONENT)


def desired_gap(speed_mps: float, closing_mps: float) -> float:
    """Return the desired gap, m: s0 + max(0, v T + v dv / (2 sqrt(a b))).

    Args:
        speed_mps: the own speed. closing_mps: by how much it is faster than the leader.
    """
    dynamic = speed_mps * (TIME_GAP_S + closing_mps / (2.0 * math.sqrt(ACCELERATION_MPS2 * BRAKING_MPS2)))
    return MINIMUM_GAP_M + max(0.0, dynamic)


def idm_acceleration(speed_mps: float, desired_mps: float, gap_m: float, leader_mps: float) -> float:
    """Return the IDM's acceleration, m/s^2: a (1 - (v / v0)^4 - (s* / s)^2); not bounded below.

    Args:
        speed_mps: own speed. desired_mps: v0, above 0.
        gap_m: bumper to bumper; infinite without a leader.
        leader_mps: the leader's speed along the lane.
    """
    wish = desired_gap(speed_mps, speed_mps - leader_mps) / max(gap_m, LEAST_GAP_M)
    return free_acceleration(speed_mps, desired_mps) - ACCELERATION_MPS2 * wish * wish
