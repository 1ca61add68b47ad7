"""Pedestrian crossings of an OpenStreetMap extract, added by this tool for extracts on which netconvert crashes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element, SubElement, tostring  # no parsing: that is safe_xml's

from foresee_dsl.compile.roads.polyline import XY, distance_to
from foresee_dsl.compile.roads.topology import Edge, Topology

_FROM_JUNCTION_M = 25.0
"""Largest distance of a crossing from its junction, m (ours: with four lanes, stop lines are 15 m from the centre)."""
_BESIDE_M = 6.0
"""Largest distance of a crossing's node from the middle of its street, m (ours: for a street with a median)."""
_LEAST_JUNCTIONS = 3


def crossings_of(root: Element, net: Topology) -> bytes | None:
    """Return netconvert's input that adds an extract's crossings to the net made from it; None if there are none.

    Each is placed at the arm of a junction; arms that have a crossing, or no sidewalk near, get none.
    """
    places = list(_places(root, net))
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


def _places(root: Element, net: Topology) -> Iterator[XY]:
    """Yield the places of the crossings, m, derived from the junctions that have the id of a node.

    Within an extract, UTM coordinates are linear in longitude and latitude, up to some decimetres.
    """
    import numpy as np

    degrees: dict[str, tuple[float, float]] = {}
    crossings = []
    for node in root.iterfind("node"):
        try:
            at = float(node.get("lon", "nan")), float(node.get("lat", "nan"))
        except ValueError:
            continue
        if not all(map(math.isfinite, at)):
            continue
        degrees[node.get("id", "")] = at
        if any(tag.get("k") == "highway" and tag.get("v") == "crossing" for tag in node.iterfind("tag")):
            crossings.append(at)
    pairs = [(degrees[name], (junction.x, junction.y)) for name, junction in net.junctions.items() if name in degrees]
    if len(pairs) < _LEAST_JUNCTIONS or not crossings:
        return
    middle = np.mean([at for at, _ in pairs], axis=0)
    rows = np.array([(*(np.array(at) - middle), 1.0) for at, _ in pairs])
    to_metres, *_ = np.linalg.lstsq(rows, np.array([xy for _, xy in pairs]), rcond=None)
    for at in crossings:
        x, y = np.array((*(np.array(at) - middle), 1.0)) @ to_metres
        yield float(x), float(y)


def _arm(net: Topology, place: XY) -> tuple[str, tuple[Edge, ...]] | None:
    """Return the junction, and the edges of its arm, to which a crossing belongs."""
    best: tuple[float, str, tuple[Edge, ...]] | None = None
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
