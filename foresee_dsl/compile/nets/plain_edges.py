"""Converts a written network to netconvert's input: an edge for each piece of a road, ramp or ring, and the joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

from foresee_dsl.errors import CompileError
from foresee_dsl.language import model as m
from foresee_dsl.language.streets import layout
from foresee_dsl.language.streets.layout import BACK, Directed, Ring, lanes_of
from foresee_dsl.language.streets.lines import XY, at, beside, curve, marks, number, shifted, with_points_at, xy

LANE_WIDTH_M = 3.3
"""Default width of a lane, m. Ours: between 3.25 m and 3.5 m, which are usual on urban main roads."""
SPEED_MPS = 50 / 3.6
"""Default speed limit, m/s: the usual urban limit (Vienna Convention countries)."""
CORNER_RADIUS_M = 5.0
"""Radius of the inner edge of a turn, m. Ours: the edge of a road with a sidewalk of 2 m then has a radius of 7 m.
SUMO's default of 4 m is too tight for buses (without a sidewalk, the centre of their lane would turn with a radius of
5.6 m).
"""
JOINT_RADIUS_M = 0.5
"""Corner radius of a node that only divides an edge, m. Ours: no vehicle turns there, and the joint stays short."""
RAMP_MPS = 80 / 3.6
"""Speed limit of a ramp without a `speed`, m/s. Ours: the design speed of ramps with radii from 250 m."""
TAPER_M = 40.0
"""Length over which a ramp approaches or leaves its edge, m. Ours: 3.5 m sideways over this length are 5 degrees."""
ISLAND_ROOM_M = 2.0
"""Distance before and behind a zebra crossing over which the carriageways stay fully apart, m (ours)."""
ISLAND_TAPER_M = 20.0
"""Length over which the carriageways separate and join again, m. Ours: 1 m sideways over this length are 3 degrees."""
ZEBRA_M = 4.0
"""Width of a zebra crossing without a `width`, m: SUMO's default (netconvert --default.crossing-width)."""
ARC_M = 3.0
"""Largest distance between two points of a ring, m. Ours: 10 degrees on a ring of 18 m radius."""

_STRIPS = ("cycle_track", "parking", "shoulder", "bay", "cycle_lane", "bus_lane")
"""Strips between a sidewalk and the lanes for cars, from right to left: the names of the road's settings, and `bay` for
the bay of a bus stop."""
_ROOM_FOR_BAY = ("parking", "shoulder")
"""Strips that a bay interrupts, because it takes their place."""
_ALLOWS: Mapping[str, str] = {"cycle_track": "bicycle", "bay": "bus", "cycle_lane": "bicycle", "bus_lane": "bus"}
"""SUMO's classes that may use a strip; no vehicle may use the other strips."""


@dataclass(frozen=True)
class SideStrip:
    """A lane that is not for cars: its index from the right, its type, its width, m."""

    index: int
    type: str
    width: float

    @property
    def allow(self) -> str:
        """SUMO's classes that may use it; "" for none."""
        return _ALLOWS.get(self.type, "")


@dataclass(frozen=True)
class PlainEdge:
    """An `<edge>` of netconvert's input.

    Attributes:
        road: name of the road, ramp or roundabout of which it is a piece.
        lanes: types of its lanes, from the right, without the sidewalk; `lane 1` is the first lane for cars.
        widths: widths of the strips among these lanes, by type, m; all lanes for cars are `lane_width` wide.
        sidewalk: width of the sidewalk, m, or None.
    """

    id: str
    road: str
    start: str
    end: str
    lanes: tuple[str, ...]
    widths: Mapping[str, float]
    lane_width: float
    speed: float
    spread: str
    shape: tuple[XY, ...]
    sidewalk: float | None
    priority: int

    @property
    def strips(self) -> tuple[SideStrip, ...]:
        """Its lanes that are not for cars."""
        return tuple(SideStrip(k, what, self.widths[what]) for k, what in enumerate(self.lanes) if what in self.widths)


class PlainNode(NamedTuple):
    """A `<node>` of netconvert's input."""

    id: str
    at: XY
    radius: float
    type: str = "priority"


@dataclass
class Plain:
    """Netconvert's input besides the junctions, in the order of the file: nodes, edges, crossings (node, edges, width),
    connections (from, to, lane, lane) and roundabouts."""

    nodes: list[PlainNode] = field(default_factory=list)
    edges: list[PlainEdge] = field(default_factory=list)
    crossings: list[tuple[str, tuple[str, ...], float | None]] = field(default_factory=list)
    connections: list[tuple[str, str, int, int]] = field(default_factory=list)
    roundabouts: list[Ring] = field(default_factory=list)

    def at(self, junction: str, road: str) -> tuple[str, ...]:
        """Return the edges of a road that begin or end at a junction."""
        return tuple(e.id for e in self.edges if e.road == road and junction in (e.start, e.end))


def plain_of(network: m.Network) -> Plain:
    """Return netconvert's input for a network, without the turn rules, which need netconvert's output."""
    rings = layout.rings_of(network)
    edges = layout.directed(network, rings)
    plain = Plain(roundabouts=list(rings.values()))
    for ring in rings.values():
        arms = zip(ring.nodes, ring.arms, strict=True)
        plain.nodes += [PlainNode(node, ring.place(angle), CORNER_RADIUS_M) for node, (angle, _) in arms]
    for edge in edges:
        plain.edges += _pieces(edge)
        plain.nodes += [node for node in _cut_nodes(edge) if node.id not in {other.id for other in plain.nodes}]
    by_id = {edge.id: edge for edge in edges}
    ends = {item.name: xy(item.at) for item in network.body if isinstance(item, m.Junction)}
    for item in network.body:
        match item:
            case m.Roundabout():
                plain.edges += _ring_edges(rings[item.name])
            case m.OnRamp() | m.OffRamp():
                plain.edges.append(_ramp(item, by_id, ends))
            case m.Zebra():
                plain.crossings += _zebra_crossings(item, by_id)
            case _:
                pass
    for edge in edges:
        plain.connections += _joints(edge, plain.edges)
    return plain


# ---- roads ----------------------------------------------------------------------------------------------------------


def _pieces(edge: Directed) -> list[PlainEdge]:
    """Return the pieces of an edge.

    The middle of a one-way road lies on the line between its junctions; each direction of a two-way road lies on the
    right of that line, beside its half of the median.
    """
    road, (there, back) = edge.road, lanes_of(edge.road)
    if there < 1:
        raise CompileError(f"road {road.name} needs at least one lane")
    count = back if edge.back else there
    lane_width = number(road.lane_width, LANE_WIDTH_M)
    widths = {what: number(value) for what in _STRIPS if (value := getattr(road, what, None)) is not None}
    speed = number(road.speed, SPEED_MPS)
    usual = PlainEdge(
        id=edge.id,
        road=road.name,
        start=edge.start,
        end=edge.end,
        lanes=_lanes(widths, 1, count),
        widths=widths,
        lane_width=lane_width,
        speed=speed,
        spread="right" if back else "center",
        shape=(),
        sidewalk=number(road.sidewalk) or None,
        # the road with more lanes has priority, among equal ones the faster road
        priority=1000 * (there + back) + round(speed * 3.6),
    )
    half_median = number(road.median) / 2
    if not edge.cuts:
        shape = shifted(edge.line, [half_median] * len(edge.line)) if back and half_median else edge.line
        return [replace(usual, shape=tuple(shape))]
    return list(_cut_pieces(edge, usual, half_median if back else -_width(usual) / 2))


def _lanes(widths: Mapping[str, float], first: int, last: int) -> tuple[str, ...]:
    """Return the types of an edge's lanes, from the right; its lanes for cars have the numbers `first` to `last`."""
    cars = tuple(f"lane {k}" for k in range(first, last + 1))
    return (*(what for what in _STRIPS if what in widths), *cars)


def _width(edge: PlainEdge) -> float:
    """Return the width of an edge's carriageway, including its strips, m."""
    return sum(edge.widths.get(lane, edge.lane_width) for lane in edge.lanes)


def _cut_pieces(edge: Directed, usual: PlainEdge, right_m: float) -> Iterator[PlainEdge]:
    """Yield the pieces of a divided edge, with the lanes and the speed limit that the divisions before each piece
    result in.

    A lane keeps its number along all pieces; an acceleration lane has number 0.
    """
    apart = _islands(edge, right_m)
    bends = [s for place, _ in apart for s in place]
    line = with_points_at(edge.line, [cut.at_m for cut in edge.cuts] + [s for s in bends if 0 < s < edge.length_m])
    along = marks(line)
    first, last = 1, sum(lane.startswith("lane ") for lane in usual.lanes)
    moved, speed, nodes, widths = right_m, usual.speed, edge.nodes, usual.widths
    for k, piece in enumerate(edge.pieces):
        begin = edge.cuts[k - 1].at_m if k else 0.0
        end = edge.cuts[k].at_m if k < len(edge.cuts) else edge.length_m
        if k:
            cut = edge.cuts[k - 1]
            match cut.item:
                case m.OnRamp() | m.OffRamp():
                    first += 1 if cut.last else -1
                case m.LaneEnd() if number(cut.item.lane) == last - first + 1:  # the leftmost lane ends
                    last -= 1
                    moved += usual.lane_width
                case m.LaneEnd():
                    first += 1
                case m.Bump():
                    speed = usual.speed if cut.last else min(number(cut.item.speed, layout.BUMP_MPS), usual.speed)
                case m.BusStop():
                    widths = usual.widths if cut.last else _with_bay(usual.widths, cut.item)
                case m.Zebra():
                    pass
        whole = shifted(line, [moved + _apart(apart, s) for s in along])
        shape = tuple(p for p, s in zip(whole, along, strict=True) if begin - 1e-6 <= s <= end + 1e-6)
        lanes = _lanes(widths, first, last)
        yield replace(usual, id=piece, start=nodes[k], end=nodes[k + 1], lanes=lanes, widths=widths, speed=speed,
                      shape=shape, spread="right")  # fmt: skip


def _with_bay(widths: Mapping[str, float], stop: m.BusStop) -> Mapping[str, float]:
    """Return the widths of an edge's strips beside the bay of a bus stop, by type, m."""
    return {what: width for what, width in widths.items() if what not in _ROOM_FOR_BAY} | {"bay": number(stop.bay)}


def _islands(edge: Directed, half_median: float) -> list[tuple[tuple[float, float, float, float], float]]:
    """Return where an edge passes the island of a zebra crossing on its right: the positions along the edge where it
    begins to shift, is fully shifted, begins to return and has returned, and the shift, m."""
    islands = []
    for cut in edge.cuts:
        if isinstance(cut.item, m.Zebra) and (more := number(cut.item.island) / 2 - half_median) > 0:
            room = number(cut.item.width, ZEBRA_M) + ISLAND_ROOM_M
            near, far = cut.at_m - room, cut.at_m + room
            islands.append(((near - ISLAND_TAPER_M, near, far, far + ISLAND_TAPER_M), more))
    return islands


def _apart(islands: Sequence[tuple[tuple[float, float, float, float], float]], s: float) -> float:
    most = 0.0
    for (begin, near, far, end), more in islands:
        share = min((s - begin) / (near - begin), (end - s) / (end - far), 1.0)
        most = max(most, more * max(share, 0.0))
    return most


def _cut_nodes(edge: Directed) -> Iterator[PlainNode]:
    """Yield the nodes that divide an edge; a node that divides only one direction of a road lies to the right of the
    road's line.
    """
    two_way = lanes_of(edge.road)[1] > 0
    width = _width(_pieces_usual(edge))
    for cut in edge.cuts:
        point, heading = at(edge.line, cut.at_m)
        both = isinstance(cut.item, m.Zebra | m.Bump)
        right = 0.0 if both or not two_way else number(edge.road.median) / 2 + width / 2
        yield PlainNode(cut.node, beside(point, heading, right), JOINT_RADIUS_M)


def _pieces_usual(edge: Directed) -> PlainEdge:
    return _pieces(Directed(edge.id, edge.road, edge.start, edge.end, edge.line))[0]


def _joints(edge: Directed, edges: Sequence[PlainEdge]) -> Iterator[tuple[str, str, int, int]]:
    """Yield the connections where an edge gains or loses lanes; each lane continues in the lane with its number."""
    by_id = {piece.id: piece for piece in edges}
    for (before_id, after_id), cut in zip(pairwise(edge.pieces), edge.cuts, strict=True):
        if isinstance(cut.item, m.Zebra | m.Bump):
            continue
        before, after = by_id[before_id], by_id[after_id]
        for k, lane in enumerate(before.lanes):
            if lane in after.lanes and (lane not in before.widths or _ALLOWS.get(lane)):
                yield before_id, after_id, _number(before, k), _number(after, after.lanes.index(lane))
        ramp = by_id.get(cut.item.name) if isinstance(cut.item, m.OnRamp | m.OffRamp) else None
        if isinstance(cut.item, m.OnRamp) and not cut.last and ramp is not None:
            first = next(k for k, lane in enumerate(after.lanes) if lane.startswith("lane "))
            yield ramp.id, after_id, 0, _number(after, first)
        elif isinstance(cut.item, m.OffRamp) and cut.last and ramp is not None:
            first = next(k for k, lane in enumerate(before.lanes) if lane.startswith("lane "))
            yield before_id, ramp.id, _number(before, first), 0


def _number(edge: PlainEdge, lane: int) -> int:
    """Return SUMO's index of a lane; a sidewalk has index 0."""
    return lane + (edge.sidewalk is not None)


def _zebra_crossings(
    item: m.Zebra, edges: Mapping[str, Directed]
) -> Iterator[tuple[str, tuple[str, ...], float | None]]:
    """Yield a zebra crossing, or two with an island between them. A crossing lies at the end of the piece of road
    before it.
    """
    width = number(item.width, ZEBRA_M)
    there, back = edges.get(item.road), edges.get(item.road + BACK)
    if there is None:
        return
    into = there.pieces[next(k for k, cut in enumerate(there.cuts) if cut.item is item)]
    out = back.pieces[1 + next(k for k, cut in enumerate(back.cuts) if cut.item is item)] if back is not None else None
    if out is None:
        yield item.name, (into,), width
    elif item.island is None:
        yield item.name, (into, out), width
    else:
        yield item.name, (into,), width
        yield item.name, (out,), width


# ---- ramps and rings ------------------------------------------------------------------------------------------------


def _ramp(item: m.OnRamp | m.OffRamp, edges: Mapping[str, Directed], ends: Mapping[str, XY]) -> PlainEdge:
    """Return a ramp's edge: a curve to its taper, which meets the additional lane of the ramp's edge."""
    edge = edges[item.edge]
    usual = _pieces_usual(edge)
    lane_width = number(item.lane_width, usual.lane_width)
    cars = sum(lane.startswith("lane ") for lane in usual.lanes)
    gone = sum(isinstance(cut.item, m.LaneEnd) and cut.at_m < number(item.at) for cut in edge.cuts)
    inner = (cars - gone) * usual.lane_width
    left = number(edge.road.median) / 2 if lanes_of(edge.road)[1] else -_width(usual) / 2
    right = left + inner + usual.lane_width / 2
    s = number(item.at)
    joins = isinstance(item, m.OnRamp)
    point, heading = at(edge.line, s)
    meets = beside(point, heading, right)
    away_at, away_heading = at(edge.line, s - TAPER_M if joins else s + TAPER_M)
    away = beside(away_at, away_heading, right + lane_width)
    via, end_at = [xy(p) for p in item.via], ends[item.junction]
    points = [end_at, *via] if joins else [*via, end_at]
    taper = math.atan2(meets[1] - away[1], meets[0] - away[0])
    if joins:
        before = points[-2:] if len(points) > 1 else [points[-1], away]
        begins = math.atan2(before[1][1] - before[0][1], before[1][0] - before[0][0])
        shape = [*points[:-1], *curve(points[-1], begins, away, taper), meets]
    else:
        taper += math.pi
        after = points[:2] if len(points) > 1 else [away, points[0]]
        arrives = math.atan2(after[1][1] - after[0][1], after[1][0] - after[0][0])
        shape = [meets, *curve(away, taper, points[0], arrives), *points[1:]]
    start, end = (item.junction, item.name) if joins else (item.name, item.junction)
    speed = number(item.speed, RAMP_MPS)
    return PlainEdge(item.name, item.name, start, end, ("lane 1",), {}, lane_width, speed, "center", tuple(shape), None,
                     priority=round(speed * 3.6))  # fmt: skip


def _ring_edges(ring: Ring) -> Iterator[PlainEdge]:
    """Yield the edges of a roundabout, counter-clockwise, because vehicles drive on the right."""
    item = ring.item
    lanes, speed = round(number(item.lanes, 1)), number(item.speed, layout.RING_MPS)
    for k, (edge, start) in enumerate(zip(ring.edges, ring.nodes, strict=True)):
        angle, following = ring.arms[k][0], ring.arms[(k + 1) % len(ring.arms)][0]
        turn = (following - angle) % math.tau or math.tau
        steps = max(math.ceil(turn * ring.radius_m / ARC_M), 2)
        shape = tuple(ring.place(angle + turn * i / steps) for i in range(steps + 1))
        end = ring.nodes[(k + 1) % len(ring.nodes)]
        yield PlainEdge(edge, item.name, start, end, _lanes({}, 1, lanes), {},
                        number(item.lane_width, layout.RING_LANE_M), speed, "center", shape,
                        number(item.sidewalk) or None, priority=100_000)  # fmt: skip
