"""Outlines of junctions: is a footprint inside one, and how far is it away."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import shapely

from foresee_dsl.kernels.boxes import Box, corner_points

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from foresee_dsl.compile.roads.network import RoadNetwork


class Outlines:
    """The outlines of a network's junctions."""

    def __init__(self, network: RoadNetwork) -> None:
        """Know the network; an outline is made when it is asked for."""
        self._network = network
        self._of = cache(self._make)

    def distance(self, box: Box, junction: str) -> float:
        """Return how far a footprint is from a junction, m: 0 where some part of it is inside.

        NaN for a junction without an area (the end of a road).
        """
        area, _ = self._of(junction)
        if area.is_empty:
            return math.nan
        return float(shapely.distance(area, shapely.Polygon(corner_points(box))))

    def nearest(self, box: Box) -> float:
        """Return how far a footprint is from the nearest junction, m; infinite where there is none."""
        best = math.inf
        reach = math.hypot(box.length, box.width) / 2
        for junction in self._network.junctions:
            area, (left, bottom, right, top) = self._of(junction)
            away = math.hypot(max(left - box.x, 0.0, box.x - right), max(bottom - box.y, 0.0, box.y - top)) - reach
            if not area.is_empty and away < best:
                best = min(best, self.distance(box, junction))
        return best

    def _make(self, junction: str) -> tuple[BaseGeometry, tuple[float, float, float, float]]:
        points = self._network.junctions[junction].polygon
        shape = shapely.make_valid(shapely.Polygon(points)) if len(points) >= 3 else shapely.Polygon()
        area = shape if shape.area > 0 else shapely.Polygon()
        shapely.prepare(area)
        return area, area.bounds


def point_distance(box: Box, x: float, y: float) -> float:
    """Return how far a footprint is from a point, m: 0 where it covers it."""
    c, s = math.cos(box.heading), math.sin(box.heading)
    dx, dy = x - box.x, y - box.y
    return math.hypot(max(abs(dx * c + dy * s) - box.length / 2, 0.0), max(abs(dy * c - dx * s) - box.width / 2, 0.0))
