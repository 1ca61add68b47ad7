"""OpenDRIVE maps: import with a first scenario and a report on the parts that are left out, and export."""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.networks import Tell, convert_map, in_silence, notes_of
from foresee_dsl.compile.foreign.opendrive_reading import crosswalks_of
from foresee_dsl.compile.nets.netconvert import NetconvertLimitError, run_netconvert, without_header
from foresee_dsl.compile.nets.safe_xml import parse_xml, unpacked
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.errors import CompileError
from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.files import read_outside
from foresee_dsl.language.model import Network
from foresee_exchange.maps.cutting import EMPTY, Around, Boundary, Part
from foresee_exchange.maps.sumo import NET, part_name, with_starter
from foresee_exchange.naming import file_name, name_of

_LIGHTS = ("1000001", "1000002", "1000009", "1000010", "1000011")
"""Types of traffic lights: the first five are those of CARLA's OpenDRIVE reader (road/SignalType.cpp, after OpenDRIVE
1.5M). Netconvert 1.28 reads these types as traffic lights. Ours: CARLA's towns have no other types."""
_TAKEN_LANES = (
    *("driving", "entry", "exit", "onRamp", "offRamp", "mwyEntry", "mwyExit", "stop"),
    *("sidewalk", "none", "biking", "parking"),
)
_NO_CROSSING = "crosswalk objects without a crossing (they are not at a junction where sidewalks meet)"
_ON_CROSSING_M = 0.5
"""Largest distance between a crossing and its crosswalk, m. Ours: each crossing is moved onto its crosswalk, so that
only rounding errors remain."""
_LEVEL_M = 0.01
_DATE = re.compile(rb'(<header\b[^>]*?) date="[^"]*"')
_LANE_TYPES = {b"bus_lane": b"bus", b"bay": b"bus", b"cycle_lane": b"biking", b"cycle_track": b"biking"}
"""OpenDRIVE's types (1.4, e_laneType) of the lanes that we write; netconvert 1.28 writes the net's types instead."""
_LANE_TYPE = re.compile(rb'(<lane id="[^"]*" type=")(' + b"|".join(_LANE_TYPES) + rb')(?=")')
_OPTIONS = ("--precision", "4", "--no-warnings", "true")


def run(file: Path, *, out: Path, part: Part | None = None, tell: Tell = in_silence) -> Imported:
    """Write `NAME.xodr` and the scenario `NAME.foresee` for an OpenDRIVE map.

    Args:
        part: the part to keep, as a SUMO network `NAME_part.net.xml`; None: the whole map.
        tell: called with each step that takes long.
    """
    plain = file.name.removesuffix(".gz")
    if not plain.endswith(".xodr"):
        raise ExchangeError(f"{file} cannot be an OpenDRIVE map: its name must end in .xodr")
    tell("reading the map")
    root = parse_xml(file, "OpenDRIVE", "an OpenDRIVE map")
    if part is not None:
        return _run_part(file, part, out, tell)
    return with_starter(
        unpacked(file),
        file_name(plain),
        name_of(plain.removesuffix(".xodr"), "map"),
        out,
        source=file.name,
        contents=lambda parts: (taken_from(parts), left_out_of(root, parts), notes_on(root, parts)),
        tell=tell,
    )


def _run_part(file: Path, part: Part, out: Path, tell: Tell) -> Imported:
    """Write the part as a SUMO network, not as an OpenDRIVE map, because netconvert cuts a part out only while it
    converts the map to a network."""
    name = part_name(name_of(file.name.removesuffix(".gz").removesuffix(".xodr"), "map"))
    box = part if isinstance(part, Boundary) else _around(part, file)
    with tempfile.TemporaryDirectory(prefix="foresee-map-") as folder:
        net = Path(folder) / NET
        try:
            convert_map(file, net, keep=box.option, tell=tell)
        except NetconvertLimitError as err:
            raise ExchangeError(f"{err}; or choose a smaller part") from err
        except CompileError as err:
            if any(words in str(err) for words in EMPTY):
                raise ExchangeError(f"{file} has no road in the box {box}{_extent(file)}") from err
            raise
        notes = (f"the part is a SUMO network of the edges that lie in the box {box}, wholly or partly", *notes_of(net))
        return with_starter(
            net.read_bytes(),
            f"{name}{NET}",
            name,
            out,
            source=f"a part of {file.name}",
            contents=lambda parts: (taken_from(parts), Counter(), notes),
            tell=tell,
        )


def _around(part: Around, file: Path) -> Boundary:
    if part.point is None:
        raise ExchangeError(f"{part.place!r} is not a place on {file}: write its x and y in m, `X,Y,RADIUS`"
                            f"{_extent(file)}")  # fmt: skip
    return part.box(*part.point)


def _extent(file: Path) -> str:
    """Return in words the box that contains the starts of a map's road pieces."""
    pieces = list(parse_xml(file, "OpenDRIVE", "an OpenDRIVE map").iter("geometry"))
    try:
        xs, ys = ([float(piece.attrib[name]) for piece in pieces] for name in ("x", "y"))
        return f"; its roads begin within the box {Boundary(min(xs), min(ys), max(xs), max(ys))}"
    except (KeyError, ValueError):
        return ""


def taken_from(parts: Topology) -> dict[str, int]:
    """Return counts of a net's elements, by name."""
    lanes = [lane for edge in parts.edges.values() for lane in edge.lanes]
    return {
        "edges": len(parts.edges),
        "lanes for cars": sum("car" in lane.kinds for lane in lanes),
        "sidewalks": sum(lane.kinds == {"pedestrian"} for lane in lanes),
        "junctions": len({edge.end for edge in parts.edges.values()}),
        "junctions with a signal": len({m.junction for m in parts.movements if m.tls is not None}),
        "crossings": len(parts.crossings),
    }


def left_out_of(root: Element, parts: Topology) -> Counter[str]:
    """Return counts of the elements of an OpenDRIVE map that are missing in the net made from it (`parts`)."""
    counts: Counter[str] = Counter()
    for signal in root.iter("signal"):
        if signal.get("type") not in _LIGHTS:
            counts["signs (right of way is computed from the roads)"] += 1
    for thing in root.iter("object"):
        crosswalk = thing.get("type") == "crosswalk"
        counts[_NO_CROSSING] += crosswalk
        counts["objects"] += not crosswalk
    counts[_NO_CROSSING] -= _from_map(root, parts)[0]
    for lane in root.iter("lane"):
        kind = lane.get("type", "none")
        if kind == "bidirectional":
            counts["lanes of type bidirectional (one direction, 5 km/h)"] += 1
        elif kind not in _TAKEN_LANES:
            counts[f"lanes of type {kind}"] += 1
    for profile in root.iter("elevation"):
        steep = any(abs(float(profile.get(key, "0") or 0)) > _LEVEL_M for key in ("a", "b", "c", "d"))
        counts["stretches with a height or slope (the world is flat)"] += steep
    counts["tables of signal controllers"] += sum(1 for _ in root.iterfind("controller"))
    return +counts


def _from_map(root: Element, parts: Topology) -> tuple[int, int]:
    """Return how many crosswalks of a map have a crossing, and how many crossings are on crosswalks."""
    crossings: set[str] = set()
    used = 0
    for crosswalk in crosswalks_of(root):
        x, y = crosswalk.pose.x, crosswalk.pose.y
        lines = {name: crossing.lane.line for name, crossing in parts.crossings.items()}
        here = {name for name, line in lines.items() if _is_over(line, x, y, crosswalk.length_m / 2)}
        crossings |= here
        used += bool(here)
    return used, len(crossings)


def _is_over(line: Polyline, x: float, y: float, beyond_m: float) -> bool:
    s, beside = line.project(x, y)
    return -beyond_m <= s <= line.length_m + beyond_m and abs(beside) < _ON_CROSSING_M


def notes_on(root: Element, parts: Topology) -> tuple[str, ...]:
    """Return a note on each thing that was added to a map."""
    notes = []
    if any(m.tls is not None for m in parts.movements):
        notes.append(
            "the map contains the places of signals, not their programs: each signal got a program of this tool, with "
            "a stage for each pair of opposite approaches (20 s green, 3 s amber, 2 s all red)"
        )
    mapped = _from_map(root, parts)[1]
    if mapped:
        notes.append(f"{mapped} pedestrian crossings lie where the map has its crosswalks")
    if len(parts.crossings) > mapped:
        guessed = len(parts.crossings) - mapped
        notes.append(
            f"{guessed} pedestrian crossings are guessed: at junctions without a crosswalk, where sidewalks end"
        )
    if root.find("road/type/speed") is None and root.find(".//lane/speed") is None:
        notes.append("the map has no speed limits: all roads got netconvert's 50 km/h")
    return tuple(notes)


def opendrive_of(network: Network | Path, net_file: Path) -> bytes:
    """Return an OpenDRIVE map in the net's own coordinates (the same net gives the same bytes); an imported map
    unchanged."""
    if isinstance(network, Path) and network.name.endswith(".xodr"):
        try:
            return read_outside(network)
        except OSError as err:
            raise ExchangeError(f"{network} cannot be read: {err.strerror or err}") from err
    with tempfile.TemporaryDirectory(prefix="foresee-xodr-") as name:
        folder = Path(name)
        try:
            run_netconvert(["-s", str(net_file), "--opendrive-output", "map.xodr", *_OPTIONS], folder)
        except CompileError as err:
            raise ExchangeError(f"the network cannot be written as OpenDRIVE: {err}") from err
        written = _DATE.sub(rb"\1", without_header((folder / "map.xodr").read_bytes()), count=1)
        return _LANE_TYPE.sub(lambda lane: lane[1] + _LANE_TYPES[lane[2]], written)
