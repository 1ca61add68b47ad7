"""Reads the heights of a net's lanes, and finds the places where a road goes over another; all other parts of the tool
treat the world as flat.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, interpolate, lengths
from foresee_dsl.compile.roads.topology import Lane

_ROUNDING_M = 1e-6
"""Difference of heights that is attributed to rounding, m. Ours: far more than the rounding error of an interpolated
height."""
_END_M = 10.0
"""Nearer than this to its end, a lane meets others in a junction instead of crossing over them, m (ours)."""
CLEARANCE_M = 3.0
"""Smallest height between roads that cross without meeting, m (ours: less than the clearance of a bridge)."""


@dataclass(frozen=True)
class Heights:
    """Heights along each lane: positions along it, m, and the heights there, m."""

    lanes: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]

    @classmethod
    def of(cls, net_file: Path) -> Heights:
        """Read the heights of a net's lanes, the third coordinates; a missing one is 0."""
        return cls.in_tree(parse_net(net_file))

    @classmethod
    def in_tree(cls, root: Element) -> Heights:
        """Return the heights in a net's tree."""
        lanes = {}
        for lane in root.iter("lane"):
            points = [[float(value) for value in point.split(",")] for point in lane.get("shape", "").split()]
            marks = lengths([(x, y) for x, y, *_ in points])
            lanes[lane.get("id", "")] = marks, tuple(p[2] if len(p) > 2 else 0.0 for p in points)
        return cls(lanes)

    @cached_property
    def has_heights(self) -> bool:
        """True if at least one lane of the net has a height."""
        return any(abs(z) >= CLEARANCE_M for _, levels in self.lanes.values() for z in levels)

    def may_differ(self, first_lane: str, other: str) -> bool:
        """Return whether somewhere along two lanes their heights differ by at least the clearance of a bridge."""
        (_, first), (_, second) = self.lanes[first_lane], self.lanes[other]
        return max(max(first) - min(second), max(second) - min(first)) >= CLEARANCE_M - _ROUNDING_M

    def at(self, lane: str, along_m: float) -> float:
        """Return a lane's height at a position along it, m."""
        return interpolate(along_m, *self.lanes[lane])


@dataclass(frozen=True)
class Bridge:
    """A place where a lane goes over another: its coordinates, m, and the edges of both lanes."""

    x: float
    y: float
    edges: frozenset[str]


def bridges(network: RoadNetwork, heights: Heights) -> tuple[Bridge, ...]:
    """Return the places where lanes for cars go over others.

    In a net without any heights, such as those made from OpenStreetMap, these are roads that cross without a
    junction.
    """
    import shapely

    lanes = [lane for lane in network.lanes.values() if "car" in lane.kinds and lane.edge not in network.walking_areas]
    lines = [shapely.LineString(lane.shape) for lane in lanes]
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    places: dict[Bridge, None] = {}
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        if i >= j or lanes[i].edge == lanes[j].edge or not _may_be_over(lanes[i], lanes[j], heights):
            continue
        for point in shapely.get_parts(shapely.intersection(lines[i], lines[j])):
            if point.is_empty:  # because of rounding, the lanes touch without a common point
                continue
            x, y = point.centroid.x, point.centroid.y
            if _over(lanes[i], lanes[j], (x, y), heights):
                places[Bridge(round(x, 1), round(y, 1), frozenset({lanes[i].edge, lanes[j].edge}))] = None
    return tuple(places)


def bridge_notes(places: Sequence[Bridge]) -> tuple[str, ...]:
    """Return a note on bridges in one sentence; empty if there are none."""
    if not places:
        return ()
    roads = len({bridge.edges for bridge in places})
    return (f"roads go over others ({roads} pairs of edges); the world is flat, and vehicles there would meet: keep "
            "routes and traffic away from them",)  # fmt: skip


def _may_be_over(lane: Lane, other: Lane, heights: Heights) -> bool:
    """Return whether one lane may go over another: a quick test, as hundreds of lanes cross on one level in
    junctions."""
    return heights.may_differ(lane.id, other.id) if heights.has_heights else not (lane.internal or other.internal)


def _over(first: Lane, other: Lane, at: XY, heights: Heights) -> bool:
    along = [lane.line.project(*at)[0] for lane in (first, other)]
    if heights.has_heights:
        levels = [heights.at(lane.id, s) for lane, s in zip((first, other), along, strict=True)]
        return abs(levels[0] - levels[1]) >= CLEARANCE_M
    inner = [_END_M < s < lane.line.length_m - _END_M for lane, s in zip((first, other), along, strict=True)]
    return all(inner)
