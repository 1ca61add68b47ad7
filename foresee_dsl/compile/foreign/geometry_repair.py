"""Repairs what is wrong with the lines of a net where that is safe, and closes what stays wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement  # no parsing: that is safe_xml's

from foresee_dsl.compile.foreign.geometry_faults import Fault, faults_of
from foresee_dsl.compile.foreign.geometry_lines import Lines
from foresee_dsl.compile.nets.net_reader import FAULT, topology_of
from foresee_dsl.compile.nets.safe_xml import parse_net

REPAIRED = "foresee.repaired"
"""The key of the `<param>` of a lane that was changed, or whose connection was; its value says what was wrong."""


@dataclass(frozen=True)
class Geometry:
    """What was repaired in a net's lines, and what stays wrong and is closed to all traffic: a phrase for each place,
    such as `lane 4_0 turns by 163 degrees within 0.9 m at (3.0 m, 4.5 m)`."""

    repaired: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything was wrong."""
        return bool(self.repaired or self.broken)


def repair_geometry(root: Element) -> Geometry:
    """Round corners of lanes, lead connections smoothly, and close what stays broken; the tree changes only there.

    A lane stays within its old band. A connection stays within its junction's area, and leads from lane to lane as
    before; where there is no room for it, the junction grows into the lanes by up to some metres. Lanes and
    connections that stay broken get a parameter that says why; the lanes are closed, and no route leads over the
    connections.
    """
    net = topology_of(root)
    faults = faults_of(net)
    if not faults:
        return Geometry()
    lines = Lines(net)
    repaired = [fault for fault in faults if not fault.to and lines.round_corners(fault.lane)]
    if repaired:
        lines.write(root)
        net = topology_of(root)
        lines = Lines(net)
    ways = {movement.ends: movement for movement in net.movements}
    for fault in faults_of(net):
        if fault.to and lines.lead(ways[fault.lane, fault.to]):
            repaired.append(fault)
    lines.write(root)
    broken = faults_of(topology_of(root))
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    for fault in repaired:
        SubElement(lanes[fault.lane], "param", {"key": REPAIRED, "value": fault.where})
    _close(root, lanes, broken)
    return Geometry(tuple(fault.where for fault in repaired), tuple(fault.where for fault in broken))


def geometry_of(net_file: Path) -> Geometry:
    """Return what `repair_geometry` has written into a net."""
    found: dict[str, list[str]] = {REPAIRED: [], FAULT: []}
    for param in parse_net(net_file).iter("param"):
        if param.get("key") in found:
            found[param.get("key", "")].append(param.get("value", ""))
    return Geometry(tuple(dict.fromkeys(found[REPAIRED])), tuple(found[FAULT]))


def _close(root: Element, lanes: dict[str, Element], broken: Sequence[Fault]) -> None:
    connections = {
        (f"{c.get('from')}_{c.get('fromLane')}", f"{c.get('to')}_{c.get('toLane')}"): c
        for c in root.iterfind("connection")
    }
    for fault in broken:
        place = connections[fault.lane, fault.to] if fault.to else lanes[fault.lane]
        SubElement(place, "param", {"key": FAULT, "value": fault.where})
        if not fault.to:
            place.attrib.pop("allow", None)
            place.set("disallow", "all")
