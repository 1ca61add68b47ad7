"""Turn restrictions and turns of lanes: derives the connections for netconvert's second run from those of its first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from foresee_dsl.compile.nets.plain_edges import Plain
from foresee_dsl.compile.roads.topology import Movement, Topology
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import BannedTurn, LaneTurns, Network, Turn
from foresee_dsl.language.streets.lines import number


class TurnConnection(NamedTuple):
    """A `<connection>` between two edges, or (with indices) between two of their lanes."""

    start: str
    end: str
    from_lane: int | None = None
    to_lane: int | None = None


def without_banned(network: Network, plain: Plain, net: Topology) -> tuple[TurnConnection, ...]:
    """Return the remaining connections of all edges with a forbidden turn; netconvert chooses their lanes again.

    Raises:
        CompileError: a forbidden turn does not exist, or an edge has no other turn.
    """
    forbidden: dict[str, dict[Turn, BannedTurn]] = {}
    for item in network.body:
        if isinstance(item, BannedTurn):
            for road in item.roads:
                into = next((e.id for e in plain.edges if e.road == road and e.end == item.junction), None)
                if into is None:
                    raise CompileError(
                        f"road {road} does not lead to {item.junction}: no turn from it can be forbidden"
                    )
                forbidden.setdefault(into, {})[item.turn] = item
    connections: list[TurnConnection] = []
    for edge, rules in forbidden.items():
        ways = _ways(net, edge)
        for turn, item in rules.items():
            if turn not in ways.values() and turn != "back":
                turns = ", ".join(dict.fromkeys(ways.values()))
                message = f"forbid {turn} over {item.junction}: from {edge} one can only go {turns or 'nowhere'} there"
                raise CompileError(message)
        left = [target for target, turn in ways.items() if turn not in rules]
        if not left:
            raise CompileError(f"forbid: no way on is left from {edge} over {net.edges[edge].end}")
        connections += [TurnConnection(edge, target) for target in left]
    return tuple(connections)


def by_lane(
    network: Network, plain: Plain, net: Topology, left: Sequence[TurnConnection]
) -> tuple[TurnConnection, ...]:
    """Return the connections, lane by lane, of all edges with a `lane N of EDGE goes` rule.

    Lanes without a rule keep their connections. `left`: the remaining connections of edges with a forbidden turn.

    Raises:
        CompileError: a turn, lane or edge of a rule does not exist.
    """
    rules: dict[str, dict[int, LaneTurns]] = {}
    for item in network.body:
        if isinstance(item, LaneTurns):
            pieces = [e.id for e in plain.edges if e.id == item.edge or e.id.startswith(f"{item.edge}#")]
            if not pieces:
                raise CompileError(f"there is no edge {item.edge}, whose lane {number(item.lane):g} goes somewhere")
            rules.setdefault(pieces[-1], {})[round(number(item.lane))] = item
    connections = [connection for connection in left if connection.start not in rules] if rules else []
    for edge, of_lanes in rules.items():
        connections += _of_edge(net, edge, of_lanes)
    return tuple(connections)


def _of_edge(net: Topology, edge: str, rules: dict[int, LaneTurns]) -> list[TurnConnection]:
    cars = net.edges[edge].for_kind("car")
    ways = _ways(net, edge)
    usual = {(m.from_lane, m.to_edge): net.lanes[m.to_lane].index for m in _movements(net, edge)}
    wanted: dict[str, list[int]] = {}
    connections = [
        TurnConnection(edge, m.to_edge, net.lanes[m.from_lane].index, net.lanes[m.to_lane].index)
        for m in _movements(net, edge)
        if all(net.lanes[m.from_lane] is not cars[k - 1] for k in rules if k <= len(cars))
    ]
    for number_, item in sorted(rules.items()):
        if number_ > len(cars):
            raise CompileError(f"{edge} has {len(cars)} lanes for cars at its end, so no lane {number_}")
        for turn in item.turns:
            targets = [target for target, way in ways.items() if way == turn]
            if not targets:
                turns = ", ".join(dict.fromkeys(ways.values()))
                raise CompileError(
                    f"lane {number_} of {edge} cannot go {turn} over {net.edges[edge].end}: one can only go "
                    f"{turns or 'nowhere'} there"
                )
            for target in targets:
                wanted.setdefault(target, []).append(cars[number_ - 1].index)
    for target, from_lanes in wanted.items():
        into = [lane.index for lane in net.edges[target].for_kind("car")]
        others = [c.from_lane for c in connections if c.end == target and c.from_lane in {lane.index for lane in cars}]
        every = sorted({*from_lanes, *(lane for lane in others if lane is not None)})
        for lane in from_lanes:
            place = every.index(lane)
            aligned = _aligned(place, len(every), into, ways[target])
            to = usual.get((net.edges[edge].lanes[lane].id, target), aligned) if others else aligned
            connections.append(TurnConnection(edge, target, lane, to))
    return sorted(connections, key=lambda c: (c.from_lane or 0, c.end))


def _aligned(place: int, count: int, into: Sequence[int], turn: Turn) -> int:
    """Return the index of the target lane for the lane at a place, from the right, among `count` lanes of a turn.

    Lanes that turn left lead to the leftmost target lanes, others to the rightmost.
    """
    from_right = place + max(len(into) - count, 0) if turn == "left" else place
    return into[min(from_right, len(into) - 1)]


def _movements(net: Topology, edge: str) -> list[Movement]:
    """Return the movements from an edge that vehicles may take."""
    return [m for m in net.movements if m.from_edge == edge and m.kinds - {"pedestrian"}]


def _ways(net: Topology, edge: str) -> dict[str, Turn]:
    """Return the edges to which an edge leads, with their turns."""
    return {m.to_edge: m.turn for m in _movements(net, edge)}
