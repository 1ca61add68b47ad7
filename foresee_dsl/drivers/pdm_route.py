"""What the `pdm` driver derives from its mission: a smooth centreline on a fine grid, a speed profile, foes' paths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.compiled import CUBE, FLAGS, FLOAT, FLOATS, INT, INTS, TABLE, compiled, inner
from foresee_dsl.drivers.protocol import FloatArray, Foe, JunctionPassage, Mission, VehicleLimits

GRID_M = 0.1
"""Spacing of the route's grid: fine enough to look speeds up without interpolating (0.04 m/s at 5 m/s)."""
PATH_M = 1.0
"""Spacing of the foes' paths."""
BEFORE_M = 40.0
AFTER_M = 120.0
"""Straight prolongations, so that look-ups need no bounds: 4 s at 100 km/h after the end."""
SMOOTH_M = 1.3
"""Ours: standard deviation of the smoothing; moves an arc of radius 6 m inwards by 0.05 m, and turns the corners of
the lanes' polylines into curvature that the steering rate can follow."""
COARSE = 10
"""Every 10th grid point (1 m) is searched when a point is projected."""
SEARCH_BEHIND_M = 30.0


@dataclass(frozen=True)
class Projection:
    """Points [N] relative to the route: length along it, offset (left positive), index of the grid point."""

    s: FloatArray
    d: FloatArray
    index: NDArray[np.int64]


@dataclass(frozen=True)
class FoePath:
    """A foe with its path on an even grid, prolonged straight at both ends (crossings are not).

    Attributes:
        x, y, cos, sin: [M] points and tangent, `PATH_M` apart. shift_m: what the prolongation adds to lengths along it.
        length_m: length of the path as given. passage: index of the junction. index: of the foe on the route.
    """

    foe: Foe
    passage: int
    index: int
    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    shift_m: float
    length_m: float


@dataclass(frozen=True)
class FoeTable:
    """All foes of a route.

    Attributes:
        numbers: [F, 5] `shift_m`, `length_m`, entry and begin of the conflict along the path, and 1 where it must give
            way to the ego (else 0). walking: [F].
        points: [4, M] the paths' x, y, cos and sin, one path after the other.
        first: [F + 1] where each path begins in `points`, and where the last one ends.
    """

    numbers: FloatArray
    walking: NDArray[np.bool_]
    points: FloatArray
    first: NDArray[np.int64]

    @classmethod
    def of(cls, foes: tuple[FoePath, ...]) -> FoeTable:
        """Gather paths."""
        rows = [(f.shift_m, f.length_m, f.foe.entry_s, f.foe.conflict_path_s[0], not f.foe.has_priority) for f in foes]
        points = [np.stack([f.x, f.y, f.cos, f.sin]) for f in foes]
        return cls(
            numbers=np.array(rows, dtype=float).reshape(-1, 5),
            walking=np.array([f.foe.pedestrian for f in foes], dtype=bool),
            points=np.concatenate([np.empty((4, 0)), *points], axis=1),
            first=np.cumsum([0, *(len(f.x) for f in foes)], dtype=np.int64),
        )


@dataclass(frozen=True)
class Route:
    """The mission, ready for look-ups. Arrays are [N] on an even grid from `origin_s`.

    Attributes:
        grid: [4, N] points and tangent: x, y, cos and sin. heading: rad, unwrapped. curvature: 1/m.
        profile: m/s, the limit, slowed down for curves so that braking stays comfortable.
        left, right: m, free width.
    """

    origin_s: float
    grid: FloatArray
    heading: FloatArray
    curvature: FloatArray
    profile: FloatArray
    left: FloatArray
    right: FloatArray
    junctions: tuple[JunctionPassage, ...]
    foes: tuple[FoePath, ...]

    @cached_property
    def x(self) -> FloatArray:
        """East, m: [N]."""
        row: FloatArray = self.grid[0]
        return row

    @cached_property
    def y(self) -> FloatArray:
        """North, m: [N]."""
        row: FloatArray = self.grid[1]
        return row

    @cached_property
    def cos(self) -> FloatArray:
        """Of the tangent: [N]."""
        row: FloatArray = self.grid[2]
        return row

    @cached_property
    def sin(self) -> FloatArray:
        """Of the tangent: [N]."""
        row: FloatArray = self.grid[3]
        return row

    def index(self, s: float) -> int:
        """Return the grid point at a length along the route, held within it."""
        return min(max(int((s - self.origin_s) / GRID_M), 0), len(self.x) - 1)

    def indices(self, s: FloatArray) -> NDArray[np.int64]:
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

    def at(self, values: FloatArray, s: float) -> float:
        """Return one of the route's arrays at one length, as `between` does."""
        place = min(max((s - self.origin_s) * (1.0 / GRID_M), 0.0), len(values) - 1.001)
        k = int(place)
        here = float(values[k])
        return here + (place - k) * (float(values[k + 1]) - here)

    @cached_property
    def junctions_end_s(self) -> tuple[float, ...]:
        """Where each junction is behind the ego: its exit, or the last of its conflicts."""
        return tuple(max([j.exit_s, *(f.conflict_s[1] for f in j.foes)]) for j in self.junctions)

    @cached_property
    def foes_of(self) -> tuple[tuple[FoePath, ...], ...]:
        """The foes of each junction."""
        return tuple(tuple(f for f in self.foes if f.passage == k) for k in range(len(self.junctions)))

    @cached_property
    def foe_table(self) -> FoeTable:
        """All foes' paths as the kernels take them."""
        return FoeTable.of(self.foes)

    def room(self, from_s: float, to_s: float) -> tuple[float, float]:
        """Return the least free width on the left and on the right on a stretch, m."""
        return _least(self.left, self.right, self.index(from_s), self.index(to_s) + 1)

    def locate(self, x: float, y: float, heading_rad: float) -> tuple[float, float, float]:
        """Find a vehicle on the whole route, by place and heading: (s, d, heading error in rad).

        A route may cross itself, so that place alone would not do: heading counts as up to 5 m (ours: a lane and a
        half).
        """
        k, along, across, error = _locate(x, y, heading_rad, self.grid, self.heading)
        return self.origin_s + k * GRID_M + along, across, error

    def project(self, x: FloatArray, y: FloatArray, s_ego: float, ahead_m: float) -> Projection:
        """Project points [N] on the stretch from `SEARCH_BEHIND_M` behind the ego to `ahead_m` before it."""
        first, last = self.index(s_ego - SEARCH_BEHIND_M), self.index(s_ego + ahead_m) + 1
        s, d, index = np.empty(len(x)), np.empty(len(x)), np.empty(len(x), dtype=np.int64)
        _project(x, y, self.grid, self.origin_s, first, last, COARSE, s, d, index)
        return Projection(s, d, index)

    def project_ways(self, who: NDArray[np.bool_], ways: FloatArray, s_ego: float, ahead_m: float) -> None:
        """Put the ways of those whose flag is set on the same stretch, in place.

        Args:
            who: [A]. ways: [rows, A, T], rows 0 and 1 are x and y, rows 5 and 6 become s and d.
            s_ego: where the ego is. ahead_m: how far before it the stretch goes.
        """
        first, last = self.index(s_ego - SEARCH_BEHIND_M), self.index(s_ego + ahead_m) + 1
        _project_ways(who, ways, self.grid, self.origin_s, first, last, 2 * COARSE)


def build_route(mission: Mission, vehicle: VehicleLimits) -> Route:
    """Derive the route from the mission; depends on nothing else, so that a restarted driver has the same."""
    s, points = np.asarray(mission.s, float), np.asarray(mission.centreline, float)
    grid_s = np.arange(s[0] - BEFORE_M, s[-1] + AFTER_M, GRID_M)
    x, y = _smooth(_prolonged(grid_s, s, points[:, 0])), _smooth(_prolonged(grid_s, s, points[:, 1]))
    tx, ty = np.gradient(x, GRID_M), np.gradient(y, GRID_M)
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    heading = np.unwrap(np.arctan2(ty, tx))
    curvature = _smooth(np.gradient(heading, GRID_M))
    limit = np.interp(grid_s, s, np.asarray(mission.speed_limit_mps, float))
    profile = _speed_profile(np.minimum(limit, vehicle.max_speed_mps), curvature, vehicle)
    foes = [(k, foe) for k, passage in enumerate(mission.junctions) for foe in passage.foes]
    return Route(
        origin_s=float(grid_s[0]),
        grid=np.stack([x, y, tx / norm, ty / norm]),
        heading=heading,
        curvature=curvature,
        profile=profile,
        left=np.interp(grid_s, s, np.asarray(mission.left_m, float)),
        right=np.interp(grid_s, s, np.asarray(mission.right_m, float)),
        junctions=mission.junctions,
        foes=tuple(_foe_path(f, k, i) for i, (k, f) in enumerate(foes)),
    )


def _prolonged(grid_s: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate, and go on straight at both ends."""
    first = (values[1] - values[0]) / (s[1] - s[0])
    last = (values[-1] - values[-2]) / (s[-1] - s[-2])
    beyond = np.minimum(grid_s - s[0], 0.0) * first + np.maximum(grid_s - s[-1], 0.0) * last
    return np.asarray(np.interp(grid_s, s, values) + beyond)


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


def _foe_path(foe: Foe, passage: int, index: int) -> FoePath:
    points = np.asarray(foe.path, float)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    keep = np.concatenate([[True], np.diff(lengths) > 1e-6])
    points, lengths = points[keep], lengths[keep]
    shift = 0.0 if foe.pedestrian else cfg.FOE_EXTENSION_M
    s = np.arange(-shift, lengths[-1] + shift + PATH_M, PATH_M)
    x, y = _prolonged(s, lengths, points[:, 0]), _prolonged(s, lengths, points[:, 1])
    tx, ty = np.gradient(x), np.gradient(y)
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    return FoePath(
        foe=foe,
        passage=passage,
        index=index,
        x=x,
        y=y,
        cos=tx / norm,
        sin=ty / norm,
        shift_m=shift,
        length_m=float(lengths[-1]),
    )


@compiled(FLOAT, FLOAT, FLOAT, TABLE, FLOATS)
def _locate(
    x: float,
    y: float,
    heading_rad: float,
    grid: FloatArray,
    headings: FloatArray,
) -> tuple[int, float, float, float]:
    """Return the grid point of a place and heading, the way on from there, the offset and the heading error."""
    gx, gy, gcos, gsin = grid[0], grid[1], grid[2], grid[3]
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    k, nearest = 0, np.inf
    for i in range(0, len(gx), COARSE):
        dx, dy = x - gx[i], y - gy[i]
        away = dx * dx + dy * dy + 12.5 * (1.0 - (cos * gcos[i] + sin * gsin[i]))
        if away < nearest:
            k, nearest = i, away
    for _ in range(2):  # the tangent at the coarse point, then at the point that it leads to
        along = (x - gx[k]) * gcos[k] + (y - gy[k]) * gsin[k]
        k = min(max(k + int(np.rint(along / GRID_M)), 0), len(gx) - 1)
    along = (x - gx[k]) * gcos[k] + (y - gy[k]) * gsin[k]
    across = (y - gy[k]) * gcos[k] - (x - gx[k]) * gsin[k]
    return k, along, across, (heading_rad - headings[k] + np.pi) % (2 * np.pi) - np.pi


@inner
def _nearest(x: float, y: float, grid: FloatArray, first: int, last: int, stride: int) -> tuple[int, float, float]:
    """Project a point on the grid points from `first` to before `last`: the grid point, the way on, the offset."""
    gx, gy, gcos, gsin = grid[0], grid[1], grid[2], grid[3]
    k, nearest = first, np.inf
    for i in range(first, last, stride):
        dx, dy = x - gx[i], y - gy[i]
        away = dx * dx + dy * dy
        if away < nearest:
            k, nearest = i, away
    along = (x - gx[k]) * gcos[k] + (y - gy[k]) * gsin[k]
    # One more look from the point that the tangent leads to, held within half a stride: bends stay exact.
    step = min(max(np.rint(along / GRID_M), -float(stride)), float(stride))
    k = min(max(k + int(step), 0), len(gx) - 1)
    rx, ry = x - gx[k], y - gy[k]
    return k, rx * gcos[k] + ry * gsin[k], ry * gcos[k] - rx * gsin[k]


@compiled(FLOATS, FLOATS, TABLE, FLOAT, INT, INT, INT, FLOATS, FLOATS, INTS)
def _project(
    x: FloatArray,
    y: FloatArray,
    grid: FloatArray,
    origin_s: float,
    first: int,
    last: int,
    stride: int,
    s: FloatArray,
    d: FloatArray,
    index: NDArray[np.int64],
) -> None:
    """Project points [N]: fill s, d and index, [N]."""
    for n in range(len(x)):
        k, along, across = _nearest(x[n], y[n], grid, first, last, stride)
        s[n], d[n], index[n] = origin_s + k * GRID_M + along, across, k


@compiled(FLAGS, CUBE, TABLE, FLOAT, INT, INT, INT)
def _project_ways(
    who: NDArray[np.bool_], ways: FloatArray, grid: FloatArray, origin_s: float, first: int, last: int, stride: int
) -> None:
    """Fill rows 5 and 6 of `ways` [..., A, T], s and d, from rows 0 and 1, x and y, of those that are asked for."""
    for a in range(len(who)):
        if who[a]:
            for t in range(ways.shape[2]):
                k, along, across = _nearest(ways[0, a, t], ways[1, a, t], grid, first, last, stride)
                ways[5, a, t], ways[6, a, t] = origin_s + k * GRID_M + along, across


@compiled(FLOATS, FLOATS, INT, INT)
def _least(left: FloatArray, right: FloatArray, first: int, last: int) -> tuple[float, float]:
    """Return the least of both from `first` to before `last`."""
    least_left, least_right = np.inf, np.inf
    for i in range(first, last):
        least_left, least_right = min(least_left, left[i]), min(least_right, right[i])
    return least_left, least_right
