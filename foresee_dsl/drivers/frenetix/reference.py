"""The route as the library wants it: a coordinate system along a polyline, made for one stretch at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import frenetix
import numpy as np

from foresee_dsl.drivers.frenetix import settings as cfg
from foresee_dsl.drivers.pdm.route import GRID_M, Route
from foresee_dsl.drivers.protocol import FloatArray


@dataclass(frozen=True)
class Window:
    """One stretch of the route. Lengths along it differ a little: the library measures its own polyline.

    Attributes:
        number: which stretch. system: the library's coordinate system.
        route_s, own_s: [M] the same points' length on the route and in the library's coordinates, m.
    """

    number: int
    system: Any  # frenetix.CoordinateSystemWrapper; the library's stubs cannot be resolved
    route_s: FloatArray
    own_s: FloatArray

    def to_route(self, own_s: FloatArray) -> FloatArray:
        """Return lengths on the route (any shape), m."""
        return np.asarray(np.interp(own_s, self.own_s, self.route_s))


def window_number(route: Route, s: float) -> int:
    """Return which stretch the rear axle is in."""
    return max(math.floor((s - route.origin_s) / cfg.WINDOW_M), 0)


def make_window(route: Route, number: int) -> Window:
    """Make the coordinates from `BEHIND_M` behind a stretch to beyond what a plan can reach from it."""
    stride = round(cfg.REFERENCE_STEP_M / GRID_M)
    reach = cfg.WINDOW_M + float(route.profile.max()) * cfg.HORIZON_S + 20.0
    begin = number * cfg.WINDOW_M
    first = max(round((begin - cfg.BEHIND_M) / GRID_M), 0)
    last = min(round((begin + reach) / GRID_M), len(route.x))
    points = np.column_stack([route.x[first:last:stride], route.y[first:last:stride]])
    system = frenetix.CoordinateSystemWrapper(points)
    # The library puts points of its own in front of the first.
    line = np.array(system.ref_line)
    ahead = float(system.ref_pos[int(np.abs(line - points[0]).sum(axis=1).argmin())])
    lengths = np.hypot(*np.diff(points, axis=0).T).astype(np.float64)
    own_s = ahead + np.concatenate([np.zeros(1), np.cumsum(lengths)])
    route_s: FloatArray = route.origin_s + GRID_M * np.arange(first, last, stride, dtype=np.float64)
    return Window(number, system, route_s, own_s)
