"""The ground of a whole map as one picture. It is drawn once; the picture of a step only reads pixels of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.language.streets.lines import shift_right
from foresee_learned.rasters.fill import filled, toggle_outlines
from foresee_learned.rasters.layout import MAP_BITS

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


M_PER_PX = 0.25
"""Side of a map's pixel, m. Ours: half of a pixel of the bird's-eye view, so that the error of sampling is at most 0.18
m."""
MARKING_M = 0.5
"""Width of markings and lane centres in pictures, m. Ours: painted lines are 0.12 to 0.25 m wide and would be missed by
pixels of 0.5 m."""
ROUTE_M = 1.5
"""Width of the route, m. Ours: half a lane, so that it differs from the lane centres."""
_MARGIN_M = 25.0
"""Margin of the map around the lanes, m. Ours: a run ends (off the road) long before its ego is this far away."""
_MAX_PX = 64_000_000
"""Largest number of pixels of a map, one byte each: 4 km^2. A larger map gets larger pixels (ours: 64 MB in each worker
process)."""
_FRACTION = 12
"""Number of fractional bits of a coordinate (fixed point, in pixels) while the map is sampled. The rest of the 32
bits is enough for a map 500,000 pixels wide; the error at the corners of a picture of 200 pixels is 0.03 of a map's
pixel."""

_drawn_maps: WeakKeyDictionary[object, GroundMap] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class GroundMap:
    """The ground of a network, as bits for each pixel.

    Attributes:
        bits: [H, W] uint8, row 0 in the north: bit k is set where the ground is `MAP_BITS[k]`.
        west_m, north_m: the outer corner of pixel (0, 0).
        m_per_px: side of a pixel.
    """

    bits: NDArray[np.uint8]
    west_m: float
    north_m: float
    m_per_px: float

    @classmethod
    def of(cls, network: RoadNetwork) -> GroundMap:
        """Return a network's ground; it is drawn at the first call for a network."""
        if network not in _drawn_maps:
            remember(network, cls._drawn(network))
        return _drawn_maps[network]

    @classmethod
    def _drawn(cls, network: RoadNetwork) -> GroundMap:
        layers = dict(_layers(network))
        boxes = np.array([shape.bounds for shape in layers.values() if not shape.is_empty] or [(0.0, 0.0, 0.0, 0.0)])
        west, south = np.floor(boxes[:, :2].min(axis=0) - _MARGIN_M).tolist()
        east, north = np.ceil(boxes[:, 2:].max(axis=0) + _MARGIN_M).tolist()
        m_per_px = M_PER_PX
        while (east - west) * (north - south) / m_per_px**2 > _MAX_PX:
            m_per_px *= 2
        toggles = np.zeros((math.ceil((north - south) / m_per_px), math.ceil((east - west) / m_per_px)), np.uint8)
        empty = cls(toggles, west, north, m_per_px)
        for name, shape in layers.items():
            toggle_outlines(toggles, empty._rings(shape), 1 << MAP_BITS.index(name))
        return cls(filled(toggles), west, north, m_per_px)

    def with_route(self, line: FloatArray) -> GroundMap:
        """Return this map with a route on it, a band around the points [N, 2] of a line (m)."""
        if len(line) < 2:
            return self
        bits = self.bits.copy()
        band = shapely.LineString(line).buffer(ROUTE_M / 2, quad_segs=2, cap_style="flat")
        west, south, east, north = band.bounds
        top, left = (max(math.floor(v / self.m_per_px), 0) for v in (self.north_m - north, west - self.west_m))
        below, right = (max(math.ceil(v / self.m_per_px), 0) for v in (self.north_m - south, east - self.west_m))
        window = bits[top : below + 1, left : right + 1]
        toggles = np.zeros_like(window)
        rings = (ring - (left, top) for ring in self._rings(band))
        toggle_outlines(toggles, rings, 1 << MAP_BITS.index("route"))
        window |= filled(toggles)
        return GroundMap(bits, self.west_m, self.north_m, self.m_per_px)

    def sample(self, pose: tuple[float, float, float], ahead_m: FloatArray, left_m: FloatArray) -> NDArray[np.uint8]:
        """Return the bits under points of a moving frame (x, y in m, heading in rad); 0 outside the map.

        `ahead_m`, `left_m`: the points; arrays that are broadcast to the result's shape.
        """
        x, y, heading = pose
        c, s = math.cos(heading) / self.m_per_px, math.sin(heading) / self.m_per_px
        unit = 1 << _FRACTION
        # Columns are counted eastwards, rows southwards. Each term is rounded separately, so that all further
        # arithmetic is that of integers.
        column = np.rint(ahead_m * (c * unit)).astype(np.int32) + np.rint(left_m * (-s * unit)).astype(np.int32)
        row = np.rint(ahead_m * (-s * unit)).astype(np.int32) + np.rint(left_m * (-c * unit)).astype(np.int32)
        height, width = self.bits.shape
        column += _offset((x - self.west_m) / self.m_per_px, width)
        row += _offset((self.north_m - y) / self.m_per_px, height)
        column >>= _FRACTION
        row >>= _FRACTION
        outside = None
        if min(row.min(), column.min()) < 0 or row.max() >= height or column.max() >= width:
            outside = (row < 0) | (row >= height) | (column < 0) | (column >= width)
            row[outside] = column[outside] = 0
        row *= width
        row += column
        values: NDArray[np.uint8] = self.bits.reshape(-1)[row]
        if outside is not None:
            values[outside] = 0
        return values

    def _rings(self, shape: BaseGeometry) -> Iterator[FloatArray]:
        """Yield outlines and holes in the map's pixels, x right and y down."""
        for part in shapely.get_parts(shape):
            if isinstance(part, shapely.Polygon):
                for ring in (part.exterior, *part.interiors):
                    points = shapely.get_coordinates(ring)[:-1]
                    yield (points - (self.west_m, self.north_m)) * (1 / self.m_per_px, -1 / self.m_per_px)


def remember(network: object, ground: GroundMap) -> None:
    """Let `GroundMap.of` return this ground for a network, or for an object that takes a network's place, while it is
    referred to.
    """
    _drawn_maps[network] = ground


def _offset(pixels: float, size: int) -> np.int32:
    """Return a coordinate in fixed point; one that is far outside the map is moved to just outside it."""
    return np.int32(round(min(max(pixels, -2.0 * size - 4000), 3.0 * size + 4000) * (1 << _FRACTION)))


def _layers(network: RoadNetwork) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield the name and the area of every layer except the route."""
    roads = [ln for ln in network.lanes.values() if "car" in ln.kinds]
    streets = [ln for ln in roads if not ln.internal]
    crossing_lanes = {crossing.lane.id for crossing in network.crossings.values()}
    walked = [
        ln
        for ln in network.lanes.values()
        if ln.kinds == {"pedestrian"} and ln.id not in crossing_lanes and ln.edge not in network.walking_areas
    ]
    yield "drivable", network.drivable
    yield "lane_centre", _bands((ln.shape for ln in roads), MARKING_M)
    yield "marking", _bands((side for ln in streets for side in _sides(ln)), MARKING_M)
    yield "crossing", shapely.union_all([_band(c.lane) for c in network.crossings.values()])
    areas = [_area(area.polygon) for area in network.walking_areas.values()]
    yield "footway", shapely.union_all([*areas, *(_band(ln) for ln in walked)])
    yield "parking", shapely.union_all([_band(ln) for ln in network.lanes.values() if ln.parking])
    yield "building", shapely.union_all([_area(outline) for outline in network.buildings])


def _sides(lane: Lane) -> Iterator[Sequence[tuple[float, float]]]:
    """Yield the two lines between a lane and its neighbours."""
    apart = [lane.shape[0], *(b for a, b in pairwise(lane.shape) if a != b)]
    if len(apart) > 1:
        yield shift_right(apart, lane.width_m / 2)
        yield shift_right(apart, -lane.width_m / 2)


def _bands(lines: Iterable[Sequence[tuple[float, float]]], width_m: float) -> BaseGeometry:
    shapes = [shapely.LineString(line).buffer(width_m / 2, cap_style="flat") for line in lines]
    return shapely.union_all(shapes)


def _band(lane: Lane) -> BaseGeometry:
    return shapely.LineString(lane.shape).buffer(lane.width_m / 2, cap_style="flat")


def _area(outline: Points) -> BaseGeometry:
    if len(outline) < 3:
        return shapely.Polygon()
    return shapely.make_valid(shapely.Polygon(outline))
