"""How well a network fits: its lanes against the map's, and the recorded vehicles against its lanes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import shapely
from foresee_recordings.maps.lanes import LaneMap
from foresee_recordings.maps.matching import route_of
from foresee_recordings.recording import FloatArray, RecordedMap, Track

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.roads.network import RoadNetwork

_STEP_M = 2.0
"""Distance of the measured places along a lane, m."""
_REACH_M = 9.0
"""Larger distances count as this, m."""
_ALONG_RAD = np.radians(45)
_ON_ROADS = ("car", "van", "truck", "bus", "motorcycle")


def network_of(roads: RecordedMap) -> RoadNetwork:
    """Return the network as a scenario gets it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"roads{roads.suffix}"
        file.write_text(roads.text, encoding="utf-8")
        return RoadNetwork.from_net(foreign_net(file))


def lane_distances(lane_map: LaneMap, roads: RecordedMap, network: RoadNetwork) -> FloatArray:
    """Return the distance of places on the map's centre lines to the nearest lane in their direction, m."""
    lines = [lane.centreline for lane in network.lanes.values() if lane.kinds or lane.strip]
    tree = shapely.STRtree(lines)
    distances = []
    for lane in lane_map.lanes.values():
        line = shapely.LineString(lane.centre + np.array(roads.offset))
        for s in np.linspace(0.0, line.length, max(int(line.length / _STEP_M), 1) + 1):
            point, heading = line.interpolate(s), _heading(line, s)
            near = [lines[k] for k in tree.query(point, predicate="dwithin", distance=_REACH_M)]
            turns = [_turn(_heading(other, other.project(point)) - heading) for other in near]
            along = [other.distance(point) for other, turn in zip(near, turns, strict=True) if turn < _ALONG_RAD]
            distances.append(min(along, default=_REACH_M))
    return np.array(distances)


def vehicles_on_lanes(tracks: Iterable[Track], roads: RecordedMap, network: RoadNetwork) -> tuple[float, float]:
    """Return the share of samples of vehicles whose centre is on a lane, and the share of vehicles with a route."""
    bands = [
        shapely.LineString(lane.shape).buffer(lane.width_m / 2)
        for lane in network.lanes.values()
        if lane.kinds - {"pedestrian"}
    ]
    tree = shapely.STRtree(bands)
    on_lane = samples = routes = vehicles = 0
    for track in tracks:
        if track.kind in _ON_ROADS:
            points = shapely.points(track.states[:, :2] + np.array(roads.offset))
            on_lane += len(np.unique(tree.query(points, predicate="intersects")[0]))
            samples += len(points)
            routes += bool(route_of(track, network, roads.offset))
            vehicles += 1
    return on_lane / max(samples, 1), routes / max(vehicles, 1)


def _turn(angle: float) -> float:
    return float(abs((angle + np.pi) % (2 * np.pi) - np.pi))


def _heading(line: shapely.LineString, s: float) -> float:
    ahead, behind = line.interpolate(min(s + 0.5, line.length)), line.interpolate(max(s - 0.5, 0.0))
    return float(np.arctan2(ahead.y - behind.y, ahead.x - behind.x))
