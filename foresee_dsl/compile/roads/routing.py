"""Routes through a network: which edges the language's `route` statements name."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from foresee_dsl.compile.roads.topology import LaneKind, Movement, Topology
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import EdgeRoute, Leg, Route, Turn
from foresee_dsl.language.traversal import word_of

_AROUND = "choose a way around that place, or correct the map there"
_TURN_ORDER: tuple[Turn, ...] = ("straight", "left", "right", "back")
_ONWARD_LETTERS = "slrLRtT"
"""SUMO's directions, the plain ones first: where two ways count as `left`, the plain left is meant."""


class RouteError(ValueError):
    """A route (or a name in it) does not fit the network; `help` says what would."""

    def __init__(self, message: str, help: str = "") -> None:
        super().__init__(message)
        self.help = help


def route_edges(network: Topology, route: Route | EdgeRoute, kind: LaneKind = "car") -> tuple[str, ...]:
    """Return the edges of a route statement; a `RouteError` where it does not fit the network.

    A `Route` starts on a road in the direction of its first junction; its turns are looked up in the junctions'
    movements; junctions without a choice need not be named. An `EdgeRoute` is checked, and filled with the shortest
    route where it says so.
    """
    if isinstance(route, EdgeRoute):
        return _listed(network, route, kind)
    start = word_of(route.start)
    choices = [edge for edge in (start, f"{start}_back", f"-{start}") if edge in network.edges]
    if not choices:
        roads = (edge for edge in network.edges if not edge.endswith("_back"))
        raise RouteError(f"there is no road or edge called {start}", did_you_mean(start, roads))
    if not route.legs:
        return (choices[0],)
    first = word_of(route.legs[0].junction)
    check_junction(network, first)
    edges = next((way for edge in choices if (way := _until(network, edge, first, kind))), None)
    if edges is None:
        ends = " or ".join(dict.fromkeys(network.edges[edge].end for edge in choices))
        raise RouteError(f"{start} does not lead to {first}", f"it leads to {ends}")
    for leg in route.legs:
        edges = _over(network, edges, leg, kind)
    return edges


def shortest_route(network: Topology, start: str, end: str, kind: LaneKind = "car") -> tuple[str, ...]:
    """Return the shortest way (by length) between two edges, both included; a `RouteError` for none."""
    import networkx as nx  # here: it takes long to import, and few need it

    for edge in (start, end):
        check_edge(network, edge)
    try:
        return tuple(nx.shortest_path(network.graph(kind), start, end, weight="length"))
    except (nx.NetworkXNoPath, nx.NodeNotFound):
        check_whole(network, (start, end))
        ways = nx.DiGraph((m.from_edge, m.to_edge) for m in network.movements if kind in m.kinds or m.fault)
        if start in ways and end in ways and nx.has_path(ways, start, end):
            check_whole(network, nx.shortest_path(ways, start, end))
        raise RouteError(f"there is no way from {start} to {end} for a {kind}") from None


def check_whole(network: Topology, edges: Sequence[str]) -> None:
    """Raise a `RouteError` that names the place where the map is broken on a way, if it is."""
    for edge in edges:
        faults = [lane.fault for lane in network.edges[edge].lanes if lane.fault]
        if faults and not network.edges[edge].for_kind("car"):
            raise RouteError(f"the map is broken on the way: {faults[0]}", _AROUND)
    for here, there in pairwise(edges):
        open_ways = any(m.to_edge == there for m in network.movements_from(here))
        if not open_ways and (fault := network.fault_between(here, there)):
            raise RouteError(f"the map is broken on the way: {fault}", _AROUND)


def check_edge(network: Topology, edge: str) -> None:
    """Raise a `RouteError` for an edge that does not exist."""
    if edge not in network.edges:
        raise RouteError(f"there is no edge called {edge}", did_you_mean(edge, network.edges))


def check_junction(network: Topology, junction: str) -> None:
    """Raise a `RouteError` for a junction that does not exist."""
    if junction not in network.junctions:
        raise RouteError(f"there is no junction called {junction}", did_you_mean(junction, network.junctions))


def onward(network: Topology, edge: str, kind: LaneKind) -> tuple[Movement, ...]:
    """Return one movement for each edge that follows, plain directions first."""
    found: dict[str, Movement] = {}
    for movement in sorted(network.movements_from(edge, kind), key=_rank):
        found.setdefault(movement.to_edge, movement)
    return tuple(found.values())


def _rank(movement: Movement) -> int:
    place = _ONWARD_LETTERS.find(movement.direction)
    return place if place >= 0 else len(_ONWARD_LETTERS)


def _until(network: Topology, edge: str, junction: str, kind: LaneKind) -> tuple[str, ...]:
    """Follow the only way onward from an edge until a junction; empty where there is a choice before it, or an end."""
    way = [edge]
    while network.edges[way[-1]].end != junction:
        ways = [m for m in onward(network, way[-1], kind) if m.turn != "back"]
        if len(ways) != 1 or ways[0].to_edge in way:
            return ()
        way.append(ways[0].to_edge)
    return tuple(way)


def _over(network: Topology, edges: tuple[str, ...], leg: Leg, kind: LaneKind) -> tuple[str, ...]:
    """Add one leg to a route."""
    junction, turn = word_of(leg.junction), word_of(leg.turn)
    check_junction(network, junction)
    way = _until(network, edges[-1], junction, kind)
    if not way:
        raise RouteError(
            f"after {edges[-1]} comes {network.edges[edges[-1]].end}, not {junction}",
            f"say first where to go over {network.edges[edges[-1]].end}",
        )
    ways = onward(network, way[-1], kind)
    chosen = next((m for m in ways if m.turn == turn), None)
    if chosen is None:
        broken = (m.to_edge for m in network.movements_at(junction) if m.from_edge == way[-1] and m.turn == turn)
        for edge in broken:
            check_whole(network, (way[-1], edge))
        turns = [t for t in _TURN_ORDER if any(m.turn == t for m in ways)]
        message = f"from {way[-1]} one can go {' or '.join(turns) or 'nowhere'} over {junction}, not {turn}"
        raise RouteError(message, f"write `{turns[0]} over {junction}`, for example" if turns else "")
    return (*edges, *way[1:], chosen.to_edge)


def _listed(network: Topology, route: EdgeRoute, kind: LaneKind) -> tuple[str, ...]:
    named = [word_of(edge) for edge in route.edges]
    for edge in named:
        check_edge(network, edge)
    edges = named[:1]
    for edge in named[1:]:
        if edge in {m.to_edge for m in network.movements_from(edges[-1], kind)}:
            edges.append(edge)
        elif not route.shortest:
            check_whole(network, (edges[-1], edge))
            raise RouteError(f"{edges[-1]} does not lead to {edge}", _leads_to(network, edges, edge, kind))
        else:
            edges += shortest_route(network, edges[-1], edge, kind)[1:]
    return tuple(edges)


def _leads_to(network: Topology, edges: Sequence[str], edge: str, kind: LaneKind) -> str:
    ways = [m.to_edge for m in onward(network, edges[-1], kind)]
    reach = f"it leads to {', '.join(ways)}" if ways else "it is a dead end"
    try:
        shortest_route(network, edges[-1], edge, kind)
    except RouteError:
        return reach
    return f"{reach}; write [{edges[-1]}, ..., {edge}] for the shortest way"
