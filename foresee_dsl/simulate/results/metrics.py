"""Measures at one moment: time to a place, distance to a junction. Infinity means "never"."""

from __future__ import annotations

from functools import cache
from math import cos, hypot, inf, nan, sin
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork, polygon
from foresee_dsl.compile.roads.topology import per_network
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import Box, corner_points

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from foresee_dsl.compile.roads.polyline import Points

ETA_SLOWEST_MPS = 1.0
"""Lowest speed with which `eta` computes, m/s: it keeps the time finite for a standing vehicle. Defined by the
language."""


def eta(distance_m: float, speed_mps: float) -> float:
    """Return the time (s) to a place `distance_m` ahead at this speed, which counts as at least 1 m/s; infinity if the
    place is behind.
    """
    return distance_m / max(speed_mps, ETA_SLOWEST_MPS) if distance_m >= 0 else inf


def headway(gap_m: float, speed_mps: float) -> float:
    """Return the time (s) in which this speed, which counts as at least 1 m/s, covers a gap."""
    return gap_m / max(speed_mps, ETA_SLOWEST_MPS)


def relative_speed(speed_mps: float, other_mps: float, turned_rad: float) -> float:
    """Return an actor's speed minus the speed along its heading of another one, which is turned by an angle, m/s."""
    return speed_mps - other_mps * cos(turned_rad)


class Outline(NamedTuple):
    """The area of a junction; empty for a junction without one (the end of a road).

    Attributes:
        area: prepared for fast queries. bounds: [4] west, south, east, north, m.
        borders: [M, 4] the end points of its sides, m; empty if the shape has parts that are only lines.
    """

    area: BaseGeometry
    borders: FloatArray
    bounds: FloatArray


class Outlines:
    """The outlines of a network's junctions.

    It holds no reference to the network: the cache, whose key is the network, could otherwise free neither of them.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._junctions, self._rings, self._joints = network.junctions, network.rings, network.joints
        self.of = cache(self._make)
        """Function that returns the `Outline` of a junction."""

    def distance(self, box: Box, junction: str) -> float:
        """Return the distance of a footprint from a junction, m: 0 if a part of it is inside.

        NaN for a junction without an area.
        """
        area = self.of(junction).area
        if area.is_empty:
            return nan
        return float(shapely.distance(area, shapely.Polygon(corner_points(box))))

    def nearest(self, box: Box) -> float:
        """Return the distance of a footprint from the nearest junction, m; infinite without junctions.

        A point at which an edge is only split does not count as a junction.
        """
        best = inf
        reach = hypot(box.length, box.width) / 2
        for junction in self._junctions:
            if junction in self._joints:
                continue
            area, _, bounds = self.of(junction)
            left, bottom, right, top = bounds.tolist()
            away = hypot(max(left - box.x, 0.0, box.x - right), max(bottom - box.y, 0.0, box.y - top)) - reach
            if not area.is_empty and away < best:
                best = min(best, self.distance(box, junction))
        return best

    def _make(self, junction: str) -> Outline:
        ring = self._rings.get(junction)
        return outline_of(ring.polygon if ring is not None else self._junctions[junction].polygon)


def outline_of(points: Points) -> Outline:
    """Return the area within an outline; outlines of SUMO may touch themselves or have no area."""
    area = polygon(points)
    shapely.prepare(area)
    parts = shapely.get_parts(shapely.get_parts(area))
    sides = [np.empty((0, 4))]
    if (shapely.get_dimensions(parts) == 2).all():
        rings = map(shapely.get_coordinates, shapely.get_rings(parts))
        sides += [np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings]
    return Outline(area, np.concatenate(sides), np.array(area.bounds))


outlines_of = per_network(Outlines)
"""Return the outlines of a network's junctions."""


def point_distance(box: Box, x: float, y: float) -> float:
    """Return the distance of a footprint from a point, m: 0 if it covers the point."""
    c, s = cos(box.heading), sin(box.heading)
    dx, dy = x - box.x, y - box.y
    return hypot(max(abs(dx * c + dy * s) - box.length / 2, 0.0), max(abs(dy * c - dx * s) - box.width / 2, 0.0))
