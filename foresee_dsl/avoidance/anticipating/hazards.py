"""Finds hazards for which an anticipating driver slows early.

These are hidden places, pedestrians at the kerb, and buses at stops.

A walker who steps out from a place beside the way, a distance g from the ego's side, needs g / v_walk to be in the way.
A driver with speed v who reacts after t and brakes with b either stands before the place, or is past it in time, if v
is at most 2 b (g / v_walk - t). This is the careful speed at the place; in practice people do not drive slower than
`settings.SLOWEST_MPS`, or past a bus at its stop `SLOWEST_AT_BUS_MPS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.foresight import Other, PredictedEgo
from foresee_dsl.avoidance.anticipating.settings import (
    AT_CROSSING_M,
    BESIDE_M,
    CLOSE_M,
    EASES_MPS2,
    EXPECTED_REACTION_S,
    HARDEST_MPS2,
    HIDES_M,
    KERB_M,
    NEAR_VEHICLE_M,
    NEARLY_STANDS_MPS,
    RUNNING_MPS,
    SLOWEST_AT_BUS_MPS,
    SLOWEST_MPS,
    WALKING_MPS,
)

_TOWARDS_MPS = 0.2
"""A walker walks towards the way if its speed towards the way's line is above this, m/s. Ours: a seventh of walking
pace.
"""
_HALF_CROSSING_M = 2.0
_APPROACHES_M = 8.0
"""The driver slows for a walker who walks towards the way and is nearer to it than this, m. Ours: five seconds of
walking.
"""


@dataclass(frozen=True)
class Hazard:
    """A place that the driver passes at a careful speed.

    Attributes:
        what: its name in reports. from_m: distance ahead of the ego's front at which the careful speed must be reached.
            speed_mps: the careful speed.
    """

    what: str
    from_m: float
    speed_mps: float

    def allows(self) -> float:
        """Return the largest present speed from which easy braking reaches the careful speed in time, m/s."""
        return math.sqrt(self.speed_mps**2 + 2 * EASES_MPS2 * max(self.from_m, 0.0))


def careful_mps(gap_m: float, walks_mps: float, slowest_mps: float) -> float:
    """Return the largest speed, m/s, at which a walker who steps out from beside the path is not hit.

    It is never lower than `slowest_mps`.
    """
    return max(2 * HARDEST_MPS2 * (gap_m / walks_mps - EXPECTED_REACTION_S), slowest_mps)


def hazards(ego: PredictedEgo, others: list[Other]) -> list[Hazard]:
    """Return the hazards ahead, from the actors in sight."""
    if not others:
        return []
    along, left, heading = ego.way.beside(np.array([(other.x, other.y) for other in others]))
    slow_places = []
    for k, other in enumerate(others):
        across = _half_across(other, float(heading[k]))
        half = _half_along(other, float(heading[k]))
        gap = abs(float(left[k])) - across - ego.width_m / 2
        front = ego.along_m + ego.length_m / 2
        if other.kind == "pedestrian" and ego.crossings:
            slow_places += _at_crossing(ego, other, front)
        if float(along[k]) + half < front or gap <= 0.0:
            continue
        before = float(along[k]) - half - front
        slow_places += _of(other, others, gap, before, float(left[k]), float(heading[k]))
    return slow_places


def _at_crossing(ego: PredictedEgo, walker: Other, front: float) -> list[Hazard]:
    """Return the crossings with priority for walkers that this walker may enter."""
    slow_places = []
    for path in ego.crossings:
        (x0, y0), (x1, y1) = path[0], path[-1]
        length = math.hypot(x1 - x0, y1 - y0)
        share = ((walker.x - x0) * (x1 - x0) + (walker.y - y0) * (y1 - y0)) / max(length, 0.1) ** 2
        nearest = min(max(share, 0.0), 1.0)
        away = math.hypot(walker.x - x0 - nearest * (x1 - x0), walker.y - y0 - nearest * (y1 - y0))
        middle = np.array([[(x0 + x1) / 2, (y0 + y1) / 2]])
        along, aside, _ = ego.way.beside(middle)
        if away < AT_CROSSING_M and float(along[0]) > front and abs(float(aside[0])) < length:
            before = float(along[0]) - front - _HALF_CROSSING_M - _stopping_m(SLOWEST_AT_BUS_MPS)
            slow_places.append(Hazard("a walker at a crossing", before, SLOWEST_AT_BUS_MPS))
    return slow_places


def _of(other: Other, others: list[Other], gap: float, before: float, left: float, heading: float) -> list[Hazard]:
    if other.kind == "pedestrian":
        return _walker(other, others, gap, before, left, heading)
    small = other.kind in ("bicycle", "motorcycle") or other.width_m < HIDES_M
    if small or other.speed_mps > NEARLY_STANDS_MPS or gap > BESIDE_M:
        return []
    bus, people = other.kind == "bus", _people_near(other, others)
    slowest = SLOWEST_AT_BUS_MPS if bus or people else SLOWEST_MPS
    speed = careful_mps(gap, RUNNING_MPS if bus else WALKING_MPS, slowest)
    what = "a bus that stands" if bus else "a stopped vehicle with people near it" if people else "a stopped vehicle"
    return [Hazard(what, before - _stopping_m(speed), speed)]


def _walker(other: Other, others: list[Other], gap: float, before: float, left: float, heading: float) -> list[Hazard]:
    towards = -math.copysign(1.0, left) * other.speed_mps * math.sin(other.course_rad - heading)
    stands = other.speed_mps < NEARLY_STANDS_MPS
    near = gap < CLOSE_M or (stands and gap < KERB_M)
    if not near and not (towards > _TOWARDS_MPS and gap < _APPROACHES_M):
        return []
    beside_vehicle = any(o.kind not in ("pedestrian", "bicycle") and _people_near(o, [other]) for o in others)
    slowest = SLOWEST_AT_BUS_MPS if beside_vehicle or towards > _TOWARDS_MPS else SLOWEST_MPS
    speed = careful_mps(gap, max(WALKING_MPS, towards), slowest)
    return [Hazard("a walker at the kerb", before - _stopping_m(speed), speed)]


def _people_near(vehicle: Other, others: list[Other]) -> bool:
    return vehicle.speed_mps < NEARLY_STANDS_MPS and any(
        other.kind == "pedestrian"
        and math.hypot(other.x - vehicle.x, other.y - vehicle.y) < vehicle.length_m / 2 + NEAR_VEHICLE_M
        for other in others
    )


def _stopping_m(speed_mps: float) -> float:
    return speed_mps * EXPECTED_REACTION_S + speed_mps**2 / (2 * HARDEST_MPS2)


def _half_across(other: Other, heading_rad: float) -> float:
    turned = other.heading_rad - heading_rad
    return (other.length_m * abs(math.sin(turned)) + other.width_m * abs(math.cos(turned))) / 2


def _half_along(other: Other, heading_rad: float) -> float:
    turned = other.heading_rad - heading_rad
    return (other.length_m * abs(math.cos(turned)) + other.width_m * abs(math.sin(turned))) / 2
