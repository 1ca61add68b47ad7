"""What the `pdm` driver derives from its mission: a smooth centreline on a fine grid, a speed profile, foes' paths."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.foes import PATH_M, FoePath, FoeTable, foe_path, prolonged
from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, Mission, VehicleLimits
from foresee_dsl.kernels.compiling import FLOAT, TABLE, compiled, inner

__all__ = ["GRID_M", "PATH_M", "FoePath", "Projection", "Route", "build_route"]
IntArray = NDArray[np.int64]

GRID_M = 0.1
"""Spacing of the route's grid: fine enough to look speeds up without interpolating (0.04 m/s at 5 m/s)."""
BEFORE_M = 40.0
AFTER_M = 120.0
"""Straight prolongations, so that look-ups need no bounds: 4 s at 100 km/h after the end."""
SMOOTH_M = 1.3
"""Ours: standard deviation of the smoothing; moves an arc of radius 6 m inwards by 0.05 m, and turns the corners of
the lanes' polylines into curvature that the steering rate can follow."""
COARSE = 10
"""Every 10th grid point (1 m) is searched when a point is projected."""
SEARCH_BEHIND_M = 30.0
X, Y, COS, SIN, HEADING, CURVATURE, PROFILE, LEFT, RIGHT = range(9)
"""Columns of `Route.table`."""
KEPT_ROUTES = 8
"""Ours: a worker goes through the children of one clip after the other; all of them have one mission."""


class Projection(NamedTuple):
    """Points [N] relative to the route: length along it, offset (left positive), index of the grid point."""

    s: FloatArray
    d: FloatArray
    point: IntArray


@dataclass(frozen=True)
class Route:
    """The mission, ready for look-ups. Arrays are [N] on an even grid from `origin_s`.

    Attributes:
        table: [N, 9] points and tangent (x, y, cos and sin), heading (rad, unwrapped), curvature (1/m), profile (m/s,
            the limit, slowed down for curves so that braking stays comfortable), free width on the left and right, m.
            A row holds what is looked up together. coarse: [4, N / COARSE] x, y, cos and sin of every `COARSE`th one.
        foe_table: foes and junctions as the kernels take them. signals: of each junction with one, its index and key.
    """

    origin_s: float
    table: FloatArray
    coarse: FloatArray
    junctions: tuple[JunctionPassage, ...]
    foes: tuple[FoePath, ...]
    foe_table: FoeTable
    signals: tuple[tuple[int, str], ...] = field(default=())

    @cached_property
    def x(self) -> FloatArray:
        """East, m: [N]."""
        row: FloatArray = self.table[:, X]
        return row

    @cached_property
    def y(self) -> FloatArray:
        """North, m: [N]."""
        row: FloatArray = self.table[:, Y]
        return row

    @cached_property
    def cos(self) -> FloatArray:
        """Of the tangent: [N]."""
        row: FloatArray = self.table[:, COS]
        return row

    @cached_property
    def sin(self) -> FloatArray:
        """Of the tangent: [N]."""
        row: FloatArray = self.table[:, SIN]
        return row

    @cached_property
    def heading(self) -> FloatArray:
        """Of the tangent, rad, unwrapped: [N]."""
        row: FloatArray = self.table[:, HEADING]
        return row

    @cached_property
    def curvature(self) -> FloatArray:
        """Of the route, 1/m: [N]."""
        row: FloatArray = self.table[:, CURVATURE]
        return row

    @cached_property
    def profile(self) -> FloatArray:
        """The fastest comfortable speed, m/s: [N]."""
        row: FloatArray = self.table[:, PROFILE]
        return row

    @cached_property
    def left(self) -> FloatArray:
        """Free width on the left, m: [N]."""
        row: FloatArray = self.table[:, LEFT]
        return row

    @cached_property
    def right(self) -> FloatArray:
        """Free width on the right, m: [N]."""
        row: FloatArray = self.table[:, RIGHT]
        return row

    def index(self, s: float) -> int:
        """Return the grid point at a length along the route, held within it."""
        return min(max(int((s - self.origin_s) / GRID_M), 0), len(self.x) - 1)

    def indices(self, s: FloatArray) -> IntArray:
        """Return the grid points at lengths along the route, held within it."""
        k = ((s - self.origin_s) * (1.0 / GRID_M)).astype(np.int64)
        return np.minimum(np.maximum(k, 0), len(self.x) - 1)

    def between(self, values: FloatArray, s: FloatArray | float) -> FloatArray:
        """Return one of the route's arrays at lengths, between its grid points too.

        Where the grid lies hangs on where the mission begins; what the driver decides must not, or a run that is taken
        up again in the middle goes on in another way.
        """
        place = np.clip((np.asarray(s) - self.origin_s) * (1.0 / GRID_M), 0.0, len(values) - 1.001)
        k = place.astype(np.int64)
        return np.asarray(values[k] + (place - k) * (values[k + 1] - values[k]))

    def locate(self, x: float, y: float, heading_rad: float, back_m: float = 0.0) -> tuple[float, float, float]:
        """Find a vehicle on the whole route, by place and heading: (s, d, heading error in rad).

        A route may cross itself, so that place alone would not do: heading counts as up to 5 m (ours: a lane and a
        half). `back_m` behind the place is what is found.
        """
        return _locate(x, y, heading_rad, back_m, self.coarse, self.table, self.origin_s)


@dataclass(frozen=True)
class _Task:
    """A mission for a vehicle; two are the same if a driver would see no difference."""

    content: tuple[object, ...]
    vehicle: VehicleLimits
    mission: Mission = field(compare=False)


def build_route(mission: Mission, vehicle: VehicleLimits) -> Route:
    """Derive the route from the mission; depends on nothing else, so that a restarted driver has the same.

    The last ones are kept: the runs of a clip and of its mutants have the same mission, up to its end.
    """
    m = mission
    arrays = [np.asarray(a, float) for a in (m.s, m.centreline, m.speed_limit_mps, m.left_m, m.right_m)]
    passages = [(j.junction, j.stop_s, j.exit_s, j.turn, j.signal, len(j.foes)) for j in m.junctions]
    foes = [
        (
            np.asarray(f.path, float).tobytes(),
            f.entry_s,
            *f.conflict_s,
            *f.conflict_path_s,
            f.has_priority,
            f.pedestrian,
        )
        for j in m.junctions
        for f in j.foes
    ]
    return _built(_Task((*[a.tobytes() for a in arrays], *passages, *foes), vehicle, mission))


@lru_cache(maxsize=KEPT_ROUTES)
def _built(task: _Task) -> Route:
    mission, vehicle = task.mission, task.vehicle
    s, points = np.asarray(mission.s, float), np.asarray(mission.centreline, float)
    grid_s = np.arange(s[0] - BEFORE_M, s[-1] + AFTER_M, GRID_M)
    x, y = _smooth(prolonged(grid_s, s, points[:, 0])), _smooth(prolonged(grid_s, s, points[:, 1]))
    tx, ty = np.gradient(x, GRID_M), np.gradient(y, GRID_M)
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    heading = np.unwrap(np.arctan2(ty, tx))
    curvature = _smooth(np.gradient(heading, GRID_M))
    limit = np.interp(grid_s, s, np.asarray(mission.speed_limit_mps, float))
    profile = _speed_profile(np.minimum(limit, vehicle.max_speed_mps), curvature, vehicle)
    left = np.interp(grid_s, s, np.asarray(mission.left_m, float))
    right = np.interp(grid_s, s, np.asarray(mission.right_m, float))
    numbered = [(k, foe) for k, passage in enumerate(mission.junctions) for foe in passage.foes]
    foes = tuple(foe_path(f, k, i) for i, (k, f) in enumerate(numbered))
    table = np.column_stack([x, y, tx / norm, ty / norm, heading, curvature, profile, left, right])
    return Route(
        origin_s=float(grid_s[0]),
        table=table,
        coarse=np.ascontiguousarray(table[::COARSE, : SIN + 1].T),
        junctions=mission.junctions,
        foes=foes,
        foe_table=FoeTable.of(foes, mission.junctions),
        signals=tuple((k, j.signal) for k, j in enumerate(mission.junctions) if j.signal is not None),
    )


def _smooth(values: FloatArray) -> FloatArray:
    """Average with a Gaussian of `SMOOTH_M`, the ends going on in a straight line."""
    reach = int(4 * SMOOTH_M / GRID_M)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * GRID_M / SMOOTH_M) ** 2)
    padded = np.pad(values, reach, mode="reflect", reflect_type="odd")
    return np.asarray(np.convolve(padded, kernel / kernel.sum(), mode="valid"), dtype=np.float64)


def _speed_profile(limit: FloatArray, curvature: FloatArray, vehicle: VehicleLimits) -> FloatArray:
    """Return the fastest comfortable speed at each point: limit, lateral comfort, then braking in time (backwards)."""
    friction = cfg.FRICTION_SHARE * vehicle.friction * cfg.GRAVITY_MPS2
    lateral = min(cfg.LATERAL_COMFORT_MPS2, friction)
    braking = min(cfg.PROFILE_BRAKING_MPS2, friction)
    squared = np.minimum(limit**2, lateral / np.maximum(np.abs(curvature), 1e-6))
    # min over all later points of (their v^2 + 2 b distance), as a running minimum from the end.
    ramp = 2.0 * braking * GRID_M * np.arange(len(squared))
    return np.asarray(np.sqrt(np.minimum.accumulate((squared + ramp)[::-1])[::-1] - ramp))


@inner
def grid_point(route: FloatArray, origin_s: float, s: float) -> int:
    """Return the grid point at a length along a route's table, held within it."""
    return min(max(int((s - origin_s) * (1.0 / GRID_M)), 0), len(route) - 1)


@inner
def at(route: FloatArray, column: int, origin_s: float, s: float) -> float:
    """Return a number of a route's table at a length, as `Route.between` does."""
    place = min(max((s - origin_s) * (1.0 / GRID_M), 0.0), route.shape[0] - 1.001)
    k = max(int(place), 0)
    here: float = route[k, column] + (place - k) * (route[k + 1, column] - route[k, column])
    return here


@inner
def least_room(route: FloatArray, origin_s: float, from_s: float, to_s: float) -> tuple[float, float]:
    """Return the least free width on the left and on the right on a stretch, m."""
    least_left, least_right = np.inf, np.inf
    count = route.shape[0]
    first = min(max(int((from_s - origin_s) / GRID_M), 0), count - 1)
    last = min(max(int((to_s - origin_s) / GRID_M), 0), count - 1)
    for i in range(first, last + 1):
        least_left, least_right = min(least_left, route[i, LEFT]), min(least_right, route[i, RIGHT])
    return least_left, least_right


@inner
def _least(values: FloatArray) -> int:
    """Return the place of the least one, the first of equal ones (a NaN is never less)."""
    k, least = 0, np.inf
    for i in range(len(values)):
        if values[i] < least:
            k, least = i, values[i]
    return k


@inner
def locate(
    x: float, y: float, heading_rad: float, back_m: float, coarse: FloatArray, route: FloatArray, origin_s: float
) -> tuple[float, float, float]:
    """Return length along the route, offset and heading error of a place and heading."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    x, y = x - back_m * cos, y - back_m * sin
    gx, gy, gcos, gsin = coarse[X], coarse[Y], coarse[COS], coarse[SIN]
    away = np.empty(len(gx))
    for i in range(len(gx)):
        dx, dy = x - gx[i], y - gy[i]
        away[i] = dx * dx + dy * dy + 12.5 * (1.0 - (cos * gcos[i] + sin * gsin[i]))
    k = _least(away) * COARSE
    for _ in range(2):  # the tangent at the coarse point, then at the point that it leads to
        along = (x - route[k, X]) * route[k, COS] + (y - route[k, Y]) * route[k, SIN]
        k = min(max(k + int(np.rint(along / GRID_M)), 0), len(route) - 1)
    along = (x - route[k, X]) * route[k, COS] + (y - route[k, Y]) * route[k, SIN]
    across = (y - route[k, Y]) * route[k, COS] - (x - route[k, X]) * route[k, SIN]
    error = (heading_rad - route[k, HEADING] + np.pi) % (2 * np.pi) - np.pi
    return origin_s + k * GRID_M + along, across, error


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
def stretch(route: FloatArray, origin_s: float, s_ego: float, ahead_m: float, stride: int) -> Stretch:
    """Return the stretch from `SEARCH_BEHIND_M` behind the ego to `ahead_m` before it."""
    last = len(route) - 1
    first = min(max(int((s_ego - SEARCH_BEHIND_M - origin_s) / GRID_M), 0), last)
    until = min(max(int((s_ego + ahead_m - origin_s) / GRID_M), 0), last) + 1
    count = max((until - first + stride - 1) // stride, 1)
    x, y = np.empty(count), np.empty(count)
    for i in range(count):
        x[i], y[i] = route[first + i * stride, X], route[first + i * stride, Y]
    return Stretch(first, stride, x, y, np.empty(count))


@inner
def _nearest(x: float, y: float, route: FloatArray, part: Stretch) -> tuple[int, float, float]:
    """Project a point on a stretch: the grid point, the way on, the offset."""
    for i in range(len(part.x)):
        dx, dy = x - part.x[i], y - part.y[i]
        part.away[i] = dx * dx + dy * dy
    k = part.first + _least(part.away) * part.stride
    along = (x - route[k, X]) * route[k, COS] + (y - route[k, Y]) * route[k, SIN]
    # One more look from the point that the tangent leads to, held within half a stride: bends stay exact.
    step = min(max(np.rint(along / GRID_M), -float(part.stride)), float(part.stride))
    k = min(max(k + int(step), 0), len(route) - 1)
    rx, ry = x - route[k, X], y - route[k, Y]
    return k, rx * route[k, COS] + ry * route[k, SIN], ry * route[k, COS] - rx * route[k, SIN]


@inner
def project(
    x: FloatArray, y: FloatArray, route: FloatArray, origin_s: float, s_ego: float, ahead_m: float, found: Projection
) -> None:
    """Project points [N] on the stretch up to `ahead_m` before the ego: fill `found`."""
    part = stretch(route, origin_s, s_ego, ahead_m, COARSE)
    for n in range(len(x)):
        k, along, across = _nearest(x[n], y[n], route, part)
        found.s[n], found.d[n], found.point[n] = origin_s + k * GRID_M + along, across, k


@inner
def project_ways(
    who: NDArray[np.bool_], ways: FloatArray, route: FloatArray, origin_s: float, s_ego: float, ahead_m: float
) -> None:
    """Put the ways of those whose flag is set on a stretch, in place.

    Args:
        who: [A]. ways: [rows, A, T], rows 0 and 1 are x and y, rows 5 and 6 become s and d.
        route: the route's table, from `origin_s` on.
        s_ego: where the ego is. ahead_m: how far before it the stretch goes.
    """
    part = stretch(route, origin_s, s_ego, ahead_m, 2 * COARSE)
    for a in range(len(who)):
        if who[a]:
            for t in range(ways.shape[2]):
                k, along, across = _nearest(ways[0, a, t], ways[1, a, t], route, part)
                ways[5, a, t], ways[6, a, t] = origin_s + k * GRID_M + along, across


@compiled(*(FLOAT,) * 4, TABLE, TABLE, FLOAT)
def _locate(
    x: float, y: float, heading_rad: float, back_m: float, coarse: FloatArray, route: FloatArray, origin_s: float
) -> tuple[float, float, float]:
    return locate(x, y, heading_rad, back_m, coarse, route, origin_s)
