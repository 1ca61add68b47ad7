"""Reads SUMO's `.net.xml` into a `Topology` or a `RoadNetwork`."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import (
    STRIPS_ON_THE_ROAD,
    Crossing,
    Lane,
    LaneKind,
    Movement,
    NetEdge,
    NetJunction,
    Topology,
    WalkingArea,
    junction_of,
)
from foresee_dsl.language.model import Turn

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml

_SUMO_CLASS: Mapping[LaneKind, str] = {
    "car": "passenger",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "bus": "bus",
}
_BAY = "bay"
_FOR_BUSES = ("bus_lane", _BAY)
"""Types of lanes for buses in written networks. In other networks buses use the lanes of cars."""
FAULT = "foresee.fault"
"""Key of the `<param>` of a lane or connection that vehicles cannot use; its value states the reason."""
_DEFAULT_WIDTH_M = 3.2
"""Width of a lane without the attribute `width`, m: SUMO's default."""
_TURNS: dict[str, Turn] = {
    "s": "straight",
    "l": "left",
    "L": "left",  # SUMO's capital letters mean half left and half right
    "r": "right",
    "R": "right",
    "t": "back",
    "T": "back",
    "invalid": "straight",
}


def read_net(net_file: Path) -> Topology:
    """Read a SUMO network.

    Raises:
        CompileError: the file is not a SUMO network.
    """
    return topology_of(parse_net(net_file))


def read_network(net_file: Path, buildings: tuple[Points, ...] = ()) -> RoadNetwork:
    """Read a SUMO network, and add the outlines of its buildings; raises like `read_net`."""
    return RoadNetwork.of(read_net(net_file), buildings)


def topology_of(root: Element) -> Topology:
    """Return the parts of a net from its tree.

    Raises:
        KeyError: a part or an attribute is missing. ValueError: an attribute is not a number.
    """
    bus_lanes = any(lane.get("type") in _FOR_BUSES for lane in root.iterfind("edge/lane"))
    functions: dict[str, str] = {}
    over: dict[str, tuple[str, ...]] = {}
    lanes: dict[str, Lane] = {}
    edges: dict[str, NetEdge] = {}
    for element in root.iterfind("edge"):
        name, function = element.attrib["id"], element.get("function", "normal")
        functions[name] = function
        over[name] = tuple(element.get("crossingEdges", "").split())
        own = tuple(_lane(child, name, function, bus_lanes) for child in element.iterfind("lane"))
        lanes.update((lane.id, lane) for lane in own)
        if function == "normal":
            edges[name] = NetEdge(id=name, start=element.attrib["from"], end=element.attrib["to"], lanes=own)
    junctions, rows = _junctions(root)
    programs = {element.get("id") for element in root.iterfind("tlLogic")}
    connections = [_without_missing_signal(element.attrib, programs) for element in root.iterfind("connection")]
    faults = {_ends(element.attrib): text for element in root.iterfind("connection") if (text := _fault(element))}
    signals = {c["to"]: (c["tl"], int(c["linkIndex"])) for c in connections if c["to"][0] == ":" and "tl" in c}
    return Topology(
        lanes=lanes,
        edges=edges,
        junctions=junctions,
        movements=tuple(_movements(connections, edges, lanes, rows, faults)),
        crossings={
            name: Crossing(
                id=name,
                lane=lanes[f"{name}_0"],
                edges=over[name],
                junction=junction_of(name),
                tls=signals[name][0] if name in signals else None,
                link=signals[name][1] if name in signals else -1,
                index=rows.get(f"{name}_0", -1),
            )
            for name, function in functions.items()
            if function == "crossing"
        },
        walking_areas={
            name: WalkingArea(id=name, junction=junction_of(name), polygon=lanes[f"{name}_0"].shape)
            for name, function in functions.items()
            if function == "walkingarea"
        },
        footways=tuple(_footways(connections, lanes, functions)),
        left_hand=root.get("lefthand") in ("true", "1"),
    )


def _lane(element: Element, edge: str, function: str, bus_lanes: bool) -> Lane:
    get = element.attrib
    fault = _fault(element)
    kinds = _kinds(get.get("allow"), get.get("disallow"))
    if not bus_lanes:
        kinds = kinds | {"bus"} if "car" in kinds else kinds - {"bus"}
    return Lane(
        id=get["id"],
        edge=edge,
        index=int(get["index"]),
        shape=points_of(get["shape"]),
        length_m=float(get["length"]),
        speed_mps=float(get["speed"]),
        width_m=float(get.get("width", _DEFAULT_WIDTH_M)),
        kinds=frozenset() if fault else kinds,
        internal=function != "normal",
        parking=get.get("type") == "parking",
        fault=fault,
        strip=get.get("type") in STRIPS_ON_THE_ROAD,
        bay=get.get("type") == _BAY,
    )


def _fault(element: Element) -> str:
    return next((param.get("value", "") for param in element.iterfind("param") if param.get("key") == FAULT), "")


def _without_missing_signal(connection: dict[str, str], programs: Container[str | None]) -> dict[str, str]:
    """Return a connection without its signal if the net has no program for the signal, as at railway crossings.

    SUMO 1.28 switches such a signal off. So the signal of a railway crossing lets road traffic pass, as it does if no
    train comes.
    """
    if "tl" not in connection or (connection["tl"] in programs and int(connection.get("linkIndex", -1)) >= 0):
        return connection
    return {name: value for name, value in connection.items() if name not in ("tl", "linkIndex")}


def _ends(connection: Mapping[str, str]) -> tuple[str, str]:
    return f"{connection['from']}_{connection['fromLane']}", f"{connection['to']}_{connection['toLane']}"


def points_of(text: str) -> Points:
    """Return the points of a `shape` attribute, m; heights are left out."""
    pairs = (pair.split(",") for pair in text.split())
    return tuple((float(pair[0]), float(pair[1])) for pair in pairs)


def _kinds(allow: str | None, disallow: str | None) -> frozenset[LaneKind]:
    if allow is not None and allow != "all":
        words = set(allow.split())
        return frozenset(kind for kind, word in _SUMO_CLASS.items() if word in words)
    words = set((disallow or "").split())
    if "all" in words:
        return frozenset()
    return frozenset(kind for kind, word in _SUMO_CLASS.items() if word not in words)


def _junctions(root: Element) -> tuple[dict[str, NetJunction], dict[str, int]]:
    """Return the junctions, and for each internal lane its row in the junction's right-of-way matrix."""
    junctions: dict[str, NetJunction] = {}
    rows: dict[str, int] = {}
    for element in root.iterfind("junction"):
        get = element.attrib
        if get.get("type") == "internal":
            continue
        rows.update((lane, k) for k, lane in enumerate(get.get("intLanes", "").split()))
        requests = sorted((int(r.attrib["index"]), r.attrib) for r in element.iterfind("request"))
        junctions[get["id"]] = NetJunction(
            id=get["id"],
            type=get.get("type", ""),
            x=float(get["x"]),
            y=float(get["y"]),
            polygon=points_of(get["shape"]) if get.get("shape") else (),
            requests=tuple((int(r["response"], 2), int(r["foes"], 2)) for _, r in requests),
        )
    return junctions, rows


def _movements(
    connections: Iterable[dict[str, str]],
    edges: dict[str, NetEdge],
    lanes: dict[str, Lane],
    rows: dict[str, int],
    faults: Mapping[tuple[str, str], str],
) -> Iterable[Movement]:
    connections = list(connections)
    onward = {f"{c['from']}_{c['fromLane']}": c["via"] for c in connections if c["from"][0] == ":" and "via" in c}
    for get in connections:
        if get["from"] not in edges or get["to"] not in edges:
            continue
        via: list[str] = []
        step = get.get("via")
        while step is not None:
            via.append(step)
            step = onward.get(step)
        chain = (f"{get['from']}_{get['fromLane']}", *via, f"{get['to']}_{get['toLane']}")
        direction = get.get("dir", "s")
        fault = faults.get(_ends(get), "") or next((lanes[lane].fault for lane in chain if lanes[lane].fault), "")
        yield Movement(
            from_edge=get["from"],
            to_edge=get["to"],
            from_lane=chain[0],
            to_lane=chain[-1],
            via=tuple(via),
            junction=edges[get["from"]].end,
            turn=_TURNS.get(direction, "straight"),
            direction=direction,
            tls=get.get("tl"),
            link=int(get.get("linkIndex", -1)),
            index=next((rows[lane] for lane in reversed(via) if lane in rows), -1),
            kinds=frozenset() if fault else frozenset.intersection(*(lanes[lane].kinds for lane in chain)),
            fault=fault,
        )


def _footways(
    connections: Iterable[dict[str, str]], lanes: dict[str, Lane], functions: dict[str, str]
) -> Iterable[tuple[str, str]]:
    for get in connections:
        ends = [(get["from"], f"{get['from']}_{get['fromLane']}"), (get["to"], f"{get['to']}_{get['toLane']}")]
        if all(lanes[lane].kinds == {"pedestrian"} for _, lane in ends):
            first, second = (edge if functions[edge] == "walkingarea" else lane for edge, lane in ends)
            yield first, get.get("via", second)
