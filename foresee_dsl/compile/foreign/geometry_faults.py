"""Finds where the lanes of a net cannot be driven: kinks, lines that cross themselves, gaps, lanes too narrow."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

from foresee_dsl.compile.roads.polyline import (
    MERGE_M,
    XY,
    Points,
    direction,
    distance,
    distance_to,
    distinct,
    lengths,
    wrap,
)
from foresee_dsl.compile.roads.topology import Lane, Movement, Topology

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

KINK_RAD = math.radians(60)
KINK_WITHIN_M = 2.0
"""A line that turns by more than 60 degrees within 2 m cannot be followed: that is a radius of 1.9 m, and a car's
smallest is about 5 m."""
LONGEST_GAP_M = 1.0
"""The largest gap between two lanes that follow each other, m (ours; of the 2,346 connections of CARLA's towns the
largest gap is 0.2 m)."""
SHORTEST_LOOP_M = 35.0
"""A line that crosses itself within this length, m, is a fault and no loop road: the smallest circle that a car can
drive is 35 m long."""
NARROWEST_M = 1.5
"""A lane for cars has at least this width, m (ours: the smallest cars are 1.5 m wide)."""
FARTHEST_OUTSIDE_M = 3.5
"""A connection may leave its junction's area and the lanes that meet there by this much, m: a lane's width (ours)."""
_TOLERANCE_M = 0.05
"""A zigzag smaller than this comes from rounding, m."""
_BESIDE_M = 3.0
"""The length of the lanes before and behind a connection that is checked together with it, m: more than
`KINK_WITHIN_M`."""

Kind = Literal["kink", "loop", "gap", "narrow", "outside"]


@dataclass(frozen=True)
class Fault:
    """A place that no car can drive over.

    Attributes:
        kind: what is wrong. x, y: where, m. text: in words, with figures.
        lane: the lane that it is on, or the one from which the connection leads. to: the lane to which that leads, or
            "" for a lane's own fault.
    """

    kind: Kind
    x: float
    y: float
    text: str
    lane: str
    to: str = ""

    @property
    def where(self) -> str:
        """The lane or connection, and the place, in words."""
        what = f"the connection from {self.lane} to {self.to}" if self.to else f"lane {self.lane}"
        return f"{what} {self.text} at ({self.x:.1f} m, {self.y:.1f} m)"


def faults_of(net: Topology) -> tuple[Fault, ...]:
    """Return what is wrong with the lanes for cars, then with the connections between them, in the net's order."""
    return Checked.of(net).faults


@dataclass(frozen=True)
class Checked:
    """A net whose lines were checked, and what is wrong with each of its lanes and connections, in its order."""

    net: Topology
    lanes: tuple[Fault | None, ...]
    ways: tuple[Fault | None, ...]

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What is wrong with the lanes for cars, then with the connections between them, in the net's order."""
        return tuple(fault for fault in (*self.lanes, *self.ways) if fault is not None)

    @classmethod
    def of(cls, net: Topology) -> Checked:
        """Check all lines of a net."""
        areas = Areas(net)
        return cls(net, tuple(map(_of_lane, _lanes(net))), tuple(_of_way(net, way, areas) for way in _ways(net)))

    def again(self, net: Topology) -> Checked:
        """Check the same net with other lines of some lanes; only these are checked, and what is at their junctions."""
        moved = {name for name, lane in net.lanes.items() if lane is not self.net.lanes[name]}
        edges = (edge for edge in net.edges.values() if any(lane.id in moved for lane in edge.lanes))
        ends = {junction for edge in edges for junction in (edge.start, edge.end)}
        areas = Areas(net)
        lanes = zip(_lanes(net), self.lanes, strict=True)
        ways = zip(_ways(net), self.ways, strict=True)
        return Checked(
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
    """The connections that are checked: a vehicle turns round in several moves."""
    return (way for way in net.movements if "car" in way.kinds and way.turn != "back")


def _of_lane(lane: Lane) -> Fault | None:
    return fault_of_line(lane.shape, lane.id) or _narrow(lane)


def _of_way(net: Topology, way: Movement, areas: Areas) -> Fault | None:
    fault = fault_of_connection(net, way)
    return _outside(net, way, areas) if fault is None and way.via else fault


def fault_of_connection(net: Topology, movement: Movement) -> Fault | None:
    """Return what is wrong with the line from one lane through a junction to another."""
    before, *via, after = (net.lanes[name].shape for name in (movement.from_lane, *movement.via, movement.to_lane))
    parts = [ending(before), *via, beginning(after)]
    gaps = pairwise(parts) if movement.via else ()
    for one, other in gaps:
        away = distance(one[-1], other[0])
        if away > LONGEST_GAP_M:
            return Fault("gap", *one[-1], f"has a gap of {away:.1f} m", *movement.ends)
    return fault_of_line(joined(parts), *movement.ends)


def fault_of_line(points: Sequence[XY], lane: str, to: str = "", kink_rad: float = KINK_RAD) -> Fault | None:
    """Return a line's kink, a turn by more than `kink_rad`, or the loop in which it crosses itself."""
    line = simplified(points)
    for k, (angle, over_m) in enumerate(turns(line)):
        if abs(angle) > kink_rad:
            text = f"turns by {abs(math.degrees(angle)):.0f} degrees within {max(over_m, 0.1):.1f} m"
            return Fault("kink", *line[k + 1], text, lane, to)
    crossing = _crossing(line)
    if crossing is not None:
        at, length_m = crossing
        return Fault("loop", *at, f"crosses itself in a loop of {length_m:.1f} m", lane, to)
    return None


def turns(line: Sequence[XY]) -> list[tuple[float, float]]:
    """Return for each inner corner the largest turn (rad) that begins there within 2 m, and over which length (m)."""
    marks = lengths(line)
    ways = [direction(a, b) for a, b in pairwise(line)]
    found = []
    for k in range(len(ways) - 1):
        worst, over_m, turned = 0.0, 0.0, 0.0
        for j in range(k + 1, len(ways)):
            if j > k + 1 and marks[j] - marks[k + 1] >= KINK_WITHIN_M:
                break
            turned += wrap(ways[j] - ways[j - 1])
            if abs(turned) > abs(worst):
                worst, over_m = turned, marks[j] - marks[k + 1]
        found.append((worst, over_m))
    return found


def joined(parts: Sequence[Sequence[XY]]) -> Points:
    """Return lanes that follow each other as one line, as a route's line is: what lies behind the last point is left
    out."""
    line = list(parts[0])
    for part in parts[1:]:
        x, y = line[-1]
        ahead = (part[1][0] - part[0][0], part[1][1] - part[0][1])
        line += _onward(part, x, y, ahead)
    return tuple(line)


def _onward(part: Sequence[XY], x: float, y: float, ahead: XY) -> Sequence[XY]:
    for k, point in enumerate(part):
        dx, dy = point[0] - x, point[1] - y
        if math.hypot(dx, dy) >= MERGE_M and dx * ahead[0] + dy * ahead[1] > 0:
            return part[k:]
    return ()


def simplified(points: Sequence[XY]) -> Points:
    """Return a line without roundings and spikes."""
    import shapely

    line = distinct(points)
    if len(line) < 3:
        return line
    found = shapely.get_coordinates(shapely.simplify(shapely.LineString(line), _TOLERANCE_M))
    return tuple((float(x), float(y)) for x, y in found)


def _crossing(line: Sequence[XY]) -> tuple[XY, float] | None:
    """Where a line crosses itself in a loop that is too short for a car, and the loop's length, m."""
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


def _narrow(lane: Lane) -> Fault | None:
    if lane.width_m >= NARROWEST_M:
        return None
    return Fault("narrow", *lane.shape[0], f"is {lane.width_m:.2f} m wide, less than a car,", lane.id)


class Areas:
    """Where the traffic of each junction may be: its outline without dents, and the lanes that meet there."""

    def __init__(self, net: Topology) -> None:
        self._net = net
        self._known: dict[str, BaseGeometry] = {}

    def beyond(self, junction: str, points: Sequence[XY]) -> list[float]:
        """Return how far outside a junction's area each of some points is, m."""
        import shapely

        if junction not in self._known:
            self._known[junction] = self._area(junction)
        return [float(away) for away in shapely.distance(self._known[junction], shapely.points(points))]

    def _area(self, junction: str) -> BaseGeometry:
        import shapely

        edges = self._net.edges_at(junction)
        bands = [shapely.LineString(lane.shape).buffer(lane.width_m / 2) for edge in edges for lane in edge.lanes]
        ends = [lane.shape[0 if edge.start == junction else -1] for edge in edges for lane in edge.lanes]
        hull = shapely.MultiPoint([*self._net.junctions[junction].polygon, *ends]).convex_hull
        area = shapely.union_all([hull, *bands])
        shapely.prepare(area)
        return area


def _outside(net: Topology, movement: Movement, areas: Areas) -> Fault | None:
    chord = net.lanes[movement.from_lane].shape[-1], net.lanes[movement.to_lane].shape[0]
    points = [point for name in movement.via for point in net.lanes[name].shape]
    points = [point for point in points if distance_to(*point, chord) > FARTHEST_OUTSIDE_M]
    if not points:  # the chord lies in the area, which costs much to compute
        return None
    away_m, (x, y) = max(zip(areas.beyond(movement.junction, points), points, strict=True))
    if away_m <= FARTHEST_OUTSIDE_M:
        return None
    return Fault("outside", x, y, f"leaves its junction by {away_m:.1f} m", *movement.ends)


def ending(shape: Points) -> Points:
    """Return the last 3 m of a lane."""
    return tuple(reversed(beginning(tuple(reversed(shape)))))


def beginning(shape: Points) -> Points:
    """Return the first 3 m of a lane."""
    found, so_far = [shape[0]], 0.0
    for a, b in pairwise(shape):
        step = distance(a, b)
        if so_far + step >= _BESIDE_M:
            share = (_BESIDE_M - so_far) / step
            return (*found, (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
        found.append(b)
        so_far += step
    return tuple(found)
