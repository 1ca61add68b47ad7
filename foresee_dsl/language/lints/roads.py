"""The roads of a written network as a graph without geometry, from which lints compute the junctions that a route
reaches."""

from __future__ import annotations

from collections.abc import Iterable

from foresee_dsl.language import model as m
from foresee_dsl.language.streets import layout


class Roads:
    """The directed edges of a network: `west` and, where the road has two directions, `west_back`."""

    def __init__(self, network: m.Network) -> None:
        self.junctions = set(layout.named_junctions(network))
        self._pieces = {piece: (start, end) for piece, start, end in layout.joined_by_name(network)}
        self._first: dict[str, str] = {}
        self.edges: dict[str, tuple[str, str]] = {}
        for piece, (start, end) in self._pieces.items():
            whole = piece.partition("#")[0]
            self._first.setdefault(whole, piece)
            self.edges[whole] = (self.edges[whole][0] if whole in self.edges else start, end)

    def reached(self, edges: Iterable[str]) -> set[str]:
        """Return the junctions that an actor on one of these edges must reach: the first along each edge, and further
        ones as long as only one way leads on."""
        junctions: set[str] = set()
        open_ = [self._first.get(edge, edge) for edge in edges]
        seen = set(open_)
        while open_:
            edge = open_.pop()
            junction = self._pieces[edge][1]
            junctions.add(junction)
            onward = self.leaving(junction, but=self._pieces[edge])
            onward = [piece for piece in onward if piece == layout.next_piece(edge)] or onward
            if len(onward) == 1 and onward[0] not in seen:
                seen.add(onward[0])
                open_ += onward
        return junctions

    def leaving(self, junction: str, but: tuple[str, str] | None = None) -> list[str]:
        """Return the edges that leave a junction; the edge that leads back along `but` is left out."""
        back = but[::-1] if but is not None else None
        return [piece for piece, ends in self._pieces.items() if ends[0] == junction and ends != back]

    def on(self, edges: Iterable[str]) -> set[str]:
        """Return the junctions at which the given edges, or pieces of them, end."""
        return {end for piece, (_, end) in self._pieces.items() if piece.partition("#")[0] in edges}

    def along(self, edges: Iterable[str]) -> set[str]:
        """Return the named places that cut the given edges, without the junctions at which the edges end."""
        whole = {edge.partition("#")[0] for edge in edges}
        return {place for edge in whole for place in self.on([edge]) - {self.edges[edge][1]}}


def junctions_of(item: m.Item, roads: Roads) -> set[str] | None:
    """Return every junction that a route may reach; None if that is unknown."""
    if isinstance(item, m.EdgeRoute) and not item.shortest:
        named = [edge for edge in item.edges if isinstance(edge, str) and edge in roads.edges]
        return roads.on(named) if len(named) == len(item.edges) else None
    if not isinstance(item, m.Route) or not isinstance(item.start, str):
        return None
    edges = [edge for edge in (item.start, f"{item.start}_back") if edge in roads.edges]
    junctions = roads.reached(edges)
    for leg in item.legs:
        if not isinstance(leg.junction, str):
            return None
        junctions |= {leg.junction} | roads.reached(roads.leaving(leg.junction))
    return junctions


def passed_by(item: m.Item, roads: Roads) -> set[str] | None:
    """Return the junctions that a route may go over, without the one at which it ends; None if that is unknown."""
    if isinstance(item, m.EdgeRoute) and junctions_of(item, roads) is not None:
        *before, last = map(str, item.edges)
        return roads.on(before) | roads.along([last])
    if not isinstance(item, m.Route) or not isinstance(item.start, str):
        return None
    edges = [edge for edge in (item.start, f"{item.start}_back") if edge in roads.edges]
    passed: set[str] = set()
    for leg in item.legs:
        if not isinstance(leg.junction, str):
            return None
        passed |= {leg.junction} | roads.reached(edge for edge in edges if leg.junction in roads.reached([edge]))
        edges = roads.leaving(leg.junction)
    return passed | roads.along(edges if item.legs else edges[:1])
