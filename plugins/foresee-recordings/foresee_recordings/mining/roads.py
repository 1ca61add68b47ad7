"""The road network of a recording, and the area that its actors drove on where it has none."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.report.drawing.ground import Ground, Layer, ground_of, within
from foresee_recordings.mining.traffic import Traffic, X, Y, spaced
from foresee_recordings.recording import Recording

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

LANE_M = 3.5
"""Width of the strip around each track that is drawn as a road, m. Ours: a usual lane."""


@lru_cache(maxsize=2)
def _network_of(text: str) -> RoadNetwork:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "roads.net.xml"
        file.write_text(text, encoding="utf-8")
        return RoadNetwork.from_net(file)


def network_of(recording: Recording) -> RoadNetwork | None:
    """Return the network of a recording's map; None without one, or for a map that only SUMO's tools read."""
    roads = recording.roads
    return _network_of(roads.text) if roads is not None and roads.suffix == ".net.xml" else None


def ground_around(traffic: Traffic, bounds: tuple[float, float, float, float]) -> Ground:
    """Return the ground within bounds (left, bottom, right, top, m in the recording's coordinates)."""
    network = network_of(traffic.recording)
    if network is None:
        return {Layer.ROAD: _driven(traffic).intersection(shapely.box(*bounds))}
    roads = traffic.recording.roads
    east, north = roads.offset if roads is not None else (0.0, 0.0)
    left, bottom, right, top = bounds
    ground = ground_of(network, within((left + east, bottom + north, right + east, top + north)))
    return {layer: shapely.transform(shape, lambda xy: xy - (east, north)) for layer, shape in ground.items()}


@lru_cache(maxsize=2)
def _driven(traffic: Traffic) -> BaseGeometry:
    """Return the area on which vehicles drove."""
    strips = []
    for k, track in enumerate(traffic.tracks):
        xy = traffic.part(k)[:, [X, Y]]
        at = spaced(xy)
        if len(at) > 1 and track.kind not in ("pedestrian", "obstacle"):
            strips.append(shapely.LineString(xy[at]).simplify(0.1).buffer(LANE_M / 2, cap_style="flat"))
    return shapely.union_all(strips)
