"""The ego's place on its route, and the route ahead of it, for bridges whose planners get numbers instead of a map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.protocol import EgoState, FloatArray, JunctionPassage, Mission, VehicleLimits

AHEAD_M = 20.0
"""Distance ahead and behind within which the place on the route is searched, m. Ours: at 200 km/h a step takes 3 m."""


class RoutePlace(NamedTuple):
    """A point relative to the route: `s` along it and `left_m` to the left of it, m; `heading_rad`: the route's
    direction there."""

    s: float
    left_m: float
    heading_rad: float


class RouteTracker:
    """Finds the place on a route of a point that moves along it, also on routes that cross themselves."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self._last_s = mission.start_s

    def place(self, x: float, y: float) -> RoutePlace:
        """Return the place of a point, which becomes the centre of the next search."""
        place = self.place_near(x, y, self._last_s)
        self._last_s = place.s
        return place

    def place_near(self, x: float, y: float, s: float, within_m: float = AHEAD_M) -> RoutePlace:
        """Return the place of a point on the part of the route around a length along it, m."""
        mission = self.mission
        first = max(int(np.searchsorted(mission.s, s - within_m)) - 1, 0)
        last = min(int(np.searchsorted(mission.s, s + within_m)) + 1, len(mission.s))
        starts = mission.centreline[first : last - 1]
        along = mission.centreline[first + 1 : last] - starts
        offset = np.array((x, y)) - starts
        lengths = np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
        share = np.clip(np.einsum("ij,ij->i", offset, along) / lengths, 0.0, 1.0)
        rest = offset - share[:, None] * along
        k = int(np.argmin(np.einsum("ij,ij->i", rest, rest)))
        dx, dy = along[k].tolist()
        left_m = (dx * float(rest[k, 1]) - dy * float(rest[k, 0])) / math.sqrt(float(lengths[k]))
        at_s = float(mission.s[first + k] + share[k] * (mission.s[first + k + 1] - mission.s[first + k]))
        return RoutePlace(at_s, left_m, math.atan2(dy, dx))

    def points(self, lengths_s: FloatArray) -> FloatArray:
        """Return the points of the route at these lengths along it, [N, 2] m; beyond its end, its last point."""
        mission = self.mission
        return np.stack([np.interp(lengths_s, mission.s, mission.centreline[:, axis]) for axis in (0, 1)], axis=1)

    def speed_limits(self, lengths_s: FloatArray) -> FloatArray:
        """Return the speed limits at these lengths along the route, [N] m/s."""
        at = np.searchsorted(self.mission.s, lengths_s, side="right") - 1
        return self.mission.speed_limit_mps[np.clip(at, 0, len(self.mission.s) - 1)]

    def next_junction(self, s: float) -> JunctionPassage | None:
        """Return the first junction whose stop line is ahead of a length along the route, if any."""
        return next((junction for junction in self.mission.junctions if junction.stop_s > s), None)


def in_frame(points: FloatArray, x: float, y: float, heading_rad: float) -> FloatArray:
    """Return points relative to a pose, x ahead and y to the left, [N, 2] m."""
    ahead = np.array((math.cos(heading_rad), math.sin(heading_rad)))
    offsets = points - (x, y)
    return np.stack((offsets @ ahead, offsets @ (-ahead[1], ahead[0])), axis=1)


def rear_axle(ego: EgoState, vehicle: VehicleLimits) -> tuple[float, float]:
    """Return the centre of the ego's rear axle, x and y, m."""
    back_m = vehicle.rear_axle_m
    return ego.x - back_m * math.cos(ego.heading_rad), ego.y - back_m * math.sin(ego.heading_rad)
