"""The centreline that a vehicle follows: which lanes, where it changes them, the junctions on the way."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

from foresee_dsl.compile.roads.polyline import (
    MERGE_M,
    STEP_M,
    XY,
    Points,
    Polyline,
    distance,
    headings,
    interpolate,
    lengths,
    subdivide,
)
from foresee_dsl.compile.roads.routing import RouteError, onward
from foresee_dsl.compile.roads.topology import Edge, Lane, LaneKind, Movement

if TYPE_CHECKING:
    from foresee_dsl.compile.roads.network import RoadNetwork
    from foresee_dsl.compile.roads.polyline import FloatArray

CHANGE_AFTER_M = 10.0
"""A lane change begins this far into its edge (ours: clear of the junction, and early, as drivers are taught)."""
CHANGE_TIME_S = 3.0
"""A change takes so long at the limit where the edge is long enough (ours: with a cosine blend over 3.5 m that is
1.9 m/s^2 sideways, comfortable; 20 m at 50 km/h would be 8 m/s^2)."""
CHANGE_MIN_M = 20.0
"""...and at least this far."""


@dataclass(frozen=True)
class Passage:
    """A junction that a route line goes over: from `entry_s` to `exit_s` along the line."""

    junction: str
    entry_s: float
    exit_s: float
    movement: Movement

    @property
    def turn(self) -> str:
        """`straight`, `left`, `right` or `back`."""
        return self.movement.turn

    @property
    def signal(self) -> str | None:
        """`TLS:LINK`, the key of the signal's head for this movement, or None where there is none."""
        tls, link = self.movement.tls, self.movement.link
        return f"{tls}:{link}" if tls is not None and link >= 0 else None


@dataclass(frozen=True, eq=False)
class RouteLine(Polyline):
    """A polyline for a vehicle.

    Attributes:
        limits: N m/s, the speed limit at each point. lefts, rights: N m, from the line to the edge of the lanes of its
            direction.
        edges: those of the route, then those that `beyond_m` added.
        passages: junctions on the way, in order (none before the route's first edge).
        origin_s: where the first edge begins (over 0 with `behind_m`). end_s: where the route's last edge ends (less
            than `length_m` with `beyond_m`).
        pieces: (start s, lane id), in order.
    """

    limits: tuple[float, ...]
    lefts: tuple[float, ...]
    rights: tuple[float, ...]
    edges: tuple[str, ...]
    passages: tuple[Passage, ...]
    origin_s: float
    end_s: float
    pieces: tuple[tuple[float, str], ...]

    @cached_property
    def speed_limit(self) -> FloatArray:
        """[N] m/s: `limits` as an array."""
        return _array(self.limits)

    @cached_property
    def left_m(self) -> FloatArray:
        """[N] m: `lefts` as an array."""
        return _array(self.lefts)

    @cached_property
    def right_m(self) -> FloatArray:
        """[N] m: `rights` as an array."""
        return _array(self.rights)

    @cached_property
    def lane_id(self) -> tuple[str, ...]:
        """[N] the lane at each point."""
        return tuple(self.lane_at(s) for s in self.marks)

    @cached_property
    def _piece_starts(self) -> list[float]:
        return [s for s, _ in self.pieces]

    def lane_at(self, s: float) -> str:
        """Return the lane at a length."""
        k = bisect_right(self._piece_starts, s + 1e-9) - 1
        return self.pieces[max(k, 0)][1]

    def passage(self, junction: str) -> Passage | None:
        """Return the first passage over a junction."""
        return next((p for p in self.passages if p.junction == junction), None)


@dataclass(frozen=True)
class _Piece:
    """A run of points on one lane (or between two, during a change)."""

    lane: Lane
    points: Points
    left: Sequence[float]
    right: Sequence[float]


@dataclass(frozen=True)
class _Stretch:
    """What a vehicle does on one edge: the lane where it enters, the lane where it leaves, and the way onward."""

    edge: str
    entry: int
    exit: int
    onward: Movement | None


@lru_cache(maxsize=512)
def build_line(
    network: RoadNetwork,
    edges: tuple[str, ...],
    *,
    start_lane: str | None = None,
    after_m: float = 0.0,
    behind_m: float = 0.0,
    beyond_m: float = 0.0,
    kind: LaneKind = "car",
) -> RouteLine:
    """Make the line; see `RoadNetwork.line`. Equal calls share one line: children of a parent mostly repeat them."""
    plan = _choose_lanes(network, edges, start_lane, kind)
    plan = _ahead(network, plan, beyond_m, kind)
    lead = _behind(network, edges[0], plan[0].entry, behind_m, kind)
    return _assemble(network, lead, plan, count=len(edges), after_m=after_m, kind=kind)


def _choose_lanes(network: RoadNetwork, edges: Sequence[str], start_lane: str | None, kind: LaneKind) -> list[_Stretch]:
    """Choose entry and exit lanes with the fewest lane changes; among equals the rightmost."""
    first = network.edges[edges[0]]
    starts, forced = [lane.index for lane in first.for_kind(kind)], None
    if start_lane is not None:
        lane = network.lanes[start_lane]
        if lane.internal:
            forced = start_lane
        else:
            starts = [lane.index]
    if not starts:
        raise RouteError(f"no lane of {first.id} is for a {kind}")
    # (lane changes, lanes so far): the smallest is the best; the stretches come along
    best: dict[int, tuple[int, tuple[int, ...], list[_Stretch]]] = {k: (0, (k,), []) for k in starts}
    for here, there in pairwise(edges):
        ways = [m for m in network.movements_from(here, kind) if m.to_edge == there]
        best = _advance(network, ways, best, forced)
        forced = None
        if not best:
            raise RouteError(f"no lane of {here} leads to {there} for a {kind}")
    entry, (_, _, stretches) = min(best.items(), key=lambda item: item[1][:2])
    return [*stretches, _Stretch(edges[-1], entry, entry, None)]


def _advance(
    network: RoadNetwork,
    ways: Sequence[Movement],
    best: dict[int, tuple[int, tuple[int, ...], list[_Stretch]]],
    forced: str | None,
) -> dict[int, tuple[int, tuple[int, ...], list[_Stretch]]]:
    """Go on by one edge: the best way to each lane of the next."""
    if forced is not None:
        ways = [m for m in ways if forced in m.via]
    found: dict[int, tuple[int, tuple[int, ...], list[_Stretch]]] = {}
    for entry, (cost, lanes, stretches) in best.items():
        for way in ways:
            leave, enter = network.lanes[way.from_lane].index, network.lanes[way.to_lane].index
            changes = 0 if forced is not None else abs(leave - entry)
            offer = (cost + changes, (*lanes, leave, enter))
            if enter not in found or offer < found[enter][:2]:
                begin = leave if forced is not None else entry
                found[enter] = (*offer, [*stretches, _Stretch(way.from_edge, begin, leave, way)])
    return found


def _ahead(network: RoadNetwork, plan: Sequence[_Stretch], length_m: float, kind: LaneKind) -> list[_Stretch]:
    """Go on after the route's end from its last lane, straight where possible.

    Not over an edge again, as in a roundabout: whoever looks for the nearest point of the line would find that pass.
    """
    stretches = list(plan)
    known = {stretch.edge for stretch in plan}
    while length_m > 0:
        here = stretches[-1]
        lane = network.edges[here.edge].lanes[here.exit]
        way = next((m for m in _ways(network, here.edge, kind) if m.from_lane == lane.id), None)
        if way is None or way.turn == "back" or way.to_edge in known:
            break
        known.add(way.to_edge)
        stretches[-1] = _Stretch(here.edge, here.entry, here.exit, way)
        target = network.lanes[way.to_lane]
        stretches.append(_Stretch(way.to_edge, target.index, target.index, None))
        length_m -= target.line.length_m
    return stretches


def _ways(network: RoadNetwork, edge: str, kind: LaneKind) -> list[Movement]:
    """All movements from an edge, in the order of the edges in `onward` (plain directions first)."""
    order = {m.to_edge: k for k, m in enumerate(onward(network, edge, kind))}
    return sorted(network.movements_from(edge, kind), key=lambda m: order[m.to_edge])


def _behind(network: RoadNetwork, edge: str, lane_index: int, length_m: float, kind: LaneKind) -> Points:
    """Return the last `length_m` of the way into a lane (straight where possible), empty for none."""
    lane = network.edges[edge].lanes[lane_index]
    return approach(network, lane, length_m, kind) if length_m > 0 else ()


def approach(network: RoadNetwork, lane: Lane, length_m: float, kind: LaneKind = "car") -> Points:
    """Return the last `length_m` (or less, where the network ends) of the way into a lane's beginning."""
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
    return subdivide([point for part in reversed(parts) for point in part]) if parts else ()


def _assemble(
    network: RoadNetwork, lead: Points, plan: Sequence[_Stretch], *, count: int, after_m: float, kind: LaneKind
) -> RouteLine:
    """Put the pieces together. `count`: how many stretches belong to the route."""
    joined = _Joined()
    if len(lead):
        lane = network.edges[plan[0].edge].lanes[plan[0].entry]
        half = [lane.width_m / 2] * len(lead)
        joined.add(_Piece(lane, lead, half, half))
    origin = len(joined)
    passages: list[tuple[Movement, int, int]] = []
    end = origin
    for k, stretch in enumerate(plan):
        for piece in _edge_pieces(network.edges[stretch.edge], stretch, after_m if k == 0 else 0.0, kind):
            joined.add(piece)
        if k == count - 1:
            end = len(joined)
        if stretch.onward is not None:
            entry = len(joined)
            for name in stretch.onward.via:
                joined.add(_whole(network.lanes[name]))
            if not stretch.onward.via:  # a net without lanes inside junctions: straight across
                target = network.lanes[stretch.onward.to_lane]
                joined.bridge(target.shape[0], target)
            passages.append((stretch.onward, entry, len(joined)))
    return joined.line(plan, passages, origin, end)


class _Joined:
    """Collects pieces into one line, leaving out points that repeat."""

    def __init__(self) -> None:
        self._points: list[XY] = []
        self._left: list[float] = []
        self._right: list[float] = []
        self._limit: list[float] = []
        self._pieces: list[tuple[int, str]] = []

    def __len__(self) -> int:
        return len(self._points)

    def add(self, piece: _Piece) -> None:
        """Add a piece, bridging a gap in front of it."""
        skip = 0
        if self._points:
            skip = _first_onward(self._points[-1], piece.points)
            if skip < len(piece.points) and distance(self._points[-1], piece.points[skip]) > 1.5 * STEP_M:
                self.bridge(piece.points[skip], piece.lane)
                skip += 1
        self._pieces.append((max(len(self._points) - 1, 0), piece.lane.id))
        self._append(piece.points[skip:], piece.left[skip:], piece.right[skip:], piece.lane.speed_mps)

    def bridge(self, to: XY, lane: Lane) -> None:
        """Go straight to a point, in steps of at most 1 m."""
        x, y = self._points[-1]
        dx, dy = to[0] - x, to[1] - y
        steps = max(math.ceil(math.hypot(dx, dy) / STEP_M), 1)
        half = [lane.width_m / 2] * steps
        self._append([(x + t * dx, y + t * dy) for t in _shares(steps)[1:]], half, half, lane.speed_mps)

    def _append(self, points: Sequence[XY], left: Sequence[float], right: Sequence[float], limit: float) -> None:
        self._points += points
        self._left += left
        self._right += right
        self._limit += [limit] * len(points)

    def line(
        self, plan: Sequence[_Stretch], passages: Sequence[tuple[Movement, int, int]], origin: int, end: int
    ) -> RouteLine:
        """Return the finished line; marks are counts of points, the joint being the last point before."""
        s = lengths(self._points)

        def mark(count: int) -> float:
            return s[max(count - 1, 0)]

        return RouteLine(
            xy=tuple(self._points),
            marks=s,
            angles=headings(self._points, s),
            limits=tuple(self._limit),
            lefts=tuple(self._left),
            rights=tuple(self._right),
            edges=tuple(stretch.edge for stretch in plan),
            passages=tuple(Passage(m.junction, mark(a), mark(b), m) for m, a, b in passages),
            origin_s=mark(origin),
            end_s=mark(end),
            pieces=tuple((s[k], lane) for k, lane in self._pieces),
        )


def _first_onward(last: XY, points: Sequence[XY]) -> int:
    """Return the first point that leads on from the last one: maps join lanes with small overlaps, never go back."""
    towards = points[1] if len(points) > 1 else None
    for k, (x, y) in enumerate(points):
        dx, dy = x - last[0], y - last[1]
        ahead = (towards[0] - points[0][0], towards[1] - points[0][1]) if towards is not None else (dx, dy)
        if math.hypot(dx, dy) >= MERGE_M and dx * ahead[0] + dy * ahead[1] > 0:
            return k
    return len(points)


def _whole(lane: Lane) -> _Piece:
    half = [lane.width_m / 2] * len(lane.line.xy)
    return _Piece(lane, lane.line.xy, half, half)


def _edge_pieces(edge: Edge, stretch: _Stretch, after_m: float, kind: LaneKind) -> list[_Piece]:
    """The points on one edge: one lane, or two with a change between them."""
    before, after = edge.lanes[stretch.entry], edge.lanes[stretch.exit]
    left0, right0 = _free(edge, before, kind)
    if before is after:
        n = len(before.line.xy)
        return [_Piece(before, before.line.xy, [left0] * n, [right0] * n)]
    left1, right1 = _free(edge, after, kind)
    length = min(before.line.length_m, after.line.length_m)
    shares = _shares(math.ceil(max(before.line.length_m, after.line.length_m) / STEP_M))
    wanted = max(CHANGE_MIN_M, CHANGE_TIME_S * before.speed_mps * abs(stretch.exit - stretch.entry))
    begin = min(max(CHANGE_AFTER_M, after_m), max(length - CHANGE_MIN_M, 0.0))
    span = max(min(wanted, length - begin), STEP_M)
    weights = [(1 - math.cos(math.pi * min(max((t * length - begin) / span, 0.0), 1.0))) / 2 for t in shares]
    points = tuple(
        ((1 - w) * x0 + w * x1, (1 - w) * y0 + w * y1)
        for w, (x0, y0), (x1, y1) in zip(
            weights, _at_shares(before.line, shares), _at_shares(after.line, shares), strict=True
        )
    )
    left, right = [left0 + w * (left1 - left0) for w in weights], [right0 + w * (right1 - right0) for w in weights]
    half = max(bisect_left(weights, 0.5), 1)
    return [
        _Piece(before, points[:half], left[:half], right[:half]),
        _Piece(after, points[half:], left[half:], right[half:]),
    ]


def _shares(steps: int) -> list[float]:
    """0 to 1 in equal steps, both included."""
    return [k / steps for k in range(steps + 1)]


def _at_shares(line: Polyline, shares: Sequence[float]) -> list[XY]:
    xs, ys = [x for x, _ in line.xy], [y for _, y in line.xy]
    at = [share * line.length_m for share in shares]
    return [(interpolate(s, line.marks, xs), interpolate(s, line.marks, ys)) for s in at]


def _array(values: Sequence[float]) -> FloatArray:
    import numpy as np

    return np.array(values, dtype=np.float64)


def _free(edge: Edge, lane: Lane, kind: LaneKind) -> tuple[float, float]:
    """Free width to the left and to the right of a lane's centre, over the lanes of its direction."""
    others = edge.for_kind(kind)
    left = sum(other.width_m for other in others if other.index > lane.index)
    right = sum(other.width_m for other in others if other.index < lane.index)
    return left + lane.width_m / 2, right + lane.width_m / 2
