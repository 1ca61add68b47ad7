"""Scores: no collision to blame, within the lanes; then progress, time to collision, comfort, clearance, centring."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.compiled import FLAG_TABLE, FLAGS, FLOAT, FLOATS, TABLE, compiled, inner
from foresee_dsl.drivers.pdm_prediction import TIMES_S, Prediction
from foresee_dsl.drivers.pdm_proposals import Rollout, tracking_length
from foresee_dsl.drivers.pdm_route import GRID_M
from foresee_dsl.drivers.pdm_situation import BoolArray, Situation
from foresee_dsl.drivers.protocol import FloatArray

NEVER_S = 99.0
STEERS_ASIDE_M = 0.7
"""Ours: a proposal that moves aside by more than this is to blame for what comes from behind."""
LEAVES_M = 0.05
"""Ours: rounding and smoothing of the lanes' edges."""
STANDS_MPS = 0.1
NEAR_M = 6.0
"""Ours: actors whose predicted footprints stay farther aside than this from the route are left out."""

SLACK_M = 1e-6
"""Ours: far over rounding."""


class Scores(NamedTuple):
    """[P] each: the score, and the time of the first collision (NEVER_S for none)."""

    score: FloatArray
    collision_s: FloatArray


def score(situation: Situation, rollout: Rollout, prediction: Prediction) -> Scores:
    """Score all proposals."""
    vehicle, pose, route = situation.vehicle, situation.pose, situation.route
    hit, close, ttc = conflicts(situation, rollout, prediction)
    length = tracking_length(pose.speed, rollout.offset - pose.d, vehicle)
    lanes = route.left, route.right, route.origin_s, vehicle.width_m / 2
    points, collision_s = np.empty(len(length)), np.empty(len(length))
    motion = rollout.s, rollout.d, rollout.offset, rollout.acceleration, length, rollout.brake
    _rate(*motion, hit, close, ttc, pose.d, pose.speed, *lanes, TIMES_S, _WEIGHTS, points, collision_s)
    return Scores(points, collision_s)


def choose(rollout: Rollout, scores: Scores) -> int:
    """Return the best proposal; where all collide (or leave the lanes) the latest collision, then the slowest one."""
    best = int(scores.score.argmax())
    if scores.score[best] >= 0:
        return best
    frame = np.minimum(np.searchsorted(TIMES_S, scores.collision_s), len(TIMES_S) - 1)
    impact = rollout.speed[np.arange(len(frame)), frame]
    emergency = scores.collision_s.max() < cfg.EMERGENCY_S
    # Within 2 s the speed at the impact counts, before that the time that is won.
    order = np.lexsort((impact, -scores.collision_s)) if not emergency else np.lexsort((-scores.collision_s, impact))
    return int(order[0])


def conflicts(situation: Situation, rollout: Rollout, prediction: Prediction) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Compare footprints: [P, T] collides (and is to blame), passes closely, would collide within TTC_S."""
    actors, vehicle = situation.actors, situation.vehicle
    hit, close, ttc = np.zeros((3, *rollout.s.shape), dtype=bool)
    if not actors.count:
        return hit, close, ttc
    p, r = prediction, rollout
    # A driver may have cut frames out of a prediction.
    where = _whole(p.x), _whole(p.y), _whole(p.cos), _whole(p.sin), _whole(p.half_length)
    on_route = _whole(p.s), _whole(p.d), _whole(p.reach_s), _whole(p.reach_d)
    others = actors.half_width, actors.speed, actors.pedestrian
    stretch = float(r.s[0, 0]), float(r.s.max())
    own = _whole(r.speed), _whole(r.x), _whole(r.y), _whole(r.cos), _whole(r.sin)
    aside = np.abs(rollout.offset - situation.pose.d) > STEERS_ASIDE_M
    size = vehicle.length_m, vehicle.width_m
    _compare(*where, *on_route, *others, *stretch, *own, aside, *size, _AIR, hit, close, ttc)
    return hit, close, ttc


def _whole(values: FloatArray) -> FloatArray:
    """Return an array in one piece, the same where it is that already."""
    return values if values.flags.c_contiguous else np.ascontiguousarray(values)


class _Air(NamedTuple):
    """Settings of `_compare`."""

    margin_m: float
    clearance_m: float
    pedestrian_m: float
    ttc_s: float


_AIR = _Air(cfg.COLLISION_MARGIN_M, cfg.CLEARANCE_M, cfg.PEDESTRIAN_CLEARANCE_M, cfg.TTC_S)


@inner
def _is_relevant(
    s: FloatArray, d: FloatArray, reach_s: FloatArray, reach_d: FloatArray, a: int, start: float, end: float
) -> bool:
    """Tell whether somebody comes near the stretch that any proposal covers."""
    for t in range(s.shape[1]):
        if abs(d[a, t]) - reach_d[a, t] < NEAR_M and s[a, t] + reach_s[a, t] > start and s[a, t] - reach_s[a, t] < end:
            return True
    return False


@compiled(
    *(TABLE,) * 9, FLOATS, FLOATS, FLAGS, FLOAT, FLOAT, *(TABLE,) * 5, FLAGS, FLOAT, FLOAT, _AIR, *(FLAG_TABLE,) * 3
)
def _compare(
    ax: FloatArray,
    ay: FloatArray,
    acos: FloatArray,
    asin: FloatArray,
    half_length: FloatArray,
    s: FloatArray,
    d: FloatArray,
    reach_s: FloatArray,
    reach_d: FloatArray,
    half_width: FloatArray,
    actor_speed: FloatArray,
    pedestrian: BoolArray,
    start_s: float,
    end_s: float,
    speed: FloatArray,
    x: FloatArray,
    y: FloatArray,
    cos: FloatArray,
    sin: FloatArray,
    aside: BoolArray,
    ego_length: float,
    ego_width: float,
    air: _Air,
    hit: BoolArray,
    close: BoolArray,
    ttc: BoolArray,
) -> None:
    """Fill hit, close and ttc [P, T] from the others' footprints [A, T] and the ego's [P, T]."""
    start, end = start_s - ego_length, end_s + 2 * ego_length
    half_l, half_w, margin = ego_length / 2, ego_width / 2, air.margin_m
    for a in range(len(half_width)):
        if not _is_relevant(s, d, reach_s, reach_d, a, start, end):
            continue
        width, pace = half_width[a], actor_speed[a]
        side = air.pedestrian_m if pedestrian[a] else air.clearance_m
        for p in range(len(aside)):
            behind_at_first = (ax[a, 0] - x[p, 0]) * cos[p, 0] + (ay[a, 0] - y[p, 0]) * sin[p, 0] < -half_l
            for t in range(s.shape[1]):
                dx, dy, ego_cos, ego_sin, v = ax[a, t] - x[p, t], ay[a, t] - y[p, t], cos[p, t], sin[p, t], speed[p, t]
                along, across = dx * ego_cos + dy * ego_sin, dy * ego_cos - dx * ego_sin
                length = half_length[a, t]
                # Nobody is near outside of a box that holds all that is asked for below.
                most = length + width + SLACK_M
                if abs(along) > half_l + most + max(margin, v * air.ttc_s):
                    continue
                if abs(across) > half_w + most + max(side, margin, pace * air.ttc_s):
                    continue
                turn_cos = acos[a, t] * ego_cos + asin[a, t] * ego_sin
                turn_sin = asin[a, t] * ego_cos - acos[a, t] * ego_sin
                size_cos, size_sin = abs(turn_cos), abs(turn_sin)
                room_along = abs(along) - (half_l + length * size_cos + width * size_sin)
                room_across = abs(across) - (half_w + length * size_sin + width * size_cos)
                there = max(
                    abs(along * turn_cos + across * turn_sin) - (length + half_l * size_cos + half_w * size_sin),
                    abs(across * turn_cos - along * turn_sin) - (width + half_l * size_sin + half_w * size_cos),
                )
                moves = v > STANDS_MPS
                # It is not to blame when it stands, nor from behind unless it moves aside.
                if moves and (aside[p] or not (behind_at_first and along < -half_l)):
                    hit[p, t] |= max(room_along, room_across, there) < margin
                    close[p, t] |= room_along < margin and room_across < side and there < side
                if moves and along > 0:
                    ahead = min(max(v - pace * turn_cos, 0.0), v) * air.ttc_s
                    inwards = max(-np.sign(across) * pace * turn_sin, 0.0) * air.ttc_s
                    ttc[p, t] |= room_along < ahead and room_across < inwards


class _Weights(NamedTuple):
    """Settings of `_rate`."""

    progress: float
    ttc: float
    comfort: float
    clearance: float
    centring: float
    centring_m: float
    braking_mps2: float
    lateral_mps2: float
    grid_m: float


_WEIGHTS = _Weights(
    cfg.PROGRESS_WEIGHT, cfg.TTC_WEIGHT, cfg.COMFORT_WEIGHT, cfg.CLEARANCE_WEIGHT, cfg.CENTRING_WEIGHT,
    cfg.CENTRING_SCALE_M, cfg.COMFORT_BRAKING_MPS2, cfg.COMFORT_LATERAL_MPS2, GRID_M,
)  # fmt: skip


@inner
def _keeps_lanes(
    s: FloatArray, d: FloatArray, left: FloatArray, right: FloatArray, origin_s: float, grid_m: float, half: float
) -> bool:
    """Tell whether a proposal leaves the lanes no farther than the ego does now."""
    at_first, most = 0.0, -np.inf
    for t in range(len(s)):
        k = min(max(int((s[t] - origin_s) * (1.0 / grid_m)), 0), len(left) - 1)
        out = max(d[t] + half - left[k], half - d[t] - right[k])
        if t == 0:
            at_first = max(out, 0.0)
        most = max(most, out)
    return most <= at_first + LEAVES_M


@compiled(
    TABLE, TABLE, *(FLOATS,) * 3, FLAGS, *(FLAG_TABLE,) * 3,
    FLOAT, FLOAT, FLOATS, FLOATS, FLOAT, FLOAT, FLOATS, _WEIGHTS, FLOATS, FLOATS,
)  # fmt: skip
def _rate(
    s: FloatArray,
    d: FloatArray,
    offset: FloatArray,
    acceleration: FloatArray,
    length: FloatArray,
    brake: BoolArray,
    hit: BoolArray,
    close: BoolArray,
    ttc: BoolArray,
    ego_d: float,
    speed: float,
    left: FloatArray,
    right: FloatArray,
    origin_s: float,
    half: float,
    times: FloatArray,
    weights: _Weights,
    points: FloatArray,
    collision_s: FloatArray,
) -> None:
    """Fill points and the time of the first collision, [P]; first `points` tells who is allowed (0, else -1)."""
    frames, best = s.shape[1], 0.0
    for p in range(len(points)):
        collision_s[p] = NEVER_S
        for t in range(frames - 1, -1, -1):
            if hit[p, t]:
                collision_s[p] = times[t]
        allowed = collision_s[p] == NEVER_S and (
            brake[p] or _keeps_lanes(s[p], d[p], left, right, origin_s, weights.grid_m, half)
        )
        points[p] = 0.0 if allowed else -1.0
        if allowed:
            best = max(best, s[p, frames - 1] - s[p, 0])
    for p in range(len(points)):
        if points[p] < 0.0:
            continue
        near, touches = 0, 0
        for t in range(frames):
            near += close[p, t]
            touches += ttc[p, t]
        error = offset[p] - ego_d
        lateral = speed**2 * abs(error) / length[p] ** 2
        comfort = acceleration[p] > -weights.braking_mps2 and lateral < weights.lateral_mps2
        aside = 0.5 * abs(offset[p]) + 0.5 * abs(error)
        points[p] = (
            weights.progress * (min((s[p, frames - 1] - s[p, 0]) / best, 1.0) if best > 1.0 else 1.0)
            + (0.0 if touches > 0 else weights.ttc)
            + (weights.comfort if comfort else 0.0)
            + weights.clearance * (1.0 - near / frames)
            - weights.centring * min(aside / weights.centring_m, 1.0)
        )
