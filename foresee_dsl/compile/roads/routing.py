"""Computes the edges of routes through a network, from the language's `route` statements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import LaneKind, Movement, Topology
from foresee_dsl.errors import Message, MessageText, measured
from foresee_dsl.helps import HelpText, instead, one_of
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import EdgeRoute, Leg, Route, Turn
from foresee_dsl.language.streets.layout import STRAIGHT_RAD, next_piece
from foresee_dsl.language.traversal import word_of

_AROUND = "choose a way around that place, or correct the map there"
_TURN_ORDER: tuple[Turn, ...] = ("straight", "left", "right", "back")
_ONWARD_LETTERS = "slrLRtT"
"""SUMO's letters of directions in order of preference: if a plain turn and a half turn both count as `left`, `left`
means the plain one."""


class RouteError(ValueError):
    """Raised if a route or a name in it does not fit the network; `help` proposes a correction."""

    def __init__(self, message: MessageText, help: HelpText = "") -> None:
        super().__init__(Message.of(message).text)
        self.message = message
        self.help = help


def metres(length_m: float, decimals: int = 1) -> Message:
    """Return a length with its unit for a message; see `measured`."""
    return measured(f"{length_m:.{decimals}f}") + " m"


def route_edges(network: Topology, route: Route | EdgeRoute, kind: LaneKind = "car") -> tuple[str, ...]:
    """Return the edges of a route statement.

    A `Route` starts on a road in the direction of its first junction, and its turns are looked up in the junctions'
    movements; junctions without a choice need not be named. An `EdgeRoute` is checked, and filled with shortest routes
    at each `...`.

    Raises:
        RouteError: the route does not fit the network.
    """
    if isinstance(route, EdgeRoute):
        return _listed(network, route, kind)
    start = word_of(route.start)
    choices = [way for edge in (start, f"{start}_back", f"-{start}") if (way := network.pieces(edge))]
    if not choices:
        roads = (edge for edge in _named(network) if not edge.endswith("_back"))
        raise RouteError(f"there is no road or edge called {start}", did_you_mean(start, roads))
    if not route.legs:
        return choices[0]
    first = word_of(route.legs[0].junction)
    check_junction(network, first, [edges[-1] for edges in choices])
    edges = next((way for edges in choices if (way := _until(network, edges[0], first, kind))), None)
    if edges is None:
        ends = one_of(dict.fromkeys(_named_end(network, edges[-1]) for edges in choices), " or ", wrong=first)
        raise RouteError(f"{start} does not lead to {first}", "it leads to " + ends)
    for leg in route.legs:
        edges = _over(network, edges, leg, kind)
    # The route goes to the end of its last road.
    while (following := next_piece(edges[-1])) in network.edges and network.parts:
        edges = (*edges, following)
    return edges


def shortest_route(network: Topology, start: str, end: str, kind: LaneKind = "car") -> tuple[str, ...]:
    """Return the shortest way (by length) between two edges, both included.

    Raises:
        RouteError: there is no way, or an edge does not exist.
    """
    import networkx as nx  # imported here: the import is slow, and few routes need it

    for edge in (start, end):
        check_edge(network, edge)
    *before, start = network.pieces(start)
    end, *after = network.pieces(end)
    if before or after:
        return (*before, *shortest_route(network, start, end, kind), *after)
    try:
        return tuple(nx.shortest_path(network.graph(kind), start, end, weight="length"))
    except (nx.NetworkXNoPath, nx.NodeNotFound):
        check_whole(network, (start, end))
        ways = nx.DiGraph((m.from_edge, m.to_edge) for m in network.movements if kind in m.kinds or m.fault)
        if start in ways and end in ways and nx.has_path(ways, start, end):
            check_whole(network, nx.shortest_path(ways, start, end))
        raise RouteError(f"there is no way from {start} to {end} for a {kind}") from None


def check_whole(network: Topology, edges: Sequence[str]) -> None:
    """Check that the map has no fault along a way.

    Raises:
        RouteError: it has one; the message names the place.
    """
    for edge in edges:
        faults = [lane.fault for lane in network.edges[edge].lanes if lane.fault]
        if faults and not network.edges[edge].for_kind("car"):
            raise RouteError(f"the map is broken on the way: {faults[0]}", _AROUND)
    for here, there in pairwise(edges):
        open_ways = any(m.to_edge == there for m in network.movements_from(here))
        if not open_ways and (fault := network.fault_between(here, there)):
            raise RouteError(f"the map is broken on the way: {fault}", _AROUND)


def check_edge(network: Topology, edge: str) -> None:
    """Check that an edge exists.

    Raises:
        RouteError: it does not.
    """
    if not network.pieces(edge):
        help = did_you_mean(edge, _named(network))
        if network.is_junction(edge):
            touching = (e.id.partition("#")[0] for e in network.edges.values() if edge in (e.start, e.end))
            names = [name for name in dict.fromkeys(touching) if network.pieces(name)]
            if names:
                help = "that is a junction: write an edge that touches it, such as " + instead(names[0], edge)
        raise RouteError(f"there is no edge called {edge}", help)


def check_junction(network: Topology, junction: str, behind: Sequence[str] = ()) -> None:
    """Check that a junction exists; `behind` holds the edges that may lead to it, for the help.

    Raises:
        RouteError: it does not.
    """
    if not network.is_junction(junction):
        if behind and (road := network.pieces(junction)):
            touching = [edge for edge in behind if network.edges[edge].end == network.edges[road[0]].start]
            ends = dict.fromkeys(_named_end(network, edge) for edge in touching or behind)
            help = "name the junction before it: write " + one_of(ends, " or ", wrong=junction)
            raise RouteError(f"{junction} is a road, not a junction", help)
        names = (*network.junctions, *network.rings)
        raise RouteError(f"there is no junction called {junction}", did_you_mean(junction, names))


def onward(network: Topology, edge: str, kind: LaneKind) -> tuple[Movement, ...]:
    """Return a movement to each of the next edges, plain directions first."""
    movements: dict[str, Movement] = {}
    for movement in sorted(network.movements_from(edge, kind), key=_rank):
        movements.setdefault(movement.to_edge, movement)
    return tuple(movements.values())


def _rank(movement: Movement) -> int:
    place = _ONWARD_LETTERS.find(movement.direction)
    return place if place >= 0 else len(_ONWARD_LETTERS)


def _until(network: Topology, edge: str, junction: str, kind: LaneKind) -> tuple[str, ...]:
    """Return the edges from an edge to a junction, if there is no choice of ways before it; otherwise empty.

    At the end of a piece of a divided edge, the way continues on the next piece, even if a ramp leaves there.
    """
    way = [edge]
    last = network.rings[junction].nodes if junction in network.rings else {junction}
    while network.edges[way[-1]].end not in last:
        ways = [m for m in onward(network, way[-1], kind) if m.turn != "back"]
        ways = [m for m in ways if m.to_edge == next_piece(way[-1])] or ways
        if len(ways) != 1 or ways[0].to_edge in way:
            return ()
        way.append(ways[0].to_edge)
    return tuple(way)


def _over(network: Topology, edges: tuple[str, ...], leg: Leg, kind: LaneKind) -> tuple[str, ...]:
    """Return a route with one more leg."""
    junction, turn = word_of(leg.junction), word_of(leg.turn)
    check_junction(network, junction, edges[-1:])
    way = _until(network, edges[-1], junction, kind)
    if not way:
        following = _named_end(network, edges[-1])
        leg_text = f"{turn} over {junction}"
        help = "write the turn over it first: " + instead(f"straight over {following} {leg_text}", leg_text)
        raise RouteError(f"after {edges[-1]} comes {following}, not {junction}", help)
    if junction in network.rings:
        return (*edges, *way[1:], *_round(network, way[-1], leg, kind))
    ways = _by_name(onward(network, way[-1], kind), way[-1])
    chosen = next((m for m in ways if m.turn == turn), None)
    if chosen is None:
        broken = (m.to_edge for m in network.movements_at(junction) if m.from_edge == way[-1] and m.turn == turn)
        for edge in broken:
            check_whole(network, (way[-1], edge))
        turns = [t for t in _TURN_ORDER if any(m.turn == t for m in ways)]
        message = f"from {way[-1]}, vehicles can go {' or '.join(turns) or 'nowhere'} over {junction}, not {turn}"
        raise RouteError(message, _other_turn(turns, turn, junction))
    return (*edges, *way[1:], chosen.to_edge)


def _other_turn(turns: Sequence[str], turn: str, junction: str) -> HelpText:
    return "write " + instead(f"{turns[0]} over {junction}", f"{turn} over {junction}") if turns else ""


def _by_name(ways: Sequence[Movement], edge: str) -> tuple[Movement, ...]:
    """Return the movements with their turns; if the edge is divided there, its next piece is straight on and a ramp is
    on the right."""
    if all(way.to_edge != next_piece(edge) for way in ways):
        return tuple(ways)
    return tuple(replace(w, turn="straight" if w.to_edge == next_piece(edge) else "right") for w in ways)


def _round(network: Topology, edge: str, leg: Leg, kind: LaneKind) -> tuple[str, ...]:
    """Return the edges on a roundabout and the exit edge for a turn, from the edge that leads into it.

    The angle between entry and exit determines an exit's turn; of several exits the one nearest to the ideal angle is
    taken.
    """
    junction, turn = word_of(leg.junction), word_of(leg.turn)
    ring = network.rings[junction]
    x, y = ring.centre

    def angle(node: str) -> float:
        at = network.junctions[node]
        return math.atan2(at.y - y, at.x - x)

    entry = network.edges[edge].end
    ways: list[tuple[Turn, float, tuple[str, ...]]] = []
    node, last = entry, edge
    on_ring: tuple[str, ...] = ()
    while True:
        following = ""
        for movement in onward(network, last, kind):
            end = network.edges[movement.to_edge].end
            if end in ring.nodes and movement.to_edge.startswith(f"{junction}#"):
                following = movement.to_edge
                continue
            off = wrap(angle(node) - angle(entry) - math.pi)
            of: Turn = "straight" if abs(off) <= STRAIGHT_RAD else ("left" if off > 0 else "right")
            ideal = {"straight": 0.0, "left": math.pi / 2, "right": -math.pi / 2}[of]
            ways.append(("back" if node == entry else of, abs(off - ideal), (*on_ring, movement.to_edge)))
        if not following or following in on_ring:
            break
        on_ring, last = (*on_ring, following), following
        node = network.edges[following].end
    fitting = [way for way in ways if way[0] == turn]
    if not fitting:
        turns = [t for t in _TURN_ORDER if any(t == way_turn for way_turn, _, _ in ways)]
        message = f"from {edge}, vehicles can go {' or '.join(turns) or 'nowhere'} over {junction}, not {turn}"
        raise RouteError(message, _other_turn(turns, turn, junction))
    return min(fitting, key=lambda way: way[1])[2]


def _named(network: Topology) -> list[str]:
    """Return the names of edges in the language: divided edges by their whole name, without edges of roundabouts."""
    return [*network.parts, *(edge for edge in network.edges if not network.parts or "#" not in edge)]


def _named_end(network: Topology, edge: str) -> str:
    """Return the junction at the end of an edge, or the roundabout to which it belongs."""
    end = network.edges[edge].end
    return next((name for name, ring in network.rings.items() if end in ring.nodes), end)


def _listed(network: Topology, route: EdgeRoute, kind: LaneKind) -> tuple[str, ...]:
    named = [word_of(edge) for edge in route.edges]
    for edge in named:
        check_edge(network, edge)
    edges = list(network.pieces(named[0]))
    for edge in named[1:]:
        first, *rest = network.pieces(edge)
        if first in {m.to_edge for m in network.movements_from(edges[-1], kind)}:
            edges += first, *rest
        elif not route.shortest:
            check_whole(network, (edges[-1], first))
            raise RouteError(f"{edges[-1]} does not lead to {edge}", _leads_to(network, edges, edge, kind))
        else:
            edges += (*shortest_route(network, edges[-1], first, kind)[1:], *rest)
    return tuple(edges)


def _leads_to(network: Topology, edges: Sequence[str], edge: str, kind: LaneKind) -> HelpText:
    ways = [m.to_edge for m in onward(network, edges[-1], kind)]
    reach = "it leads to " + one_of(ways, wrong=edge) if ways else "it is a dead end"
    try:
        shortest_route(network, edges[-1], edge, kind)
    except RouteError:
        return reach
    return reach + f"; write [{edges[-1]}, ..., {edge}] for the shortest way"
