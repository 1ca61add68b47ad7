"""The parts of a road network in SUMO's terms, and their connections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeVar
from weakref import WeakKeyDictionary

from foresee_dsl.compile.roads.polyline import Points, Polyline, distance_to
from foresee_dsl.language.model import Turn

if TYPE_CHECKING:
    import networkx as nx
    from shapely import LineString

LaneKind = Literal["car", "bicycle", "pedestrian", "bus"]
"""The kinds of traffic to which a lane is open; `car` stands for all motor vehicles. Buses may use lanes for cars and
bus lanes."""
_Network = TypeVar("_Network", bound="Topology")
_Key = TypeVar("_Key")
_Value = TypeVar("_Value")
STRIPS_ON_THE_ROAD = ("parking", "shoulder", "bay", "cycle_lane", "bus_lane")
"""Types of lanes that are closed to cars but part of the carriageway: a vehicle on them has not left the road."""


@dataclass(frozen=True, eq=False)
class Lane:
    """A lane; index 0 is the rightmost (often the sidewalk).

    Attributes:
        shape: points of the centreline, m, as in the net file.
        length_m: length as in the net file; positions in this package are measured along `line`, whose length can
            differ by rounding.
        internal: the lane is inside a junction. parking: it is a strip for parked vehicles, closed to traffic.
        strip: it is on the carriageway and not for cars: a bus lane, a shoulder, parking, ...
        bay: it is the bay of a bus stop, which begins and ends beside the other lanes.
        fault: reason why vehicles cannot use it, if the map is broken; otherwise "".
    """

    id: str
    edge: str
    index: int
    shape: Points
    length_m: float
    speed_mps: float
    width_m: float
    kinds: frozenset[LaneKind]
    internal: bool
    parking: bool = False
    fault: str = ""
    strip: bool = False
    bay: bool = False

    @cached_property
    def line(self) -> Polyline:
        """The centreline, with points at most 1 m apart."""
        return Polyline.of(self.shape)

    @cached_property
    def centreline(self) -> LineString:
        """The centreline with the points of the net file."""
        import shapely  # imported here: the import is slow, and placing actors does not need it

        return shapely.LineString(self.shape)


@dataclass(frozen=True, eq=False)
class NetEdge:
    """A road in one direction: `start` and `end` are junctions."""

    id: str
    start: str
    end: str
    lanes: tuple[Lane, ...]

    def for_kind(self, kind: LaneKind) -> tuple[Lane, ...]:
        """Return the lanes that are open to a kind, from the right."""
        return tuple(lane for lane in self.lanes if kind in lane.kinds)

    @property
    def drivable(self) -> tuple[Lane, ...]:
        """The lanes for cars; if there are none, the lanes for bicycles; if there are none either, all lanes."""
        return self.for_kind("car") or self.for_kind("bicycle") or self.lanes


@dataclass(frozen=True, eq=False)
class NetJunction:
    """A junction of edges.

    `requests[k]` is row k of SUMO's right-of-way matrix, which has one row for each link: (response, foes) as bit masks
    over the links. Bit j of `response` is set if link k must yield to link j, bit j of `foes` if the two conflict.
    """

    id: str
    type: str
    x: float
    y: float
    polygon: Points
    requests: tuple[tuple[int, int], ...] = ()

    def yields(self, link: int, other: int) -> bool:
        """Return whether link `link` must yield to link `other`."""
        return 0 <= link < len(self.requests) and bool(self.requests[link][0] >> other & 1)

    def conflicts(self, link: int, other: int) -> bool:
        """Return whether two links conflict."""
        return 0 <= link < len(self.requests) and bool(self.requests[link][1] >> other & 1)


@dataclass(frozen=True, eq=False)
class Movement:
    """A way from a lane through a junction to another lane: SUMO's connection with its internal lanes.

    Attributes:
        via: the internal lanes in driving order (two if vehicles may wait in the middle; none in nets without internal
            lanes).
        direction: SUMO's letter of the turn. turn: the language's word for it.
        tls: id of the signal that controls it, or None. link: its index in that signal's states.
        index: its row in the junction's `requests`, -1 without a row.
        fault: reason why vehicles cannot use it, if the map is broken there (it is then closed); otherwise "".
    """

    from_edge: str
    to_edge: str
    from_lane: str
    to_lane: str
    via: tuple[str, ...]
    junction: str
    turn: Turn
    direction: str
    tls: str | None
    link: int
    index: int
    kinds: frozenset[LaneKind]
    fault: str = ""

    @property
    def ends(self) -> tuple[str, str]:
        """The lanes that it connects."""
        return self.from_lane, self.to_lane


@dataclass(frozen=True, eq=False)
class NetRoundabout:
    """Several junctions that have one name in the language: centre of the ring, m, and its outline."""

    nodes: frozenset[str]
    centre: tuple[float, float]
    polygon: Points


@dataclass(frozen=True, eq=False)
class Crossing:
    """A pedestrian crossing: its lane, the edges that it crosses, its signal, its row in the junction's `requests`."""

    id: str
    lane: Lane
    edges: tuple[str, ...]
    junction: str
    tls: str | None
    link: int
    index: int

    @property
    def ends(self) -> tuple[str, str]:
        """The ids of the two lanes at its ends: twice its own lane, because pedestrians use it in both directions."""
        return self.lane.id, self.lane.id


@dataclass(frozen=True, eq=False)
class WalkingArea:
    """A corner where sidewalks and crossings meet. `polygon` does not repeat its first point."""

    id: str
    junction: str
    polygon: Points


@dataclass(frozen=True, eq=False, repr=False)
class Topology:
    """The parts of a net, in the order of the file; compared by identity.

    `left_hand` is True if traffic keeps to the left; lanes are then counted from the left.
    `parts` holds, for each divided edge by its whole name, its pieces in driving order. `rings` holds roundabouts by
    name.
    `joints` holds the junctions at which an edge is only divided. A net file has neither parts nor rings nor joints.
    `footways` holds pairs of connected ids: of a sidewalk's lane, a crossing's lane or a walking area.
    """

    lanes: Mapping[str, Lane]
    edges: Mapping[str, NetEdge]
    junctions: Mapping[str, NetJunction]
    movements: tuple[Movement, ...]
    crossings: Mapping[str, Crossing]
    walking_areas: Mapping[str, WalkingArea]
    footways: tuple[tuple[str, str], ...]
    left_hand: bool = False
    parts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rings: Mapping[str, NetRoundabout] = field(default_factory=dict)
    joints: frozenset[str] = frozenset()
    _graphs: dict[LaneKind, nx.DiGraph[str]] = field(default_factory=dict, init=False)

    def is_junction(self, name: str) -> bool:
        """Return whether a junction or a roundabout has a name."""
        return name in self.junctions or name in self.rings

    def outline(self, junction: str) -> Points:
        """Return the outline of a junction, or of a roundabout with its island."""
        ring = self.rings.get(junction)
        return ring.polygon if ring is not None else self.junctions[junction].polygon

    def pieces(self, edge: str) -> tuple[str, ...]:
        """Return the edges that a name denotes: the pieces of a divided edge, or the edge itself; none if it is
        unknown."""
        return self.parts.get(edge) or ((edge,) if edge in self.edges else ())

    def lanes_to(self, left: int) -> int:
        """Return the number that is added to a lane's index to get that of the lane `left` lanes to its left."""
        return -left if self.left_hand else left

    def lane_beside(self, lane: Lane, side: int) -> Lane | None:
        """Return the lane of the same edge to the left (1) or right (-1) of a lane, if any."""
        edge = self.edges.get(lane.edge)
        index = lane.index + self.lanes_to(side)
        return None if edge is None or not 0 <= index < len(edge.lanes) else edge.lanes[index]

    def movements_from(self, edge: str, kind: LaneKind = "car") -> tuple[Movement, ...]:
        """Return the movements that leave an edge and are open to a kind."""
        return tuple(m for m in self._movements_by.get(("from", edge), ()) if kind in m.kinds)

    def movements_into(self, lane: str, kind: LaneKind = "car") -> tuple[Movement, ...]:
        """Return the movements that end on a lane and are open to a kind."""
        return tuple(m for m in self._movements_by.get(("into", lane), ()) if kind in m.kinds)

    def movements_through(self, lane: str) -> Sequence[Movement]:
        """Return the movements that use an internal lane; none for other lanes."""
        return self._movements_by.get(("through", lane), ())

    def movements_at(self, junction: str) -> tuple[Movement, ...]:
        """Return all movements through a junction."""
        return tuple(m for m in self.movements if m.junction == junction)

    def edges_at(self, junction: str) -> Sequence[NetEdge]:
        """Return the edges that begin or end at a junction."""
        return self._edges_by.get(junction, ())

    def fault_between(self, edge: str, onward: str) -> str:
        """Return why vehicles cannot drive from one edge to the next, if the map is broken there; otherwise ""."""
        ways = self._movements_by.get(("from", edge), ())
        return next((way.fault for way in ways if way.to_edge == onward and way.fault), "")

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """The reasons why lanes and connections are closed because the map is broken, in the net's order."""
        of_lanes = (lane.fault for lane in self.lanes.values())
        of_ways = (movement.fault for movement in self.movements)
        return tuple(dict.fromkeys(fault for fault in (*of_lanes, *of_ways) if fault))

    def fault_near(self, x: float, y: float) -> str:
        """Return why a lane or connection at a place is closed because the map is broken; otherwise ""."""
        for lane in self.lanes.values() if self.faults else ():
            fault = lane.fault or next((m.fault for m in self.movements_through(lane.id) if m.fault), "")
            if fault and distance_to(x, y, lane.shape) <= lane.width_m:
                return fault
        return ""

    def crossings_at(self, junction: str) -> tuple[Crossing, ...]:
        """Return the pedestrian crossings of a junction."""
        return tuple(c for c in self.crossings.values() if c.junction == junction)

    def graph(self, kind: LaneKind = "car") -> nx.DiGraph[str]:
        """Return the graph of edges that are open to a kind; the weight `length` is that of the entered edge."""
        if kind not in self._graphs:
            import networkx as nx  # imported here: the import is slow, and only `...` in a route needs it

            graph: nx.DiGraph[str] = nx.DiGraph()
            graph.add_nodes_from(edge.id for edge in self.edges.values() if edge.for_kind(kind))
            for m in self.movements:
                if kind in m.kinds:
                    graph.add_edge(m.from_edge, m.to_edge, length=self.lanes[m.to_lane].length_m)
            self._graphs[kind] = graph
        return self._graphs[kind]

    @cached_property
    def _edges_by(self) -> dict[str, list[NetEdge]]:
        edges: dict[str, list[NetEdge]] = {}
        for edge in self.edges.values():
            for junction in dict.fromkeys((edge.start, edge.end)):
                edges.setdefault(junction, []).append(edge)
        return edges

    @cached_property
    def _movements_by(self) -> dict[tuple[str, str], list[Movement]]:
        """The movements from an edge, into a lane and through an internal lane."""
        movements: dict[tuple[str, str], list[Movement]] = {}
        for movement in self.movements:
            through = (("through", lane) for lane in movement.via)
            for key in (("from", movement.from_edge), ("into", movement.to_lane), *through):
                movements.setdefault(key, []).append(movement)
        return movements


def junction_of(edge: str) -> str:
    """Return the junction of an internal edge, `j4` for `:j4_c0`; "" for an edge outside junctions."""
    return edge[1:].rpartition("_")[0] if edge.startswith(":") else ""


def per_network(make: Callable[[_Network], _Value]) -> Callable[[_Network], _Value]:
    """Return a function that calls `make` once for each network, and keeps the value as long as the network.

    Runs share these values: all mutants of a clip drive on the same network.
    """
    values: WeakKeyDictionary[_Network, _Value] = WeakKeyDictionary()

    def value_of(network: _Network) -> _Value:
        value = values.get(network)
        if value is None:
            value = values[network] = make(network)
        return value

    return value_of


def cached(values: dict[_Key, _Value], key: _Key, most: int, make: Callable[[], _Value]) -> _Value:
    """Return the value of a key; it is computed if it is missing, after all others are dropped if they are `most`."""
    value = values.get(key)
    if value is None:
        if len(values) >= most:
            values.clear()
        value = values[key] = make()
    return value
