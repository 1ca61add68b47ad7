"""Reads OpenDRIVE maps: rewrites parts that netconvert 1.28 cannot read in an equivalent form, and places crossings at
the crosswalk objects that it does not read."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import (  # no parsing: that is safe_xml's
    Element,
    ElementTree,
    SubElement,
)

from foresee_dsl.compile.foreign.opendrive_geometry import OpenDriveRoads, Pose, cubic_at, number
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import Crossing, Topology
from foresee_dsl.errors import CompileError

_LENGTH_M = 0.1
"""Length of a connecting road, m (ours; the roads themselves touch, so it lies on top of the next road)."""


def join_directly(root: Element) -> int:
    """Give each connection of a direct junction its own road, and return the number of such junctions."""
    roads = {road.get("id", ""): road for road in root.iterfind("road")}
    where = OpenDriveRoads(root)
    count = 0
    direct = [junction for junction in root.iterfind("junction") if junction.get("type") == "direct"]
    for junction in direct:
        for connection in junction.findall("connection"):
            name = f"direct_{junction.get('id')}_{count}"
            incoming, linked = (roads.get(connection.get(key) or "") for key in ("incomingRoad", "linkedRoad"))
            if incoming is None or linked is None:
                junction.remove(connection)
                continue
            road = _connecting(where, junction, connection, incoming, linked)
            road.set("id", name)
            root.insert(list(root).index(junction), road)
            connection.attrib.pop("linkedRoad")
            _lead(junction, connection, name)
            count += 1
        del junction.attrib["type"]
    return len(direct)


def _connecting(
    where: OpenDriveRoads, junction: Element, connection: Element, incoming: Element, linked: Element
) -> Element:
    """Return the road from the end of one road to the other, with the lanes that the first road has at its end."""
    at_end = _touches(incoming, "successor", junction)
    s = number(incoming, "length") if at_end else 0.0
    pose = where.at(incoming.get("id", ""), s, 0.0)
    heading = pose.heading_rad if at_end else pose.heading_rad + math.pi
    contact = connection.get("contactPoint") or "start"
    turn = 1 if at_end else -1
    road = Element("road", {"name": "", "length": f"{_LENGTH_M}", "junction": junction.get("id", "")})
    if incoming.get("rule"):
        road.set("rule", incoming.get("rule", ""))
    link = SubElement(road, "link")
    ends = {"predecessor": (incoming, "end" if at_end else "start"), "successor": (linked, contact)}
    for tag, (other, point) in ends.items():
        SubElement(link, tag, {"elementType": "road", "elementId": other.get("id", ""), "contactPoint": point})
    line = {"s": "0", "x": f"{pose.x!r}", "y": f"{pose.y!r}", "hdg": f"{heading!r}", "length": f"{_LENGTH_M}"}
    SubElement(SubElement(SubElement(road, "planView"), "geometry", line), "line")
    lanes = SubElement(road, "lanes")
    offset = turn * cubic_at(incoming.iterfind("lanes/laneOffset"), "s", s)
    SubElement(lanes, "laneOffset", {"s": "0", "a": f"{offset!r}", "b": "0", "c": "0", "d": "0"})
    section = SubElement(lanes, "laneSection", {"s": "0"})
    onward = {turn * int(number(pair, "from")): pair for pair in connection.iterfind("laneLink")}
    sides: dict[str, list[tuple[int, Element]]] = {"left": [], "center": [], "right": []}
    for number_, lane in _lanes_at(incoming, at_end):
        side = "center" if number_ == 0 else "left" if turn * number_ > 0 else "right"
        sides[side].append((turn * number_, lane))
    for side, members in sides.items():
        group = SubElement(section, side)
        for number_, lane in sorted(members, key=lambda item: -item[0]):
            copy = SubElement(group, "lane", {"id": str(number_), "type": lane.get("type", "none"), "level": "false"})
            links = SubElement(copy, "link")
            if number_ and number_ in onward:
                SubElement(links, "predecessor", {"id": str(turn * number_)})
                SubElement(links, "successor", {"id": onward[number_].get("to", "")})
            if number_:
                width = cubic_at(lane.iterfind("width"), "sOffset", s - _section_start(incoming, at_end))
                SubElement(copy, "width", {"sOffset": "0", "a": f"{width!r}", "b": "0", "c": "0", "d": "0"})
    for pair in connection.findall("laneLink"):
        pair.set("to", str(turn * int(number(pair, "from"))))
    return road


def _lead(junction: Element, connection: Element, road: str) -> None:
    """Connect a connection to the beginning of its road, and remove lanes that lead in the opposite direction."""
    connection.set("connectingRoad", road)
    connection.set("contactPoint", "start")
    back = [pair for pair in connection.findall("laneLink") if number(pair, "to") > 0]
    for pair in back:
        connection.remove(pair)
    if not connection.findall("laneLink"):
        junction.remove(connection)


def _touches(road: Element, tag: str, junction: Element) -> bool:
    link = road.find(f"link/{tag}")
    return link is not None and link.get("elementType") == "junction" and link.get("elementId") == junction.get("id")


def _lanes_at(road: Element, at_end: bool) -> Iterator[tuple[int, Element]]:
    sections = road.findall("lanes/laneSection")
    if not sections:
        raise CompileError(f"the map's road {road.get('id')} has no lanes")
    for lane in sections[-1 if at_end else 0].iter("lane"):
        yield int(number(lane, "id")), lane


def _section_start(road: Element, at_end: bool) -> float:
    return number(road.findall("lanes/laneSection")[-1 if at_end else 0], "s", 0.0)


_STRAIGHT = 1e-12
"""Curvature below which a line is straight, 1/m (ours), because netconvert 1.28 divides by the curvature."""
_SHORTEST_M = 1e-6
"""Length below which a piece of a reference line has no direction, m (ours)."""


def read_opendrive(path: Path) -> Element:
    """Return the root of an OpenDRIVE map, which must have roads."""
    root = parse_xml(path, "OpenDRIVE", "an OpenDRIVE map")
    if root.find("road") is None:
        raise CompileError(f"{path} is an OpenDRIVE map without roads")
    return root


def drives_on_the_left(root: Element) -> bool:
    """Return whether a map's traffic keeps to the left, by the `rule` of its roads with driving lanes.

    Raises:
        CompileError: these roads have both rules.
    """
    rules = Counter(road.get("rule") or "RHT" for road in root.iterfind("road") if _is_driven(road))
    if rules["LHT"] and rules["RHT"]:
        raise CompileError(
            f'the map has {rules["LHT"]} roads with traffic on the left (rule="LHT") and {rules["RHT"]} with traffic '
            "on the right; a network has one side: cut out the part that is needed"
        )
    return bool(rules["LHT"])


def _is_driven(road: Element) -> bool:
    return any(lane.get("type") == "driving" for lane in road.iter("lane"))


def make_readable(root: Element) -> Counter[str]:
    """Rewrite parts that netconvert 1.28 cannot read, and return descriptions of the changes with counts.

    - An arc without curvature becomes a line, a spiral with constant curvature an arc (netconvert would divide by
        zero); a piece without length is removed.
    - Signals with an empty type, as RoadRunner writes them, become signs (netconvert would reject the map).
    - Roads that meet in a direct junction get connecting roads (netconvert does not support direct junctions).
    - Connections of roads that the map does not have are removed (netconvert would reject the map).
    """
    changed: Counter[str] = Counter()
    for view in root.iterfind("road/planView"):
        for piece in view.findall("geometry"):
            changed["pieces of roads without length"] += _leave_out_empty(view, piece)
            _straighten(piece)
    for signal in root.iter("signal"):
        if not (signal.get("type") or "").strip():
            signal.set("type", "-1")
            changed["signals without a type (taken as signs)"] += 1
        if signal.get("subtype") is not None and not (signal.get("subtype") or "").strip():
            signal.set("subtype", "-1")
    changed["direct junctions (their roads are joined)"] += join_directly(root)
    changed["connections of roads that the map does not have"] += _leave_out_unknown(root)
    return +changed


def _leave_out_empty(view: Element, piece: Element) -> bool:
    if number(piece, "length", 0.0) >= _SHORTEST_M or len(view.findall("geometry")) == 1:
        return False
    view.remove(piece)
    return True


def _straighten(piece: Element) -> None:
    shape = next(iter(piece), None)
    if shape is None:
        SubElement(piece, "line")
    elif shape.tag == "spiral":
        start, end = number(shape, "curvStart", 0.0), number(shape, "curvEnd", 0.0)
        if abs(end - start) < _STRAIGHT:
            shape.tag, shape.attrib = "arc", {"curvature": f"{start!r}"}
    if shape is not None and shape.tag == "arc" and abs(number(shape, "curvature", 0.0)) < _STRAIGHT:
        shape.tag, shape.attrib = "line", {}


def _leave_out_unknown(root: Element) -> int:
    roads = {road.get("id") for road in root.iterfind("road")}
    count = 0
    for junction in root.iterfind("junction"):
        for connection in junction.findall("connection"):
            named = {connection.get("incomingRoad"), connection.get("connectingRoad")}
            if not named <= roads and connection.get("connectingRoad") is not None:
                junction.remove(connection)
                count += 1
    return count


NEAR_M = 8.0
"""Largest distance of a crosswalk from the crossing that netconvert guesses at a junction's arm, m, for the crosswalk
to belong to that arm (the farthest of Town10HD's 16 is 4.9 m away; measured)."""
_BESIDE_M = 2.0
"""An arm has one crossing for each direction of its road. This is the largest difference of their distances from a
crosswalk, m (ours).
"""
_SAME_ANGLE_RAD = math.radians(30)
"""Largest angle between a crosswalk and its crossing, rad (ours)."""
_LEAST_WIDTH_M, _MOST_WIDTH_M = 1.0, 8.0
"""Range to which widths of crosswalks are limited, m (ours)."""
_CROSSING_LENGTH_M, _WIDTH_M = 14.0, 2.5
"""Size of a crosswalk without an outline, m (ours: the size of the crosswalks over four lanes in CARLA's towns)."""


@dataclass(frozen=True)
class Crosswalk:
    """A crosswalk of a map: its middle and the walking direction, its length and width, m."""

    pose: Pose
    length_m: float
    width_m: float


def crosswalks_of(root: Element) -> tuple[Crosswalk, ...]:
    """Return the crosswalk objects of an OpenDRIVE map.

    Crosswalks beyond their road, or with attributes that are not numbers, are left out.
    """
    roads = OpenDriveRoads(root)
    crosswalks = []
    for road in root.iterfind("road"):
        for thing in road.iterfind("objects/object"):
            if thing.get("type") == "crosswalk":
                try:
                    crosswalks.append(_crosswalk(roads, road, thing))
                except CompileError:
                    continue
    return tuple(crosswalks)


def write_crossings(net: Topology, crosswalks: Sequence[Crosswalk], out: Path) -> int:
    """Write netconvert's input for crossings at the crosswalks of junctions.

    These crossings replace netconvert's guesses at junctions with crosswalks; other junctions keep them. `net` holds
    the guessed crossings, from which the edges of a crossing are taken.

    Returns:
        Number of crosswalks at a junction's arm; if it is 0, no file is written.
    """
    placed: dict[str, Crosswalk] = {}
    used = 0
    for crosswalk in crosswalks:
        near = sorted(
            (away, name)
            for name, crossing in net.crossings.items()
            if (away := _away(crosswalk, crossing)) <= NEAR_M and name not in placed
        )
        junctions = [net.crossings[name].junction for _, name in near]
        of_arm = [
            name
            for (away, name), junction in zip(near, junctions, strict=True)
            if junction == junctions[0] and away <= near[0][0] + _BESIDE_M
        ]
        placed |= dict.fromkeys(of_arm, crosswalk)
        used += bool(of_arm)
    connections = Element("connections")
    for name, crosswalk in sorted(placed.items()):
        SubElement(connections, "crossing", _moved(net.crossings[name], crosswalk))
    if placed:
        ElementTree(connections).write(out, encoding="UTF-8", xml_declaration=True)
    return used


def _crosswalk(roads: OpenDriveRoads, road: Element, thing: Element) -> Crosswalk:
    s = min(max(number(thing, "s"), 0.0), number(road, "length"))
    beyond = number(thing, "s") - s  # CARLA has crosswalks up to 4 m behind the end of a road of 3 m
    pose = roads.at(road.get("id", ""), s, number(thing, "t"))
    pose = pose.ahead(beyond)
    turned = pose.heading_rad + number(thing, "hdg", 0.0)
    corners = [(number(c, "u"), number(c, "v")) for c in thing.iter("cornerLocal")]
    if not corners:
        return Crosswalk(Pose(pose.x, pose.y, turned), _CROSSING_LENGTH_M, _WIDTH_M)
    us, vs = [u for u, _ in corners], [v for _, v in corners]
    long, wide = max(us) - min(us), max(vs) - min(vs)
    if wide > long:
        long, wide, turned = wide, long, turned + math.pi / 2
    return Crosswalk(Pose(pose.x, pose.y, turned), long, min(max(wide, _LEAST_WIDTH_M), _MOST_WIDTH_M))


def _away(crosswalk: Crosswalk, crossing: Crossing) -> float:
    """Return the distance of a crosswalk from a crossing along its road, m; infinite for a crossing of another arm."""
    (x0, y0), (x1, y1) = crossing.lane.shape[0], crossing.lane.shape[-1]
    heading = crosswalk.pose.heading_rad
    turned = abs(wrap(math.atan2(y1 - y0, x1 - x0) - heading))
    dx, dy = (x0 + x1) / 2 - crosswalk.pose.x, (y0 + y1) / 2 - crosswalk.pose.y
    over_m = abs(dx * math.cos(heading) + dy * math.sin(heading))
    if min(turned, math.pi - turned) > _SAME_ANGLE_RAD or over_m > crosswalk.length_m / 2:
        return math.inf
    return abs(dy * math.cos(heading) - dx * math.sin(heading))


def _moved(crossing: Crossing, crosswalk: Crosswalk) -> dict[str, str]:
    """Return the attributes of a `<crossing>` that is moved along its road to the crosswalk."""
    (x0, y0), (x1, y1) = crossing.lane.shape[0], crossing.lane.shape[-1]
    across = math.atan2(y1 - y0, x1 - x0)
    dx, dy = crosswalk.pose.x - (x0 + x1) / 2, crosswalk.pose.y - (y0 + y1) / 2
    along_m = dy * math.cos(across) - dx * math.sin(across)
    mx, my = -along_m * math.sin(across), along_m * math.cos(across)
    return {
        "node": crossing.junction,
        "edges": " ".join(crossing.edges),
        "width": f"{crosswalk.width_m:.2f}",
        "shape": f"{x0 + mx:.2f},{y0 + my:.2f} {x1 + mx:.2f},{y1 + my:.2f}",
    }
