"""Paths off the lanes: shifts them by the statement `line`, finds the lanes that a vehicle follows after their end, and
computes the smooth line beside a route for the statement `path along`.

The line of a route has the corners of netconvert's turns. For `path along` they are replaced by arcs, so that an actor
on the line follows a single bend and does not slow down at each corner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from foresee_dsl.compile.roads import polyline as lines
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, Polyline, direction, distance, interpolate, wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.errors import measured
from foresee_dsl.language import model as m

if TYPE_CHECKING:
    import shapely

BESIDE_M = 2.5
"""A path joins edges only if its end is at most this far from the middle of one of their lanes, m. Ours: half of a wide
lane and a margin.
"""
LINE_OVER_M = 5.0
"""Length of path, m, over which an actor moves to its `line`. Ours: for 0.6 m sideways, the actor turns aside by 7 deg,
like a pedestrian who crosses obliquely. A pedestrian needs 4 s for this length, a bicycle about 1 s.
"""
_SHARPEST = 0.5
"""The offset line keeps its corner where the cosine of half the turn is at least this (ours). At a sharper turn the
corner would extend far outwards, so it is cut at two widths.
"""


def joined_way(
    network: RoadNetwork, edges: Sequence[str | m.Ref], end: XY, kind: LaneKind
) -> tuple[tuple[str, ...], RouteLine]:
    """Return the edges that a vehicle follows after the end of a path, beginning with the edge on which the path ends,
    and their line, which begins on the lane nearest to that end.

    Raises:
        RouteError: the path does not end on a lane of these edges, or the edges are not connected.
    """
    way = network.route_edges(m.EdgeRoute(edges=tuple(edges), shortest=True), kind)
    for k, edge in enumerate(way):
        for lane in network.edges[edge].for_kind(kind):
            s, beside_m = lane.line.project(*end)
            if abs(beside_m) <= BESIDE_M and -BESIDE_M <= s <= lane.line.length_m:
                nearest = min(
                    network.edges[edge].for_kind(kind), key=lambda candidate: abs(candidate.line.project(*end)[1])
                )
                return way[k:], network.line(way[k:], start_lane=nearest.id, after_m=max(s, 0.0), kind=kind)
    raise RouteError(f"the path ends on no lane of {way[0]}", f"end it on the middle of a lane of {way[0]}")


def shifted(path: Points, along_m: float, left_m: float) -> Points:
    """Return a path shifted by the statement `line`: it leaves the old path at `along_m`, and from `LINE_OVER_M` later
    (or from the end, if that is nearer) it is `left_m` to its left (negative: to its right)."""
    marks = lines.lengths(path)
    begins = min(max(along_m, 0.0), marks[-1])
    over = max(min(LINE_OVER_M, marks[-1] - begins), 1e-6)
    before = [point for point, mark in zip(path, marks, strict=True) if mark < begins]
    bends = [(begins, 0.0)]
    bends += [(mark, left_m * min((mark - begins) / over, 1.0)) for mark in marks if mark > begins]
    if begins + over < marks[-1]:
        bends.append((begins + over, left_m))
    new = lines.whole_millimetres(_beside(path, marks, mark, left) for mark, left in sorted(bends))
    return lines.distinct((*before, *new))


def _beside(path: Points, marks: tuple[float, ...], mark: float, left_m: float) -> XY:
    """Return the point beside a position along a path; at a corner, the point at which the offset lines of both sides
    meet.
    """
    x = interpolate(mark, marks, [p[0] for p in path])
    y = interpolate(mark, marks, [p[1] for p in path])
    sides = [(a, b) for (a, b), (s, t) in zip(pairwise(path), pairwise(marks), strict=True) if s <= mark <= t and s < t]
    normals = [(-(b[1] - a[1]) / distance(a, b), (b[0] - a[0]) / distance(a, b)) for a, b in sides]
    nx, ny = (sum(n[k] for n in normals) / len(normals) for k in (0, 1))
    size = math.hypot(nx, ny)  # the cosine of half the turn
    if size < 1e-9:  # the path reverses
        return x + left_m * normals[0][0], y + left_m * normals[0][1]
    reach = left_m / (size * max(size, _SHARPEST))
    return x + reach * nx, y + reach * ny


# ---- the smooth line beside a part of a route -----------------------------------------------------------------------


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


def smooth_beside(line: Polyline, begin_m: float, end_m: float, *, left_m: float) -> tuple[XY, ...]:
    """Return the smooth line `left_m` to the left of a part of a line (negative: to the right), m.

    If `begin_m` is beyond `end_m`, the line leads back, on the same side.

    Raises:
        RouteError: the part is inside a bend that is narrower than the offset, so there is no such line.
    """
    import shapely  # imported here: the import is slow, and most actors do not need it

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
    import shapely

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
