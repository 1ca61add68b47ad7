"""The roads of a network of ours, as far as routes over it need no geometry: which junctions a route comes to."""

from __future__ import annotations

from collections.abc import Iterable

from foresee_dsl.language import model as m


class Roads:
    """The directed edges of a network: `west` and, where the road has two directions, `west_back`."""

    def __init__(self, network: m.Network) -> None:
        self.edges: dict[str, tuple[str, str]] = {}
        self.junctions = {item.name for item in network.body if isinstance(item, m.Junction)}
        for road in network.body:
            if isinstance(road, m.Road):
                self.edges[road.name] = (road.start, road.end)
                if not (isinstance(road.back, m.Quantity) and road.back.value == 0):
                    self.edges[f"{road.name}_back"] = (road.end, road.start)

    def reached(self, edges: Iterable[str]) -> set[str]:
        """Return the junctions that come first along some edges: one only drives on where there is one way on."""
        found: set[str] = set()
        open_ = list(edges)
        seen = set(open_)
        while open_:
            edge = open_.pop()
            junction = self.edges[edge][1]
            found.add(junction)
            onward = self.leaving(junction, but=self.edges[edge])
            if len(onward) == 1 and onward[0] not in seen:
                seen.add(onward[0])
                open_ += onward
        return found

    def leaving(self, junction: str, but: tuple[str, str] | None = None) -> list[str]:
        """Return the edges that leave a junction, without the way back to where one comes from."""
        back = but[::-1] if but is not None else None
        return [edge for edge, ends in self.edges.items() if ends[0] == junction and ends != back]


def junctions_of(item: m.Item, roads: Roads) -> set[str] | None:
    """Return every junction that a route may come to; None where that is unknown."""
    if isinstance(item, m.EdgeRoute) and not item.shortest:
        named = [edge for edge in item.edges if isinstance(edge, str) and edge in roads.edges]
        return {roads.edges[edge][1] for edge in named} if len(named) == len(item.edges) else None
    if not isinstance(item, m.Route) or not isinstance(item.start, str):
        return None
    edges = [edge for edge in (item.start, f"{item.start}_back") if edge in roads.edges]
    found = roads.reached(edges)
    for leg in item.legs:
        if not isinstance(leg.junction, str):
            return None
        found |= {leg.junction} | roads.reached(roads.leaving(leg.junction))
    return found
