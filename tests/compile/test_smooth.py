"""The smooth line beside a part of a route: `path along ego.route from 2 m to 96 m offset 1.9 m`."""

from __future__ import annotations

import math

import pytest

from foresee_dsl.compile.placement.paths import smooth_beside
from foresee_dsl.compile.roads.polyline import Polyline, line_of
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.simulate.actors.bend_speeds import BendSpeeds
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from tests.support.worlds import EGO, problems_of, scene_of

RING = Polyline.of([(20.0 * math.cos(k * math.pi / 8), 20.0 * math.sin(k * math.pi / 8)) for k in range(13)])
"""Three quarters of a circle of 20 m, with corners of 22.5 deg."""
_BEHIND = """
bicycle cyclist: bicycle.city {{
  path along ego.route from {begin} to {end} offset -1 m
}}
"""


def slowest_kmh(points: tuple[tuple[float, float], ...]) -> float:
    """How slow a bicycle gets on a line, apart from its ends."""
    line = line_of(points)
    limit = lateral_limit_mps2("bicycle.city", 0.9)
    bends = BendSpeeds(line.marks, line.angles, axle_m=1.8, lateral_mps2=limit, braking_mps2=3.0)
    return bends.slowest_mps * 3.6


def test_a_bicycle_does_not_slow_down_at_each_corner_of_a_roundabout() -> None:
    corners = tuple(RING.at(s, 1.9)[:2] for s in range(0, int(RING.length_m), 5))
    assert slowest_kmh(corners) < 18
    smooth = smooth_beside(RING, 0.0, RING.length_m, left_m=1.9)
    assert slowest_kmh(smooth) > 22  # a circle of 17.6 m is taken with 23 km/h
    radii = [math.hypot(x, y) for x, y in smooth[8:-8]]
    assert max(radii) - min(radii) < 0.15


def test_it_begins_and_ends_beside_the_places_that_are_named() -> None:
    smooth = smooth_beside(RING, 5.0, 60.0, left_m=-1.5)
    for mark, xy in ((5.0, smooth[0]), (60.0, smooth[-1])):
        assert xy == pytest.approx(RING.at(mark, -1.5)[:2], abs=0.3)
    assert smooth_beside(RING, 60.0, 5.0, left_m=-1.5) == smooth[::-1]


def test_a_bend_that_is_narrower_than_the_offset_is_refused() -> None:
    hook = Polyline.of([(3.0 * math.cos(k * math.pi / 8), 3.0 * math.sin(k * math.pi / 8)) for k in range(9)])
    with pytest.raises(RouteError, match="4 m beside this part of the route no line is left"):
        smooth_beside(hook, 0.0, hook.length_m, left_m=4.0)


def test_lengths_count_from_where_the_other_actor_starts() -> None:
    scene = scene_of(EGO + _BEHIND.format(begin="10 m", end="40 m") + "end after 3 s")
    ego, cyclist = (next(a for a in scene.actors if a.id == name) for name in ("ego", "cyclist"))
    assert math.hypot(cyclist.path[0][0] - ego.x, cyclist.path[0][1] - ego.y) == pytest.approx(10.05, abs=0.01)
    assert line_of(cyclist.path).length_m == pytest.approx(30, abs=0.01)


@pytest.mark.parametrize(
    ("begin", "end", "message"),
    [
        ("10 m", "500 m", "after the end of the route of ego"),
        ("-90 m", "10 m", "before the beginning of the route of ego"),
        ("20 m", "20 m", "the path has no length"),
    ],
)
def test_what_is_not_on_the_route_is_said(begin: str, end: str, message: str) -> None:
    ((actor, item, text, help_),) = problems_of(EGO + _BEHIND.format(begin=begin, end=end) + "end after 3 s")
    assert (actor, item) == ("cyclist", "path_along")
    assert message in text and help_
