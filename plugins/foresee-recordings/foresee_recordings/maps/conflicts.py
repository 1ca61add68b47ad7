"""Adds to a net the conflicts between ways through a junction that netconvert does not see.

netconvert 1.28 derives conflicts from the order of the edges around a junction, not from the lines of its lanes. In
large junctions, whose edges do not lie around one point, it misses some: 28 of the 127 pairs of ways that cross or
merge on INTERACTION's map DR_USA_Intersection_GL.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np
import shapely

from foresee_recordings.maps.junctions import LaneLink
from foresee_recordings.maps.lanes import RightOfWay
from foresee_recordings.recording import FloatArray

_RANKS: Mapping[RightOfWay, int] = {"priority": 2, "": 1, "yield": 0, "stop": 0}
_STRAIGHT_RAD = np.radians(20)
"""A way that turns by this much more than another one yields to it. Ours: curved roads go straight on."""


@dataclass(frozen=True)
class Stream:
    """A way through a junction: its line in the network, [N, 2] m, its last lane inside, and the rule at its start."""

    way: LaneLink
    line: FloatArray
    lane: str
    rule: RightOfWay

    @property
    def directions(self) -> tuple[FloatArray, FloatArray]:
        """The directions in which it begins and ends, [2] each."""
        return self.line[1] - self.line[0], self.line[-1] - self.line[-2]

    @property
    def turn_rad(self) -> float:
        """The angle by which it turns."""
        return abs(_angle(*self.directions))


def add_conflicts(root: Element, streams: Iterable[Stream]) -> int:
    """Add the missing conflicts to the right-of-way matrices, and return their number."""
    by_lane = {stream.lane: stream for stream in streams}
    added = 0
    for junction in root.iterfind("junction"):
        inner = junction.get("intLanes", "").split()
        own = {index: by_lane[lane] for index, lane in enumerate(inner) if lane in by_lane}
        requests = {int(request.get("index", "-1")): request for request in junction.iterfind("request")}
        if len(own) > 1:
            added += _add(own, requests)
    return added


def _add(own: Mapping[int, Stream], requests: Mapping[int, Element]) -> int:
    indices = [index for index in own if index in requests]
    if len(indices) < 2:
        return 0
    lines = [shapely.LineString(own[index].line) for index in indices]
    crossing = {(int(a), int(b)) for a, b in shapely.STRtree(lines).query(lines, predicate="crosses").T if a < b}
    ends = {(a, b) for a in range(len(indices)) for b in range(a) if _merge(own[indices[a]].way, own[indices[b]].way)}
    added = 0
    for a, b in sorted(crossing | ends):
        first, other = indices[a], indices[b]
        if own[first].way.start == own[other].way.start or _bit(requests[first], "foes", other):
            continue
        added += 1
        _set(requests[first], "foes", other)
        _set(requests[other], "foes", first)
        yields, goes = (first, other) if _yields(own[first], own[other]) else (other, first)
        _set(requests[yields], "response", goes)
    return added


def _merge(way: LaneLink, other: LaneLink) -> bool:
    return way.end == other.end and way.start != other.start


def _yields(stream: Stream, other: Stream) -> bool:
    """Return whether a stream yields to another one: by signs, then to one that turns less, then to the right."""
    if _RANKS[stream.rule] != _RANKS[other.rule]:
        return _RANKS[stream.rule] < _RANKS[other.rule]
    more = stream.turn_rad - other.turn_rad
    if abs(more) > _STRAIGHT_RAD:
        return more > 0
    return _angle(stream.directions[0], other.directions[0]) > 0  # the other one comes from the right


def _angle(direction: FloatArray, other: FloatArray) -> float:
    """Return the angle from one direction to another, rad, left positive."""
    cross = direction[0] * other[1] - direction[1] * other[0]
    return float(np.arctan2(cross, direction @ other))


def _bit(request: Element, name: str, index: int) -> bool:
    text = request.get(name, "")
    return index < len(text) and text[-1 - index] == "1"


def _set(request: Element, name: str, index: int) -> None:
    text = request.get(name, "")
    if index < len(text):
        place = len(text) - 1 - index
        request.set(name, f"{text[:place]}1{text[place + 1 :]}")
