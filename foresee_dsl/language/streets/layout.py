"""Cuts the edges of a written network where objects on them begin or end, and finds the roads that meet at a
roundabout.

It does not need SUMO: the checks, the lints and the compiler use it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from foresee_dsl.language import model as m
from foresee_dsl.language.streets.lines import XY, marks, number, xy

BACK = "_back"
"""Suffix of a road's name for its edge in the other direction."""
STRAIGHT_RAD = math.radians(45)
"""Largest angle at which a way over a junction counts as straight, rad. SUMO names directions by the same limit."""
RAMP_LANE_M = 200.0
"""Default length of a ramp's extra lane, m. Ours: between the 150 m and 250 m of German and Dutch motorways."""
BUMP_MPS = 20 / 3.6
"""Speed limit of a bump without a `speed`, m/s: 20 km/h, for which sinusoidal humps in 30 km/h zones are made
(ours)."""
BUMP_M = 4.0
"""Length of a bump without a `length`, m: the usual flat or round-topped hump, 3.7 m, and its ramps (ours)."""

STOP_LENGTH_M = 15.0
"""Length of a bus stop without a `length`, m. Ours: a city bus of 12 m and a door's width on either side."""
BAY_ENTRY, BAY_EXIT = 5.0, 4.0
"""Length of a bay's tapers, as a multiple of its width: entry 1 in 5 and exit 1 in 4 (Roads Service and Translink, Bus
Stop Design Guide, 2005, paragraph 8.17)."""
BAY_STRAIGHT_M = 20.0
"""Length over which a bay goes straight on between its entry taper and the stop, m. Ours: a bus of 12 m that arrives at
50 km/h at a stop of 20 m then stands 1 degree askew, and a car close behind it passes with 0.6 m to spare; without this
length it stands 4.7 degrees askew, and the two vehicles touch."""

OnRoads = m.Zebra | m.Bump | m.LaneEnd | m.OnRamp | m.OffRamp | m.BusStop


@dataclass(frozen=True)
class Cut:
    """A cut of an edge: its position along the edge, m, its node (a junction of SUMO), and the statement that causes
    it.

    `last` is True for the statement's second cut, at the end of its object.
    """

    at_m: float
    node: str
    item: OnRoads
    last: bool = False


@dataclass(frozen=True)
class Directed:
    """One direction of a road: its id, its road, the junctions that it joins, its line, and its cuts."""

    id: str
    road: m.Road
    start: str
    end: str
    line: tuple[XY, ...]
    cuts: tuple[Cut, ...] = ()

    @property
    def back(self) -> bool:
        """True if it runs against the road's own direction."""
        return self.id != self.road.name

    @property
    def length_m(self) -> float:
        """Its length along the road's line from junction to junction, m."""
        return marks(self.line)[-1]

    @property
    def pieces(self) -> tuple[str, ...]:
        """The ids of its pieces in driving order; its own id if it has no cuts."""
        return tuple(f"{self.id}#{k}" for k in range(1, len(self.cuts) + 2)) if self.cuts else (self.id,)

    @property
    def nodes(self) -> tuple[str, ...]:
        """The junctions between which its pieces run."""
        return (self.start, *(cut.node for cut in self.cuts), self.end)


@dataclass(frozen=True)
class Ring:
    """A roundabout: its arms counter-clockwise, with the roads that end there.

    Attributes:
        arms: (angle from the centre, rad; the road).
        radius_m: radius of the middle of the carriageway, m.
        outer_m: radius of its outer border, m.
    """

    item: m.Roundabout
    centre: XY
    radius_m: float
    outer_m: float
    arms: tuple[tuple[float, m.Road], ...] = field(default=())

    @property
    def nodes(self) -> tuple[str, ...]:
        """The junctions at its arms, in the order of the arms."""
        return tuple(f"{self.item.name}_{road.name}" for _, road in self.arms)

    @property
    def edges(self) -> tuple[str, ...]:
        """Ids of the roundabout's edges in driving order; the first one begins at the first arm."""
        return tuple(f"{self.item.name}#{k}" for k in range(1, len(self.arms) + 1))

    def place(self, angle_rad: float, radius_m: float | None = None) -> XY:
        """Return the point at an angle of the ring; without a radius, in the middle of the carriageway."""
        radius = self.radius_m if radius_m is None else radius_m
        return self.centre[0] + radius * math.cos(angle_rad), self.centre[1] + radius * math.sin(angle_rad)


def lanes_of(road: m.Road) -> tuple[int, int]:
    """Return the number of lanes of a road in its own and in the other direction."""
    lanes = round(number(road.lanes, 1))
    return lanes, round(number(road.back, lanes))


def rings_of(network: m.Network) -> Mapping[str, Ring]:
    """Return the roundabouts of a network, by name; a road with both ends at one roundabout is not an arm of it."""
    rings = {}
    ends = {item.name: xy(item.at) for item in network.body if isinstance(item, m.Junction | m.Roundabout)}
    for item in network.all(m.Roundabout):
        x, y = centre = xy(item.at)
        arms = []
        for road in network.all(m.Road):
            if (road.start == item.name) != (road.end == item.name):
                far = ends.get(road.end if road.start == item.name else road.start, centre)
                inner = [xy(p) for p in road.via] or [far]
                near = inner[0] if road.start == item.name else inner[-1]
                arms.append((math.atan2(near[1] - y, near[0] - x) % math.tau, road))
        radius = number(item.radius, 1.0)
        half = round(number(item.lanes, 1)) * number(item.lane_width, RING_LANE_M) / 2
        rings[item.name] = Ring(item, centre, radius, radius + half, tuple(sorted(arms, key=lambda arm: arm[0])))
    return rings


RING_LANE_M = 4.5
"""Width of a roundabout's lane without a `lane_width`, m: one lane of 4.5 m lets buses pass (the bundled town's)."""
RING_MPS = 30 / 3.6
"""Speed limit of a roundabout without a `speed`, m/s (the bundled town's)."""


def directed(network: m.Network, rings: Mapping[str, Ring] | None = None) -> tuple[Directed, ...]:
    """Return the edges of a network's roads in their order, each with its cuts, without roads between unknown
    junctions."""
    rings = rings_of(network) if rings is None else rings
    ends = {item.name: xy(item.at) for item in network.all(m.Junction)}
    cuts: dict[str, list[Cut]] = {}
    edges: list[Directed] = []
    for road in network.all(m.Road):
        joined = [_end(road, name, ends, rings) for name in (road.start, road.end)]
        if None in joined or road.start == road.end:
            continue
        (start, first), (end, last) = (arm for arm in joined if arm is not None)
        line = (first, *(xy(p) for p in road.via), last)
        edges.append(Directed(road.name, road, start, end, line))
        if lanes_of(road)[1]:
            edges.append(Directed(road.name + BACK, road, end, start, line[::-1]))
    by_id = {edge.id: edge for edge in edges}
    for item in network.body:
        if isinstance(item, OnRoads):
            for edge, cut in _cuts(item, by_id):
                cuts.setdefault(edge, []).append(cut)
    return tuple(
        Directed(e.id, e.road, e.start, e.end, e.line, tuple(sorted(cuts.get(e.id, ()), key=lambda cut: cut.at_m)))
        for e in edges
    )


def _end(road: m.Road, name: str, ends: Mapping[str, XY], rings: Mapping[str, Ring]) -> tuple[str, XY] | None:
    """Return the junction at one end of a road, and its position; None if it does not exist."""
    if name in ends:
        return name, ends[name]
    ring = rings.get(name)
    angle = next((angle for angle, arm in ring.arms if arm is road), None) if ring is not None else None
    return (f"{name}_{road.name}", ring.place(angle)) if ring is not None and angle is not None else None


def _cuts(item: OnRoads, edges: Mapping[str, Directed]) -> Iterator[tuple[str, Cut]]:
    """Yield the cuts that a statement makes, with the id of their edge."""
    at_m = number(item.at)
    match item:
        case m.Zebra() | m.Bump():
            there, back = edges.get(item.road), edges.get(item.road + BACK)
            further = number(item.length, BUMP_M) if isinstance(item, m.Bump) else 0.0
            for edge in (there, back):
                if edge is not None:
                    places = [(at_m, item.name), (at_m + further, f"{item.name}_end")]
                    for place, node in places if further else places[:1]:
                        along = edge.length_m - place if edge.back else place
                        yield edge.id, Cut(along, node, item, last=(node != item.name) != edge.back and further > 0)
        case m.LaneEnd():
            if item.edge in edges:
                yield item.edge, Cut(at_m, f"{item.edge}_lane_{round(number(item.lane))}_end", item)
        case m.OnRamp():
            if item.edge in edges:
                yield item.edge, Cut(at_m, item.name, item)
                yield item.edge, Cut(at_m + number(item.length, RAMP_LANE_M), f"{item.name}_end", item, last=True)
        case m.OffRamp():
            if item.edge in edges:
                yield item.edge, Cut(at_m - number(item.length, RAMP_LANE_M), f"{item.name}_begin", item)
                yield item.edge, Cut(at_m, item.name, item, last=True)
        case m.BusStop():
            if item.bay is not None and item.road in edges:
                begin_m, end_m = bay_of(item, edges[item.road].length_m)
                yield item.road, Cut(begin_m, f"{item.name}_begin", item)
                yield item.road, Cut(end_m, f"{item.name}_end", item, last=True)


def bay_of(stop: m.BusStop, edge_m: float) -> tuple[float, float]:
    """Return the positions along its edge at which the bay of a bus stop begins and ends, m, including both tapers.

    SUMO's lanes do not widen: the bay has its full width on the tapers too.

    Args:
        stop: a stop with a bay.
        edge_m: length of its edge, m.
    """
    at_m, bay_m = number(stop.at), number(stop.bay)
    front_m = at_m if at_m >= 0 else edge_m + at_m
    straight_m = BAY_STRAIGHT_M + number(stop.length, STOP_LENGTH_M)
    return front_m - straight_m - BAY_ENTRY * bay_m, front_m + BAY_EXIT * bay_m


def next_piece(edge: str) -> str:
    """Return the id of the next piece of a cut edge; "" for an edge that is not a piece."""
    whole, _, number_ = edge.rpartition("#")
    return f"{whole}#{int(number_) + 1}" if whole and number_.isdigit() else ""


def parts_of(network: m.Network) -> Mapping[str, tuple[str, ...]]:
    """Return the pieces of every edge that is cut, by the id of the edge."""
    return {edge.id: edge.pieces for edge in directed(network) if edge.cuts}


def joints_of(network: m.Network) -> frozenset[str]:
    """Return the nodes that only cut an edge, because a lane or a bay begins or ends there; no scenario can name
    them."""
    unnamed = (cut for edge in directed(network) for cut in edge.cuts if not isinstance(cut.item, m.Zebra | m.Bump))
    # a ramp has its own name only at the end where it meets the edge
    return frozenset(cut.node for cut in unnamed if isinstance(cut.item, m.LaneEnd) or cut.node != cut.item.name)


def joined_by_name(network: m.Network) -> Iterator[tuple[str, str, str]]:
    """Yield (edge, start, end) of all edges by the names that a scenario uses.

    A ring is one junction. An edge is whole, but cut at objects that have a name: a zebra crossing, a bump, a ramp.
    """
    rings = rings_of(network)
    ring_of = {node: ring.item.name for ring in rings.values() for node in ring.nodes}
    for edge in directed(network, rings):
        nodes = [ring_of.get(node, node) for node in edge.nodes]
        for piece, (start, end) in zip(edge.pieces, itertools.pairwise(nodes), strict=True):
            yield piece, start, end
    for item in network.body:
        if isinstance(item, m.OnRamp):
            yield item.name, item.junction, item.name
        elif isinstance(item, m.OffRamp):
            yield item.name, item.name, item.junction


def named_junctions(network: m.Network) -> Sequence[str]:
    """Return the names of everything that a scenario can name as a junction."""
    kinds = m.Junction | m.Roundabout | m.Zebra | m.Bump | m.OnRamp | m.OffRamp
    return [item.name for item in network.body if isinstance(item, kinds)]
