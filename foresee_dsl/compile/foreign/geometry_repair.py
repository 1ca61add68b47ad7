"""Repairs faults of a net's lines where that is safe, and closes the lanes and connections with other faults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element, SubElement  # no parsing: that is safe_xml's

from foresee_dsl.compile.foreign.geometry_faults import CheckedGeometry, GeometryFault
from foresee_dsl.compile.foreign.geometry_lines import Centrelines
from foresee_dsl.compile.nets.net_reader import FAULT, points_of, topology_of
from foresee_dsl.compile.roads.topology import Topology

REPAIRED = "foresee.repaired"
"""Key of the `<param>` of a changed lane, or of one with a changed connection; its value states the repaired fault."""


@dataclass(frozen=True)
class Geometry:
    """The faults of a net's lines that were repaired, and the remaining ones, which are closed to all traffic.

    Each fault is a phrase such as `lane 4_0 turns by 163 degrees within 0.9 m at (3.0 m, 4.5 m)`.
    """

    repaired: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """True if there were faults."""
        return bool(self.repaired or self.broken)


def repair_geometry(root: Element, net: Topology | None = None) -> Geometry:
    """Round corners of lanes, lead connections smoothly, and close faulty places that remain; only these places change.

    A lane stays within its old band. A connection stays within its junction's area, and connects the same lanes; if
    there is no room for it, the junction extends into the lanes by up to some metres. Lanes and connections that
    remain faulty get a parameter with the reason; the lanes are closed, and routes do not use the connections.

    `net`: the tree's topology, if the caller has it.
    """
    net = topology_of(root) if net is None else net
    checked = CheckedGeometry.of(net)
    if not checked.faults:
        return Geometry()
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    lines = Centrelines(net)
    repaired = [fault for fault in checked.faults if not fault.to and lines.round_corners(fault.lane)]
    if repaired:
        checked = checked.again(_with_lines(net, lanes, lines.write(lanes)))
        lines = Centrelines(checked.net)
    ways = {movement.ends: movement for movement in net.movements}
    for fault in checked.faults:
        if fault.to and lines.lead(ways[fault.lane, fault.to]):
            repaired.append(fault)
    broken = checked.again(_with_lines(checked.net, lanes, lines.write(lanes))).faults
    for fault in repaired:
        SubElement(lanes[fault.lane], "param", {"key": REPAIRED, "value": fault.where})
    _close(root, lanes, broken)
    return Geometry(tuple(fault.where for fault in repaired), tuple(fault.where for fault in broken))


def _with_lines(net: Topology, elements: Mapping[str, Element], changed: Iterable[str]) -> Topology:
    """Return a net in which the changed lanes have the lines that the tree has now."""
    new = {
        name: replace(
            net.lanes[name],
            shape=points_of(elements[name].attrib["shape"]),
            length_m=float(elements[name].attrib["length"]),
        )
        for name in changed
    }
    edges = {lane.edge for lane in new.values()} & net.edges.keys()
    moved = {
        name: replace(net.edges[name], lanes=tuple(new.get(lane.id, lane) for lane in net.edges[name].lanes))
        for name in edges
    }
    return replace(net, lanes={**net.lanes, **new}, edges={**net.edges, **moved})


def geometry_of(root: Element) -> Geometry:
    """Return the faults that `repair_geometry` has written into a net's tree."""
    values: dict[str, list[str]] = {REPAIRED: [], FAULT: []}
    for param in root.iter("param"):
        if param.get("key") in values:
            values[param.get("key", "")].append(param.get("value", ""))
    return Geometry(tuple(dict.fromkeys(values[REPAIRED])), tuple(values[FAULT]))


def _close(root: Element, lanes: dict[str, Element], broken: Sequence[GeometryFault]) -> None:
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
