"""Where the others will be: constant velocity, along a foe's path, along the road, or straight on."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.compiled import CUBE, FLAG_TABLE, FLAGS, FLOAT, FLOATS, INTS, TABLE, compiled, inner
from foresee_dsl.drivers.pdm_route import GRID_M, PATH_M, FoePath
from foresee_dsl.drivers.pdm_situation import BoolArray, Situation
from foresee_dsl.drivers.protocol import FloatArray

IntArray = NDArray[np.int64]

TIMES_S: FloatArray = np.arange(round(cfg.HORIZON_S / cfg.ROLLOUT_STEP_S) + 1, dtype=np.float64) * cfg.ROLLOUT_STEP_S
"""[T] the frames of every roll-out and prediction."""
FOE_STRIDE = 2
STEEPEST_BEND = 0.6
"""Ours: offset times curvature; at 1 the centre of the bend is reached, and the route's coordinates end."""
CREEP_MPS = 4.0
CREEP_BRAKING_MPS2 = 2.0
"""Ours: who waits inside the junction for the ego creeps slower than this and is trusted to stop this gently."""


@dataclass(frozen=True)
class FoeMatches:
    """Who is on which foe's path.

    Attributes:
        foes: F of them. which: [F] their indices on the route. on: [A, F], on it or not.
        found: [3, A, F], length along it, speed along it, offset.
    """

    foes: tuple[FoePath, ...]
    which: IntArray
    on: BoolArray
    found: FloatArray

    @property
    def s(self) -> FloatArray:
        """Length along the path, m: [A, F]."""
        row: FloatArray = self.found[0]
        return row

    @property
    def speed(self) -> FloatArray:
        """Speed along the path, m/s: [A, F]."""
        row: FloatArray = self.found[1]
        return row

    @property
    def d(self) -> FloatArray:
        """Offset from the path, m: [A, F]."""
        row: FloatArray = self.found[2]
        return row


@dataclass(frozen=True)
class Prediction:
    """Footprints over the horizon, [A, T] each.

    Attributes:
        x, y, cos, sin: centre and heading. half_length: m, growing where speed is uncertain. s, d: on the route.
        reach_s, reach_d: half of the footprint's extent along and across the route. speed_s: m/s along the route.
    """

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    half_length: FloatArray
    s: FloatArray
    d: FloatArray
    reach_s: FloatArray
    reach_d: FloatArray
    speed_s: FloatArray


_ROWS = len(fields(Prediction))


def match_foes(situation: Situation, foes: tuple[FoePath, ...]) -> FoeMatches:
    """Find who is on which foe's path; who is in the ego's lane is on none."""
    actors, table = situation.actors, situation.route.foe_table
    shape = (actors.count, len(foes))
    on, found = np.zeros(shape, dtype=bool), np.empty((3, *shape))
    which = np.array([f.index for f in foes], dtype=np.int64)
    if on.size:
        others = actors.table, situation.own, actors.pedestrian, actors.obstacle
        paths = table.numbers, table.walking, table.points, table.first
        _match(*others, which, *paths, _MATCHING, on, found)
    return FoeMatches(foes, which, on, found)


def predict(situation: Situation, matches: FoeMatches) -> Prediction:
    """Roll everybody out over the horizon."""
    route, actors, now = situation.route, situation.actors, situation.now
    out = np.empty((_ROWS, actors.count, len(TIMES_S)))
    if actors.count:
        table, free = route.foe_table, np.empty(actors.count, dtype=bool)
        paths = matches.on, matches.found, matches.which, table.numbers, table.points, table.first
        road = now.s, now.d, now.index, route.grid, route.curvature, route.origin_s
        _move_on(actors.table, actors.pedestrian, *paths, *road, TIMES_S, _PREDICTING, free, out)
        route.project_ways(free, out, situation.pose.s, situation.reach_m)
        _reach(actors.half_width, route.grid, route.origin_s, GRID_M, cfg.ROLLOUT_STEP_S, out)
    return Prediction(*out)


class _Matching(NamedTuple):
    """Settings of `_match`."""

    reach_m: float
    cosine: float
    coast_mps: float
    path_m: float


class _Predicting(NamedTuple):
    """Settings of `_move_on`."""

    aligned_reach_m: float
    aligned_cosine: float
    drift_deadband: float
    coast_mps: float
    foe_stops_mps2: float
    grid_m: float
    path_m: float


One = tuple[float, float, float, float, float, float, float]
"""An actor's column of `Actors.table`."""
_ONE: One = (0.0,) * 7
_MATCHING = _Matching(cfg.FOE_REACH_M, math.cos(cfg.FOE_HEADING_RAD), cfg.COAST_MPS, PATH_M)
_PREDICTING = _Predicting(
    aligned_reach_m=cfg.ALIGNED_REACH_M,
    aligned_cosine=math.cos(cfg.ALIGNED_RAD),
    drift_deadband=cfg.DRIFT_DEADBAND_RAD,
    coast_mps=cfg.COAST_MPS,
    foe_stops_mps2=cfg.FOE_STOPS_MPS2,
    grid_m=GRID_M,
    path_m=PATH_M,
)


@compiled(TABLE, *(FLAGS,) * 3, INTS, TABLE, FLAGS, TABLE, INTS, _MATCHING, FLAG_TABLE, CUBE)
def _match(
    actors: FloatArray,
    own: BoolArray,
    pedestrian: BoolArray,
    obstacle: BoolArray,
    which: IntArray,
    numbers: FloatArray,
    walking: BoolArray,
    points: FloatArray,
    first: IntArray,
    k: _Matching,
    on: BoolArray,
    found: FloatArray,
) -> None:
    """Fill `on` [A, F], and length along the path, speed along it and offset: `found` [3, A, F]."""
    x, y, cos, sin, speed = actors[0], actors[1], actors[2], actors[3], actors[4]
    for f in range(len(which)):
        foe = which[f]
        start, on_foot = first[foe], walking[foe]
        reach = 2 * k.reach_m if on_foot else k.reach_m
        for a in range(len(x)):
            i, nearest = start, np.inf
            for j in range(start, first[foe + 1], FOE_STRIDE):
                dx, dy = x[a] - points[0, j], y[a] - points[1, j]
                away = dx * dx + dy * dy
                if away < nearest:
                    i, nearest = j, away
            rx, ry, tx, ty = x[a] - points[0, i], y[a] - points[1, i], points[2, i], points[3, i]
            s = (i - start) * k.path_m - numbers[foe, 0] + rx * tx + ry * ty
            d = ry * tx - rx * ty
            cosine = cos[a] * tx + sin[a] * ty
            # Somebody on foot may use a crossing in either direction; somebody who stands faces anywhere.
            aligned = (abs(cosine) if on_foot else cosine) > k.cosine or (on_foot and speed[a] < k.coast_mps)
            there = aligned and abs(d) < reach and s < numbers[foe, 1]
            on[a, f] = there and not own[a] and not obstacle[a] and on_foot == pedestrian[a]
            found[0, a, f], found[1, a, f], found[2, a, f] = s, cosine * speed[a], d


@inner
def _nearest_foe(a: int, on: BoolArray, found: FloatArray, pedestrian: BoolArray) -> int:
    """Return the foe whose path an actor is nearest to, -1 for none."""
    best, nearest = -1, np.inf
    for f in range(on.shape[1]):
        if on[a, f] and abs(found[2, a, f]) < nearest:
            best, nearest = f, abs(found[2, a, f])
    # On foot, only who walks along the path follows it; the predictions of the others go straight.
    return -1 if best >= 0 and pedestrian[a] and found[1, a, best] <= 0 else best


@inner
def _stopping_point(entry: float, conflict: float, front_s: float, speed: float, stops_mps2: float) -> float:
    """Return where somebody who must give way is trusted to stop: at the entry, else (creeping) at the conflict;
    infinite for nowhere."""
    if front_s < entry and speed * speed <= 2 * stops_mps2 * (entry - front_s):
        return entry
    if front_s < conflict and speed < CREEP_MPS and speed * speed <= 2 * CREEP_BRAKING_MPS2 * (conflict - front_s):
        return conflict
    return np.inf


@inner
def _on_path(
    a: int,
    one: One,
    way: tuple[float, float, float],
    foe: int,
    numbers: FloatArray,
    points: FloatArray,
    first: IntArray,
    times: FloatArray,
    k: _Predicting,
    out: FloatArray,
) -> None:
    """Predict actor a along a foe's path, its offset kept; one that must give way and can is taken to stop.

    `way` is its length along the path, the speed along it and the offset.
    """
    s0, speed, d = way
    begin, count, half, stop, room = first[foe], first[foe + 1] - first[foe], one[5], np.inf, 0.0
    if numbers[foe, 4] > 0 and speed > k.coast_mps:
        stop = _stopping_point(numbers[foe, 2], numbers[foe, 3], s0 + half, speed, k.foe_stops_mps2)
        room = max(stop - s0 - half, 1e-3)
    for n in range(len(times)):
        s = s0 + speed * times[n]
        if stop < np.inf:
            # v^2 / 2b = room, so that it stands after 2 room / v.
            t = min(times[n], 2 * room / speed)
            s = s0 + speed * t - speed * speed / (4 * room) * t * t
        i = min(max((s + numbers[foe, 0]) / k.path_m, 0.0), count - 1.001)
        j = max(int(i), 0)
        part, cos, sin = (i - j) * k.path_m, points[2, begin + j], points[3, begin + j]
        out[0, a, n] = points[0, begin + j] + part * cos - d * sin
        out[1, a, n] = points[1, begin + j] + part * sin + d * cos
        out[2, a, n], out[3, a, n], out[4, a, n] = cos, sin, half


@inner
def _straight(a: int, one: One, times: FloatArray, k: _Predicting, out: FloatArray) -> None:
    """Predict actor a straight on."""
    x, y, cos, sin, speed, half, speeds_up = one
    rate = speeds_up if speed > k.coast_mps else 0.0
    for n in range(len(times)):
        grows = rate * (times[n] * times[n]) / 4  # half of how far the front may run ahead
        distance = speed * times[n] + grows
        out[0, a, n], out[1, a, n] = x + distance * cos, y + distance * sin
        out[2, a, n], out[3, a, n], out[4, a, n] = cos, sin, half + grows


@inner
def _on_road(
    a: int,
    one: One,
    s0: float,
    d0: float,
    i: int,
    grid: FloatArray,
    origin_s: float,
    times: FloatArray,
    k: _Predicting,
    out: FloatArray,
) -> None:
    """Predict actor a in the route's own coordinates: constant speed along it and across it."""
    _, _, cos, sin, speed, half, _ = one
    turn_cos = cos * grid[2, i] + sin * grid[3, i]
    turn_sin = sin * grid[2, i] - cos * grid[3, i]
    drift = turn_sin if abs(turn_sin) > k.drift_deadband else 0.0
    for n in range(len(times)):
        s, d = s0 + speed * turn_cos * times[n], d0 + speed * drift * times[n]
        j = min(max(int((s - origin_s) * (1.0 / k.grid_m)), 0), grid.shape[1] - 1)
        part, base_cos, base_sin = s - (origin_s + j * k.grid_m), grid[2, j], grid[3, j]
        out[0, a, n] = grid[0, j] + part * base_cos - d * base_sin
        out[1, a, n] = grid[1, j] + part * base_sin + d * base_cos
        out[2, a, n] = base_cos * turn_cos - base_sin * turn_sin
        out[3, a, n] = base_sin * turn_cos + base_cos * turn_sin
        out[4, a, n], out[5, a, n], out[6, a, n] = half, s, d


@compiled(
    TABLE, FLAGS, FLAG_TABLE, CUBE, INTS, TABLE, TABLE, INTS,
    FLOATS, FLOATS, INTS, TABLE, FLOATS, FLOAT, FLOATS, _PREDICTING, FLAGS, CUBE,
)  # fmt: skip
def _move_on(
    actors: FloatArray,
    pedestrian: BoolArray,
    on: BoolArray,
    found: FloatArray,
    which: IntArray,
    numbers: FloatArray,
    points: FloatArray,
    first: IntArray,
    now_s: FloatArray,
    now_d: FloatArray,
    now_index: IntArray,
    grid: FloatArray,
    curvature: FloatArray,
    origin_s: float,
    times: FloatArray,
    k: _Predicting,
    free: BoolArray,
    out: FloatArray,
) -> None:
    """Fill the first five rows of `out` [10, A, T], and for those along the road s and d; `free` [A]: all others."""
    for a in range(len(free)):
        one = (
            actors[0, a], actors[1, a], actors[2, a], actors[3, a], actors[4, a], actors[5, a], actors[6, a],
        )  # fmt: skip
        i, f = now_index[a], _nearest_foe(a, on, found, pedestrian)
        cosine = one[2] * grid[2, i] + one[3] * grid[3, i]
        along = abs(now_d[a]) < k.aligned_reach_m and abs(cosine) > k.aligned_cosine
        free[a] = f >= 0 or not along or curvature[i] * now_d[a] >= STEEPEST_BEND
        if f >= 0:
            way = found[0, a, f], found[1, a, f], found[2, a, f]
            _on_path(a, one, way, which[f], numbers, points, first, times, k, out)
        elif free[a]:
            _straight(a, one, times, k, out)
        else:
            _on_road(a, one, now_s[a], now_d[a], i, grid, origin_s, times, k, out)


@compiled(FLOATS, TABLE, FLOAT, FLOAT, FLOAT, CUBE)
def _reach(
    half_width: FloatArray, grid: FloatArray, origin_s: float, grid_m: float, step_s: float, out: FloatArray
) -> None:
    """Fill the last three rows of `out` [10, A, T]: the extents along and across the route, the speed along it."""
    last = out.shape[2] - 1
    for a in range(out.shape[1]):
        s = out[5, a]
        for n in range(last + 1):
            j = min(max(int((s[n] - origin_s) * (1.0 / grid_m)), 0), grid.shape[1] - 1)
            turn_cos = abs(out[2, a, n] * grid[2, j] + out[3, a, n] * grid[3, j])
            turn_sin = abs(out[3, a, n] * grid[2, j] - out[2, a, n] * grid[3, j])
            out[7, a, n] = out[4, a, n] * turn_cos + half_width[a] * turn_sin
            out[8, a, n] = out[4, a, n] * turn_sin + half_width[a] * turn_cos
            before, after = max(n - 1, 0), min(n + 1, last)
            out[9, a, n] = (s[after] - s[before]) / ((after - before) * step_s)
