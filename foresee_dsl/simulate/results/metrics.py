"""Measures of a single moment: time to collision, time to a place, distance to a junction, time since it was entered.

Definitions follow Westhofen et al., "Criticality Metrics for Automated Driving" (Archives of Computational Methods in
Engineering, 2023), section on TTC. Infinity means "never".
"""

from __future__ import annotations

from functools import cache
from math import cos, hypot, inf, nan, sin, sqrt
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import shapely

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import Box, Mover, corner_points
from foresee_dsl.kernels.conditions import time_to_touch

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from foresee_dsl.compile.roads.network import RoadNetwork
    from foresee_dsl.compile.roads.polyline import Points

SLOWEST_MPS = 1.0
"""`eta` counts with at least this speed (the language's definition), so that a standing vehicle has a finite one."""

STANDS_MPS = 0.1
"""The least speed with which a vehicle on a junction is taken to have entered it: SUMO's threshold of halting."""

CREEPS_MPS = 0.5
"""The mean speed with which a vehicle that waits inside a junction came to its place. Ours: it only decides the order
of those that wait there, by how far they are inside."""


def ttc(a: Mover, b: Mover) -> float:
    """Return the time (s) until two footprints touch when both keep heading and speed.

    Exact: each of the four directions at right angles to the sides separates the footprints outside one interval of
    time; they overlap where all four intervals do.

    Returns:
        0 when they overlap now, infinity when they never will, NaN where a value is NaN.
    """
    both = np.array((a, b), dtype=np.float64)
    return float(time_to_touch(both, both[:, 4:], 0, 1))


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


class Outline(NamedTuple):
    """The area of a junction; empty for a junction without one (the end of a road).

    Attributes:
        area: prepared for many questions. bounds: [4] west, south, east, north, m.
        borders: [M, 4] the ends of its sides, m; none where lines are a part of it.
    """

    area: BaseGeometry
    borders: FloatArray
    bounds: FloatArray


class Outlines:
    """The outlines of a network's junctions. They do not know the network, so that both can be forgotten."""

    def __init__(self, network: RoadNetwork) -> None:
        self._junctions, self._rings, self._joints = network.junctions, network.rings, network.joints
        self.of = cache(self._make)
        """Returns the `Outline` of a junction."""

    def distance(self, box: Box, junction: str) -> float:
        """Return how far a footprint is from a junction, m: 0 where some part of it is inside.

        NaN for a junction without an area.
        """
        area = self.of(junction).area
        if area.is_empty:
            return nan
        return float(shapely.distance(area, shapely.Polygon(corner_points(box))))

    def nearest(self, box: Box) -> float:
        """Return how far a footprint is from the nearest junction, m; infinite where there is none.

        A place at which an edge is only cut does not count.
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
    """Return the area within an outline; SUMO's may touch themselves, or have no area."""
    shape = shapely.make_valid(shapely.Polygon(points)) if len(points) >= 3 else shapely.Polygon()
    area = shape if shape.area > 0 else shapely.Polygon()
    shapely.prepare(area)
    parts = shapely.get_parts(shapely.get_parts(area))
    sides = [np.empty((0, 4))]
    if (shapely.get_dimensions(parts) == 2).all():
        rings = map(shapely.get_coordinates, shapely.get_rings(parts))
        sides += [np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings]
    return Outline(area, np.concatenate(sides), np.array(area.bounds))


_OUTLINES: WeakKeyDictionary[RoadNetwork, Outlines] = WeakKeyDictionary()
"""The children of a clip drive on the same network."""


def outlines_of(network: RoadNetwork) -> Outlines:
    """Return the outlines of a network's junctions; remembered."""
    known = _OUTLINES.get(network)
    if known is None:
        known = _OUTLINES[network] = Outlines(network)
    return known


def point_distance(box: Box, x: float, y: float) -> float:
    """Return how far a footprint is from a point, m: 0 where it covers it."""
    c, s = cos(box.heading), sin(box.heading)
    dx, dy = x - box.x, y - box.y
    return hypot(max(abs(dx * c + dy * s) - box.length / 2, 0.0), max(abs(dy * c - dx * s) - box.width / 2, 0.0))
