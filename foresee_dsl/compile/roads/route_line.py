"""Makes the centreline that a vehicle follows: its lanes, its lane changes, and the junctions on its way."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby, pairwise
from operator import itemgetter
from typing import NamedTuple

from foresee_dsl.compile.roads import polyline as lines
from foresee_dsl.compile.roads.polyline import STEP_M, XY, Points, Polyline, distance
from foresee_dsl.compile.roads.routing import RouteError, check_whole, onward
from foresee_dsl.compile.roads.topology import Lane, LaneKind, Movement, Topology

CHANGE_AFTER_M = 10.0
"""Distance from the beginning of its edge at which a lane change begins, m (ours: it is clear of the junction, and
early, as driving schools teach).
"""
CHANGE_TIME_S = 3.0
"""Duration of a lane change at the speed limit, s, if the edge is long enough. Ours: with a cosine blend over 3.5 m
sideways, the lateral acceleration is 1.9 m/s^2, which is comfortable; if the change took only 20 m at 50 km/h, it would
be 8 m/s^2.
"""
CHANGE_MIN_M = 20.0
"""Smallest length of a lane change, m (ours: five car lengths, for low limits and short edges)."""


_START = itemgetter(0)


@dataclass(frozen=True)
class Passage:
    """A junction on a route line: from `entry_s` to `exit_s` along the line, m."""

    junction: str
    entry_s: float
    exit_s: float
    movement: Movement

    @property
    def turn(self) -> str:
        """The turn: `straight`, `left`, `right` or `back`."""
        return self.movement.turn

    @property
    def signal(self) -> str | None:
        """The signal head of this movement as `TLS:LINK`; None without a signal."""
        tls, link = self.movement.tls, self.movement.link
        return f"{tls}:{link}" if tls is not None and link >= 0 else None


@dataclass(frozen=True, eq=False)
class RouteLine(Polyline):
    """A polyline for a vehicle.

    Attributes:
        limits: speed limit at each point, m/s.
        lefts, rights: distance from each point to the left and right border of the lanes of its direction, m.
        edges: edges of the route, then those that `beyond_m` added.
        passages: junctions on the way, in order (none before the route's first edge).
        origin_s: beginning of the first edge along the line, m (over 0 with `behind_m`).
        end_s: end of the route's last edge, m (less than `length_m` with `beyond_m`).
        pieces: lanes in order: (position at which the lane begins, lane id).
        rings: roundabouts on the way, each from its first junction on the way to its last.
    """

    limits: tuple[float, ...]
    lefts: tuple[float, ...]
    rights: tuple[float, ...]
    edges: tuple[str, ...]
    passages: tuple[Passage, ...]
    origin_s: float
    end_s: float
    pieces: tuple[tuple[float, str], ...]
    rings: tuple[Passage, ...] = ()

    speed_limit = lines.as_array("limits")
    """The speed limits at the points, [N] m/s."""
    left_m = lines.as_array("lefts")
    """The distances to the left border at the points, [N] m."""
    right_m = lines.as_array("rights")
    """The distances to the right border at the points, [N] m."""

    def lane_at(self, s: float) -> str:
        """Return the id of the lane at a position along the line."""
        k = bisect_right(self.pieces, s + 1e-9, key=_START) - 1
        return self.pieces[max(k, 0)][1]

    def passage(self, junction: str) -> Passage | None:
        """Return the first passage over a junction or a roundabout, from its entry to its exit."""
        return next((p for p in self.over(junction)), None)

    def over(self, junction: str) -> tuple[Passage, ...]:
        """Return every passage over a junction or a roundabout, in order."""
        return tuple(p for p in (*self.passages, *self.rings) if p.junction == junction)


class _Vertex(NamedTuple):
    """A point of a line: its position, m, the free width to either side, m, and the speed limit, m/s."""

    x: float
    y: float
    left_m: float
    right_m: float
    limit_mps: float


@dataclass(frozen=True)
class _Stretch:
    """An edge of a route: index of the lane on which it is entered, of the lane on which it is left, and the next
    movement."""

    edge: str
    entry: int
    exit: int
    onward: Movement | None


class _Plan(NamedTuple):
    """The best way to a lane: number of lane changes, lanes so far (to choose among equal ways), and stretches."""

    changes: int
    lanes: tuple[int, ...]
    stretches: tuple[_Stretch, ...]


@lru_cache(maxsize=128)  # a line takes 80 kB; 512 lines would save 2 % of the calls of a campaign
def build_line(
    network: Topology,
    edges: tuple[str, ...],
    start_lane: str | None,
    after_m: float,
    behind_m: float,
    beyond_m: float,
    kind: LaneKind,
) -> RouteLine:
    """Return the line of a route; see `RoadNetwork.line`. It is cached, because children mostly repeat their
    parent's."""
    plan = _ahead(network, _choose_lanes(network, edges, start_lane, kind), beyond_m, kind)
    first = network.edges[edges[0]].lanes[plan[0].entry]
    joined = _Joined()
    if behind_m > 0 and (lead := approach(network, first, behind_m, kind)):
        joined.add(first, _vertices(first, lead))
    origin = end = len(joined.vertices)
    passages: list[tuple[Movement, int, int]] = []
    for k, stretch in enumerate(plan):
        for lane, vertices in _on_edge(network, stretch, after_m if k == 0 else 0.0, kind):
            joined.add(lane, vertices)
        if k == len(edges) - 1:
            end = len(joined.vertices)
        if stretch.onward is not None:
            entry = len(joined.vertices)
            for name in stretch.onward.via:
                joined.add(network.lanes[name], _vertices(network.lanes[name]))
            if not stretch.onward.via:  # in a net without internal lanes, the line goes straight across the junction
                target = network.lanes[stretch.onward.to_lane]
                joined.bridge(target.shape[0], target)
            passages.append((stretch.onward, entry, len(joined.vertices)))
    line = joined.line(tuple(stretch.edge for stretch in plan), passages, origin, end)
    return replace(line, rings=_rings(network, line.passages)) if network.rings else line


def _rings(network: Topology, passages: Sequence[Passage]) -> tuple[Passage, ...]:
    """Return the passages over roundabouts, joined from consecutive passages over their junctions."""
    of = {node: name for name, ring in network.rings.items() for node in ring.nodes}
    rings = []
    for name, group in groupby(passages, lambda passage: of.get(passage.junction)):
        if name is not None:
            first, *_, last = (members := list(group))[0], members[-1]
            rings.append(Passage(name, first.entry_s, last.exit_s, first.movement))
    return tuple(rings)


def _choose_lanes(
    network: Topology, edges: Sequence[str], start_lane: str | None, kind: LaneKind
) -> tuple[_Stretch, ...]:
    """Return the stretches with the fewest lane changes; among equal ones the rightmost lanes."""
    first = network.edges[edges[0]]
    starts = [lane.index for lane in first.for_kind(kind)]
    through = start_lane if start_lane is not None and network.lanes[start_lane].internal else None
    if start_lane is not None and through is None:
        starts = [network.lanes[start_lane].index]
    if not starts:
        check_whole(network, edges)
        raise RouteError(f"no lane of {first.id} is open to a {kind}")
    best = {k: _Plan(0, (k,), ()) for k in starts}
    for here, there in pairwise(edges):
        ways = [m for m in network.movements_from(here, kind) if m.to_edge == there]
        best = _advance(network, ways, best, through)
        through = None
        if not best:
            check_whole(network, (here, there))
            raise RouteError(f"no lane of {here} leads to {there} for a {kind}")
    entry, plan = min(best.items(), key=lambda item: item[1][:2])
    return (*plan.stretches, _Stretch(edges[-1], entry, entry, None))


def _advance(
    network: Topology, ways: Sequence[Movement], best: dict[int, _Plan], through: str | None
) -> dict[int, _Plan]:
    """Extend the plans by one edge, and return the best plan for each of its lanes; `through`: an internal lane on the
    way."""
    plans: dict[int, _Plan] = {}
    for entry, plan in best.items():
        for way in ways:
            if through is not None and through not in way.via:
                continue
            leave, enter = network.lanes[way.from_lane].index, network.lanes[way.to_lane].index
            begin = entry if through is None else leave
            offer = (plan.changes + abs(leave - begin), (*plan.lanes, leave, enter))
            if enter not in plans or offer < plans[enter][:2]:
                plans[enter] = _Plan(*offer, (*plan.stretches, _Stretch(way.from_edge, begin, leave, way)))
    return plans


def _ahead(network: Topology, plan: Sequence[_Stretch], length_m: float, kind: LaneKind) -> list[_Stretch]:
    """Return a plan that continues beyond the route's end from its last lane, straight on if possible.

    It never enters an edge twice (as it could in a roundabout), because the nearest point of the line would be
    ambiguous on that edge.
    """
    stretches = list(plan)
    visited = {stretch.edge for stretch in plan}
    while length_m > 0:
        here = stretches[-1]
        lane = network.edges[here.edge].lanes[here.exit]
        order = {m.to_edge: k for k, m in enumerate(onward(network, here.edge, kind))}
        ways = [m for m in network.movements_from(here.edge, kind) if m.from_lane == lane.id]
        way = min(ways, key=lambda m: order[m.to_edge], default=None)
        if way is None or way.turn == "back" or way.to_edge in visited:
            break
        visited.add(way.to_edge)
        stretches[-1] = _Stretch(here.edge, here.entry, here.exit, way)
        target = network.lanes[way.to_lane]
        stretches.append(_Stretch(way.to_edge, target.index, target.index, None))
        length_m -= target.line.length_m
    return stretches


def approach(network: Topology, lane: Lane, length_m: float, kind: LaneKind = "car") -> Points:
    """Return the last `length_m` (or less, if the network ends) of the way to a lane's beginning."""
    parts: list[Points] = []
    missing = length_m
    while missing > 0:
        into = sorted(network.movements_into(lane.id, kind), key=lambda m: (m.turn != "straight", m.turn == "back"))
        if not into or into[0].turn == "back":
            break
        lane = network.lanes[into[0].from_lane]
        for name in (*reversed(into[0].via), lane.id):
            line = network.lanes[name].line
            if missing > 0:
                cut = max(line.length_m - missing, 0.0)
                parts.append((line.at(cut)[:2], *line.xy[bisect_right(line.marks, cut) :]))
                missing -= line.length_m
    return lines.subdivide([point for part in reversed(parts) for point in part]) if parts else ()


class _Joined:
    """Joins the vertices of lanes to one line, without repeated points."""

    def __init__(self) -> None:
        self.vertices: list[_Vertex] = []
        self._pieces: list[tuple[int, str]] = []

    def add(self, lane: Lane, vertices: Sequence[_Vertex]) -> None:
        """Add vertices on a lane, and close a gap before them."""
        skip = 0
        if self.vertices:
            skip = lines.first_ahead(self.vertices[-1], vertices)
            if skip < len(vertices) and distance(self.vertices[-1][:2], vertices[skip][:2]) > 1.5 * STEP_M:
                self.bridge(vertices[skip][:2], lane)
                skip += 1
        self._pieces.append((max(len(self.vertices) - 1, 0), lane.id))
        self.vertices += vertices[skip:]

    def bridge(self, to: XY, lane: Lane) -> None:
        """Add vertices on the straight line to a point, at most 1 m apart."""
        x, y = self.vertices[-1][:2]
        dx, dy = to[0] - x, to[1] - y
        steps = max(math.ceil(math.hypot(dx, dy) / STEP_M), 1)
        self.vertices += _vertices(lane, [(x + t * dx, y + t * dy) for t in _shares(steps)[1:]])

    def line(
        self, edges: tuple[str, ...], passages: Sequence[tuple[Movement, int, int]], origin: int, end: int
    ) -> RouteLine:
        """Return the finished line. A position is given as a number of vertices, and is that of the last of them."""
        points = tuple(vertex[:2] for vertex in self.vertices)
        s = lines.lengths(points)

        def mark(count: int) -> float:
            return s[max(count - 1, 0)]

        _, _, lefts, rights, limits = zip(*self.vertices, strict=True)
        return RouteLine(
            xy=points,
            marks=s,
            angles=lines.headings(points, s),
            limits=limits,
            lefts=lefts,
            rights=rights,
            edges=edges,
            passages=tuple(Passage(m.junction, mark(a), mark(b), m) for m, a, b in passages),
            origin_s=mark(origin),
            end_s=mark(end),
            pieces=tuple((s[k], lane) for k, lane in self._pieces),
        )


def _vertices(lane: Lane, points: Sequence[XY] | None = None, sides: XY | None = None) -> list[_Vertex]:
    """Return points (by default the lane's) as vertices with the free width on either side (by default half the
    lane's)."""
    left, right = sides or (lane.width_m / 2, lane.width_m / 2)
    return [_Vertex(x, y, left, right, lane.speed_mps) for x, y in (lane.line.xy if points is None else points)]


def _on_edge(network: Topology, stretch: _Stretch, after_m: float, kind: LaneKind) -> list[tuple[Lane, list[_Vertex]]]:
    """Return the vertices on an edge: on one lane, or on two lanes with a lane change between them."""
    edge = network.edges[stretch.edge]
    before, after = edge.lanes[stretch.entry], edge.lanes[stretch.exit]
    sides = _free(network, before, kind)
    if before is after:
        return [(before, _vertices(before, sides=sides))]
    length = min(before.line.length_m, after.line.length_m)
    shares = _shares(math.ceil(max(before.line.length_m, after.line.length_m) / STEP_M))
    wanted = max(CHANGE_MIN_M, CHANGE_TIME_S * before.speed_mps * abs(stretch.exit - stretch.entry))
    begin = min(max(CHANGE_AFTER_M, after_m), max(length - CHANGE_MIN_M, 0.0))
    span = max(min(wanted, length - begin), STEP_M)
    weights = [(1 - math.cos(math.pi * min(max((t * length - begin) / span, 0.0), 1.0))) / 2 for t in shares]
    half = max(bisect_left(weights, 0.5), 1)
    (left0, right0), (left1, right1) = sides, _free(network, after, kind)
    places = zip(weights, _at_shares(before.line, shares), _at_shares(after.line, shares), strict=True)
    mixed = []
    for k, (w, (x0, y0), (x1, y1)) in enumerate(places):
        limit_mps = (before if k < half else after).speed_mps
        free = (left0 + w * (left1 - left0), right0 + w * (right1 - right0))
        mixed.append(_Vertex((1 - w) * x0 + w * x1, (1 - w) * y0 + w * y1, *free, limit_mps))
    return [(before, mixed[:half]), (after, mixed[half:])]


def _shares(steps: int) -> list[float]:
    """Return 0 to 1 in equal steps, both included."""
    return [k / steps for k in range(steps + 1)]


def _at_shares(line: Polyline, shares: Sequence[float]) -> list[XY]:
    xs, ys = zip(*line.xy, strict=True)
    at = [share * line.length_m for share in shares]
    return [(lines.interpolate(s, line.marks, xs), lines.interpolate(s, line.marks, ys)) for s in at]


def _free(network: Topology, lane: Lane, kind: LaneKind) -> tuple[float, float]:
    """Return the free width to the left and right of a lane's centre, m, over the lanes of its direction."""
    others = network.edges[lane.edge].for_kind(kind)
    inner = sum(other.width_m for other in others if other.index > lane.index) + lane.width_m / 2
    outer = sum(other.width_m for other in others if other.index < lane.index) + lane.width_m / 2
    return (outer, inner) if network.left_hand else (inner, outer)
