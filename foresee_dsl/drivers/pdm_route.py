"""What the `pdm` driver derives from its mission: a smooth centreline on a fine grid, a speed profile, foes' paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers import pdm_settings as cfg
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
    """Points relative to the route: length along it, offset (left positive), index of the grid point."""

    s: FloatArray
    d: FloatArray
    index: NDArray[np.int64]


@dataclass(frozen=True)
class FoePath:
    """A foe with its path on an even grid, prolonged straight at both ends (crossings are not).

    Attributes:
        x, y, cos, sin: [M] points and tangent, `PATH_M` apart. shift_m: what the prolongation adds to lengths along it.
        length_m: length of the path as given. passage: index of the junction.
    """

    foe: Foe
    passage: int
    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    shift_m: float
    length_m: float


@dataclass(frozen=True)
class Route:
    """The mission, ready for look-ups. Arrays are [N] on an even grid from `origin_s`.

    Attributes:
        x, y, cos, sin: points and tangent. heading: rad, unwrapped. curvature: 1/m.
        profile: m/s, the limit, slowed down for curves so that braking stays comfortable.
        left, right: m, free width.
    """

    origin_s: float
    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    heading: FloatArray
    curvature: FloatArray
    profile: FloatArray
    left: FloatArray
    right: FloatArray
    junctions: tuple[JunctionPassage, ...]
    foes: tuple[FoePath, ...]

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

    def locate(self, x: float, y: float, heading_rad: float) -> tuple[float, float, float]:
        """Find a vehicle on the whole route, by place and heading: (s, d, heading error in rad).

        A route may cross itself, so that place alone would not do: heading counts as up to 5 m (ours: a lane and a
        half).
        """
        dx, dy = x - self.x[::COARSE], y - self.y[::COARSE]
        turned = 1.0 - (np.cos(heading_rad) * self.cos[::COARSE] + np.sin(heading_rad) * self.sin[::COARSE])
        k = int(np.argmin(dx * dx + dy * dy + 12.5 * turned)) * COARSE
        for _ in range(2):  # the tangent at the coarse point, then at the point that it leads to
            along = (x - self.x[k]) * self.cos[k] + (y - self.y[k]) * self.sin[k]
            k = min(max(k + round(float(along) / GRID_M), 0), len(self.x) - 1)
        along = (x - self.x[k]) * self.cos[k] + (y - self.y[k]) * self.sin[k]
        d = (y - self.y[k]) * self.cos[k] - (x - self.x[k]) * self.sin[k]
        error = (heading_rad - float(self.heading[k]) + np.pi) % (2 * np.pi) - np.pi
        return self.origin_s + k * GRID_M + float(along), float(d), float(error)

    def project(self, x: FloatArray, y: FloatArray, s_ego: float, ahead_m: float, stride: int = COARSE) -> Projection:
        """Project points (any shape) on the stretch from `SEARCH_BEHIND_M` behind the ego to `ahead_m` before it."""
        first, last = self.index(s_ego - SEARCH_BEHIND_M), self.index(s_ego + ahead_m) + 1
        gx, gy = self.x[first:last:stride], self.y[first:last:stride]
        dx = x[..., None] - gx
        dy = y[..., None] - gy
        dx *= dx
        dy *= dy
        dx += dy
        k = first + dx.argmin(axis=-1) * stride
        along = (x - self.x[k]) * self.cos[k] + (y - self.y[k]) * self.sin[k]
        # One more look from the point that the tangent leads to, held within half a stride: bends stay exact.
        step = np.minimum(np.maximum(np.rint(along / GRID_M), -stride), stride).astype(np.int64)
        k = np.minimum(np.maximum(k + step, 0), len(self.x) - 1)
        rx, ry = x - self.x[k], y - self.y[k]
        along = rx * self.cos[k] + ry * self.sin[k]
        return Projection(self.origin_s + k * GRID_M + along, ry * self.cos[k] - rx * self.sin[k], k)


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
    return Route(
        origin_s=float(grid_s[0]),
        x=x,
        y=y,
        cos=tx / norm,
        sin=ty / norm,
        heading=heading,
        curvature=curvature,
        profile=profile,
        left=np.interp(grid_s, s, np.asarray(mission.left_m, float)),
        right=np.interp(grid_s, s, np.asarray(mission.right_m, float)),
        junctions=mission.junctions,
        foes=tuple(_foe_path(f, k) for k, passage in enumerate(mission.junctions) for f in passage.foes),
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


def _foe_path(foe: Foe, passage: int) -> FoePath:
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
        foe=foe, passage=passage, x=x, y=y, cos=tx / norm, sin=ty / norm, shift_m=shift, length_m=float(lengths[-1])
    )
