"""Decides whether a condition holds at the beginning of the run, as far as the actors' places and speeds
determine it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import shapely

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.language import model as m
from foresee_dsl.language.logic import compares, truth
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.results.metrics import headway, relative_speed


@dataclass(frozen=True)
class Beginning:
    """An actor at the beginning: pose of its centre, its speed, m/s, and the size of its footprint, m."""

    middle: Pose
    speed_mps: float
    length_m: float
    width_m: float

    @property
    def footprint(self) -> shapely.Polygon:
        """Return the area that the actor covers."""
        half_l, half_w = self.length_m / 2, self.width_m / 2
        corners = ((half_l, half_w), (half_l, -half_w), (-half_l, -half_w), (-half_l, half_w))
        poses = [self.middle.ahead(along).beside(left) for along, left in corners]
        return shapely.Polygon([(pose.x, pose.y) for pose in poses])


def holds_at_start(condition: m.Condition, beginnings: Mapping[str, Beginning]) -> bool | None:
    """Return whether a condition holds at the beginning; None if that is unknown.

    `beginnings` has the actors by name.
    """
    return truth(condition, partial(_part_holds, beginnings))


def _part_holds(beginnings: Mapping[str, Beginning], condition: m.Condition) -> bool | None:
    holds: bool | None = None
    match condition:
        case m.Sustained():
            holds = False if si_of(condition.duration) > 0 else None  # no time has passed yet
        case m.Predicate(what="collision"):
            holds = False  # the compiler refuses actors that overlap
        case m.Comparison(left=m.Measure() as measure):
            value = _measured(measure, beginnings)
            holds = None if value is None else compares(condition.op, value, si_of(condition.right))
        case m.Within() if condition.actor in beginnings:
            off = _distance(beginnings[condition.actor], condition.of, beginnings)
            holds = None if off is None else off <= si_of(condition.distance)
    return holds


def _measured(measure: m.Measure, beginnings: Mapping[str, Beginning]) -> float | None:
    """Return the value of a measure at the beginning, in SI units; None if it is unknown."""
    actor, other = beginnings.get(measure.actor or ""), beginnings.get(str(measure.other))
    if measure.what == "time":
        return 0.0
    if actor is not None and measure.what == "speed":
        return actor.speed_mps
    if actor is None or other is None or measure.what not in ("relative_speed", "distance", "headway"):
        return None
    if measure.what == "relative_speed":
        turned = other.middle.heading_rad - actor.middle.heading_rad
        return relative_speed(actor.speed_mps, other.speed_mps, turned)
    apart = float(actor.footprint.distance(other.footprint))
    return apart if measure.what == "distance" else headway(apart, actor.speed_mps)


def _distance(actor: Beginning, of: object, beginnings: Mapping[str, Beginning]) -> float | None:
    """Return the distance between a footprint and another actor or a point, m; None if it is unknown."""
    if isinstance(of, m.Named) and str(of.name) in beginnings:
        return float(actor.footprint.distance(beginnings[str(of.name)].footprint))
    if isinstance(of, m.Point):
        return float(actor.footprint.distance(shapely.Point(si_of(of.x), si_of(of.y))))
    return None
