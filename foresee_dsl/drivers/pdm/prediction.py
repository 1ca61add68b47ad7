"""Where the others will be: constant velocity, along a foe's path, along the road, or straight on."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.foes import (
    ENTRY_S,
    HAS_PRIORITY,
    LENGTH_M,
    MEETS_S,
    PATH_M,
    SHIFT_M,
    FoeTable,
)
from foresee_dsl.drivers.pdm.route import (
    COS,
    CURVATURE,
    GRID_M,
    SIN,
    IntArray,
    Projection,
    X,
    Y,
    grid_point,
    project_ways,
)
from foresee_dsl.drivers.pdm.situation import (
    A_COS,
    A_SIN,
    A_SPEED,
    A_X,
    A_Y,
    ALIGNED_COSINE,
    HALF_LENGTH,
    HALF_WIDTH,
    SPEEDS_UP,
    Actors,
    BoolArray,
)
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.compiling import inner

TIMES_S: FloatArray = np.arange(round(cfg.HORIZON_S / cfg.ROLLOUT_STEP_S) + 1, dtype=np.float64) * cfg.ROLLOUT_STEP_S
"""[T] the frames of every roll-out and prediction."""
FRAMES = len(TIMES_S)
FOE_STRIDE = 2
STEEPEST_BEND = 0.6
"""Ours: offset times curvature; at 1 the centre of the bend is reached, and the route's coordinates end."""
CREEP_MPS = 4.0
CREEP_BRAKING_MPS2 = 2.0
"""Ours: who waits inside the junction for the ego creeps slower than this and is trusted to stop this gently."""
FOE_COSINE = math.cos(cfg.FOE_HEADING_RAD)
P_X, P_Y, P_COS, P_SIN, P_HALF_LENGTH, P_S, P_D, REACH_S, REACH_D, SPEED_S = range(10)
"""Rows of a prediction: the attributes of `Prediction`."""


@inner
def match(actors: Actors, own: BoolArray, which: IntArray, foes: FoeTable, on: BoolArray, found: FloatArray) -> None:
    """Fill `on` [A, F], and length along the path, speed along it and offset: `found` [3, A, F]."""
    table, numbers, points, first = actors.table, foes.numbers, foes.points, foes.first
    x, y, cos, sin, speed = table[A_X], table[A_Y], table[A_COS], table[A_SIN], table[A_SPEED]
    for f in range(len(which)):
        foe = which[f]
        start, on_foot = first[foe], foes.walking[foe]
        reach = 2 * cfg.FOE_REACH_M if on_foot else cfg.FOE_REACH_M
        for a in range(len(x)):
            i, nearest = start, np.inf
            for j in range(start, first[foe + 1], FOE_STRIDE):
                dx, dy = x[a] - points[0, j], y[a] - points[1, j]
                away = dx * dx + dy * dy
                if away < nearest:
                    i, nearest = j, away
            rx, ry, tx, ty = x[a] - points[0, i], y[a] - points[1, i], points[2, i], points[3, i]
            s = (i - start) * PATH_M - numbers[foe, SHIFT_M] + rx * tx + ry * ty
            d = ry * tx - rx * ty
            cosine = cos[a] * tx + sin[a] * ty
            # Somebody on foot may use a crossing in either direction; somebody who stands faces anywhere.
            aligned = (abs(cosine) if on_foot else cosine) > FOE_COSINE or (on_foot and speed[a] < cfg.COAST_MPS)
            there = aligned and abs(d) < reach and s < numbers[foe, LENGTH_M]
            on[a, f] = there and not own[a] and not actors.obstacle[a] and on_foot == actors.pedestrian[a]
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
def _stopping_point(entry: float, conflict: float, front_s: float, speed: float) -> float:
    """Return where somebody who must give way is trusted to stop: at the entry, else (creeping) at the conflict;
    infinite for nowhere."""
    if front_s < entry and speed * speed <= 2 * cfg.FOE_STOPS_MPS2 * (entry - front_s):
        return entry
    if front_s < conflict and speed < CREEP_MPS and speed * speed <= 2 * CREEP_BRAKING_MPS2 * (conflict - front_s):
        return conflict
    return np.inf


@inner
def _on_path(
    a: int,
    actors: FloatArray,
    way: tuple[float, float, float],
    foe: int,
    foes: FoeTable,
    out: FloatArray,
) -> None:
    """Predict actor a along a foe's path, its offset kept; one that must give way and can is taken to stop.

    `way` is its length along the path, the speed along it and the offset.
    """
    s0, speed, d = way
    numbers, points, first = foes.numbers, foes.points, foes.first
    begin, count, half, stop, room = first[foe], first[foe + 1] - first[foe], actors[HALF_LENGTH, a], np.inf, 0.0
    if numbers[foe, HAS_PRIORITY] == 0 and speed > cfg.COAST_MPS:
        stop = _stopping_point(numbers[foe, ENTRY_S], numbers[foe, MEETS_S], s0 + half, speed)
        room = max(stop - s0 - half, 1e-3)
    for n in range(FRAMES):
        s = s0 + speed * TIMES_S[n]
        if stop < np.inf:
            # v^2 / 2b = room, so that it stands after 2 room / v.
            t = min(TIMES_S[n], 2 * room / speed)
            s = s0 + speed * t - speed * speed / (4 * room) * t * t
        i = min(max((s + numbers[foe, SHIFT_M]) / PATH_M, 0.0), count - 1.001)
        j = max(int(i), 0)
        part, cos, sin = (i - j) * PATH_M, points[2, begin + j], points[3, begin + j]
        out[0, a, n] = points[0, begin + j] + part * cos - d * sin
        out[1, a, n] = points[1, begin + j] + part * sin + d * cos
        out[2, a, n], out[3, a, n], out[4, a, n] = cos, sin, half


@inner
def _straight(a: int, actors: FloatArray, out: FloatArray) -> None:
    """Predict actor a straight on."""
    x, y, cos, sin = actors[A_X, a], actors[A_Y, a], actors[A_COS, a], actors[A_SIN, a]
    speed, half = actors[A_SPEED, a], actors[HALF_LENGTH, a]
    rate = actors[SPEEDS_UP, a] if speed > cfg.COAST_MPS else 0.0
    for n in range(FRAMES):
        t = TIMES_S[n]
        grows = rate * (t * t) / 4  # half of how far the front may run ahead
        distance = speed * t + grows
        out[P_X, a, n], out[P_Y, a, n] = x + distance * cos, y + distance * sin
        out[P_COS, a, n], out[P_SIN, a, n], out[P_HALF_LENGTH, a, n] = cos, sin, half + grows


@inner
def _on_road(
    a: int, actors: FloatArray, s0: float, d0: float, i: int, route: FloatArray, origin_s: float, out: FloatArray
) -> None:
    """Predict actor a in the route's own coordinates: constant speed along it and across it."""
    cos, sin, speed, half = actors[A_COS, a], actors[A_SIN, a], actors[A_SPEED, a], actors[HALF_LENGTH, a]
    turn_cos = cos * route[i, COS] + sin * route[i, SIN]
    turn_sin = sin * route[i, COS] - cos * route[i, SIN]
    drift = turn_sin if abs(turn_sin) > cfg.DRIFT_DEADBAND_RAD else 0.0
    for n in range(FRAMES):
        s, d = s0 + speed * turn_cos * TIMES_S[n], d0 + speed * drift * TIMES_S[n]
        j = grid_point(route, origin_s, s)
        part, base_cos, base_sin = s - (origin_s + j * GRID_M), route[j, COS], route[j, SIN]
        out[P_X, a, n] = route[j, X] + part * base_cos - d * base_sin
        out[P_Y, a, n] = route[j, Y] + part * base_sin + d * base_cos
        out[P_COS, a, n] = base_cos * turn_cos - base_sin * turn_sin
        out[P_SIN, a, n] = base_sin * turn_cos + base_cos * turn_sin
        out[P_HALF_LENGTH, a, n], out[P_S, a, n], out[P_D, a, n] = half, s, d


@inner
def move_on(
    actors: Actors,
    now: Projection,
    which: IntArray,
    on: BoolArray,
    found: FloatArray,
    foes: FoeTable,
    route: FloatArray,
    origin_s: float,
    ego_s: float,
    reach_m: float,
    out: FloatArray,
) -> None:
    """Fill a prediction [10, A, T]."""
    table, free = actors.table, np.empty(len(now.s), dtype=np.bool_)
    for a in range(len(free)):
        i, f = now.point[a], _nearest_foe(a, on, found, actors.pedestrian)
        cosine = table[A_COS, a] * route[i, COS] + table[A_SIN, a] * route[i, SIN]
        along = abs(now.d[a]) < cfg.ALIGNED_REACH_M and abs(cosine) > ALIGNED_COSINE
        free[a] = f >= 0 or not along or route[i, CURVATURE] * now.d[a] >= STEEPEST_BEND
        if f >= 0:
            _on_path(a, table, (found[0, a, f], found[1, a, f], found[2, a, f]), which[f], foes, out)
        elif free[a]:
            _straight(a, table, out)
        else:
            _on_road(a, table, now.s[a], now.d[a], i, route, origin_s, out)
    project_ways(free, out, route, origin_s, ego_s, reach_m)
    _reach(table[HALF_WIDTH], route, origin_s, out)


@inner
def _reach(half_width: FloatArray, route: FloatArray, origin_s: float, out: FloatArray) -> None:
    """Fill the last three rows of a prediction: the extents along and across the route, the speed along it."""
    last = out.shape[2] - 1
    for a in range(out.shape[1]):
        s = out[P_S, a]
        for n in range(last + 1):
            j = grid_point(route, origin_s, s[n])
            cos, sin, half = out[P_COS, a, n], out[P_SIN, a, n], out[P_HALF_LENGTH, a, n]
            turn_cos, turn_sin = (
                abs(cos * route[j, COS] + sin * route[j, SIN]),
                abs(sin * route[j, COS] - cos * route[j, SIN]),
            )
            out[REACH_S, a, n] = half * turn_cos + half_width[a] * turn_sin
            out[REACH_D, a, n] = half * turn_sin + half_width[a] * turn_cos
            before, after = max(n - 1, 0), min(n + 1, last)
            out[SPEED_S, a, n] = (s[after] - s[before]) / ((after - before) * cfg.ROLLOUT_STEP_S)
