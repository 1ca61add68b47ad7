"""Mirrors maps and nets with traffic on the left, so that netconvert can treat them as maps with traffic on the
right."""

from __future__ import annotations

from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import number

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
