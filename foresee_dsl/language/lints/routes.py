"""Lints about ways through a network that is written in the language: gaps, and junctions that are not on the way.

Which turn leads where depends on the geometry, which the compiler knows. A way is reported as impossible here, or a
junction as off it, only where that holds whatever the turns are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from foresee_dsl.language import model as m
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.lints.actors import Found
from foresee_dsl.language.printer import written
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.traversal import walk


class _Roads:
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


def route_lints(case: TestCase) -> Iterator[Found]:
    """Return the lints about one concrete scenario's routes; none where the network is a foreign file."""
    if not isinstance(case.network, m.Network):
        return
    roads = _Roads(case.network)
    passed: dict[str, set[str]] = {}
    for actor in case.scenario.actors:
        for item in actor.body:
            gap = _gap(item, roads)
            if gap is not None:
                yield gap
            elif (junctions := _passed(item, roads)) is not None:
                passed[actor.name] = junctions
    for statement in case.scenario.body:
        if isinstance(statement, m.When | m.Expect):
            yield from _off_the_way(statement, roads, passed)


def _gap(item: m.Item, roads: _Roads) -> Found | None:
    if isinstance(item, m.EdgeRoute) and not item.shortest:
        for one, other in zip(item.edges, item.edges[1:], strict=False):
            if one in roads.edges and other in roads.edges and roads.edges[one][1] != roads.edges[other][0]:
                message = f"'{one}' ends at {roads.edges[one][1]}, but '{other}' begins at {roads.edges[other][0]}"
                help = f"write `[{one}, ..., {other}]` for the shortest way between them"
                return Found(item, "edges", c.BROKEN_ROUTE, message, help)
    if isinstance(item, m.Route) and isinstance(item.start, str):
        return _gap_between_legs(item, roads)
    return None


def _gap_between_legs(route: m.Route, roads: _Roads) -> Found | None:
    edges = [edge for edge in (str(route.start), f"{route.start}_back") if edge in roads.edges]
    before = f"road '{route.start}'"
    for leg in route.legs:
        junction = leg.junction
        if not edges or junction not in roads.junctions or not isinstance(junction, str):
            return None  # an unknown name, which is reported as such
        reached = roads.reached(edges)
        if junction not in reached:
            help = f"say first where to go over {' or '.join(sorted(reached))}"
            return Found(leg, "junction", c.BROKEN_ROUTE, f"{before} does not lead to '{junction}'", help)
        edges = roads.leaving(junction)
        before = f"the way over '{junction}'"
    return None


def _passed(item: m.Item, roads: _Roads) -> set[str] | None:
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


def _off_the_way(statement: m.When | m.Expect, roads: _Roads, passed: dict[str, set[str]]) -> Iterator[Found]:
    for part in walk(statement):
        if not isinstance(part, m.Measure) or part.what not in ("eta", "distance") or part.actor not in passed:
            continue
        if part.other in roads.junctions and part.other not in passed[part.actor]:
            message = (
                f"the route of '{part.actor}' does not go over '{part.other}', so `{written(part)}` is never known"
            )
            help = f"it comes to {', '.join(sorted(passed[part.actor])) or 'no junction'}"
            yield Found(part, "other", c.NOT_ON_ROUTE, message, help)
