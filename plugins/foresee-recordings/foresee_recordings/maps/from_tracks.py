"""Guesses roads from the tracks of vehicles, for recordings without a map: a road of one lane along each track."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from foresee_recordings.maps.joined_lines import length_of
from foresee_recordings.maps.lanes import Lane, LaneMap
from foresee_recordings.maps.network import network_of, usual_speed
from foresee_recordings.recording import FloatArray, RecordedMap, Recording, Track

_VEHICLES = ("car", "van", "truck", "bus", "motorcycle", "bicycle")
_SPACING_M = 2.0
"""Distance between the points of a road's line, m. Ours: recorded positions have a noise of some centimetres, which
turns a line by less than 5 degrees at this distance."""
_SHORTEST_M = 15.0
"""Vehicles that move less make no road, m. Ours: the length of some vehicles."""
_WIDTH_M, _BESIDE_M = 3.5, 1.0
"""Least width of a road, and room beside a vehicle on both sides together, m. Ours: a usual lane is 3.5 m wide, and
1 m wider than a truck."""
_BEYOND_M = 30.0
"""Length by which a road continues straight at both ends of its track, m. Ours: room to stop behind a goal."""
_SAME_M, _SAME_RAD, _SAME_SHARE = 1.0, np.radians(30), 0.95
"""A track makes no road of its own if this share of it is this near to an earlier road in the same direction (ours)."""
_OVERLAP_M = 10.0
"""Least length for which a track runs along a road that it makes longer, m (ours: two vehicles)."""
_MOST_ROADS = 300
"""Largest number of roads. Ours: more than the lanes of any intersection."""


class _Road(NamedTuple):
    """A road: points of its middle, m, [N, 2], and its width."""

    line: FloatArray
    width_m: float


def roads_of(recording: Recording) -> RecordedMap | None:
    """Return the roads of a recording, or roads that are guessed from its tracks; None if no vehicle moves."""
    return recording.roads or guessed_roads(recording.tracks)


def guessed_roads(tracks: Iterable[Track]) -> RecordedMap | None:
    """Return roads along the tracks of vehicles, the longest first; None if no vehicle moves.

    Tracks that run along an earlier road share it, and make it longer where they go on. The roads are not connected:
    vehicles that SUMO drives stay on the road of their track, and do not yield to vehicles on other roads.
    """
    tracks = tuple(tracks)
    lines = [(track, line) for track in tracks if track.kind in _VEHICLES and (line := _line(track)) is not None]
    lines.sort(key=lambda item: -length_of(item[1]))
    roads: list[_Road] = []
    for track, line in lines:
        if not any(_covers(_extended(road.line), line) for road in roads):
            _add(roads, _Road(line, max(_WIDTH_M, track.width_m + _BESIDE_M)))
    lanes = {str(k): _lane(str(k), _extended(road.line), road.width_m) for k, road in enumerate(roads[:_MOST_ROADS])}
    if not lanes:
        return None
    network = network_of(LaneMap(lanes), usual_speed(tracks), junctions=False)
    notes = (
        f"the recording has no map: {len(lanes)} roads are guessed from the tracks of {len(lines)} vehicles",
        "the guessed roads are not connected, so vehicles on different roads do not yield to each other",
    )
    return replace(network, notes=(*notes, *network.notes))


def _line(track: Track) -> FloatArray | None:
    """Return points along a track, at least `_SPACING_M` apart; None if it is too short."""
    points = [track.states[0, :2]]
    for place in track.states[1:, :2]:
        if np.hypot(*(place - points[-1])) >= _SPACING_M:
            points.append(place)
    line = np.array(points)
    return line if len(line) > 1 and length_of(line) >= _SHORTEST_M else None


def _add(roads: list[_Road], new: _Road) -> None:
    """Add a road, or make an earlier one longer, of which it is the beginning or the rest: a vehicle that follows
    another one in its lane is recorded on another stretch of it."""
    for k, road in enumerate(roads):
        longer = _joined(road.line, new.line)
        if longer is not None:
            roads[k] = _Road(longer, max(road.width_m, new.width_m))
            roads[k + 1 :] = [other for other in roads[k + 1 :] if not _covers(_extended(longer), other.line)]
            return
    roads.append(new)


def _joined(road: FloatArray, line: FloatArray) -> FloatArray | None:
    """Return a road's line together with what a track has before and behind it; None if one leaves the other."""
    centre = shapely.LineString(road)
    marks = shapely.line_locate_point(centre, np.asarray(shapely.points(line)))
    before, behind = marks <= 0.0, marks >= centre.length
    beside = ~(before | behind)
    if not beside.any() or np.ptp(marks[beside]) < _OVERLAP_M or not _covers(road, line[beside]):
        return None
    first, last = np.flatnonzero(beside)[[0, -1]]
    return np.vstack((line[:first][before[:first]], road, line[last + 1 :][behind[last + 1 :]]))


def _covers(road: FloatArray, line: FloatArray) -> bool:
    """Return whether a line, of at least two points, runs along a road."""
    if len(line) < 2:
        return False
    centre, points = shapely.LineString(road), np.asarray(shapely.points(line))
    if centre.distance(points[len(points) // 2]) >= _SAME_M:
        return False
    x, y = np.gradient(line, axis=0).T
    marks = shapely.line_locate_point(centre, points)
    ahead, behind = (shapely.get_coordinates(shapely.line_interpolate_point(centre, marks + d)) for d in (1, -1))
    along = ahead - behind
    turn = np.abs(np.arctan2(along[:, 0] * y - along[:, 1] * x, along[:, 0] * x + along[:, 1] * y))
    return bool(((shapely.distance(centre, points) < _SAME_M) & (turn < _SAME_RAD)).mean() >= _SAME_SHARE)


def _extended(line: FloatArray) -> FloatArray:
    """Return a line with a straight piece before and behind it."""
    k = min(len(line) - 1, 3)
    begin, end = line[0] - line[k], line[-1] - line[-1 - k]
    first = line[0] + begin / np.hypot(*begin) * _BEYOND_M
    last = line[-1] + end / np.hypot(*end) * _BEYOND_M
    return np.vstack((first, line, last))


def _lane(id_: str, centre: FloatArray, width_m: float) -> Lane:
    """Return a lane with borders beside a centre line."""
    along = np.gradient(centre, axis=0)
    aside = np.column_stack((-along[:, 1], along[:, 0])) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    return Lane(id_, centre + aside * width_m / 2, centre - aside * width_m / 2)
