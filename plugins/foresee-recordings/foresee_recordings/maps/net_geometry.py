"""Gives the lanes of a net the lines of the map.

netconvert 1.28 cuts the lines of lanes at the borders that it computes for junctions, also lines that are given. Short
lanes disappear, and lanes that end beside each other run back and forth; so the lines are written again afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np
import shapely

from foresee_dsl.compile.templates import number, polyline
from foresee_recordings.maps.conflicts import Stream
from foresee_recordings.maps.junctions import Layout, Road, Way
from foresee_recordings.maps.lanes import at_shares, without_repeats
from foresee_recordings.recording import FloatArray

_TRIM_M = 0.1
"""Length by which a lane's ends are shortened, m. Ours: the lane between two lanes that touch then has a direction."""
_LEAST_M = 1.0
"""Lanes shorter than this keep half of their length, m (ours)."""
_CLOSE_M = 1.0
"""Half of the widest gap between lanes inside a junction that belongs to the junction, m. Ours: the islands of
intersections are wider."""

_STRAIGHT_M = 0.005
"""Points that change a line by less than this are left out, m. Ours: less than the lines' accuracy."""

Points = Callable[[FloatArray], FloatArray]
"""Moves points of the map to the network."""


def set_lines(root: Element, layout: Layout, move: Points) -> list[Stream]:
    """Write the lines of a layout into the net that netconvert made of it, and return the ways through junctions."""
    lanes = {lane.get("id", ""): lane for lane in root.iterfind("edge/lane")}
    ends: dict[tuple[str, int], FloatArray] = {}
    for road in layout.roads:
        ends |= _set_road(lanes, road, move)
    via = {_key(element): element.get("via", "") for element in root.iterfind("connection") if element.get("via")}
    bands: dict[int, list[shapely.Geometry]] = {}
    roads = {road.id: road for road in layout.roads}
    streams = []
    for way in layout.ways:
        line = without_repeats(_line(way, ends, move))
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


def _set_road(lanes: Mapping[str, Element], road: Road, move: Points) -> dict[tuple[str, int], FloatArray]:
    """Write the lines of a road's lanes, and return the lines by edge and index."""
    lines = {(road.id, k): _trimmed(move(lane.centre)) for k, lane in enumerate(road.lanes)}
    length = number(float(np.mean([_length(line) for line in lines.values()])))
    for (edge, index), line in lines.items():
        element = lanes[f"{edge}_{index}"]
        element.set("shape", _shape(line))
        element.set("length", length)  # the lanes of one edge have one length in SUMO
    return lines


def _line(way: Way, ends: Mapping[tuple[str, int], FloatArray], move: Points) -> FloatArray:
    """Return the line from the end of a way's first lane to the beginning of its last one."""
    between = [] if way.shape is None else [move(way.shape)]
    return np.concatenate([ends[way.start][-1:], *between, ends[way.end][:1]])


def _chain(way: Way, via: Mapping[tuple[str, int, str, int], str]) -> list[str]:
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
        lane.set("length", number(max(_length(piece), 0.01)))


def _outline(bands: list[shapely.Geometry]) -> list[tuple[float, float]]:
    """Return the outline of the lanes inside a junction, without gaps; an open ring."""
    area = shapely.union_all(bands).buffer(_CLOSE_M, join_style="mitre").buffer(-_CLOSE_M, join_style="mitre")
    largest = max(shapely.get_parts(area), key=lambda part: part.area)
    return [(float(x), float(y)) for x, y in largest.exterior.coords[:-1]]


def _trimmed(line: FloatArray) -> FloatArray:
    """Return a line with its ends shortened."""
    length_m = _length(line)
    share = min(_TRIM_M, 0.25 * min(length_m, _LEAST_M)) / length_m
    own = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T)))) / length_m
    return at_shares(line, np.concatenate(([share], own[(own > share) & (own < 1 - share)], [1 - share])))


def _shape(line: FloatArray) -> str:
    return polyline((float(x), float(y)) for x, y in simplified(line))


def simplified(line: FloatArray) -> FloatArray:
    """Return a line without the points that lie between others."""
    simple: FloatArray = shapely.get_coordinates(shapely.LineString(line).simplify(_STRAIGHT_M))
    return simple


def _length(line: FloatArray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _width(lane: Element) -> float:
    return float(lane.get("width", "3.2"))  # SUMO's default


def _key(element: Element) -> tuple[str, int, str, int]:
    get = element.get
    return get("from", ""), int(get("fromLane", "0")), get("to", ""), int(get("toLane", "0"))
