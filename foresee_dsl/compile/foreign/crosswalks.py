"""Places pedestrian crossings at the crosswalk objects of an OpenDRIVE map, which netconvert 1.28 does not read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement  # no parsing: that is safe_xml's

from foresee_dsl.compile.foreign.opendrive_geometry import Pose, RoadMap, number
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import Crossing, Topology
from foresee_dsl.errors import CompileError

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
_LENGTH_M, _WIDTH_M = 14.0, 2.5
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
    roads = RoadMap(root)
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


def _crosswalk(roads: RoadMap, road: Element, thing: Element) -> Crosswalk:
    s = min(max(number(thing, "s"), 0.0), number(road, "length"))
    beyond = number(thing, "s") - s  # CARLA has crosswalks up to 4 m behind the end of a road of 3 m
    pose = roads.at(road.get("id", ""), s, number(thing, "t"))
    pose = pose.ahead(beyond)
    turned = pose.heading_rad + number(thing, "hdg", 0.0)
    corners = [(number(c, "u"), number(c, "v")) for c in thing.iter("cornerLocal")]
    if not corners:
        return Crosswalk(Pose(pose.x, pose.y, turned), _LENGTH_M, _WIDTH_M)
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
