"""Paths off the lanes: shifts them by the statement `line`, and finds the lanes that a vehicle follows after their
end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from foresee_dsl.compile.roads import polyline as lines
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, distance, interpolate
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.language import model as m

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
