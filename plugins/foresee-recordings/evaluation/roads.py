"""How well a network fits: the recorded vehicles against its lanes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import shapely
from foresee_recordings.maps.matching import route_of
from foresee_recordings.recording import RecordedMap, Track

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork

_ON_ROADS = ("car", "van", "truck", "bus", "motorcycle")


def network_of(roads: RecordedMap) -> RoadNetwork:
    """Return the network as a scenario gets it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"roads{roads.suffix}"
        file.write_text(roads.text, encoding="utf-8")
        return read_network(foreign_net(file))


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
