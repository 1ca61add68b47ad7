"""Builds the SUMO network of a network that is written in the language."""

from __future__ import annotations

import itertools
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.compile.nets import signals
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.compile.nets.netconvert import run_netconvert, without_header
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.compile.templates import render
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Building, Count, Junction, Length, Network, Point, Quantity, Road, Speed
from foresee_dsl.language.printer import written

LANE_WIDTH_M = 3.3
"""Ours: between the 3.25 m and 3.5 m that are usual on urban main roads."""
SPEED_MPS = 50 / 3.6
"""The usual urban limit (Vienna Convention countries)."""
CORNER_RADIUS_M = 5.0
"""Radius of the inner edge of a turn, m. Ours: with a 2 m sidewalk the road's edge has 7 m; SUMO's default of 4 m is
too tight for buses (the centre of their lane would turn with 5.6 m where there is no sidewalk)."""
CROSSING_WIDTH_M = 4.0
"""SUMO's default (netconvert --default.crossing-width)."""
BACK = "_back"
"""Suffix of a road's name for its edge in the other direction."""

_CONTROL_TYPES = {
    "signals": "traffic_light",
    "priority": "priority",
    "right_before_left": "right_before_left",
    "stop": "allway_stop",
}
_OPTIONS = (  # of netconvert 1.28
    *("--no-internal-links", "false"),  # vehicles follow lanes inside junctions
    *("--offset.disable-normalization", "true"),  # coordinates stay those of the file
    *("--no-turnarounds.except-deadend", "true"),  # traffic turns round only where it could go nowhere else
    *("--walkingareas", "true"),
    *("--precision", "3"),  # millimetres
    *("--no-warnings", "true"),
)


@dataclass(frozen=True)
class _Edge:
    """One `<edge>` of netconvert's input: all its car lanes have the same width; `parking` and `sidewalk` are None
    where there is none."""

    id: str
    start: str
    end: str
    lanes: int
    lane_width: float
    speed: float
    spread: str
    shape: tuple[XY, ...]
    parking: float | None
    sidewalk: float | None
    priority: int


def build_network(network: Network, out: Path) -> None:
    """Write the SUMO net of a network to `out`: the same network gives the same bytes.

    Junctions keep their names. Road `west` becomes the edges `west` and `west_back`.
    """
    junctions = {item.name: item for item in network.body if isinstance(item, Junction)}
    roads = tuple(item for item in network.body if isinstance(item, Road))
    _check_names(junctions, roads)
    edges = tuple(edge for road in roads for edge in _road_edges(road, junctions))
    with tempfile.TemporaryDirectory(prefix="foresee-net-") as name:
        folder = Path(name)
        files = _write_plain(folder, tuple(junctions.values()), roads, edges)
        net = folder / "net.net.xml"
        run_netconvert([*files, *_OPTIONS, "--output-file", net.name], folder)
        topology = read_net(net)
        controlled = tuple(j for j in junctions.values() if j.control == "signals")
        if controlled:
            # programs need the numbers of the movements, which netconvert gives: it runs again with the programs
            roads_of = {edge: road.name for road in roads for edge in _edges_at(road, road.start)}
            programs = [signals.program(j, signals.links_of(topology, j.name) or (), roads_of) for j in controlled]
            signals.write_programs(programs, folder / "signals.tll.xml")
            final = folder / "final.net.xml"
            extra = ["--tllogic-files", "signals.tll.xml"]
            run_netconvert([*files, *extra, *_OPTIONS, "--output-file", final.name], folder)
            signals.check_same_links(topology, read_net(final))
            net = final
        _check_buildings(network, topology)
        out.write_bytes(without_header(net.read_bytes()))


def _road_edges(road: Road, junctions: dict[str, Junction]) -> tuple[_Edge, ...]:
    """Return the edges of a road: one or two.

    A one-way road lies with its middle on the line between its junctions; a two-way road drives on the right of that
    line, with half of the median on either side.
    """
    lanes = _count(road.lanes, 1)
    back = _count(road.back, lanes)
    if lanes < 1:
        raise CompileError(f"road {road.name} needs at least one lane")
    ends = (junctions[road.start].at, junctions[road.end].at)
    line = [_xy(p) for p in (ends[0], *road.via, ends[1])]
    half_median = _si(road.median) / 2
    speed = _si(road.speed, SPEED_MPS)

    there = _Edge(
        id=road.name,
        start=road.start,
        end=road.end,
        lanes=lanes,
        lane_width=_si(road.lane_width, LANE_WIDTH_M),
        speed=speed,
        spread="right" if back else "center",
        shape=tuple(shift_right(line, half_median) if back else line),
        parking=None if road.parking is None else _si(road.parking),
        sidewalk=_si(road.sidewalk) or None,
        # the road with more lanes goes first, among equals the faster one
        priority=1000 * (lanes + back) + round(speed * 3.6),
    )
    if not back:
        return (there,)
    shape = tuple(shift_right(line[::-1], half_median))
    return there, replace(there, id=road.name + BACK, start=road.end, end=road.start, lanes=back, shape=shape)


def shift_right(line: Sequence[XY], distance: float) -> list[XY]:
    """Return a polyline moved to its right by a distance (m); corners are mitred, very sharp ones cut short."""
    if distance == 0:
        return list(line)
    normals = []
    for (x0, y0), (x1, y1) in itertools.pairwise(line):
        length = math.hypot(x1 - x0, y1 - y0)
        if length == 0:
            raise CompileError(f"a road has the point ({x0:g} m, {y0:g} m) twice in a row")
        normals.append(((y1 - y0) / length, -(x1 - x0) / length))
    moved = []
    for k, (x, y) in enumerate(line):
        (ax, ay), (bx, by) = normals[max(k - 1, 0)], normals[min(k, len(normals) - 1)]
        scale = distance / max(1 + ax * bx + ay * by, 0.5)
        moved.append((x + (ax + bx) * scale, y + (ay + by) * scale))
    return moved


def _edges_at(road: Road, junction: str) -> tuple[str, ...]:
    """Return the ids of a road's edges that touch a junction."""
    if junction not in (road.start, road.end):
        return ()
    return (road.name, road.name + BACK) if _count(road.back, _count(road.lanes, 1)) else (road.name,)


def _write_plain(
    folder: Path, junctions: Sequence[Junction], roads: Sequence[Road], edges: Sequence[_Edge]
) -> list[str]:
    """Write netconvert's input; return the options that name it."""
    nodes = [dict(zip("xy", _xy(j.at), strict=True), id=j.name, type=_CONTROL_TYPES[j.control]) for j in junctions]
    walked = {edge.id for edge in edges if edge.sidewalk is not None}
    crossings = [
        {"node": j.name, "edges": found}
        for j in junctions
        if j.crossings is not None
        for road in roads
        if road.name in j.crossings or not j.crossings
        if (found := tuple(e for e in _edges_at(road, j.name) if e in walked))
    ]
    render("nodes.nod.xml", folder / "nodes.nod.xml", nodes=nodes, radius=CORNER_RADIUS_M)
    render("edges.edg.xml", folder / "edges.edg.xml", edges=edges)
    render("connections.con.xml", folder / "connections.con.xml", crossings=crossings, width=CROSSING_WIDTH_M)
    return [
        *("--node-files", "nodes.nod.xml"),
        *("--edge-files", "edges.edg.xml"),
        *("--connection-files", "connections.con.xml"),
    ]


def _check_names(junctions: dict[str, Junction], roads: Sequence[Road]) -> None:
    seen: set[str] = set()
    for road in roads:
        for end in (road.start, road.end):
            if end not in junctions:
                raise CompileError(f"road {road.name} names the junction {end}, which is not in the network")
        for edge in _edges_at(road, road.start):
            if edge in seen:
                raise CompileError(
                    f"two roads have the edge {edge}: a road may not have the name of another one's back"
                )
            seen.add(edge)
    if not roads:
        raise CompileError("the network has no roads")


def _check_buildings(network: Network, topology: Topology) -> None:
    """Raise a `CompileError` for a building on a lane: actors would drive through it and see nothing inside."""
    buildings = {item.name: [_xy(p) for p in item.outline] for item in network.body if isinstance(item, Building)}
    if not buildings:
        return
    import shapely

    bands = {
        lane.id: shapely.LineString(lane.shape).buffer(lane.width_m / 2, cap_style="flat")
        for lane in topology.lanes.values()
        if (lane.kinds or lane.parking) and lane.edge not in topology.walking_areas
    }
    for name, outline in buildings.items():
        shape = shapely.Polygon(outline)
        if not shape.is_valid:
            raise CompileError(f"the outline of building {name} crosses itself")
        for lane, band in bands.items():
            if shape.intersects(band):
                at = shapely.intersection(shape, band).centroid
                raise CompileError(f"building {name} stands on {lane}, at ({at.x:.0f} m, {at.y:.0f} m)")


def _xy(point: Point) -> XY:
    return _si(point.x), _si(point.y)


def _count(value: Count | None, default: int) -> int:
    return round(_si(value, default))


def _si(value: Length | Speed | Count | None, default: float = 0.0) -> float:
    if value is None:
        return default
    if not isinstance(value, Quantity):
        raise CompileError(f"a network cannot use the parameter in `{written(value)}`")
    return value.si
