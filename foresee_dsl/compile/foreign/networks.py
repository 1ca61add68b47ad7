"""Converts networks that were not written in the language: SUMO nets and OpenDRIVE maps."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring  # no parsing: that is safe_xml's

from foresee_dsl.compile.foreign.geometry_repair import repair_geometry, repair_overlaps
from foresee_dsl.compile.foreign.opendrive_geometry import number
from foresee_dsl.compile.foreign.opendrive_reading import (
    crosswalks_of,
    drives_on_the_left,
    make_readable,
    read_opendrive,
    write_crossings,
)
from foresee_dsl.compile.foreign.signal_programs import fix_times, give_programs
from foresee_dsl.compile.nets.cache import cached_net
from foresee_dsl.compile.nets.net_reader import read_net, topology_of
from foresee_dsl.compile.nets.netconvert import (
    NetconvertDiedError,
    check_loads,
    run_netconvert,
    sumo_home,
    without_header,
)
from foresee_dsl.compile.nets.safe_xml import parse_net, unreadable
from foresee_dsl.compile.nets.signals import signals_of
from foresee_dsl.compile.roads.polyline import lengths
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.errors import CompileError
from foresee_dsl.files import read_outside
from foresee_dsl.language.units import UNITS

_TURNED = {"l": "r", "r": "l", "L": "R", "R": "L", "T": "T"}
_NORTH_SOUTH = str.maketrans("ns", "sn")
_SIDEWAYS = {  # attributes that change their sign, by element
    "geometry": ("y", "hdg"),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "poly3": ("a", "b", "c", "d"),
    "paramPoly3": ("aV", "bV", "cV", "dV"),
    "laneOffset": ("a", "b", "c", "d"),
    "lane": ("id",),
    "laneLink": ("from", "to"),
    "signal": ("t", "hOffset"),
    "signalReference": ("t",),
    "object": ("t", "hdg"),
    "cornerLocal": ("v",),
    "validity": ("fromLane", "toLane"),
}


def mirror_map(root: Element) -> None:
    """Mirror an OpenDRIVE map at the x-axis, so that traffic on the left is on the right.

    netconvert 1.28 does not read the attribute `rule`; it treats all maps as maps with traffic on the right.
    """
    for element in root.iter():
        for name in _SIDEWAYS.get(element.tag, ()):
            if element.get(name) is not None:
                element.set(name, _negative(element, name))
    for road in root.iterfind("road"):
        road.set("rule", "RHT")
        for section in road.iterfind("lanes/laneSection"):
            for side in section.findall("left") + section.findall("right"):
                side.tag = "right" if side.tag == "left" else "left"
                side[:] = sorted(side, key=lambda lane: -number(lane, "id"))
            order = {"left": 0, "center": 1, "right": 2}
            section[:] = sorted(section, key=lambda child: order.get(child.tag, 3))
            for link in section.iter("link"):
                for other in link:
                    other.set("id", _negative(other, "id"))


def mirror_net(root: Element) -> None:
    """Mirror a SUMO net at the x-axis, and mark it as a net with traffic on the left.

    In such a net lane 0 is the leftmost; left turns become right turns.
    """
    root.set("lefthand", "true")
    for element in root.iter():
        for name in ("shape", "outlineShape", "customShape"):
            text = element.get(name)
            if text and "," in text:
                element.set(name, " ".join(_mirrored(point) for point in text.split()))
        if element.tag == "junction" and element.get("y") is not None:
            element.set("y", _negative(element, "y"))
        if element.get("dir") in _TURNED:
            element.set("dir", _TURNED[element.get("dir", "")])
    for location in root.iterfind("location"):
        for name in ("convBoundary", "origBoundary"):
            parts = location.get(name, "").split(",")
            if len(parts) == 4:
                west, south, east, north = parts
                location.set(name, ",".join((west, _minus(north), east, _minus(south))))
    for phase in root.iter("phase"):
        if phase.get("name", "").endswith("_go"):
            phase.set("name", _other_stage(phase.get("name", "")))


def _mirrored(point: str) -> str:
    x, y, *rest = point.split(",")
    return ",".join((x, _minus(y), *rest))


def _minus(text: str) -> str:
    return text[1:] if text.startswith("-") else f"-{text}" if float(text) else text


def _negative(element: Element, name: str) -> str:
    number(element, name)
    return _minus((element.get(name) or "").strip().removeprefix("+"))


def _other_stage(name: str) -> str:
    """Return the mirrored name of a stage: `s_go` becomes `n_go`, `ns_go` stays."""
    words = name.split("_")
    points = [word.translate(_NORTH_SOUTH) for word in words[:-1]]
    return "_".join("ns" if point == "sn" else point for point in points) + "_go"


_EDITION = "14"
"""Edition of the conversion of OpenDRIVE maps, a part of the cache key; increase it when the conversion changes."""

_NET_EDITION = "10"
"""Edition of the conversion of SUMO nets, a part of the cache key; increase it when the conversion changes."""

_LARGEST_M = 1e8
"""Largest coordinate of a network, m. Ours: more than UTM's northings (1e7 m), and small enough to resolve
millimetres."""

_LONGEST_M = 1e5
"""Largest length of a lane, m. Ours: the longest lanes of motorways are some 20 km long; a node that was placed in
another country by mistake would make millions of points.
"""

SUFFIXES = (".net.xml", ".xodr")
"""Suffixes of the accepted files."""

_SPEED_UNITS = {word: UNITS[word] for word in ("m/s", "km/h", "mph")}
"""OpenDRIVE's e_unitSpeed; the default is m/s."""
_DRIVEN = ("driving", "entry", "exit", "onRamp", "offRamp", "mwyEntry", "mwyExit", "stop")
"""OpenDRIVE's types of lanes that get the limit of their road; SUMO's typemap has 80 km/h for entries and exits."""
_TYPEMAPS = ("opendriveNetconvert.typ.xml", "opendriveNetconvertPedestrians.typ.xml")
_OPTIONS = (  # of netconvert 1.28
    *("--crossings.guess", "true"),
    *("--offset.disable-normalization", "true"),  # coordinates stay those of the map
    *("--no-turnarounds.except-deadend", "true"),  # vehicles make a U-turn only at dead ends
    *("--no-warnings", "true"),
)
_INNER_SHAPES = ("--opendrive.internal-shapes", "true")
"""Option of netconvert that keeps lanes inside junctions as the map has them, not bent; netconvert 1.28 crashes with it
for some maps."""
NOTES = "notes.txt"
"""File beside a net in the cache that holds notes on its conversion."""


Tell = Callable[[str], None]
"""A function that is called with a description at the beginning of each step that is slow for large maps."""


def in_silence(_: str) -> None:
    """Do nothing; used by callers that do not show the steps."""


def foreign_net(path: Path, tell: Tell = in_silence) -> Path:
    """Return the net in the cache for a `.net.xml` file or an `.xodr` map.

    Ids and coordinates are those of the file. A net is copied without the comments at its beginning and otherwise
    unchanged, except for signals that react to traffic (the copy has the same stages with fixed times) and lines that
    no car can follow (see `repair_geometry`).

    Raises:
        CompileError: the file cannot be read, converted or simulated.
    """
    try:
        data = read_outside(path)
    except OSError as err:
        raise unreadable(path, err) from err
    if path.name.endswith(".net.xml"):
        return cached_net(("net.xml", _NET_EDITION, data), lambda out: _copy_net(path, data, out, tell))
    if path.name.endswith(".xodr"):
        return cached_net(("xodr", _EDITION, data), lambda out: convert_map(path, out, tell=tell))
    raise CompileError(f"the network {path} is of an unknown kind: its name must end in {' or '.join(SUFFIXES)}")


def limit_of(road: Element, at_m: float) -> float | None:
    """Return the speed limit of an OpenDRIVE road's `<type>` at a position along it, m/s, or None."""
    limit = None
    for kind in sorted(road.iterfind("type"), key=lambda e: float(e.get("s", "0"))):
        if float(kind.get("s", "0")) <= at_m:
            speed = kind.find("speed")
            limit = _speed(speed) if speed is not None else None
    return limit


def _speed(speed: Element) -> float | None:
    try:
        value = float(speed.get("max", "")) * _SPEED_UNITS[speed.get("unit", "m/s")].to_si
    except (ValueError, KeyError):  # the value may also be "no limit" or "undefined"
        return None
    return value if 0 < value < math.inf else None


def _give_lanes_their_limits(root: Element) -> None:
    """Write the roads' speed limits into their lanes, because netconvert 1.28 reads only the limits of lanes."""
    for road in root.iterfind("road"):
        for section in road.iterfind("lanes/laneSection"):
            limit = limit_of(road, float(section.get("s", "0")))
            for lane in section.iter("lane"):
                if limit is not None and lane.get("type") in _DRIVEN and lane.find("speed") is None:
                    SubElement(lane, "speed", {"sOffset": "0", "max": f"{limit:.3f}", "unit": "m/s"})


def _copy_net(path: Path, data: bytes, out: Path, tell: Tell) -> None:
    tell("checking the lanes and connections")
    root = parse_net(path)
    if root.find("edge") is None or root.find("location") is None:
        raise CompileError(f"{path} is not a complete SUMO network: it has no edges or no location")
    try:
        parts = topology_of(root)
        _check_sound(parts)
        changed = any((fix_times(root), repair_geometry(root, parts)))
        if changed:
            write_net(root, out)
        else:
            out.write_bytes(without_header(data))
        signals_of(root, parts, None)
        tell("loading the network in SUMO")
        _check_loads(path, out)
    except TypeError as err:  # rows with the same index cannot be sorted
        raise CompileError(
            f"{path} is not a sound SUMO network: two requests of a junction have the same index"
        ) from err
    except (KeyError, ValueError, IndexError) as err:
        detail = f"there is no {err}" if isinstance(err, KeyError) else str(err)
        raise CompileError(f"{path} is not a sound SUMO network: {detail}") from err


def _check_loads(path: Path, net: Path) -> None:
    try:
        check_loads(net)
    except CompileError as err:
        raise CompileError(f"{path} cannot be simulated: {err}") from err


def _check_sound(parts: Topology) -> None:
    """Check that all edges have lanes, and that all lanes and junctions have valid positions and sizes.

    Raises:
        ValueError: they do not.
    """
    for edge in parts.edges.values():
        if not edge.lanes or [lane.index for lane in edge.lanes] != list(range(len(edge.lanes))):
            raise ValueError(f"the lanes of edge {edge.id} are not numbered from 0 on")
    for lane in parts.lanes.values():
        figures = (lane.length_m, lane.speed_mps, lane.width_m, *(value for point in lane.shape for value in point))
        # This comparison is also False for NaN.
        if len(lane.shape) < 2 or not all(abs(figure) < _LARGEST_M for figure in figures):
            raise ValueError(f"lane {lane.id} has no usable shape, length, speed or width")
        if lengths(lane.shape)[-1] > _LONGEST_M:
            raise ValueError(f"lane {lane.id} is longer than {_LONGEST_M / 1000:.0f} km: a point of it is misplaced")
        if min(lane.length_m, lane.speed_mps, lane.width_m) < 0:
            raise ValueError(f"the length, speed or width of lane {lane.id} is negative")
    for junction in parts.junctions.values():
        figures = (junction.x, junction.y, *(value for point in junction.polygon for value in point))
        if not all(abs(figure) < _LARGEST_M for figure in figures):  # SUMO 1.28 crashes with x="-inf"
            raise ValueError(f"junction {junction.id} has no usable place or outline")


def convert_map(path: Path, out: Path, *, keep: Sequence[str] = (), tell: Tell = in_silence) -> None:
    """Write the net of an OpenDRIVE map, and beside it a file with notes on its conversion.

    `keep` is netconvert's option for a part of the map, with its value. `tell` is called at each slow step.
    """
    tell("converting the map with netconvert")
    root = read_opendrive(path)
    try:
        notes = [f"netconvert cannot read {text}: {count}" for text, count in make_readable(root).items()]
        left_hand = drives_on_the_left(root)
        if left_hand:
            mirror_map(root)
        _give_lanes_their_limits(root)
    except ValueError as err:
        raise CompileError(f"{path} is not a sound OpenDRIVE map: {err}") from err
    with tempfile.TemporaryDirectory(prefix="foresee-map-") as name:
        folder = Path(name)
        notes += _build(root, folder, keep)
        net = parse_net(folder / "map.net.xml")
    try:
        _check_sound(topology_of(net))
    except ValueError as err:
        raise CompileError(f"{path} is not a sound OpenDRIVE map: {err}") from err
    tell("checking the lanes and connections")
    close_parking(net)
    repair_overlaps(net)
    repair_geometry(net)
    give_programs(net)  # an OpenDRIVE map holds the places of signals, not their programs
    if left_hand:
        mirror_net(net)
    write_net(net, out)
    tell("loading the network in SUMO")
    _check_loads(path, out)
    if notes:
        (out.parent / NOTES).write_text("\n".join(notes), encoding="utf-8")


def _build(root: Element, folder: Path, keep: Sequence[str]) -> list[str]:
    """Build `map.net.xml` in a folder with netconvert, and return notes on the conversion."""
    maps = sumo_home() / "data" / "typemap"
    (folder / "map.xodr").write_bytes(tostring(root, encoding="utf-8", xml_declaration=True))
    types = ",".join(str(maps / file) for file in _TYPEMAPS)
    command = ["--opendrive-files", "map.xodr", "--type-files", types, "--output-file", "map.net.xml", *_OPTIONS, *keep]
    notes = []
    try:
        run_netconvert([*command, *_INNER_SHAPES], folder)
        command += _INNER_SHAPES
    except NetconvertDiedError as err:
        run_netconvert(command, folder)
        notes = [f"{err} with the lanes inside junctions as the map has them: they are bent by netconvert"]
    if write_crossings(read_net(folder / "map.net.xml"), crosswalks_of(root), folder / "crossings.con.xml"):
        run_netconvert([*command, "--connection-files", "crossings.con.xml"], folder)
    return notes


def notes_of(net_file: Path) -> tuple[str, ...]:
    """Return the notes on a net's conversion."""
    try:
        return tuple((net_file.parent / NOTES).read_text(encoding="utf-8").splitlines())
    except OSError:
        return ()


def close_parking(root: Element) -> int:
    """Close the parking lanes of a net from an OpenDRIVE map, and return their number.

    netconvert 1.28 lets vehicles drive on them at 5 km/h. It stores the lanes' types in their edge's `type`, from the
    right, as in `sidewalk|parking|driving`; sidewalks that netconvert adds are on the right of these lanes.
    """
    closed = 0
    for edge in root.iterfind("edge"):
        types = edge.get("type", "").split("|")
        lanes = edge.findall("lane")
        for lane, kind in zip(lanes[len(lanes) - len(types) :], types, strict=False):
            if kind == "parking" and len(types) <= len(lanes):
                lane.attrib.pop("allow", None)
                lane.set("disallow", "all")
                lane.set("type", "parking")
                closed += 1
    return closed


def write_net(root: Element, out: Path) -> None:
    """Write a net from its tree; equal trees give equal bytes."""
    out.write_bytes(tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")
