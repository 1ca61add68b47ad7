"""Import of an OpenStreetMap extract: its streets, signals, sidewalks and crossings become a SUMO network."""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring  # only to build elements; `safe_xml` parses

from foresee_dsl.compile.foreign.networks import Tell, in_silence
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.compile.nets.netconvert import (
    NetconvertDiedError,
    NetconvertLimitError,
    run_netconvert,
    sumo_home,
    without_header,
)
from foresee_dsl.compile.nets.safe_xml import MOST_ELEMENTS, parse_xml, unreadable
from foresee_dsl.compile.roads.polyline import XY, distance_to
from foresee_dsl.compile.roads.topology import NetEdge, Topology
from foresee_dsl.errors import CompileError
from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.files import open_outside
from foresee_exchange.maps.cutting import CUT, EMPTY, Around, Boundary, Part
from foresee_exchange.maps.sumo import NET, counts, part_name, with_starter
from foresee_exchange.naming import name_of

_TYPEMAPS = ("osmNetconvert.typ.xml", "osmNetconvertUrbanDe.typ.xml", "osmNetconvertPedestrians.typ.xml")
"""SUMO's own tables of `highway=...`: lanes, limits, permissions; then urban limits and sidewalks."""
_OPTIONS = (
    *("--geometry.remove", "true"),  # a node at which a street only bends must not be a junction
    *("--junctions.join", "true"),  # a crossing of two dual carriageways must be one junction, not four
    *("--junctions.corner-detail", "5"),
    *("--roundabouts.guess", "true"),  # extracts often lack the tag
    *("--tls.guess-signals", "true"),  # OSM puts signals at stop lines, before the junction
    *("--tls.discard-simple", "true"),  # a signal without crossing streams belongs to a pedestrian crossing
    *("--tls.join", "true"),  # a junction that has several nodes must have one program
    *("--tls.default-type", "static"),
    *("--sidewalks.guess", "true"),
    *("--crossings.guess", "true"),
    *("--osm.sidewalks", "true"),
    *("--osm.turn-lanes", "true"),
    *("--keep-edges.by-vclass", "passenger,delivery,bus,truck,motorcycle,bicycle"),
    *("--no-turnarounds.except-deadend", "true"),
    *("--output.street-names", "true"),
    *("--precision", "3"),  # coordinates in millimetres
    *("--no-warnings", "true"),
)
_NOT_ALONE = ("--remove-edges.isolated", "true")
"""Option that removes streets that lead to no other street; it is not used if all streets are such."""
_MAPPED_CROSSINGS = ("--osm.crossings", "true")
"""Option that uses the map's own crossings. With it, netconvert 1.28 crashes on some extracts (3 of 28 of osm2streets),
which are then converted without it."""
_AGAIN = (
    *("--junctions.corner-detail", "5"),
    *("--output.street-names", "true"),
    *("--precision", "3"),
    *("--no-warnings", "true"),
)
_CAR_STREETS = frozenset(
    {
        *("motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential", "living_street"),
        *("motorway_link", "trunk_link", "primary_link", "secondary_link", "tertiary_link", "service", "cycleway"),
        *("road", "busway", "track"),
    }
)
_OTHER_WAYS = ("building", "railway", "waterway", "landuse", "natural", "leisure", "amenity", "barrier", "boundary")
_FROM_JUNCTION_M = 25.0
"""Largest distance of a crossing from its junction, m (ours: with four lanes, stop lines are 15 m from the centre)."""
_BESIDE_M = 6.0
"""Largest distance of a crossing's node from the middle of its street, m (ours: for a street with a median)."""
_LEAST_JUNCTIONS = 3


def run(file: Path, *, out: Path, part: Part | None = None, tell: Tell = in_silence) -> Imported:
    """Write `NAME.net.xml` and the scenario `NAME.foresee` for an extract `NAME.osm` that has streets.

    Args:
        part: the part to keep, as `NAME_part`; None: all. tell: called with each step that takes long.
    """
    box = part.geo_box() if isinstance(part, Around) else part
    tell(f"reading {file.name}")
    root = read_osm(file)
    if not any(_tag(way, "highway") in _CAR_STREETS for way in root.iterfind("way")):
        raise ExchangeError(f"{file} has no streets: it must contain `highway` ways with their nodes")
    if root.find("node") is None:
        raise ExchangeError(f"{file} has no nodes: export it with them")
    name = name_of(file.name.partition(".osm")[0], "map")
    extent = None
    if box is not None:
        name, extent = part_name(name), extent_of(root)
        keep_within(root, box)
    tell("converting the extract to a network with netconvert")
    net, notes = converted(root, box=box)
    if b"<edge " not in net:
        net, notes = converted(root, alone=True, box=box)
    if b"<edge " not in net and box is not None:
        raise ExchangeError(f"{file} has no street for cars in the box {box}; it reaches {extent}")
    if b"<edge " not in net:
        raise ExchangeError(f"{file} has no street that leads anywhere: use a larger extract")
    return with_starter(
        net,
        f"{name}{NET}",
        name,
        out,
        source=f"{'a part of ' if box is not None else ''}{file.name}, (c) OpenStreetMap contributors",
        contents=lambda parts: (counts(parts), _left_out(root), (*notes, *_kept(box), _GUESSED)),
        tell=tell,
    )


def _kept(box: Boundary | None) -> tuple[str, ...]:
    return () if box is None else (f"streets that lie in the box {box}, wholly or partly, are kept",)


def extent_of(root: Element) -> Boundary | None:
    """Return the bounding box of an extract's nodes; None if it has none."""
    places = list(_places(root).values())
    if not places:
        return None
    lons, lats = zip(*places, strict=True)
    return Boundary(min(lons), min(lats), max(lons), max(lats), geo=True)


def keep_within(root: Element, box: Boundary) -> None:
    """Remove the ways of an extract that lie wholly on one side of a box, and the nodes that no other way needs.

    netconvert cuts exactly; this only reduces its input.
    """
    places = _places(root)
    needed: set[str] = set()
    for way in root.findall("way"):
        refs = [node.get("ref", "") for node in way.iterfind("nd")]
        points = [places[ref] for ref in refs if ref in places]
        lons, lats = [lon for lon, _ in points], [lat for _, lat in points]
        if points and not (max(lons) < box.west or min(lons) > box.east or max(lats) < box.south
                           or min(lats) > box.north):  # fmt: skip
            needed.update(refs)
        else:
            root.remove(way)
    for node in root.findall("node"):
        lon, lat = places.get(node.get("id", ""), (math.nan, math.nan))
        within = box.west <= lon <= box.east and box.south <= lat <= box.north
        if not within and node.get("id") not in needed:
            root.remove(node)


def _places(root: Element) -> dict[str, tuple[float, float]]:
    """Return longitude and latitude of each node, degrees."""
    places = {}
    for node in root.iterfind("node"):
        with suppress(ValueError, KeyError):
            places[node.get("id", "")] = float(node.attrib["lon"]), float(node.attrib["lat"])
    return places


_GUESSED = ("signals without known times have netconvert's fixed programs of 90 s; sidewalks and crossings that are "
            "missing in OSM are guessed")  # fmt: skip


def converted(root: Element, *, alone: bool = False, box: Boundary | None = None) -> tuple[bytes, tuple[str, ...]]:
    """Return the net of an extract, and notes on the conversion.

    The extract is written again for netconvert, so that no document type remains which it would download.

    Args:
        alone: whether to keep streets that lead to no other street. box: the part to keep; None: all.
    """
    maps = sumo_home() / "data" / "typemap"
    with tempfile.TemporaryDirectory(prefix="foresee-osm-") as folder_name:
        folder = Path(folder_name)
        (folder / "map.osm.xml").write_bytes(tostring(root, encoding="utf-8", xml_declaration=True))
        types = ",".join(str(maps / file) for file in _TYPEMAPS)
        command = ["--osm-files", "map.osm.xml", "--type-files", types, "--output-file", f"map{NET}", *_OPTIONS]
        notes: tuple[str, ...] = ()
        command += () if alone else _NOT_ALONE
        command += () if box is None else box.option
        if drives_on_the_left(root):
            command += ["--lefthand", "true"]
        try:
            try:
                run_netconvert([*command, *_MAPPED_CROSSINGS], folder)
            except NetconvertDiedError as err:
                run_netconvert(command, folder)
                put = _put_crossings(root, folder)
                notes = (f"{err} while it added the map's crossings, so this tool added {put} of them, at the "
                         "arms of junctions with sidewalks; others are guessed",)  # fmt: skip
        except CompileError as err:
            if any(words in str(err) for words in EMPTY):
                return b"", ()
            if isinstance(err, NetconvertLimitError):
                raise ExchangeError(f"{err}; or {CUT}") from err
            raise ExchangeError(f"netconvert cannot convert the extract to a network: {err}") from err
        return without_header((folder / f"map{NET}").read_bytes()), notes


def _put_crossings(root: Element, folder: Path) -> int:
    """Add an extract's crossings to the net in a folder; return how many were added."""
    net = folder / f"map{NET}"
    before = read_net(net)
    wanted = crossings_of(root, before)
    if wanted is None:
        return 0
    (folder / "crossings.con.xml").write_bytes(wanted)
    more = folder / f"more{NET}"
    command = ["--sumo-net-file", net.name, "--connection-files", "crossings.con.xml", "--output-file", more.name]
    try:
        run_netconvert([*command, *_AGAIN], folder)
    except CompileError:
        return 0
    more.replace(net)
    return max(len(read_net(net).crossings) - len(before.crossings), 0)


def _left_out(root: Element) -> Counter[str]:
    """Return counts of the elements of the extract that are missing in the network."""
    counts: Counter[str] = Counter()
    for way in root.iterfind("way"):
        highway = _tag(way, "highway")
        if highway and highway not in _CAR_STREETS:
            counts[f"ways for others: {highway}"] += 1
        elif not highway:
            kind = next((key for key in _OTHER_WAYS if _tag(way, key)), "other ways")
            counts[f"outlines and lines: {kind}"] += 1
        elif _tag(way, "maxspeed:conditional") or _tag(way, "access:conditional"):
            counts["conditions on time or weather"] += 1
    for node in root.iterfind("node"):
        if (highway := _tag(node, "highway")) in ("stop", "give_way", "speed_camera", "bus_stop"):
            counts[f"signs and stops: {highway}"] += 1
        if _tag(node, "traffic_calming"):
            counts["traffic calming"] += 1
    for relation in root.iterfind("relation"):
        kind = _tag(relation, "type")
        if kind != "restriction":  # netconvert takes them into account
            counts[f"relations: {kind or 'without a type'}"] += 1
    return counts


def _tag(element: Element, key: str) -> str:
    return next((tag.get("v", "") for tag in element.iterfind("tag") if tag.get("k") == key), "")


_LEFT = (
    # Boxes inside countries with left-hand traffic: west, south, east, north, in degrees. Ours: they are coarse, and
    # none crosses a border to a country with right-hand traffic; tags of the extract take precedence.
    (-10.8, 49.8, 1.8, 61.0),  # Great Britain, Ireland
    (32.2, 34.5, 34.7, 35.8),  # Cyprus
    (14.1, 35.7, 14.7, 36.1),  # Malta
    (68.0, 6.0, 88.0, 27.5),  # India, Sri Lanka
    (66.0, 24.0, 74.0, 34.0),  # Pakistan, north-western India
    (129.5, 30.0, 146.0, 45.6),  # Japan
    (126.0, 24.0, 129.5, 28.5),  # Okinawa
    (113.8, 22.15, 114.5, 22.57),  # Hong Kong
    (99.5, 1.1, 104.5, 6.5),  # Malaysia, Singapore
    (98.5, 13.0, 101.5, 19.0),  # middle of Thailand
    (105.1, -8.9, 116.0, -5.8),  # Java, Bali
    (112.9, -44.0, 154.0, -10.0),  # Australia
    (166.0, -47.5, 179.0, -34.0),  # New Zealand
    (16.4, -35.0, 33.0, -22.2),  # South Africa, Botswana
    (34.0, -4.6, 41.5, 4.0),  # Kenya
    (-78.5, 17.6, -76.1, 18.6),  # Jamaica
    (-61.95, 10.0, -60.5, 11.4),  # Trinidad
)


def read_osm(file: Path) -> Element:
    """Return the root of an extract: `.osm`, also compressed by gzip, or `.osm.pbf`."""
    if not file.name.endswith(".pbf"):
        return parse_xml(file, "osm", "an OpenStreetMap file", ExchangeError)
    try:
        open_outside(file).close()
    except OSError as err:
        raise unreadable(file, err, ExchangeError) from err
    try:
        osmium: Any = import_module("osmium")
    except ImportError as err:
        raise ExchangeError(f"{file} is a PBF file, which needs pyosmium: pip install 'foresee-dsl[osm]'") from err
    with tempfile.TemporaryDirectory(prefix="foresee-osm-") as folder:
        plain = Path(folder) / "map.osm"
        try:
            _write_plain(osmium, file, plain)
        except (RuntimeError, ValueError, OSError) as err:
            raise ExchangeError(f"{file} is not an OpenStreetMap file in PBF, or a damaged one: {err}") from err
        return parse_xml(plain, "osm", "an OpenStreetMap file", ExchangeError)


def _write_plain(osmium: Any, file: Path, plain: Path) -> None:  # noqa: ANN401 - an optional package
    elements = 0
    with osmium.SimpleWriter(str(plain)) as writer:
        for thing in osmium.FileProcessor(str(file)):
            elements += 1 + len(thing.tags) + (len(thing.nodes) if thing.is_way() else 0)
            if elements > MOST_ELEMENTS:
                raise ExchangeError(
                    f"{file} has more than {MOST_ELEMENTS:,} elements: use an extract of the part that you need"
                )
            writer.add(thing)


def drives_on_the_left(root: Element) -> bool:
    """Return whether an extract has left-hand traffic, by its `driving_side` tags, otherwise by its location."""
    sides = [tag.get("v") for tag in root.iter("tag") if tag.get("k") == "driving_side"]
    if sides:
        return 2 * sides.count("left") > len(sides)
    node = root.find("node")
    try:
        lon, lat = (float(node.get(name, "nan")) for name in ("lon", "lat")) if node is not None else (0.0, 0.0)
    except ValueError:
        return False
    return any(west <= lon <= east and south <= lat <= north for west, south, east, north in _LEFT)


def crossings_of(root: Element, net: Topology) -> bytes | None:
    """Return netconvert's input that adds an extract's crossings to the net made from it; None if there are none.

    Each crossing is placed at the arm of a junction; arms that already have a crossing, or have no sidewalk near, get
    none.
    """
    places = list(_crossing_places(root, net))
    taken = {edge for crossing in net.crossings.values() for edge in crossing.edges}
    connections = Element("connections")
    for place in places:
        arm = _arm(net, place)
        if arm is None or taken & {edge.id for edge in arm[1]}:
            continue
        taken |= {edge.id for edge in arm[1]}
        edges = " ".join(edge.id for edge in arm[1])
        SubElement(connections, "crossing", {"node": arm[0], "edges": edges, "width": "4.00"})
    return tostring(connections, encoding="utf-8", xml_declaration=True) if len(connections) else None


def _crossing_places(root: Element, net: Topology) -> Iterator[XY]:
    """Yield the places of the crossings, m, derived from the junctions that have the id of a node.

    Within an extract, UTM coordinates are linear in longitude and latitude, up to some decimetres.
    """
    import numpy as np

    degrees = {name: at for name, at in _places(root).items() if all(map(math.isfinite, at))}
    nodes = (node.get("id", "") for node in root.iterfind("node") if _tag(node, "highway") == "crossing")
    crossings = [degrees[name] for name in nodes if name in degrees]
    pairs = [(degrees[name], (junction.x, junction.y)) for name, junction in net.junctions.items() if name in degrees]
    if len(pairs) < _LEAST_JUNCTIONS or not crossings:
        return
    middle = np.mean([at for at, _ in pairs], axis=0)
    rows = np.array([(*(np.array(at) - middle), 1.0) for at, _ in pairs])
    to_metres, *_ = np.linalg.lstsq(rows, np.array([xy for _, xy in pairs]), rcond=None)
    for at in crossings:
        x, y = np.array((*(np.array(at) - middle), 1.0)) @ to_metres
        yield float(x), float(y)


def _arm(net: Topology, place: XY) -> tuple[str, tuple[NetEdge, ...]] | None:
    """Return the junction, and the edges of its arm, to which a crossing belongs."""
    best: tuple[float, str, tuple[NetEdge, ...]] | None = None
    for name, junction in net.junctions.items():
        if math.dist(place, (junction.x, junction.y)) > _FROM_JUNCTION_M:
            continue
        edges = net.edges_at(name)
        if not any("pedestrian" in lane.kinds for edge in edges for lane in edge.lanes):
            continue
        for edge in edges:
            away = min((distance_to(*place, lane.shape) for lane in edge.for_kind("car")), default=math.inf)
            if away <= _BESIDE_M and (best is None or away < best[0]):
                other = next((e for e in edges if (e.start, e.end) == (edge.end, edge.start)), None)
                best = away, name, (edge,) if other is None else (edge, other)
    return best[1:] if best is not None else None
