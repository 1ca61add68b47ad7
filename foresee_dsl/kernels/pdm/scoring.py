"""Scores proposals: no collision at fault, within the lanes; then progress, TTC, comfort, clearance, centring."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.arrays import BoolArray, FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLOATS, compiled, inner
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import TIMES_S
from foresee_dsl.kernels.pdm.proposals import BRAKING, decay_length, place_footprints
from foresee_dsl.kernels.pdm.records import CONFLICT
from foresee_dsl.kernels.pdm.route import grid_point

STEERS_SIDEWAYS_M = 0.7
"""Lateral movement above which a proposal is at fault in a collision with an actor from behind, m. Ours."""
LEAVES_M = 0.05
"""Distance by which a proposal may leave the lanes, m. Ours: rounding and smoothing of the lanes' edges."""
NEAR_M = 6.0
"""Lateral distance from the route above which predicted footprints are ignored, m. Ours."""

ROUNDING_M = 1e-6
"""Slack for rounding errors, m. Ours: far larger than those errors."""


@inner
def _near(ego: np.void, predicted: Records, rolled: Records) -> tuple[BoolArray, bool]:
    """Return which actors come near the stretch that the proposals cover, [A], and whether any does."""
    near, anyone, ends_s = np.zeros(len(predicted), np.bool_), False, rolled[0, 0]["s"]
    for p in range(rolled.shape[0]):
        for t in range(rolled.shape[1]):
            ends_s = max(ends_s, rolled[p, t]["s"])
    start, end = rolled[0, 0]["s"] - ego["length"], ends_s + 2 * ego["length"]
    for a in range(len(predicted)):
        for t in range(predicted.shape[1]):
            actor = predicted[a, t]
            beside = abs(actor["d"]) - actor["reach_d"] < NEAR_M
            if beside and actor["s"] + actor["reach_s"] > start and actor["s"] - actor["reach_s"] < end:
                near[a], anyone = True, True
                break
    return near, anyone


@inner
def _compare(
    ego: np.void, actor: np.void, predicted: Records, rolled: Records, moves_sideways: bool, out: Records
) -> None:
    """Mark the conflicts of a proposal with an actor in `out`; `predicted`, `rolled` and `out`: [T]."""
    half_l, half_w, margin = ego["length"] / 2, ego["width"] / 2, cfg.COLLISION_MARGIN_M
    width, pace = actor["half_width"], actor["speed"]
    side = cfg.PEDESTRIAN_CLEARANCE_M if actor["pedestrian"] else cfg.CLEARANCE_M
    first, own = predicted[0], rolled[0]
    behind_at_first = (first["x"] - own["x"]) * own["cos"] + (first["y"] - own["y"]) * own["sin"] < -half_l
    for t in range(len(predicted)):
        other, own = predicted[t], rolled[t]
        dx, dy, ego_cos, ego_sin, v = other["x"] - own["x"], other["y"] - own["y"], own["cos"], own["sin"], own["speed"]
        along, across = dx * ego_cos + dy * ego_sin, dy * ego_cos - dx * ego_sin
        length = other["half_length"]
        # Outside of this box all tests below fail.
        most = length + width + ROUNDING_M
        if abs(along) > half_l + most + max(margin, v * cfg.TTC_S):
            continue
        if abs(across) > half_w + most + max(side, margin, pace * cfg.TTC_S):
            continue
        turn_cos = other["cos"] * ego_cos + other["sin"] * ego_sin
        turn_sin = other["sin"] * ego_cos - other["cos"] * ego_sin
        size_cos, size_sin = abs(turn_cos), abs(turn_sin)
        room_along = abs(along) - (half_l + length * size_cos + width * size_sin)
        room_across = abs(across) - (half_w + length * size_sin + width * size_cos)
        there = max(
            abs(along * turn_cos + across * turn_sin) - (length + half_l * size_cos + half_w * size_sin),
            abs(across * turn_cos - along * turn_sin) - (width + half_l * size_sin + half_w * size_cos),
        )
        moves = v > STANDS_MPS
        # The ego is not at fault when it stands, nor when it is hit from behind without moving sideways.
        if moves and (moves_sideways or not (behind_at_first and along < -half_l)):
            out[t]["hit"] |= max(room_along, room_across, there) < margin
            out[t]["close"] |= room_along < margin and room_across < side and there < side
        if moves and along > 0:
            ahead = min(max(v - pace * turn_cos, 0.0), v) * cfg.TTC_S
            inwards = max(-np.sign(across) * pace * turn_sin, 0.0) * cfg.TTC_S
            out[t]["ttc"] |= room_along < ahead and room_across < inwards


@inner
def _compare_all(
    ego: np.void, actors: Records, near: BoolArray, predicted: Records, rolled: Records, offsets: FloatArray
) -> Records:
    """Return the conflicts of each proposal in each frame with the near actors, [P, T]."""
    out = np.zeros(rolled.shape, CONFLICT)
    for a in range(len(near)):
        if near[a]:
            for p in range(len(offsets)):
                sideways = abs(offsets[p] - ego["d"]) > STEERS_SIDEWAYS_M
                _compare(ego, actors[a], predicted[a], rolled[p], sideways, out[p])
    return out


@inner
def find_conflicts(
    egos: Records, actors: Records, predicted: Records, rolled: Records, offsets: FloatArray, route: Records
) -> Records:
    """Place the proposals' footprints if needed, and return their conflicts, [P, T]; arguments as for `conflicts`."""
    near, anyone = _near(egos[0], predicted, rolled)
    if anyone:
        place_footprints(egos[0], route, rolled)
    return _compare_all(egos[0], actors, near, predicted, rolled, offsets)


@compiled(r.EGOS, r.ACTORS, r.PREDICTION, r.ROLLOUT, FLOATS)
def conflicts(egos: Records, actors: Records, predicted: Records, rolled: Records, offsets: FloatArray) -> Records:
    """Return the conflicts of each proposal in each frame, [P, T]; `offsets`: [P] the proposals' offsets, m."""
    return _compare_all(egos[0], actors, _near(egos[0], predicted, rolled)[0], predicted, rolled, offsets)


@inner
def _keeps_lanes(rolled: Records, route: Records, half: float) -> bool:
    """Return whether a proposal [T] leaves the lanes no farther than the ego does now."""
    at_first, most = 0.0, -np.inf
    for t in range(len(rolled)):
        d, road = rolled[t]["d"], route[grid_point(route, rolled[t]["s"])]
        out = max(d + half - road["left"], half - d - road["right"])
        if t == 0:
            at_first = max(out, 0.0)
        most = max(most, out)
    return most <= at_first + LEAVES_M


@inner
def rate(
    ego: np.void,
    route: Records,
    rolled: Records,
    conflict: Records,
    offset: FloatArray,
    acceleration: FloatArray,
    points: FloatArray,
    collides: IntArray,
) -> None:
    """Score the proposals; `acceleration`: [P] their first accelerations.

    Fills `points`, [P] the score, -1 if the proposal collides or leaves the lanes, and `collides`, [P] the frame of the
    first collision, T without one.
    """
    frames, best, half = rolled.shape[1], 0.0, ego["width"] / 2
    for p in range(len(points)):
        collides[p] = frames
        for t in range(frames - 1, -1, -1):
            if conflict[p, t]["hit"]:
                collides[p] = t
        brakes = p >= len(points) - BRAKING
        allowed = collides[p] == frames and (brakes or _keeps_lanes(rolled[p], route, half))
        points[p] = 0.0 if allowed else -1.0  # 0 here; these points are computed below, when `best` is known
        if allowed:
            best = max(best, rolled[p, frames - 1]["s"] - rolled[p, 0]["s"])
    for p in range(len(points)):
        if points[p] < 0.0:
            continue
        near, touches = 0, 0
        for t in range(frames):
            near += conflict[p, t]["close"]
            touches += conflict[p, t]["ttc"]
        error = offset[p] - ego["d"]
        lateral = ego["forward"] ** 2 * abs(error) / decay_length(ego["forward"], error, ego["sharpest"]) ** 2
        comfort = acceleration[p] > -cfg.COMFORT_BRAKING_MPS2 and lateral < cfg.COMFORT_LATERAL_MPS2
        off_middle_m = 0.5 * abs(offset[p]) + 0.5 * abs(error)
        progress = rolled[p, frames - 1]["s"] - rolled[p, 0]["s"]
        points[p] = (
            cfg.PROGRESS_WEIGHT * (min(progress / best, 1.0) if best > 1.0 else 1.0)
            + (0.0 if touches > 0 else cfg.TTC_WEIGHT)
            + (cfg.COMFORT_WEIGHT if comfort else 0.0)
            + cfg.CLEARANCE_WEIGHT * (1.0 - near / frames)
            - cfg.CENTRING_WEIGHT * min(off_middle_m / cfg.CENTRING_SCALE_M, 1.0)
        )


@inner
def best_proposal(points: FloatArray, collides: IntArray, rolled: Records) -> int:
    """Return the best proposal; if all collide or leave the lanes, the one with the latest collision, then the slowest.

    `points` and `collides`: [P] as filled by `rate`. `rolled`: [P, T].
    """
    best, latest, frames = 0, 0, rolled.shape[1]
    for p in range(len(points)):
        if points[p] > points[best]:
            best = p
        latest = max(latest, collides[p])
    if points[best] >= 0:
        return best
    emergency = latest < frames and TIMES_S[min(latest, frames - 1)] < cfg.EMERGENCY_S
    best = 0
    for p in range(1, len(points)):
        impact = rolled[p, min(collides[p], frames - 1)]["speed"]
        least = rolled[best, min(collides[best], frames - 1)]["speed"]
        # For collisions within 2 s the impact speed decides first, for later ones the time of the collision.
        if emergency:
            better = impact < least or (impact == least and collides[p] > collides[best])
        else:
            better = collides[p] > collides[best] or (collides[p] == collides[best] and impact < least)
        if better:
            best = p
    return best
