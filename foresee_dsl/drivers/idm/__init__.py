"""The driver `idm`: follows its route with the Intelligent Driver Model, gives way, and brakes in an emergency.

The floor that other drivers are compared with: no change of lane, nobody predicted beyond constant speed. Route,
tracker, signals and the steering are those of `pdm`; between steps it keeps no more than that does.
"""

from __future__ import annotations

from foresee_dsl.drivers.idm import model
from foresee_dsl.drivers.idm.traffic import (
    STANDS_MPS,
    Leader,
    giving_way,
    leader,
    read_others,
    stop_line,
    time_to_collision,
    walkers,
)
from foresee_dsl.drivers.pdm.reading import Situation, read_situation
from foresee_dsl.drivers.pdm.route import Route, build_route
from foresee_dsl.drivers.pdm.signals import SignalMemory
from foresee_dsl.drivers.pdm.steps import control, steering
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker
from foresee_dsl.errors import DriverError

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
        angle = steering(self._route, situation.pose, 0.0, self._vehicle)
        return control(angle, _acceleration(situation), observation.ego, self._vehicle)


def _acceleration(situation: Situation) -> float:
    """Return the acceleration asked for, m/s^2."""
    pose, route = situation.pose, situation.route
    strongest = situation.ego.strongest_braking_mps2
    others = read_others(situation)
    if pose.speed > STANDS_MPS and time_to_collision(others, pose.speed) < EMERGENCY_TTC_S:
        return -strongest
    ahead = float(route.between(route.profile, pose.s + PREVIEW_S * pose.speed))
    # Bends are met by braking in time: the IDM's free term knows one desired speed and would come too late.
    wish = min(model.free_acceleration(pose.speed, max(ahead, SLOWEST_MPS)), (ahead - pose.speed) / PREVIEW_S)
    # A place to wait at is a leader that stands further on by the gap which the IDM keeps.
    places = [leader(others), _standing(walkers(situation, others))]
    places += [_standing(gap, model.MINIMUM_GAP_M) for gap in (stop_line(situation), giving_way(situation))]
    for place in places:
        if place is not None:
            desired = max(ahead, SLOWEST_MPS)
            wish = min(wish, model.acceleration(pose.speed, desired, place.gap_m, place.speed_mps))
    return max(wish, -strongest)


def _standing(gap_m: float | None, further_m: float = 0.0) -> Leader | None:
    return None if gap_m is None else Leader(gap_m + further_m, 0.0)
