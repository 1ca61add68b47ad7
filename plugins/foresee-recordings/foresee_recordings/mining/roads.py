"""The road network of a recording, and the area that its actors drove on where it has none."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import shapely

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.compile.roads.network import RoadNetwork, buildings_of
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import load
from foresee_dsl.report.drawing.ground import Ground, Layer, ground_of, within
from foresee_recordings.mining.traffic import Traffic, X, Y, spaced
from foresee_recordings.recording import RecordedMap, RecordingError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

LANE_M = 3.5
"""Width of the strip around each track that is drawn as a road, m. Ours: a usual lane."""


def network_of(roads: RecordedMap) -> RoadNetwork:
    """Return the network of a recording's map, as a scenario that uses the map has it.

    Raises:
        ForeseeError: the map cannot be converted or simulated.
    """
    return _network_of(roads.text, roads.suffix)


@lru_cache(maxsize=2)
def _network_of(text: str, suffix: str) -> RoadNetwork:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"roads{suffix}"
        file.write_text(text, encoding="utf-8")
        if suffix != ".foresee":
            return read_network(foreign_net(file))
        model = load(file).model
        if not isinstance(model, m.Network):
            raise RecordingError("the map is not a network of the language")
        net = Path(folder) / "built.net.xml"
        build_network(model, net)
        return read_network(net, buildings_of(model))


def ground_around(traffic: Traffic, bounds: tuple[float, float, float, float]) -> Ground:
    """Return the ground within bounds (left, bottom, right, top, m in the recording's coordinates)."""
    roads = traffic.recording.roads
    if roads is None:
        return {Layer.ROAD: _driven(traffic).intersection(shapely.box(*bounds))}
    network, (east, north) = network_of(roads), roads.offset
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
