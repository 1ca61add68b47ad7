"""Gives the lanes of a net the lines of the map.

netconvert 1.28 cuts the lines of lanes at the borders that it computes for junctions, also lines that are given. Short
lanes disappear, and lanes that end beside each other run back and forth; so the lines are written again afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np
import shapely

from foresee_dsl.compile.templates import number, polyline
from foresee_recordings.maps.conflicts import Stream
from foresee_recordings.maps.joined_lines import Lines, Move, length_of, lines_of
from foresee_recordings.maps.junctions import LaneLink, Layout, Road
from foresee_recordings.maps.lanes import at_shares
from foresee_recordings.recording import FloatArray

_CLOSE_M = 1.0
"""Half of the widest gap between lanes inside a junction that belongs to the junction, m. Ours: the islands of
intersections are wider."""

_STRAIGHT_M = 0.005
"""Points that change a line by less than this are left out, m. Ours: less than the lines' accuracy."""


def set_lines(root: Element, layout: Layout, move: Move) -> list[Stream]:
    """Write the lines of a layout into the net that netconvert made of it, and return the ways through junctions."""
    lanes = {lane.get("id", ""): lane for lane in root.iterfind("edge/lane")}
    lines = lines_of(layout, move)
    for road in layout.roads:
        _set_road(lanes, road, lines)
    via = {_key(element): element.get("via", "") for element in root.iterfind("connection") if element.get("via")}
    bands: dict[int, list[shapely.Geometry]] = {}
    roads = {road.id: road for road in layout.roads}
    streams = []
    for way, line in lines.ways:
        chain = _chain(way, via)
        if len(line) < 2 or not all(id_ in lanes for id_ in chain) or not chain:
            continue
        _set_way([lanes[id_] for id_ in chain], line)
        road = roads[way.start[0]]
        streams.append(Stream(way, line, chain[-1], road.lanes[way.start[1]].way))
        width = max(_width(lanes[f"{edge}_{index}"]) for edge, index in (way.start, way.end))
        band = shapely.LineString(line).buffer(width / 2, cap_style="flat")
        bands.setdefault(road.end, []).append(band)
    for junction in root.iterfind("junction"):
        own = bands.get(int(name)) if (name := junction.get("id", "").removeprefix("j")).isdigit() else None
        if own:
            junction.set("shape", polyline(_outline(own)))
    return streams


def _set_road(lanes: Mapping[str, Element], road: Road, lines: Lines) -> None:
    """Write the lines of a road's lanes."""
    own = [lines.lanes[road.id, index] for index in range(len(road.lanes))]
    length = number(float(np.mean([length_of(line) for line in own])))
    for index, line in enumerate(own):
        element = lanes[f"{road.id}_{index}"]
        element.set("shape", _shape(line))
        element.set("length", length)  # the lanes of one edge have one length in SUMO


def _chain(way: LaneLink, via: Mapping[tuple[str, int, str, int], str]) -> list[str]:
    """Return the ids of the lanes inside the junction that a way uses: two if vehicles may wait in the middle."""
    chain: list[str] = []
    lane = via.get((*way.start, *way.end), "")
    while lane and lane not in chain:
        chain.append(lane)
        edge, _, index = lane.rpartition("_")
        lane = via.get((edge, int(index), *way.end), "")
    return chain


def _set_way(chain: list[Element], line: FloatArray) -> None:
    """Write a line into the lanes of a chain, divided as netconvert divides them."""
    lengths = np.array([max(float(lane.get("length", "0")), 0.01) for lane in chain])
    marks = np.concatenate(([0.0], np.cumsum(lengths) / lengths.sum()))
    own = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    own /= own[-1]
    for lane, begin, end in zip(chain, marks, marks[1:], strict=False):
        shares = np.concatenate(([begin], own[(own > begin) & (own < end)], [end]))
        piece = at_shares(line, shares)
        lane.set("shape", _shape(piece))
        lane.set("length", number(max(length_of(piece), 0.01)))


def _outline(bands: list[shapely.Geometry]) -> list[tuple[float, float]]:
    """Return the outline of the lanes inside a junction, without gaps; an open ring."""
    area = shapely.union_all(bands).buffer(_CLOSE_M, join_style="mitre").buffer(-_CLOSE_M, join_style="mitre")
    largest = max(shapely.get_parts(area), key=lambda part: part.area)
    return [(float(x), float(y)) for x, y in largest.exterior.coords[:-1]]


def _shape(line: FloatArray) -> str:
    return polyline((float(x), float(y)) for x, y in simplified(line))


def simplified(line: FloatArray) -> FloatArray:
    """Return a line without the points that lie between others."""
    simple: FloatArray = shapely.get_coordinates(shapely.LineString(line).simplify(_STRAIGHT_M))
    return simple


def _width(lane: Element) -> float:
    return float(lane.get("width", "3.2"))  # SUMO's default


def _key(element: Element) -> tuple[str, int, str, int]:
    get = element.get
    return get("from", ""), int(get("fromLane", "0")), get("to", ""), int(get("toLane", "0"))
