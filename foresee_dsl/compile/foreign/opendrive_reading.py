"""Reads OpenDRIVE maps, and rewrites parts that netconvert cannot read in an equivalent form."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement  # no parsing: that is safe_xml's

from foresee_dsl.compile.foreign.direct_junctions import join_directly
from foresee_dsl.compile.foreign.opendrive_geometry import number
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.errors import CompileError

_STRAIGHT = 1e-12
"""A curvature below this is treated as zero, 1/m (ours), because netconvert 1.28 divides by it."""
_SHORTEST_M = 1e-6
"""Shorter pieces of a reference line have no direction, m (ours)."""


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
