"""Scores: no collision to blame, within the lanes; then progress, time to collision, comfort, clearance, centring."""

from __future__ import annotations

import numpy as np

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.prediction import TIMES_S
from foresee_dsl.drivers.pdm.rollout import BRAKING, R_D, R_S, decay_length
from foresee_dsl.drivers.pdm.route import LEFT, RIGHT, IntArray, grid_point
from foresee_dsl.drivers.pdm.situation import A_SPEED, HALF_WIDTH, Actors, BoolArray, Car, EgoPose
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.compiling import inner

STEERS_ASIDE_M = 0.7
"""Ours: a proposal that moves aside by more than this is to blame for what comes from behind."""
LEAVES_M = 0.05
"""Ours: rounding and smoothing of the lanes' edges."""
STANDS_MPS = 0.1
NEAR_M = 6.0
"""Ours: actors whose predicted footprints stay farther aside than this from the route are left out."""

SLACK_M = 1e-6
"""Ours: far over rounding."""


@inner
def find_relevant(
    s: FloatArray,
    d: FloatArray,
    reach_s: FloatArray,
    reach_d: FloatArray,
    begins_s: float,
    ends_s: float,
    car: Car,
    who: BoolArray,
) -> bool:
    """Fill `who` [A] with who comes near the stretch that any proposal covers; tell whether anybody does."""
    start, end, anybody = begins_s - car.length, ends_s + 2 * car.length, False
    for a in range(len(who)):
        who[a] = False
        for t in range(s.shape[1]):
            beside = abs(d[a, t]) - reach_d[a, t] < NEAR_M
            if beside and s[a, t] + reach_s[a, t] > start and s[a, t] - reach_s[a, t] < end:
                who[a], anybody = True, True
                break
    return anybody


@inner
def compare(
    actors: Actors,
    who: BoolArray,
    ax: FloatArray,
    ay: FloatArray,
    acos: FloatArray,
    asin: FloatArray,
    half_length: FloatArray,
    speed: FloatArray,
    x: FloatArray,
    y: FloatArray,
    cos: FloatArray,
    sin: FloatArray,
    aside: BoolArray,
    car: Car,
    hit: BoolArray,
    close: BoolArray,
    ttc: BoolArray,
) -> None:
    """Fill hit, close and ttc [P, T] from the others' footprints [A, T] and the ego's [P, T]."""
    half_l, half_w, margin = car.length / 2, car.width / 2, cfg.COLLISION_MARGIN_M
    for a in range(len(who)):
        if not who[a]:
            continue
        width, pace = actors.table[HALF_WIDTH, a], actors.table[A_SPEED, a]
        side = cfg.PEDESTRIAN_CLEARANCE_M if actors.pedestrian[a] else cfg.CLEARANCE_M
        for p in range(len(aside)):
            behind_at_first = (ax[a, 0] - x[p, 0]) * cos[p, 0] + (ay[a, 0] - y[p, 0]) * sin[p, 0] < -half_l
            for t in range(ax.shape[1]):
                dx, dy, ego_cos, ego_sin, v = ax[a, t] - x[p, t], ay[a, t] - y[p, t], cos[p, t], sin[p, t], speed[p, t]
                along, across = dx * ego_cos + dy * ego_sin, dy * ego_cos - dx * ego_sin
                length = half_length[a, t]
                # Nobody is near outside of a box that holds all that is asked for below.
                most = length + width + SLACK_M
                if abs(along) > half_l + most + max(margin, v * cfg.TTC_S):
                    continue
                if abs(across) > half_w + most + max(side, margin, pace * cfg.TTC_S):
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
                    ahead = min(max(v - pace * turn_cos, 0.0), v) * cfg.TTC_S
                    inwards = max(-np.sign(across) * pace * turn_sin, 0.0) * cfg.TTC_S
                    ttc[p, t] |= room_along < ahead and room_across < inwards


@inner
def _keeps_lanes(s: FloatArray, d: FloatArray, route: FloatArray, origin_s: float, half: float) -> bool:
    """Tell whether a proposal leaves the lanes no farther than the ego does now."""
    at_first, most = 0.0, -np.inf
    for t in range(len(s)):
        k = grid_point(route, origin_s, s[t])
        out = max(d[t] + half - route[k, LEFT], half - d[t] - route[k, RIGHT])
        if t == 0:
            at_first = max(out, 0.0)
        most = max(most, out)
    return most <= at_first + LEAVES_M


@inner
def rate(
    rolled: FloatArray,
    offset: FloatArray,
    acceleration: FloatArray,
    hit: BoolArray,
    close: BoolArray,
    ttc: BoolArray,
    pose: EgoPose,
    car: Car,
    route: FloatArray,
    origin_s: float,
    points: FloatArray,
    collides: IntArray,
) -> None:
    """Fill points and the frame of the first collision (their number for none), [P].

    First `points` tells who is allowed: 0, else -1.
    """
    frames, best, half = rolled.shape[2], 0.0, car.width / 2
    for p in range(len(points)):
        s = rolled[R_S, p]
        collides[p] = frames
        for t in range(frames - 1, -1, -1):
            if hit[p, t]:
                collides[p] = t
        brakes = p >= len(points) - BRAKING
        allowed = collides[p] == frames and (brakes or _keeps_lanes(s, rolled[R_D, p], route, origin_s, half))
        points[p] = 0.0 if allowed else -1.0
        if allowed:
            best = max(best, s[frames - 1] - s[0])
    for p in range(len(points)):
        if points[p] < 0.0:
            continue
        near, touches = 0, 0
        for t in range(frames):
            near += close[p, t]
            touches += ttc[p, t]
        error = offset[p] - pose.d
        lateral = pose.speed**2 * abs(error) / decay_length(pose.speed, error, car.sharpest) ** 2
        comfort = acceleration[p] > -cfg.COMFORT_BRAKING_MPS2 and lateral < cfg.COMFORT_LATERAL_MPS2
        aside = 0.5 * abs(offset[p]) + 0.5 * abs(error)
        way = rolled[R_S, p, frames - 1] - rolled[R_S, p, 0]
        points[p] = (
            cfg.PROGRESS_WEIGHT * (min(way / best, 1.0) if best > 1.0 else 1.0)
            + (0.0 if touches > 0 else cfg.TTC_WEIGHT)
            + (cfg.COMFORT_WEIGHT if comfort else 0.0)
            + cfg.CLEARANCE_WEIGHT * (1.0 - near / frames)
            - cfg.CENTRING_WEIGHT * min(aside / cfg.CENTRING_SCALE_M, 1.0)
        )


@inner
def choose(points: FloatArray, collides: IntArray, speed: FloatArray) -> int:
    """Return the best proposal; where all collide (or leave the lanes) the latest collision, then the slowest one.

    Args:
        points, collides: of each proposal, [P]. speed: [P, T].
    """
    best, latest, frames = 0, 0, speed.shape[1]
    for p in range(len(points)):
        if points[p] > points[best]:
            best = p
        latest = max(latest, collides[p])
    if points[best] >= 0:
        return best
    emergency = latest < frames and TIMES_S[min(latest, frames - 1)] < cfg.EMERGENCY_S
    best = 0
    for p in range(1, len(points)):
        impact, least = speed[p, min(collides[p], frames - 1)], speed[best, min(collides[best], frames - 1)]
        # Within 2 s the speed at the impact counts, before that the time that is won.
        if emergency:
            better = impact < least or (impact == least and collides[p] > collides[best])
        else:
            better = collides[p] > collides[best] or (collides[p] == collides[best] and impact < least)
        if better:
            best = p
    return best
