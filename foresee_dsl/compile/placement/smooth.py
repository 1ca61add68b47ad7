"""The smooth line beside a part of a route, for the statement `path along`.

The line of a route has the corners of netconvert's turns. Here they are replaced by arcs, so that an actor on the line
follows a single bend and does not slow down at each corner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import shapely

from foresee_dsl.compile.roads.polyline import XY, Polyline, direction, distance, wrap
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.errors import measured

_STRAIGHT_M = 0.05
"""If a corner of a route's line is nearer than this to the straight line between its neighbours, it is attributed to
rounding, m: nets are rounded to 1 cm. Ours.
"""
_STRAIGHT_RAD = 1e-4
"""A line counts as straight at a point at which it turns by less than this, rad: 0.1 mm per metre. Ours."""
_CUT_M = 0.5
"""Largest distance of an arc from its corner, m. Ours: SUMO's roundabouts of 20 corners deviate as much from a circle
of 40 m."""
_TURN_RAD = math.radians(4.0)
"""Change of direction between neighbouring points of an arc, rad. Ours: half of the corner of 8 deg at which a bicycle
of 1.8 m at 25 km/h would begin to slow down."""


def beside(line: Polyline, begin_m: float, end_m: float, *, left_m: float) -> tuple[XY, ...]:
    """Return the smooth line `left_m` to the left of a part of a line (negative: to the right), m.

    If `begin_m` is beyond `end_m`, the line leads back, on the same side.

    Raises:
        RouteError: the part is inside a bend that is narrower than the offset, so there is no such line.
    """
    low, high = min(begin_m, end_m), max(begin_m, end_m)
    middle = [xy for mark, xy in zip(line.marks, line.xy, strict=True) if low < mark < high]
    ends = line.at(low)[:2], line.at(high)[:2]
    whole = shapely.LineString(_without_straight((ends[0], *middle, ends[1])))
    part = shapely.LineString(whole.simplify(_STRAIGHT_M).coords)
    points = (*_rounded(_moved(part, left_m)),)
    return points if begin_m <= end_m else points[::-1]


def _without_straight(points: Sequence[XY]) -> list[XY]:
    """Return a line without the points at which it is straight, because such a point is not a corner."""
    kept = [points[0]]
    for point, after in pairwise(points[1:]):
        if abs(wrap(direction(point, after) - direction(kept[-1], point))) > _STRAIGHT_RAD:
            kept.append(point)
    return [*kept, points[-1]]


def _moved(part: shapely.LineString, left_m: float) -> Sequence[XY]:
    """Return the corners of the parallel line `left_m` to the left."""
    corners = [(float(x), float(y)) for x, y in part.coords]
    turns = [direction(a, b) for a, b in pairwise(corners)]
    moved: list[XY] = []
    for k, (x, y) in enumerate(corners):
        before, after = turns[max(k - 1, 0)], turns[min(k, len(turns) - 1)]
        half = wrap(after - before) / 2
        reach = left_m / max(math.cos(half), 0.5)  # a sharper corner is cut at two widths
        moved.append((x - reach * math.sin(before + half), y + reach * math.cos(before + half)))
    if all(
        abs(wrap(direction(a, b) - turn)) < math.pi / 2 for (a, b), turn in zip(pairwise(moved), turns, strict=True)
    ):
        return moved
    # Inside a bend that is narrower than the offset, the parallel line reverses; that loop is removed.
    cut = shapely.offset_curve(part, left_m, join_style="mitre", mitre_limit=2.0).simplify(_STRAIGHT_M)
    if cut.is_empty or cut.geom_type != "LineString":
        message = (
            measured(f"{abs(left_m):g}") + " m beside this part of the route no line is left: its bends are narrower"
        )
        raise RouteError(message, "take a smaller offset")
    return [(float(x), float(y)) for x, y in cut.coords]


def _rounded(corners: Sequence[XY]) -> Iterator[XY]:
    """Yield the points of a line with its corners replaced by arcs; its ends do not change."""
    yield corners[0]
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        yield from _arc(before, corner, after)
    yield corners[-1]


def _arc(before: XY, corner: XY, after: XY) -> Iterator[XY]:
    """Yield the points of the largest arc that uses at most half of either side and passes within `_CUT_M`."""
    (inwards, room), (outwards, more) = (
        (direction(a, b), distance(a, b) / 2) for a, b in pairwise((before, corner, after))
    )
    turn = wrap(outwards - inwards)
    if abs(turn) < 1e-6:
        return
    back = min(room, more, _CUT_M / math.tan(abs(turn) / 4))
    radius = back / math.tan(abs(turn) / 2)
    side = math.copysign(math.pi / 2, turn)
    x0, y0 = corner[0] - back * math.cos(inwards), corner[1] - back * math.sin(inwards)
    cx, cy = x0 + radius * math.cos(inwards + side), y0 + radius * math.sin(inwards + side)
    count = max(math.ceil(abs(turn) / _TURN_RAD), 1)
    for k in range(count + 1):
        angle = inwards - side + turn * k / count
        yield cx + radius * math.cos(angle), cy + radius * math.sin(angle)
