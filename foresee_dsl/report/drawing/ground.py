"""The ground of a road network as layers of areas and lines in metres."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely

from foresee_dsl.compile.bundle import SlipperyPatch
from foresee_dsl.compile.roads.network import CLOSE_GAPS_M, RoadNetwork, polygon
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.language.streets.lines import shift_right

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Bounds = tuple[float, float, float, float]
"""Left, bottom, right and top, m."""

Near = Callable[[Sequence[tuple[float, float]], float], bool]
"""A function that returns whether a shape is in the picture. Its arguments are the shape's points and the width, m, by
which the shape extends beyond its points."""

ZEBRA_M = 0.6
"""Width of a crossing's bars, and of the gaps between them, m. Ours: German bars are 0.5 m wide, which is too thin for
small pictures."""


class Layer(StrEnum):
    """Kinds of areas and lines on the ground, in the order in which they are drawn."""

    FOOTWAY = "footway"
    ROAD = "road"
    CYCLEWAY = "cycleway"
    PARKING = "parking"
    BUS_STOP = "bus_stop"
    MARKING = "marking"
    EDGE_LINE = "edge_line"
    CROSSING = "crossing"
    STOP_LINE = "stop_line"
    SLIPPERY = "slippery"
    BUILDING = "building"


LINES = (Layer.MARKING, Layer.EDGE_LINE, Layer.STOP_LINE)
"""Layers that consist of lines; all other layers consist of areas."""
_FAST_MPS = 80 / 3.6 - 0.01
"""Roads with at least this speed limit have solid lines at their edges, m/s. Ours, after Germany's roads outside towns,
which have such lines (guideline RMS) and a limit of 100 km/h, or 80 km/h on narrow roads."""
_SAME_LINE_M = 1.0
"""If the left sides of a road's two directions are nearer to each other than this, they share a middle line, m. Ours: a
median is wider."""
_INSIDE_M = 0.25
"""Distance of an edge line from the side of its lane, m. Ours: the line must be visible apart from the verge."""
Ground = Mapping[Layer, "BaseGeometry"]


def within(bounds: Bounds) -> Near:
    """Return a test of whether the bounding box of points, widened by a width, overlaps `bounds`."""
    left, bottom, right, top = bounds

    def near(points: Sequence[tuple[float, float]], wide_m: float) -> bool:
        if not points:
            return False
        xs, ys = zip(*points, strict=True)
        beside = min(xs) - wide_m > right or max(xs) + wide_m < left
        return not (beside or min(ys) - wide_m > top or max(ys) + wide_m < bottom)

    return near


def with_patches(ground: Ground, patches: Sequence[SlipperyPatch]) -> Ground:
    """Return the ground with slippery patches on it, if there are any."""
    if not patches:
        return ground
    rounds = [shapely.Point(patch.x, patch.y).buffer(patch.radius_m) for patch in patches]
    return {**ground, Layer.SLIPPERY: shapely.union_all(rounds)}


def ground_of(network: RoadNetwork, near: Near) -> Ground:
    """Return the ground of those parts of a network for which `near` is true. Shapes are not clipped, so they may
    extend beyond the picture.
    """
    lanes = [lane for lane in network.lanes.values() if near(lane.shape, lane.width_m)]
    crossing_ids = {crossing.lane.id for crossing in network.crossings.values()}
    areas = [area.polygon for area in network.walking_areas.values() if near(area.polygon, 0.0)]
    walked = [
        lane
        for lane in lanes
        if lane.kinds == {"pedestrian"} and lane.id not in crossing_ids and lane.edge not in network.walking_areas
    ]
    streets = [lane for lane in lanes if "car" in lane.kinds and not lane.internal]
    stops = [stop.outline for stop in network.stops.values() if near(stop.outline, 0.0)]
    divided, edge_lines = _edge_lines(network, streets)
    signalled = {m.from_lane for m in network.movements if m.tls is not None}
    return {
        Layer.FOOTWAY: shapely.union_all([*map(polygon, areas), *map(_band, walked)]),
        Layer.ROAD: _road(network, lanes, areas, near),
        Layer.CYCLEWAY: shapely.union_all(
            [_band(ln) for ln in lanes if "bicycle" in ln.kinds and "car" not in ln.kinds]
        ),
        Layer.PARKING: shapely.union_all([_band(lane) for lane in lanes if lane.parking]),
        Layer.BUS_STOP: shapely.union_all(list(map(polygon, stops))),
        Layer.MARKING: shapely.union_all(
            [shapely.LineString(line) for line in _between(streets, divided)]
        ),  # each junction and lane is drawn once
        Layer.EDGE_LINE: shapely.MultiLineString([line for line in edge_lines if len(line) > 1]),
        Layer.CROSSING: shapely.union_all([_band(lane) for lane in lanes if lane.id in crossing_ids]),
        Layer.STOP_LINE: shapely.MultiLineString([stop_line(lane) for lane in streets if lane.id in signalled]),
        Layer.BUILDING: shapely.union_all([polygon(b) for b in network.buildings if near(b, 0.0)]),
    }


def zebra(crossing: BaseGeometry) -> BaseGeometry:
    """Return the bars of crossings, which are parallel to the vehicles' direction."""
    bars = []
    for part in shapely.get_parts(crossing):
        box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(part))
        if len(box) < 4:
            continue
        a, b = box[1] - box[0], box[2] - box[1]
        way, side = (a, b) if np.hypot(*a) >= np.hypot(*b) else (b, a)
        corner = box[0] if np.hypot(*a) >= np.hypot(*b) else box[1]
        length = float(np.hypot(*way))
        for k in range(math.ceil(length / (2 * ZEBRA_M))):
            from_, to = (min(m, length) / length for m in (2 * k * ZEBRA_M, (2 * k + 1) * ZEBRA_M))
            start, end = corner + from_ * way, corner + to * way
            bars.append(shapely.intersection(shapely.Polygon([start, end, end + side, start + side]), part))
    return shapely.GeometryCollection([bar for bar in bars if not bar.is_empty])


def rings_of(shape: BaseGeometry) -> Iterator[FloatArray]:
    """Yield the outlines and holes of all polygons in a shape, without the repeated last point."""
    for part in _flat(shape):
        if isinstance(part, shapely.Polygon):
            for ring in (part.exterior, *part.interiors):
                yield shapely.get_coordinates(ring)[:-1]


def lines_of(shape: BaseGeometry) -> Iterator[FloatArray]:
    """Yield the points of all lines in a shape; polygons give their outlines."""
    for part in _flat(shape):
        if isinstance(part, shapely.Polygon):
            yield from (shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors))
        elif isinstance(part, shapely.LineString):
            yield shapely.get_coordinates(part)


def _flat(shape: BaseGeometry) -> Iterator[BaseGeometry]:
    for part in shapely.get_parts(shape):
        if hasattr(part, "geoms"):
            yield from _flat(part)
        else:
            yield part


def _road(network: RoadNetwork, lanes: Sequence[Lane], areas: Sequence[Points], near: Near) -> BaseGeometry:
    """Return the area on which vehicles may be, as in `RoadNetwork.drivable`, but only where `near` is true."""
    junctions = shapely.union_all([polygon(j.polygon) for j in network.junctions.values() if near(j.polygon, 0.0)])
    bands = [_band(lane) for lane in lanes if "car" in lane.kinds or lane.parking or lane.strip]
    road = shapely.union_all([shapely.difference(junctions, shapely.union_all(list(map(polygon, areas)))), *bands])
    return shapely.buffer(shapely.buffer(road, CLOSE_GAPS_M, join_style="mitre"), -CLOSE_GAPS_M)


def _between(lanes: Iterable[Lane], divided: frozenset[str]) -> Iterable[FloatArray]:
    """Yield the left sides of lanes, which are lines between two lanes or middle lines of roads, except those of the
    lanes `divided`.
    """
    for lane in lanes:
        if lane.id not in divided and len(side := _side(lane, -1)) > 1:
            yield side


def _side(lane: Lane, sign: int, inside_m: float = 0.0) -> FloatArray:
    """Return the left (`sign` -1) or right (1) side of a lane, moved `inside_m` towards the lane's middle.

    A lane of length zero has a side with fewer than two points.
    """
    apart = [lane.shape[0], *(b for a, b in pairwise(lane.shape) if a != b)]
    moved_m = sign * (lane.width_m / 2 - inside_m)
    return np.array(shift_right(apart, moved_m)) if len(apart) > 1 else np.empty((0, 2))


def _edge_lines(network: RoadNetwork, streets: Sequence[Lane]) -> tuple[frozenset[str], list[FloatArray]]:
    """Return the ids of the lanes whose left side is the edge of a divided road, and the solid lines at the edges of
    roads.

    Fast roads and roads with a shoulder have solid lines at their edges.
    """
    by_edge: dict[str, list[Lane]] = {}
    for lane in streets:
        by_edge.setdefault(lane.edge, []).append(lane)
    fast = {
        edge: sorted(lanes, key=lambda lane: lane.index)
        for edge, lanes in by_edge.items()
        if lanes[0].speed_mps >= _FAST_MPS or _has_shoulder(network, edge)
    }
    inner = [lanes[-1] for lanes in fast.values() if len(_side(lanes[-1], -1)) > 1]
    tree = shapely.STRtree([shapely.LineString(_side(lane, -1)) for lane in inner])
    divided = []
    for k, lane in enumerate(inner):
        middle = tree.geometries[k].interpolate(0.5, normalized=True)
        if {*tree.query(middle, "dwithin", _SAME_LINE_M).tolist()} <= {k}:
            divided.append(lane)
    right = [_side(lanes[0], 1, _INSIDE_M) for lanes in fast.values()]
    return frozenset(lane.id for lane in divided), [*right, *(_side(lane, -1, _INSIDE_M) for lane in divided)]


def _has_shoulder(network: RoadNetwork, edge: str) -> bool:
    return any(ln.strip and not ln.kinds and not ln.parking for ln in network.edges[edge].lanes)


def stop_line(lane: Lane) -> FloatArray:
    """Return the line across a lane at its end."""
    x, y, heading = lane.line.at(lane.line.length_m)
    aside_x, aside_y = -math.sin(heading) * lane.width_m / 2, math.cos(heading) * lane.width_m / 2
    return np.array(((x + aside_x, y + aside_y), (x - aside_x, y - aside_y)))


def _band(lane: Lane) -> BaseGeometry:
    return shapely.buffer(shapely.LineString(lane.shape), lane.width_m / 2, cap_style="flat", quad_segs=4)
