"""Whether a condition holds at the beginning of the run, as far as the places and speeds of the actors say it."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import shapely

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of

_COMPARES: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_LEAST_MPS = 1.0
"""The slowest speed that `headway` counts with, m/s (the language's)."""


@dataclass(frozen=True)
class Beginning:
    """Where an actor is at the beginning: its footprint, the pose of its middle, and its speed, m/s."""

    middle: Pose
    speed_mps: float
    length_m: float
    width_m: float

    @property
    def footprint(self) -> shapely.Polygon:
        """The rectangle that it covers."""
        half_l, half_w = self.length_m / 2, self.width_m / 2
        corners = ((half_l, half_w), (half_l, -half_w), (-half_l, -half_w), (-half_l, half_w))
        poses = [self.middle.ahead(along).beside(left) for along, left in corners]
        return shapely.Polygon([(pose.x, pose.y) for pose in poses])


def holds_at_start(condition: m.Condition, beginnings: Mapping[str, Beginning]) -> bool | None:
    """Return whether a condition holds at the beginning; None where the import does not know it.

    `beginnings` are those of the actors, by name.
    """
    if isinstance(condition, m.Not):
        inner = holds_at_start(condition.condition, beginnings)
        return None if inner is None else not inner
    if isinstance(condition, m.Both | m.Either):
        decides = isinstance(condition, m.Either)
        found = [holds_at_start(part, beginnings) for part in condition.conditions]
        return decides if decides in found else None if None in found else not decides
    if isinstance(condition, m.Sustained) and si_of(condition.duration) > 0:
        return False  # the run is not as old
    if isinstance(condition, m.Predicate) and condition.what == "collision":
        return False  # actors that begin on top of each other are refused
    if isinstance(condition, m.Comparison) and isinstance(condition.left, m.Measure):
        value = _measured(condition.left, beginnings)
        return None if value is None else _COMPARES[condition.op](value, si_of(condition.right))
    if isinstance(condition, m.Within) and condition.actor in beginnings:
        off = _distance(beginnings[condition.actor], condition.of, beginnings)
        return None if off is None else off <= si_of(condition.distance)
    return None


def _measured(measure: m.Measure, beginnings: Mapping[str, Beginning]) -> float | None:
    """Return what a measure is at the beginning, in SI units."""
    if measure.what == "time":
        return 0.0
    one, other = beginnings.get(measure.actor or ""), beginnings.get(str(measure.other))
    if one is None:
        return None
    if measure.what == "speed":
        return one.speed_mps
    if other is None:
        return None
    if measure.what == "relative_speed":
        turned = other.middle.heading_rad - one.middle.heading_rad
        return one.speed_mps - other.speed_mps * math.cos(turned)
    if measure.what in ("distance", "headway"):
        apart = float(one.footprint.distance(other.footprint))
        return apart if measure.what == "distance" else apart / max(one.speed_mps, _LEAST_MPS)
    return None


def _distance(one: Beginning, of: object, beginnings: Mapping[str, Beginning]) -> float | None:
    """Return how far a footprint is from another actor's or from a point, m."""
    if isinstance(of, m.Named) and str(of.name) in beginnings:
        return float(one.footprint.distance(beginnings[str(of.name)].footprint))
    if isinstance(of, m.Point):
        return float(one.footprint.distance(shapely.Point(si_of(of.x), si_of(of.y))))
    return None
