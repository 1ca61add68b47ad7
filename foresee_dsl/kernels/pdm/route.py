"""Look-ups on the route's grid: values at a length, and the place of vehicles and others on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.compiling import FLOAT, TABLE, compiled, inner
from foresee_dsl.kernels.pdm.records import ROUTE, BoolArray, FloatArray, Records

GRID_M = 0.1
"""Spacing of the route's grid: fine enough to look speeds up without interpolating (0.04 m/s at 5 m/s)."""
COARSE = 10
"""Every 10th grid point (1 m) is searched when a point is projected."""
SEARCH_BEHIND_M = 30.0


@inner
def grid_point(route: Records, s: float) -> int:
    """Return the grid point at a length along a route, held within it."""
    return min(max(int((s - route[0]["s"]) * (1.0 / GRID_M)), 0), len(route) - 1)


@inner
def grid_place(route: Records, s: float) -> tuple[int, float]:
    """Return the grid point before a length along a route, and the share of the way to the next one.

    Where the grid lies depends on where the mission begins; what the driver decides must not, or a run that is resumed
    in the middle would go differently: so values are interpolated.
    """
    place = min(max((s - route[0]["s"]) * (1.0 / GRID_M), 0.0), len(route) - 1.001)
    k = max(int(place), 0)
    return k, place - k


@inner
def curvature_at(route: Records, s: float) -> float:
    """Return the route's curvature at a length, 1/m."""
    k, share = grid_place(route, s)
    here = route[k]["curvature"]
    return float(here + share * (route[k + 1]["curvature"] - here))


@inner
def profile_at(route: Records, s: float) -> float:
    """Return the speed that the route's profile allows at a length, m/s."""
    k, share = grid_place(route, s)
    here = route[k]["profile"]
    return float(here + share * (route[k + 1]["profile"] - here))


@inner
def least_room(route: Records, from_s: float, to_s: float) -> tuple[float, float]:
    """Return the least free width on the left and on the right on a stretch, m."""
    least_left, least_right = np.inf, np.inf
    count, origin_s = len(route), route[0]["s"]
    first = min(max(int((from_s - origin_s) / GRID_M), 0), count - 1)
    last = min(max(int((to_s - origin_s) / GRID_M), 0), count - 1)
    for i in range(first, last + 1):
        least_left, least_right = min(least_left, route[i]["left"]), min(least_right, route[i]["right"])
    return least_left, least_right


@inner
def _least(values: FloatArray) -> int:
    """Return the place of the least one, the first of equal ones (a NaN is never less)."""
    k, least = 0, np.inf
    for i in range(len(values)):
        if values[i] < least:
            k, least = i, values[i]
    return k


@compiled(FLOAT, FLOAT, FLOAT, ROUTE, TABLE)
def locate(x: float, y: float, heading: float, route: Records, coarse: FloatArray) -> tuple[float, float, float]:
    """Return length along the whole route, offset and heading error of a place and heading.

    A route may cross itself, so the place alone would not do: heading counts as up to 5 m (ours: a lane and a half).

    Args:
        x, y, heading: the place, m and rad. route: its points.
        coarse: [4, N / COARSE] x, y, cos and sin of every `COARSE`th one.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    gx, gy, gcos, gsin = coarse[0], coarse[1], coarse[2], coarse[3]
    away = np.empty(len(gx))
    for i in range(len(gx)):
        dx, dy = x - gx[i], y - gy[i]
        away[i] = dx * dx + dy * dy + 12.5 * (1.0 - (cos * gcos[i] + sin * gsin[i]))
    k = _least(away) * COARSE
    for _ in range(2):  # the tangent at the coarse point, then at the point that it leads to
        at = route[k]
        along = (x - at["x"]) * at["cos"] + (y - at["y"]) * at["sin"]
        k = min(max(k + int(np.rint(along / GRID_M)), 0), len(route) - 1)
    at = route[k]
    along = (x - at["x"]) * at["cos"] + (y - at["y"]) * at["sin"]
    across = (y - at["y"]) * at["cos"] - (x - at["x"]) * at["sin"]
    error = (heading - at["heading"] + np.pi) % (2 * np.pi) - np.pi
    return at["s"] + along, across, error


class Stretch(NamedTuple):
    """A piece of the route where others are looked for: every `stride`th grid point from `first` on.

    Attributes:
        x, y: [M] these points. away: [M] to work in.
    """

    first: int
    stride: int
    x: FloatArray
    y: FloatArray
    away: FloatArray


@inner
def _stretch(route: Records, ego_s: float, ahead_m: float, stride: int) -> Stretch:
    """Return the stretch from `SEARCH_BEHIND_M` behind the ego to `ahead_m` before it."""
    last, origin_s = len(route) - 1, route[0]["s"]
    first = min(max(int((ego_s - SEARCH_BEHIND_M - origin_s) / GRID_M), 0), last)
    until = min(max(int((ego_s + ahead_m - origin_s) / GRID_M), 0), last) + 1
    count = max((until - first + stride - 1) // stride, 1)
    x, y = np.empty(count), np.empty(count)
    for i in range(count):
        at = route[first + i * stride]
        x[i], y[i] = at["x"], at["y"]
    return Stretch(first, stride, x, y, np.empty(count))


@inner
def _nearest(x: float, y: float, route: Records, part: Stretch) -> tuple[int, float, float]:
    """Project a point on a stretch: the grid point, the way on, the offset."""
    for i in range(len(part.x)):
        dx, dy = x - part.x[i], y - part.y[i]
        part.away[i] = dx * dx + dy * dy
    k = part.first + _least(part.away) * part.stride
    at = route[k]
    along = (x - at["x"]) * at["cos"] + (y - at["y"]) * at["sin"]
    # One more look from the point that the tangent leads to, held within half a stride: bends stay exact.
    step = min(max(np.rint(along / GRID_M), -float(part.stride)), float(part.stride))
    k = min(max(k + int(step), 0), len(route) - 1)
    at = route[k]
    rx, ry = x - at["x"], y - at["y"]
    return k, rx * at["cos"] + ry * at["sin"], ry * at["cos"] - rx * at["sin"]


@inner
def project_actors(actors: Records, route: Records, ego_s: float, ahead_m: float) -> None:
    """Fill `s`, `d` and `point` of the actors, from the stretch up to `ahead_m` before the ego."""
    part = _stretch(route, ego_s, ahead_m, COARSE)
    for a in range(len(actors)):
        one = actors[a]
        k, along, across = _nearest(one["x"], one["y"], route, part)
        one["s"], one["d"], one["point"] = route[k]["s"] + along, across, k


@inner
def project_predicted(which: BoolArray, predicted: Records, route: Records, ego_s: float, ahead_m: float) -> None:
    """Fill `s` and `d` of the predictions, [A, T], of those actors whose flag is set."""
    part = _stretch(route, ego_s, ahead_m, 2 * COARSE)
    for a in range(len(which)):
        if which[a]:
            for t in range(predicted.shape[1]):
                one = predicted[a, t]
                k, along, across = _nearest(one["x"], one["y"], route, part)
                one["s"], one["d"] = route[k]["s"] + along, across
