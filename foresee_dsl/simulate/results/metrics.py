"""Measures of a single moment: time to collision, time to a place, distance to a junction, time since it was entered.

Definitions follow Westhofen et al., "Criticality Metrics for Automated Driving" (Archives of Computational Methods in
Engineering, 2023), section on TTC. Infinity means "never".
"""

from __future__ import annotations

from functools import cache
from math import cos, hypot, inf, isnan, nan, sin, sqrt
from typing import TYPE_CHECKING

import shapely

from foresee_dsl.kernels.boxes import Box, Mover, corner_points

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from foresee_dsl.compile.roads.network import RoadNetwork

SLOWEST_MPS = 1.0
"""`eta` counts with at least this speed (the language's definition), so that a standing vehicle has a finite one."""

STANDS_MPS = 0.1
"""The least speed with which a vehicle on a junction is taken to have entered it: SUMO's threshold of halting."""

CREEPS_MPS = 0.5
"""The mean speed with which a vehicle that waits inside a junction came to its place. Ours: it only decides the order
of those that wait there, by how far they are inside."""

STILL_MPS = 1e-9
"""A closing speed under this is rounding: at the largest distances of a town it would take a century to meet."""


def ttc(a: Mover, b: Mover) -> float:
    """Return the time (s) until two footprints touch when both keep heading and speed.

    Exact: each of the four directions at right angles to the sides separates the footprints outside one interval of
    time; they overlap where all four intervals do.

    Returns:
        0 when they overlap now, infinity when they never will, NaN where a value is NaN.
    """
    dx, dy = b.x - a.x, b.y - a.y
    (ax, ay), (bx, by) = a.velocity, b.velocity
    vx, vy = bx - ax, by - ay
    ca, sa, cb, sb = cos(a.heading), sin(a.heading), cos(b.heading), sin(b.heading)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    along_a, across_a = a.length + c * b.length + s * b.width, a.width + s * b.length + c * b.width
    along_b, across_b = b.length + c * a.length + s * a.width, b.width + s * a.length + c * a.width
    begin, end = 0.0, inf
    for nx, ny, reach in ((ca, sa, along_a), (-sa, ca, across_a), (cb, sb, along_b), (-sb, cb, across_b)):
        apart, speed = dx * nx + dy * ny, vx * nx + vy * ny
        if isnan(apart) or isnan(speed):
            return nan
        if abs(speed) < STILL_MPS:
            if abs(apart) > reach / 2:
                return inf
            continue
        first, last = sorted(((-reach / 2 - apart) / speed, (reach / 2 - apart) / speed))
        begin, end = max(begin, first), min(end, last)
    return begin if begin <= end else inf


def eta(distance_m: float, speed_mps: float) -> float:
    """Return the time (s) to a place `distance_m` ahead at this speed, not under 1 m/s; infinity once it is behind."""
    return distance_m / max(speed_mps, SLOWEST_MPS) if distance_m >= 0 else inf


def since_entry_s(inside_m: float, speed_mps: float, acceleration_mps2: float) -> float:
    """Return how long ago a vehicle entered a junction (s), as far as its present state tells.

    Args:
        inside_m: how far its front is inside.
        speed_mps: its speed; without an acceleration, that at which it came.
        acceleration_mps2: over 0 where it was slower before: it is taken to have accelerated as it does now, from a
            stand if it is far enough inside, and to have crept until then.
    """
    if acceleration_mps2 <= 0.0:
        return inside_m / max(speed_mps, STANDS_MPS)
    began = speed_mps * speed_mps - 2 * acceleration_mps2 * inside_m
    if began >= 0.0:
        return (speed_mps - sqrt(began)) / acceleration_mps2
    crept_m = inside_m - speed_mps * speed_mps / (2 * acceleration_mps2)
    return speed_mps / acceleration_mps2 + crept_m / CREEPS_MPS


class Outlines:
    """The outlines of a network's junctions."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._of = cache(self._make)

    def distance(self, box: Box, junction: str) -> float:
        """Return how far a footprint is from a junction, m: 0 where some part of it is inside.

        NaN for a junction without an area (the end of a road).
        """
        area, _ = self._of(junction)
        if area.is_empty:
            return nan
        return float(shapely.distance(area, shapely.Polygon(corner_points(box))))

    def nearest(self, box: Box) -> float:
        """Return how far a footprint is from the nearest junction, m; infinite where there is none."""
        best = inf
        reach = hypot(box.length, box.width) / 2
        for junction in self._network.junctions:
            area, (left, bottom, right, top) = self._of(junction)
            away = hypot(max(left - box.x, 0.0, box.x - right), max(bottom - box.y, 0.0, box.y - top)) - reach
            if not area.is_empty and away < best:
                best = min(best, self.distance(box, junction))
        return best

    def _make(self, junction: str) -> tuple[BaseGeometry, tuple[float, float, float, float]]:
        points = self._network.outline(junction)
        shape = shapely.make_valid(shapely.Polygon(points)) if len(points) >= 3 else shapely.Polygon()
        area = shape if shape.area > 0 else shapely.Polygon()
        shapely.prepare(area)
        return area, area.bounds


def point_distance(box: Box, x: float, y: float) -> float:
    """Return how far a footprint is from a point, m: 0 where it covers it."""
    c, s = cos(box.heading), sin(box.heading)
    dx, dy = x - box.x, y - box.y
    return hypot(max(abs(dx * c + dy * s) - box.length / 2, 0.0), max(abs(dy * c - dx * s) - box.width / 2, 0.0))
