"""Finds places of a net over which vehicles cannot drive: kinks, lines that cross themselves, gaps, narrow lanes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

from foresee_dsl.compile.roads.polyline import (
    XY,
    Points,
    direction,
    distance,
    distance_to,
    distinct,
    first_ahead,
    lengths,
    stretch,
    wrap,
)
from foresee_dsl.compile.roads.topology import Lane, Movement, Topology

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

KINK_RAD = math.radians(60)
KINK_WITHIN_M = 2.0
"""A turn by more than 60 degrees within this length is a kink, m: a car cannot follow such a line, because the line has
a radius of 1.9 m, and the smallest radius of a car is about 5 m.
"""
LONGEST_GAP_M = 1.0
"""Largest gap between two consecutive lanes, m (ours; the largest of the 2,346 connections of CARLA's towns is 0.2
m)."""
SHORTEST_LOOP_M = 35.0
"""If a line crosses itself after a shorter length than this, that is a fault and not a loop road, m: the smallest
circle that a car can drive is 35 m long.
"""
NARROWEST_M = 1.5
"""Smallest width of a lane for cars, m (ours: the smallest cars are 1.5 m wide)."""
FARTHEST_OUTSIDE_M = 3.5
"""Largest distance of a connection from its junction's area and the lanes that meet there, m: a lane's width (ours)."""
_TOLERANCE_M = 0.05
"""A zigzag smaller than this is attributed to rounding, m."""
_BESIDE_M = 3.0
"""Length of the lanes before and behind a connection that are checked together with it, m: more than
`KINK_WITHIN_M`."""

Kind = Literal["kink", "loop", "gap", "narrow", "outside"]


@dataclass(frozen=True)
class GeometryFault:
    """A place over which no car can drive.

    Attributes:
        kind: the kind of fault. x, y: its place, m. text: the fault in words, with figures.
        lane: the lane of the fault, or the lane from which the connection leads.
        to: the lane to which the connection leads; "" for a lane's own fault.
    """

    kind: Kind
    x: float
    y: float
    text: str
    lane: str
    to: str = ""

    @property
    def where(self) -> str:
        """The lane or connection, the fault and the place, in words for a message."""
        what = f"the connection from {self.lane} to {self.to}" if self.to else f"lane {self.lane}"
        return f"{what} {self.text} at ({self.x:.1f} m, {self.y:.1f} m)"


@dataclass(frozen=True)
class CheckedGeometry:
    """A checked net, with the fault (or None) of each of its lanes and connections, in its order."""

    net: Topology
    lanes: tuple[GeometryFault | None, ...]
    ways: tuple[GeometryFault | None, ...]

    @property
    def faults(self) -> tuple[GeometryFault, ...]:
        """The faults of the lanes for cars, then of the connections between them, in the net's order."""
        return tuple(fault for fault in (*self.lanes, *self.ways) if fault is not None)

    @classmethod
    def of(cls, net: Topology) -> CheckedGeometry:
        """Check all lines of a net."""
        areas = Areas(net)
        return cls(net, tuple(map(_of_lane, _lanes(net))), tuple(_of_way(net, way, areas) for way in _ways(net)))

    def again(self, net: Topology) -> CheckedGeometry:
        """Check the same net with changed lines; only changed lanes and the connections at their junctions are
        checked."""
        moved = {name for name, lane in net.lanes.items() if lane is not self.net.lanes[name]}
        edges = (edge for edge in net.edges.values() if any(lane.id in moved for lane in edge.lanes))
        ends = {junction for edge in edges for junction in (edge.start, edge.end)}
        areas = Areas(net)
        lanes = zip(_lanes(net), self.lanes, strict=True)
        ways = zip(_ways(net), self.ways, strict=True)
        return CheckedGeometry(
            net,
            tuple(_of_lane(lane) if lane.id in moved else fault for lane, fault in lanes),
            tuple(
                _of_way(net, way, areas) if way.junction in ends or not moved.isdisjoint(way.via) else fault
                for way, fault in ways
            ),
        )


def _lanes(net: Topology) -> Iterator[Lane]:
    for edge in net.edges.values():
        yield from edge.for_kind("car")


def _ways(net: Topology) -> Iterator[Movement]:
    """Return the connections to check: all for cars except U-turns, which a vehicle drives in several moves."""
    return (way for way in net.movements if "car" in way.kinds and way.turn != "back")


def _of_lane(lane: Lane) -> GeometryFault | None:
    return fault_of_line(lane.shape, lane.id) or _narrow(lane)


def _of_way(net: Topology, way: Movement, areas: Areas) -> GeometryFault | None:
    fault = fault_of_connection(net, way)
    return _outside(net, way, areas) if fault is None and way.via else fault


def fault_of_connection(net: Topology, movement: Movement) -> GeometryFault | None:
    """Return the fault of the line from one lane through a junction to another, if any."""
    before, *via, after = (net.lanes[name].shape for name in (movement.from_lane, *movement.via, movement.to_lane))
    parts = [ending(before), *via, beginning(after)]
    gaps = pairwise(parts) if movement.via else ()
    for first, second in gaps:
        away = distance(first[-1], second[0])
        if away > LONGEST_GAP_M:
            return GeometryFault("gap", *first[-1], f"has a gap of {away:.1f} m", *movement.ends)
    return fault_of_line(joined(parts), *movement.ends)


def fault_of_line(points: Sequence[XY], lane: str, to: str = "", kink_rad: float = KINK_RAD) -> GeometryFault | None:
    """Return a line's kink (a turn by more than `kink_rad`) or the loop in which it crosses itself, if any."""
    line = simplified(points)
    for k, (angle, over_m) in enumerate(turns(line)):
        if abs(angle) > kink_rad:
            text = f"turns by {abs(math.degrees(angle)):.0f} degrees within {max(over_m, 0.1):.1f} m"
            return GeometryFault("kink", *line[k + 1], text, lane, to)
    crossing = _crossing(line)
    if crossing is not None:
        at, length_m = crossing
        return GeometryFault("loop", *at, f"crosses itself in a loop of {length_m:.1f} m", lane, to)
    return None


def turns(line: Sequence[XY]) -> list[tuple[float, float]]:
    """Return for each inner corner the largest turn that begins there within 2 m, rad, and its length, m."""
    marks = lengths(line)
    ways = [direction(a, b) for a, b in pairwise(line)]
    worst_turns = []
    for k in range(len(ways) - 1):
        worst, over_m, turned = 0.0, 0.0, 0.0
        for j in range(k + 1, len(ways)):
            if j > k + 1 and marks[j] - marks[k + 1] >= KINK_WITHIN_M:
                break
            turned += wrap(ways[j] - ways[j - 1])
            if abs(turned) > abs(worst):
                worst, over_m = turned, marks[j] - marks[k + 1]
        worst_turns.append((worst, over_m))
    return worst_turns


def joined(parts: Sequence[Sequence[XY]]) -> Points:
    """Return consecutive lanes as one line, as in a route's line. A point that would lead backwards is left out."""
    line = list(parts[0])
    for part in parts[1:]:
        line += part[first_ahead(line[-1], part) :]
    return tuple(line)


def simplified(points: Sequence[XY]) -> Points:
    """Return a line without rounding errors and spikes."""
    import shapely

    line = distinct(points)
    if len(line) < 3:
        return line
    corners = shapely.get_coordinates(shapely.simplify(shapely.LineString(line), _TOLERANCE_M))
    return tuple((float(x), float(y)) for x, y in corners)


def _crossing(line: Sequence[XY]) -> tuple[XY, float] | None:
    """Return the point at which a line crosses itself in a loop too short for a car, and the loop's length, m."""
    import shapely

    if len(line) < 4 or shapely.is_simple(shapely.LineString(line)):
        return None
    marks = lengths(line)
    segments = [shapely.LineString(pair) for pair in pairwise(line)]
    for j in range(2, len(segments)):
        for i in range(j - 1):
            if marks[j] - marks[i + 1] > SHORTEST_LOOP_M:
                continue
            at = shapely.intersection(segments[i], segments[j])
            if not at.is_empty:
                x, y = at.centroid.x, at.centroid.y
                return (x, y), marks[j] - marks[i] + distance(line[j], (x, y)) - distance(line[i], (x, y))
    return None


def _narrow(lane: Lane) -> GeometryFault | None:
    if lane.width_m >= NARROWEST_M:
        return None
    return GeometryFault("narrow", *lane.shape[0], f"is {lane.width_m:.2f} m wide, less than a car,", lane.id)


class Areas:
    """The areas for the traffic of each junction: the convex hull of its outline, and the lanes that meet there."""

    def __init__(self, net: Topology) -> None:
        self._net = net
        self._areas: dict[str, BaseGeometry] = {}

    def beyond(self, junction: str, points: Sequence[XY]) -> list[float]:
        """Return the distance of each point from a junction's area, m; 0 inside."""
        import shapely

        if junction not in self._areas:
            self._areas[junction] = self._area(junction)
        return [float(away) for away in shapely.distance(self._areas[junction], shapely.points(points))]

    def _area(self, junction: str) -> BaseGeometry:
        import shapely

        edges = self._net.edges_at(junction)
        bands = [shapely.LineString(lane.shape).buffer(lane.width_m / 2) for edge in edges for lane in edge.lanes]
        ends = [lane.shape[0 if edge.start == junction else -1] for edge in edges for lane in edge.lanes]
        hull = shapely.MultiPoint([*self._net.junctions[junction].polygon, *ends]).convex_hull
        area = shapely.union_all([hull, *bands])
        shapely.prepare(area)
        return area


def _outside(net: Topology, movement: Movement, areas: Areas) -> GeometryFault | None:
    chord = net.lanes[movement.from_lane].shape[-1], net.lanes[movement.to_lane].shape[0]
    points = [point for name in movement.via for point in net.lanes[name].shape]
    points = [point for point in points if distance_to(*point, chord) > FARTHEST_OUTSIDE_M]
    if not points:  # points near the chord are inside the area, whose computation is slow
        return None
    away_m, (x, y) = max(zip(areas.beyond(movement.junction, points), points, strict=True))
    if away_m <= FARTHEST_OUTSIDE_M:
        return None
    return GeometryFault("outside", x, y, f"leaves its junction by {away_m:.1f} m", *movement.ends)


def ending(shape: Points) -> Points:
    """Return the last 3 m of a lane."""
    end = lengths(shape)[-1]
    return stretch(shape, max(end - _BESIDE_M, 0.0), end)


def beginning(shape: Points) -> Points:
    """Return the first 3 m of a lane."""
    return stretch(shape, 0.0, min(lengths(shape)[-1], _BESIDE_M))
