"""How high the lanes of a net are, and where one road goes over another: the rest of the tool knows a flat world."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, distance
from foresee_dsl.compile.roads.topology import Lane

_ROUNDING_M = 1e-6
"""Ours: far more than interpolating a height adds to it."""
_END_M = 10.0
"""Nearer than this to a lane's end it meets others in a junction (ours)."""
CLEARANCE_M = 3.0
"""Roads that cross with this much between them do not meet (ours: less than any bridge leaves free)."""


@dataclass(frozen=True)
class Heights:
    """For each lane the lengths along it (m) at which its height is known, and the heights (m)."""

    lanes: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]

    @classmethod
    def of(cls, net_file: Path) -> Heights:
        """Read the third coordinates of a net's lanes; those that it leaves out are 0."""
        return cls.in_tree(parse_net(net_file))

    @classmethod
    def in_tree(cls, root: Element) -> Heights:
        """Return the same of a net's tree."""
        found = {}
        for lane in root.iter("lane"):
            points = [[float(value) for value in point.split(",")] for point in lane.get("shape", "").split()]
            marks = [0.0]
            for (x0, y0, *_), (x1, y1, *_) in pairwise(points):
                marks.append(marks[-1] + distance((x0, y0), (x1, y1)))
            found[lane.get("id", "")] = tuple(marks), tuple(p[2] if len(p) > 2 else 0.0 for p in points)
        return cls(found)

    @cached_property
    def known(self) -> bool:
        """Whether the net has heights at all."""
        return any(abs(z) >= CLEARANCE_M for _, levels in self.lanes.values() for z in levels)

    def may_differ(self, one: str, other: str) -> bool:
        """Say whether two lanes have heights, at any place of theirs, with the clearance of a bridge between them."""
        (_, first), (_, second) = self.lanes[one], self.lanes[other]
        return max(max(first) - min(second), max(second) - min(first)) >= CLEARANCE_M - _ROUNDING_M

    def at(self, lane: str, along_m: float) -> float:
        """Return a lane's height at a length along it, m."""
        marks, heights = self.lanes[lane]
        k = min(max(bisect_right(marks, along_m) - 1, 0), len(heights) - 1)
        if k == len(heights) - 1 or marks[k + 1] <= marks[k]:
            return heights[k]
        share = min(max((along_m - marks[k]) / (marks[k + 1] - marks[k]), 0.0), 1.0)
        return heights[k] + share * (heights[k + 1] - heights[k])


@dataclass(frozen=True)
class Bridge:
    """Where a lane goes over another: m, and the edges of both."""

    x: float
    y: float
    edges: frozenset[str]


def bridges(network: RoadNetwork, heights: Heights) -> tuple[Bridge, ...]:
    """Return where lanes for cars go over others.

    In a net that is flat altogether, as those made of OpenStreetMap are, these are roads that cross where there is no
    junction.
    """
    import shapely

    lanes = [lane for lane in network.lanes.values() if "car" in lane.kinds and lane.edge not in network.walking_areas]
    lines = [shapely.LineString(lane.shape) for lane in lanes]
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    found: dict[Bridge, None] = {}
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        if i >= j or lanes[i].edge == lanes[j].edge or not _may_be_over(lanes[i], lanes[j], heights):
            continue
        for point in shapely.get_parts(shapely.intersection(lines[i], lines[j])):
            if point.is_empty:  # roundings: they touch, and have no point in common
                continue
            x, y = point.centroid.x, point.centroid.y
            if _over(lanes[i], lanes[j], (x, y), heights):
                found[Bridge(round(x, 1), round(y, 1), frozenset({lanes[i].edge, lanes[j].edge}))] = None
    return tuple(found)


def bridge_notes(found: Sequence[Bridge]) -> tuple[str, ...]:
    """Return what to say of bridges: a sentence, or none."""
    if not found:
        return ()
    roads = len({one.edges for one in found})
    return (f"roads go over others ({roads} pairs of edges); the world is flat, and vehicles there would meet: keep "
            "routes and traffic away from them",)  # fmt: skip


def _may_be_over(one: Lane, other: Lane, heights: Heights) -> bool:
    """Whether one lane may go over another, wherever they cross: in a junction hundreds cross on one level."""
    return heights.may_differ(one.id, other.id) if heights.known else not (one.internal or other.internal)


def _over(one: Lane, other: Lane, at: XY, heights: Heights) -> bool:
    along = [lane.line.project(*at)[0] for lane in (one, other)]
    if heights.known:
        levels = [heights.at(lane.id, s) for lane, s in zip((one, other), along, strict=True)]
        return abs(levels[0] - levels[1]) >= CLEARANCE_M
    inner = [_END_M < s < lane.line.length_m - _END_M for lane, s in zip((one, other), along, strict=True)]
    return all(inner)
