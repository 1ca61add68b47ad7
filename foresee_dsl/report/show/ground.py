"""The map around a run: roads, footways, crossings, parking strips, markings and buildings as shapes in metres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.language.streets.lines import shift_right

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

FloatArray = NDArray[np.float64]
Bounds = tuple[float, float, float, float]
"""Left, bottom, right and top, m."""

_CLOSE_GAPS_M = 0.3
"""As `RoadNetwork.drivable` closes them."""


class Layer(StrEnum):
    """What lies on the ground, in the order in which it is drawn."""

    FOOTWAY = "footway"
    ROAD = "road"
    PARKING = "parking"
    MARKING = "marking"
    CROSSING = "crossing"
    STOP_LINE = "stop_line"
    BUILDING = "building"


Ground = Mapping[Layer, "BaseGeometry"]


def ground_of(network: RoadNetwork, bounds: Bounds) -> Ground:
    """Return what lies on the ground of a network within bounds (and somewhat beyond)."""
    lanes = [lane for lane in network.lanes.values() if _near(lane.shape, bounds, lane.width_m)]
    crossing_ids = {crossing.lane.id for crossing in network.crossings.values()}
    areas = [area.polygon for area in network.walking_areas.values() if _near(area.polygon, bounds)]
    walked = [
        lane
        for lane in lanes
        if lane.kinds == {"pedestrian"} and lane.id not in crossing_ids and lane.edge not in network.walking_areas
    ]
    streets = [lane for lane in lanes if "car" in lane.kinds and not lane.internal]
    signalled = {m.from_lane for m in network.movements if m.tls is not None}
    return {
        Layer.FOOTWAY: shapely.union_all([*map(_polygon, areas), *map(_band, walked)]),
        Layer.ROAD: _road(network, lanes, areas, bounds),
        Layer.PARKING: shapely.union_all([_band(lane) for lane in lanes if lane.parking]),
        Layer.MARKING: shapely.union_all([shapely.LineString(line) for line in _between(streets)]),  # each once
        Layer.CROSSING: shapely.union_all([_band(lane) for lane in lanes if lane.id in crossing_ids]),
        Layer.STOP_LINE: shapely.MultiLineString([_stop_line(lane) for lane in streets if lane.id in signalled]),
        Layer.BUILDING: shapely.union_all([_polygon(b) for b in network.buildings if _near(b, bounds)]),
    }


def _road(network: RoadNetwork, lanes: Sequence[Lane], areas: Sequence[Points], bounds: Bounds) -> BaseGeometry:
    """Return where vehicles may be; as `RoadNetwork.drivable`, of a part of the map."""
    junctions = shapely.union_all([_polygon(j.polygon) for j in network.junctions.values() if _near(j.polygon, bounds)])
    bands = [_band(lane) for lane in lanes if "car" in lane.kinds or lane.parking]
    road = shapely.union_all([shapely.difference(junctions, shapely.union_all(list(map(_polygon, areas)))), *bands])
    return shapely.buffer(shapely.buffer(road, _CLOSE_GAPS_M, join_style="mitre"), -_CLOSE_GAPS_M)


def _between(lanes: Iterable[Lane]) -> Iterable[FloatArray]:
    """Yield the left sides of lanes: lines between two lanes, and middle lines of roads."""
    for lane in lanes:
        apart = [lane.shape[0], *(b for a, b in pairwise(lane.shape) if a != b)]
        if len(apart) > 1:
            yield np.array(shift_right(apart, -lane.width_m / 2))


def _stop_line(lane: Lane) -> FloatArray:
    """Return the line across a lane's end."""
    x, y, heading = lane.line.at(lane.line.length_m)
    aside_x, aside_y = -math.sin(heading) * lane.width_m / 2, math.cos(heading) * lane.width_m / 2
    return np.array(((x + aside_x, y + aside_y), (x - aside_x, y - aside_y)))


def _band(lane: Lane) -> BaseGeometry:
    return shapely.buffer(shapely.LineString(lane.shape), lane.width_m / 2, cap_style="flat", quad_segs=4)


def _polygon(points: Points) -> BaseGeometry:
    if len(points) < 3:
        return shapely.Polygon()
    return shapely.make_valid(shapely.Polygon(points))


def _near(points: Sequence[tuple[float, float]], bounds: Bounds, wide_m: float = 0.0) -> bool:
    """Say whether the box around points (and some width) touches bounds."""
    if not points:
        return False
    xs, ys = zip(*points, strict=True)
    left, bottom, right, top = bounds
    beside = min(xs) - wide_m > right or max(xs) + wide_m < left
    return not (beside or min(ys) - wide_m > top or max(ys) + wide_m < bottom)
