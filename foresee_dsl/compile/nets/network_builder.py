"""Builds the SUMO network of a network that is written in the language."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.compile.nets import signals
from foresee_dsl.compile.nets.misfits import Misfit, MisfitError
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.compile.nets.netconvert import run_netconvert, without_header
from foresee_dsl.compile.nets.plain_edges import CORNER_RADIUS_M, Plain, PlainNode, plain_of
from foresee_dsl.compile.roads.topology import Lane, Movement, Topology
from foresee_dsl.compile.templates import render
from foresee_dsl.errors import CompileError
from foresee_dsl.helps import HelpText, one_of, remove, write
from foresee_dsl.language.model import BannedTurn, Building, Junction, LaneTurns, Network, Ref, Road, Roundabout, Turn
from foresee_dsl.language.streets.layout import BACK, directed, lanes_of
from foresee_dsl.language.streets.lines import number, xy
from foresee_dsl.language.streets.outlines import fault_of
from foresee_dsl.language.traversal import walk


class TurnConnection(NamedTuple):
    """A `<connection>` of netconvert's input between two edges, or (with indices) between two of their lanes."""

    start: str
    end: str
    from_lane: int | None = None
    to_lane: int | None = None


def without_banned(network: Network, plain: Plain, net: Topology) -> tuple[TurnConnection, ...]:
    """Return the connections that remain for all edges with a forbidden turn; netconvert chooses their lanes again.

    Raises:
        MisfitError: a forbidden turn does not exist, or an edge has no other turn.
    """
    forbidden: dict[str, dict[Turn, BannedTurn]] = {}
    for item in network.body:
        if isinstance(item, BannedTurn):
            for road in item.roads:
                into = next((e.id for e in plain.edges if e.road == road and e.end == item.junction), None)
                if into is None:
                    message = f"no vehicle comes from '{road}' to '{item.junction}'"
                    field = f"roads.{item.roads.index(road)}"
                    raise MisfitError([Misfit(item, field, message, remove("leave it out"))])
                forbidden.setdefault(into, {})[item.turn] = item
    connections: list[TurnConnection] = []
    for edge, rules in forbidden.items():
        ways = _ways(net, edge)
        for turn, item in rules.items():
            if turn not in ways.values() and turn != "back":
                turns = one_of(dict.fromkeys(ways.values()), " or ")
                message = f"no way leads {turn} from '{edge}' over '{item.junction}' anyway"
                help = ("from there, ways lead " + turns if ways else "no way leads on from there") + ": "
                raise MisfitError([Misfit(item, "turn", message, help + remove("remove this turn"))])
        left = [target for target, turn in ways.items() if turn not in rules]
        if not left:
            message = f"this bans the last way from '{edge}' over '{net.edges[edge].end}'"
            raise MisfitError([Misfit([*rules.values()][-1], "turn", message, remove("remove it"))])
        connections += [TurnConnection(edge, target) for target in left]
    return tuple(connections)


def by_lane(
    network: Network, plain: Plain, net: Topology, left: Sequence[TurnConnection]
) -> tuple[TurnConnection, ...]:
    """Return the connections, lane by lane, of all edges with a `lane N of EDGE goes` rule.

    Lanes without a rule keep their connections. `left` holds the connections that remain for edges with a forbidden
    turn.

    Raises:
        MisfitError: a turn, lane or edge of a rule does not exist.
    """
    rules: dict[str, dict[int, LaneTurns]] = {}
    for item in network.body:
        if isinstance(item, LaneTurns):
            pieces = [e.id for e in plain.edges if e.id == item.edge or e.id.startswith(f"{item.edge}#")]
            if not pieces:
                message = f"there is no edge called {item.edge}"
                raise MisfitError([Misfit(item, "edge", message, remove("remove the rule"))])
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
            message = f"'{item.edge}' has {len(cars)} lanes for cars at its end, so no lane {number_}"
            raise MisfitError([Misfit(item, "lane", message, "lanes are counted from the right, from " + write("1"))])
        for k, turn in enumerate(item.turns):
            targets = [target for target, way in ways.items() if way == turn]
            if not targets:
                turns = one_of(dict.fromkeys(ways.values()), " or ")
                message = f"no way leads {turn} from '{item.edge}' over '{net.edges[edge].end}'"
                help: HelpText = "from there, ways lead " + turns if ways else remove("remove the rule")
                raise MisfitError([Misfit(item, f"turns.{k}", message, help)])
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
    """Return the index of the target lane for one of the `count` lanes of a turn; `place` is its number among them,
    from the right.

    Lanes that turn left lead to the leftmost target lanes, other lanes to the rightmost ones.
    """
    from_right = place + max(len(into) - count, 0) if turn == "left" else place
    return into[min(from_right, len(into) - 1)]


def _movements(net: Topology, edge: str) -> list[Movement]:
    """Return the movements from an edge that vehicles may take."""
    return [m for m in net.movements if m.from_edge == edge and m.kinds - {"pedestrian"}]


def _ways(net: Topology, edge: str) -> dict[str, Turn]:
    """Return the edges to which an edge leads, with their turns."""
    return {m.to_edge: m.turn for m in _movements(net, edge)}


CROSSING_WIDTH_M = 4.0
"""Width of crossings, m: SUMO's default (netconvert --default.crossing-width)."""
_CONTROL_TYPES = {
    "signals": "traffic_light",
    "priority": "priority",
    "right_before_left": "right_before_left",
    "stop": "allway_stop",
}
_OPTIONS = (  # of netconvert 1.28
    *("--no-internal-links", "false"),  # vehicles follow lanes inside junctions
    *("--offset.disable-normalization", "true"),  # coordinates stay those of the file
    *("--no-turnarounds.except-deadend", "true"),  # vehicles make a U-turn only at dead ends
    *("--walkingareas", "true"),
    *("--precision", "3"),  # millimetres
    *("--no-warnings", "true"),
)


def build_network(network: Network, out: Path) -> None:
    """Write the SUMO net of a network to `out`; equal networks give equal bytes.

    Junctions keep their names. Road `west` becomes the edges `west` and `west_back`.
    """
    _check_names(network)
    plain = plain_of(network)
    with tempfile.TemporaryDirectory(prefix="foresee-net-") as name:
        folder = Path(name)
        net = folder / "net.net.xml"
        files = _write_plain(folder, network, plain, ())
        run_netconvert([*files, *_OPTIONS, "--output-file", net.name], folder)
        topology = read_net(net)
        # only netconvert knows where each turn leads, so it runs again with the connections that remain
        if left := without_banned(network, plain, topology):
            topology = _again(folder, files, network, plain, left)
        if connections := by_lane(network, plain, topology, left):
            topology = _again(folder, files, network, plain, connections)
        controlled = [j for j in network.body if isinstance(j, Junction) and j.control == "signals"]
        if controlled:
            # programs need the movements' indices, which netconvert assigns, so it runs again with the programs
            roads_of = {edge.id: edge.road for edge in plain.edges}
            programs = [signals.program(j, signals.links_of(topology, j.name) or (), roads_of) for j in controlled]
            signals.write_programs(programs, folder / "signals.tll.xml")
            final = folder / "final.net.xml"
            extra = ["--tllogic-files", "signals.tll.xml"]
            run_netconvert([*files, *extra, *_OPTIONS, "--output-file", final.name], folder)
            signals.check_same_links(topology, read_net(final))
            net = final
        _check_buildings(network, topology)
        out.write_bytes(without_header(net.read_bytes()))


def _write_plain(folder: Path, network: Network, plain: Plain, connections: Sequence[TurnConnection]) -> list[str]:
    """Write netconvert's input files; return the options that name them."""
    junctions = (item for item in network.body if isinstance(item, Junction))
    usual = [PlainNode(j.name, xy(j.at), CORNER_RADIUS_M, _CONTROL_TYPES[j.control]) for j in junctions]
    nodes = [*usual, *plain.nodes]
    crossings = [*_crossings(network, plain), *plain.crossings]
    render("nodes.nod.xml", folder / "nodes.nod.xml", nodes=nodes)
    render("edges.edg.xml", folder / "edges.edg.xml", edges=plain.edges, roundabouts=plain.roundabouts)
    render(
        "connections.con.xml",
        folder / "connections.con.xml",
        crossings=[{"node": node, "edges": edges, "width": width} for node, edges, width in crossings],
        connections=[*map(TurnConnection._make, plain.connections), *connections],
        width=CROSSING_WIDTH_M,
    )
    return [
        *("--node-files", "nodes.nod.xml"),
        *("--edge-files", "edges.edg.xml"),
        *("--connection-files", "connections.con.xml"),
    ]


def _again(
    folder: Path, files: Sequence[str], network: Network, plain: Plain, connections: Sequence[TurnConnection]
) -> Topology:
    """Build the net again, with the connections that the turn rules allow."""
    _write_plain(folder, network, plain, connections)
    run_netconvert([*files, *_OPTIONS, "--output-file", "net.net.xml"], folder)
    return read_net(folder / "net.net.xml")


def _crossings(network: Network, plain: Plain) -> Iterator[tuple[str, tuple[str, ...], None]]:
    """Yield the crossings of junctions and roundabouts: node, edges, and None for the default width."""
    walked = {edge.id for edge in plain.edges if edge.sidewalk is not None}
    roads = [item for item in network.body if isinstance(item, Road)]
    rings = {ring.item.name: ring for ring in plain.roundabouts}
    for item in network.body:
        if not isinstance(item, Junction | Roundabout) or item.crossings is None:
            continue
        for road in roads:
            node = item.name
            if item.name in rings:
                node = f"{item.name}_{road.name}"
            if road.name in item.crossings or not item.crossings:
                edges = tuple(e for e in plain.at(node, road.name) if e in walked)
                if edges:
                    yield node, edges, None


def _check_names(network: Network) -> None:
    """Check a model that was not read from a checked file.

    Raises:
        CompileError: netconvert could not use the model.
    """
    junctions = {item.name for item in network.body if isinstance(item, Junction | Roundabout)}
    roads = [item for item in network.body if isinstance(item, Road)]
    seen: set[str] = set()
    for road in roads:
        for end in (road.start, road.end):
            if end not in junctions:
                raise CompileError(f"road {road.name} names the junction {end}, which is not in the network")
        for edge in (road.name, road.name + BACK)[: 2 if lanes_of(road)[1] else 1]:
            if edge in seen:
                raise CompileError(
                    f"two roads have the edge {edge}: a road cannot have the name of another road's other direction"
                )
            seen.add(edge)
    if not roads:
        raise CompileError("the network has no roads")
    for part in walk(network):
        if isinstance(part, Ref):
            raise CompileError(f"a network cannot use the parameter in `{part.name}`")
    for way in directed(network):
        for start, (x, y) in itertools.pairwise(way.line):
            if start == (x, y) and (way.cuts or number(way.road.median)):
                message = f"road '{way.road.name}' has the point ({x:g} m, {y:g} m) twice in a row"
                raise MisfitError([Misfit(way.road, "name", message, "leave out one of the two points")])


def _check_buildings(network: Network, topology: Topology) -> None:
    """Check that no building stands on a lane: actors would drive through it and see nothing inside.

    Raises:
        MisfitError: a building stands on a lane, or its outline crosses itself.
    """
    buildings = [item for item in network.body if isinstance(item, Building)]
    if not buildings:
        return
    import shapely

    bands = [
        (lane, shapely.LineString(lane.shape).buffer(lane.width_m / 2, cap_style="flat"))
        for lane in topology.lanes.values()
        if (lane.kinds or lane.parking) and lane.edge not in topology.walking_areas
    ]
    misfits: list[Misfit] = []
    for building in buildings:
        shape = shapely.Polygon([xy(p) for p in building.outline])
        if not shape.is_valid:
            misfits.append(Misfit(building, "outline", *fault_of(building.name, crosses=True)))
            continue
        shared = ((shapely.intersection(shape, band), lane) for lane, band in bands if shape.intersects(band))
        most = max(shared, key=lambda pair: pair[0].area, default=None)
        if most is not None:
            at = most[0].centroid
            place = f"at ({round(at.x)} m, {round(at.y)} m)"
            message = f"building '{building.name}' stands on {_called(most[1])}, {place}"
            help = "move it off the lanes and the sidewalk, or " + remove("remove it")
            misfits.append(Misfit(building, "outline", message, help))
    if misfits:
        raise MisfitError(misfits)


def _called(lane: Lane) -> str:
    """Return what a lane belongs to, in the words of the network's file: `road 'west'` or `junction 'm'`."""
    if lane.internal:
        return f"junction '{lane.edge.removeprefix(':').rpartition('_')[0]}'"
    return f"road '{lane.edge.partition('#')[0].removesuffix(BACK)}'"
