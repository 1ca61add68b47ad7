"""Computes the route of the bundled drivers from their mission.

The route is a smooth centreline on a fine grid with a speed profile, the junctions, and the paths of the streams that
cross or join the ego's route.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, Mission, VehicleLimits
from foresee_dsl.kernels.arrays import IntArray, Records
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import PATH_M
from foresee_dsl.kernels.pdm.records import FOE, JUNCTION, PATH_POINT, ROUTE_POINT
from foresee_dsl.kernels.pdm.route import COARSE, GRID_M

BEFORE_M = 40.0
AFTER_M = 120.0
"""Length by which the route is extended straight ahead at its end, m, so that look-ups need no bounds: 4 s at 100
km/h."""
SMOOTH_M = 1.3
"""Standard deviation of the smoothing, m. Ours: it moves an arc with a radius of 6 m inwards by 0.05 m, and turns the
corners of the lanes' polylines into a curvature that the steering rate can follow."""
KEPT_ROUTES = 8
"""Maximum number of cached routes. Ours: a worker runs the mutants of a clip one after the other, and all have the same
mission."""


@dataclass(frozen=True)
class DriverRoute:
    """The mission, prepared for look-ups.

    Attributes:
        points: [N] `RoutePoint`s on an even grid.
        coarse: [5, N / COARSE] x, y, cos and sin of every `COARSE`th point, and the largest distance of two neighbours.
        columns: [N] each field of `points` as a contiguous array, from which numpy reads many places faster.
        passages: the junctions of the mission. junctions: [J] the same as `Junction`s.
        foes: [F] `Foe`s, in the order of their junctions. paths: the `PathPoint`s of all foes.
        signals: for each junction with a signal, its index among the junctions and the key of the signal.
    """

    points: Records
    columns: dict[str, FloatArray]
    coarse: FloatArray
    passages: tuple[JunctionPassage, ...]
    junctions: Records
    foes: Records
    paths: Records
    signals: tuple[tuple[int, str], ...]

    @property
    def origin_s(self) -> float:
        """The length along the route at which its grid begins, m."""
        return float(self.columns["s"][0])

    def index(self, s: float) -> int:
        """Return the grid point at a length along the route, clamped to the route."""
        return min(max(int((s - self.origin_s) / GRID_M), 0), len(self.points) - 1)

    def indices(self, s: FloatArray) -> IntArray:
        """Return the grid points at lengths along the route, clamped to the route."""
        k = ((s - self.origin_s) * (1.0 / GRID_M)).astype(np.int64)
        return np.minimum(np.maximum(k, 0), len(self.points) - 1)

    def between(self, column: str, s: FloatArray | float) -> FloatArray:
        """Return a column at lengths along the route, interpolated between grid points (see `grid_place`)."""
        values = self.columns[column]
        place = np.clip((np.asarray(s) - self.origin_s) * (1.0 / GRID_M), 0.0, len(values) - 1.001)
        k = place.astype(np.int64)
        return np.asarray(values[k] + (place - k) * (values[k + 1] - values[k]))


@dataclass(frozen=True)
class _Task:
    """A mission together with a vehicle; two tasks are equal if a driver would see no difference."""

    content: tuple[object, ...]
    vehicle: VehicleLimits
    mission: Mission = field(compare=False)


def build_route(mission: Mission, vehicle: VehicleLimits) -> DriverRoute:
    """Return the route of a mission. It depends on mission and vehicle only, so that a driver that is started again
    gets the same.

    The last `KEPT_ROUTES` routes are cached: a clip and its mutants have the same mission, up to its end.
    """
    m = mission
    arrays = [np.asarray(a, float) for a in (m.s, m.centreline, m.speed_limit_mps, m.left_m, m.right_m)]
    passages = [(j.junction, j.stop_s, j.exit_s, j.turn, j.signal, len(j.foes)) for j in m.junctions]
    foes = [
        (_bytes_of(f.path), f.entry_s, *f.conflict_s, *f.conflict_path_s, f.has_priority, f.pedestrian)
        for j in m.junctions
        for f in j.foes
    ]
    return _built(_Task((*[a.tobytes() for a in arrays], *passages, *foes), vehicle, mission))


@lru_cache(maxsize=KEPT_ROUTES)
def _built(task: _Task) -> DriverRoute:
    mission, vehicle = task.mission, task.vehicle
    s, centreline = np.asarray(mission.s, float), np.asarray(mission.centreline, float)
    grid_s = np.arange(s[0] - BEFORE_M, s[-1] + AFTER_M, GRID_M)
    points = np.empty(len(grid_s), ROUTE_POINT)
    x, y = (_smooth(_prolonged(grid_s, s, values)) for values in centreline.T)
    tx, ty = np.gradient(x, GRID_M), np.gradient(y, GRID_M)
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    heading = np.unwrap(np.arctan2(ty, tx))
    curvature = _smooth(np.gradient(heading, GRID_M))
    limit = np.interp(grid_s, s, np.asarray(mission.speed_limit_mps, float))
    columns = {
        "s": grid_s[0] + np.arange(len(grid_s)) * GRID_M,
        "x": x,
        "y": y,
        "cos": tx / norm,
        "sin": ty / norm,
        "heading": heading,
        "curvature": curvature,
        "profile": _speed_profile(np.minimum(limit, vehicle.max_speed_mps), curvature, vehicle),
        "left": np.interp(grid_s, s, np.asarray(mission.left_m, float)),
        "right": np.interp(grid_s, s, np.asarray(mission.right_m, float)),
    }
    for name, values in columns.items():
        points[name] = values
    foes, paths = _foes_and_paths(mission.junctions)
    junctions = [
        (j.stop_s, j.exit_s, max([j.exit_s, *(f.conflict_s[1] for f in j.foes)]), any(not f.pedestrian for f in j.foes))
        for j in mission.junctions
    ]
    return DriverRoute(
        points=points,
        columns=columns,
        coarse=_coarse(columns),
        passages=mission.junctions,
        junctions=np.array(junctions, JUNCTION),
        foes=foes,
        paths=paths,
        signals=tuple((k, j.signal) for k, j in enumerate(mission.junctions) if j.signal is not None),
    )


def _coarse(columns: dict[str, FloatArray]) -> FloatArray:
    x, y, cos, sin = (columns[name][::COARSE] for name in ("x", "y", "cos", "sin"))
    spacing = np.hypot(np.diff(x), np.diff(y)).max(initial=GRID_M)
    return np.stack([x, y, cos, sin, np.full(len(x), spacing)])


def _smooth(values: FloatArray) -> FloatArray:
    """Return values averaged with a Gaussian of `SMOOTH_M`; both ends are extended in a straight line before that."""
    reach = int(4 * SMOOTH_M / GRID_M)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * GRID_M / SMOOTH_M) ** 2)
    padded = np.pad(values, reach, mode="reflect", reflect_type="odd")
    return np.asarray(np.convolve(padded, kernel / kernel.sum(), mode="valid"), dtype=np.float64)


def _speed_profile(limit: FloatArray, curvature: FloatArray, vehicle: VehicleLimits) -> FloatArray:
    """Return the highest speed at each point that keeps the limit, is comfortable in the bend, and allows braking."""
    friction = cfg.FRICTION_SHARE * vehicle.friction * GRAVITY_MPS2
    lateral = min(cfg.LATERAL_COMFORT_MPS2, friction)
    braking = min(cfg.PROFILE_BRAKING_MPS2, friction)
    squared = np.minimum(limit**2, lateral / np.maximum(np.abs(curvature), 1e-6))
    # The smallest value, over all later points, of (their v^2 + 2 b distance), computed as a running minimum from the
    # end.
    ramp = 2.0 * braking * GRID_M * np.arange(len(squared))
    return np.asarray(np.sqrt(np.minimum.accumulate((squared + ramp)[::-1])[::-1] - ramp))


def _foes_and_paths(passages: tuple[JunctionPassage, ...]) -> tuple[Records, Records]:
    """Return the `Foe`s of all junctions, and the points of their paths."""
    foes, paths, first = [], [np.empty(0, PATH_POINT)], 0
    for k, passage in enumerate(passages):
        for foe in passage.foes:
            points, added, length = _even_path(_bytes_of(foe.path), foe.pedestrian)
            span = (first, first + len(points), k, foe.has_priority, foe.pedestrian)
            foes.append((added, length, foe.entry_s, *foe.conflict_path_s, *foe.conflict_s, *span))
            paths.append(points)
            first += len(points)
    together = np.empty(first, PATH_POINT)
    # Without `out`, the dtype would be a new object, which takes numba 100 us to look up.
    np.concatenate(paths, out=together)
    return np.array(foes, FOE), together


def _bytes_of(path: FloatArray) -> bytes:
    return np.ascontiguousarray(path, dtype=np.float64).tobytes()


@lru_cache(maxsize=512)  # cached: the lanes of a town's junctions are the same in every run
def _even_path(path: bytes, pedestrian: bool) -> tuple[Records, float, float]:
    """Return a path's points on an even grid, the length of the extension before the path, and the path's own length,
    m.

    Both ends are extended in a straight line, except those of a crossing.
    """
    points = np.frombuffer(path).reshape(-1, 2)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    keep = np.concatenate([[True], np.diff(lengths) > 1e-6])
    points, lengths = points[keep], lengths[keep]
    added = 0.0 if pedestrian else cfg.FOE_EXTENSION_M
    s = np.arange(-added, lengths[-1] + added + PATH_M, PATH_M)
    x, y = _prolonged(s, lengths, points[:, 0]), _prolonged(s, lengths, points[:, 1])
    tx, ty = np.gradient(x), np.gradient(y)
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    even = np.empty(len(s), PATH_POINT)
    even["x"], even["y"], even["cos"], even["sin"] = x, y, tx / norm, ty / norm
    return even, added, float(lengths[-1])


def _prolonged(at_s: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Return values interpolated at lengths along a path; beyond both ends they are extrapolated in a straight line."""
    first = (values[1] - values[0]) / (s[1] - s[0])
    last = (values[-1] - values[-2]) / (s[-1] - s[-2])
    beyond = np.minimum(at_s - s[0], 0.0) * first + np.maximum(at_s - s[-1], 0.0) * last
    return np.asarray(np.interp(at_s, s, values) + beyond)
