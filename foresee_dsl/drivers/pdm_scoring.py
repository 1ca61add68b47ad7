"""Scores: no collision to blame, within the lanes; then progress, time to collision, comfort, clearance, centring."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.pdm_prediction import TIMES_S, Prediction
from foresee_dsl.drivers.pdm_proposals import Rollout, tracking_length
from foresee_dsl.drivers.pdm_route import Route
from foresee_dsl.drivers.pdm_situation import BoolArray, Situation
from foresee_dsl.drivers.protocol import FloatArray, VehicleLimits

NEVER_S = 99.0
STEERS_ASIDE_M = 0.7
"""Ours: a proposal that moves aside by more than this is to blame for what comes from behind."""
LEAVES_M = 0.05
"""Ours: rounding and smoothing of the lanes' edges."""
STANDS_MPS = 0.1
NEAR_M = 6.0
"""Ours: actors whose predicted footprints stay farther aside than this from the route are left out."""


@dataclass(frozen=True)
class Scores:
    """[P] each: the score, and the time of the first collision (NEVER_S for none)."""

    score: FloatArray
    collision_s: FloatArray


def score(situation: Situation, rollout: Rollout, prediction: Prediction) -> Scores:
    """Score all proposals."""
    vehicle, current_d = situation.vehicle, situation.pose.d
    hit, close, ttc = conflicts(situation, rollout, prediction)
    collision_s = np.where(hit.any(axis=1), TIMES_S[hit.argmax(axis=1)], NEVER_S)
    free = collision_s == NEVER_S
    way = rollout.s[:, -1] - rollout.s[:, 0]
    allowed = free & _within_lanes(situation.route, rollout, vehicle)
    best = float(way[allowed].max()) if allowed.any() else 0.0
    progress = np.minimum(way / best, 1.0) if best > 1.0 else np.ones(len(way))
    error = rollout.offset - current_d
    lateral = situation.pose.speed**2 * np.abs(error) / tracking_length(situation.pose.speed, error, vehicle) ** 2
    comfort = (rollout.acceleration > -cfg.COMFORT_BRAKING_MPS2) & (lateral < cfg.COMFORT_LATERAL_MPS2)
    aside = 0.5 * np.abs(rollout.offset) + 0.5 * np.abs(error)
    points = (
        cfg.PROGRESS_WEIGHT * progress
        + cfg.TTC_WEIGHT * ~ttc.any(axis=1)
        + cfg.COMFORT_WEIGHT * comfort
        + cfg.CLEARANCE_WEIGHT * (1.0 - close.mean(axis=1))
        - cfg.CENTRING_WEIGHT * np.minimum(aside / cfg.CENTRING_SCALE_M, 1.0)
    )
    return Scores(score=np.where(allowed, points, -1.0), collision_s=collision_s)


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


def _within_lanes(route: Route, rollout: Rollout, vehicle: VehicleLimits) -> BoolArray:
    """Tell which proposals leave the lanes no farther than the ego does now: [P]."""
    k = route.indices(rollout.s)
    half = vehicle.width_m / 2
    out = np.maximum(rollout.d + half - route.left[k], half - rollout.d - route.right[k])
    return np.asarray((out.max(axis=1) <= np.maximum(out[:, 0], 0.0) + LEAVES_M) | rollout.brake)


def conflicts(situation: Situation, rollout: Rollout, prediction: Prediction) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Compare footprints: [P, T] collides (and is to blame), passes closely, would collide within TTC_S."""
    actors, vehicle = situation.actors, situation.vehicle
    who = _relevant(rollout, prediction, vehicle)
    none = np.zeros(rollout.s.shape, dtype=bool)
    if not who.size:
        return none, none, none
    shape = (slice(None), None, slice(None))  # [P, 1, T] against [1, A, T]
    cos, sin = rollout.cos[shape], rollout.sin[shape]
    dx = prediction.x[who] - rollout.x[shape]
    dy = prediction.y[who] - rollout.y[shape]
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    pc, ps = prediction.cos[who], prediction.sin[who]
    turn_cos, turn_sin = pc * cos + ps * sin, ps * cos - pc * sin
    size_cos, size_sin = np.abs(turn_cos), np.abs(turn_sin)
    length, width = prediction.half_length[who], actors.half_width[who][:, None]
    half_l, half_w = vehicle.length_m / 2, vehicle.width_m / 2
    margin = cfg.COLLISION_MARGIN_M
    room_along = np.abs(along) - (half_l + length * size_cos + width * size_sin)
    room_across = np.abs(across) - (half_w + length * size_sin + width * size_cos)
    there_along = np.abs(along * turn_cos + across * turn_sin) - (length + half_l * size_cos + half_w * size_sin)
    there_across = np.abs(across * turn_cos - along * turn_sin) - (width + half_l * size_sin + half_w * size_cos)
    apart = np.maximum(np.maximum(room_along, room_across), np.maximum(there_along, there_across))
    blame = _blame(rollout, along, situation.pose.d, half_l)
    hit = (apart < margin) & blame
    air = np.where(actors.pedestrian[who], cfg.PEDESTRIAN_CLEARANCE_M, cfg.CLEARANCE_M)[:, None]
    close = (room_along < margin) & (room_across < air) & (np.maximum(there_along, there_across) < air) & blame
    speed = rollout.speed[shape]
    forward = speed - actors.speed[who][:, None] * turn_cos
    ahead_m = np.minimum(np.maximum(forward, 0.0), speed) * cfg.TTC_S
    inwards = np.maximum(-np.sign(across) * actors.speed[who][:, None] * turn_sin, 0.0) * cfg.TTC_S
    ttc = (along > 0) & (room_along < ahead_m) & (room_across < inwards) & (speed > STANDS_MPS)
    return np.any(hit, axis=1), np.any(close, axis=1), np.any(ttc, axis=1)


def _relevant(rollout: Rollout, prediction: Prediction, vehicle: VehicleLimits) -> NDArray[np.int64]:
    """Return who comes near the stretch that any proposal covers."""
    if not len(prediction.s):
        return np.zeros(0, dtype=np.int64)
    start, end = float(rollout.s[0, 0]), float(rollout.s.max())
    aside = np.abs(prediction.d) - prediction.reach_d < NEAR_M
    along = (prediction.s + prediction.reach_s > start - vehicle.length_m) & (
        prediction.s - prediction.reach_s < end + 2 * vehicle.length_m
    )
    return np.flatnonzero((aside & along).any(axis=1))


def _blame(rollout: Rollout, along: FloatArray, current_d: float, half_length: float) -> BoolArray:
    """Tell where a collision would be the ego's: [P, A, T].

    It is not when the ego stands, nor from behind unless it moves aside.
    """
    moves = rollout.speed[:, None, :] > STANDS_MPS
    aside = np.abs(rollout.offset - current_d)[:, None, None] > STEERS_ASIDE_M
    behind = (along < -half_length) & (along[:, :, :1] < -half_length)
    return moves & (aside | ~behind)
