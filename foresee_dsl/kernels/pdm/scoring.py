"""Scores proposals: no collision at fault, within the lanes; then progress, TTC, comfort, clearance, centring.

A proposal is rolled out and compared with the others only if it can still be the best one. Until then its score is
bounded by that of the same proposal without any conflict, which its motion along the route and its offset give.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLOATS, compiled, inner
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import FRAMES, TIMES_S
from foresee_dsl.kernels.pdm.proposals import BRAKING, Motions, decay_length, place_footprints, progress_of, roll
from foresee_dsl.kernels.pdm.records import CONFLICT, PROPOSAL_RESULT, ROLLED
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
def _near(ego: np.void, predicted: Records, start_s: float, ends_s: float) -> IntArray:
    """Return the actors that come near the stretch that the proposals cover, in their order.

    `start_s`, `ends_s`: lengths along the route at which the proposals begin and the last one ends.
    """
    near, count = np.empty(len(predicted), np.int64), 0
    start, end = start_s - ego["length"], ends_s + 2 * ego["length"]
    for a in range(len(predicted)):
        for t in range(predicted.shape[1]):
            actor = predicted[a, t]
            beside = abs(actor["d"]) - actor["reach_d"] < NEAR_M
            if beside and actor["s"] + actor["reach_s"] > start and actor["s"] - actor["reach_s"] < end:
                near[count] = a
                count += 1
                break
    return near[:count]


@inner
def _behind_at_first(ego: np.void, other: np.void, own: np.void) -> bool:
    """Return whether an actor is behind the ego, from their footprints in the first frame."""
    ahead = (other["x"] - own["x"]) * own["cos"] + (other["y"] - own["y"]) * own["sin"]
    return bool(ahead < -ego["length"] / 2)


@inner
def _conflict(
    ego: np.void, actor: np.void, other: np.void, own: np.void, moves_sideways: bool, behind_at_first: bool
) -> tuple[bool, bool, bool]:
    """Return the fields of a `ConflictRecord`: the conflicts of the footprint `own` of a proposal with an actor's
    predicted footprint `other` in the same frame.
    """
    half_l, half_w, margin = ego["length"] / 2, ego["width"] / 2, cfg.COLLISION_MARGIN_M
    width, pace, hit, close, ttc = actor["half_width"], actor["speed"], False, False, False
    side = cfg.PEDESTRIAN_CLEARANCE_M if actor["pedestrian"] else cfg.CLEARANCE_M
    dx, dy, ego_cos, ego_sin, v = other["x"] - own["x"], other["y"] - own["y"], own["cos"], own["sin"], own["speed"]
    along, across = dx * ego_cos + dy * ego_sin, dy * ego_cos - dx * ego_sin
    length = other["half_length"]
    # Outside of this box all tests below fail.
    most = length + width + ROUNDING_M
    if abs(along) > half_l + most + max(margin, v * cfg.TTC_S):
        return hit, close, ttc
    if abs(across) > half_w + most + max(side, margin, pace * cfg.TTC_S):
        return hit, close, ttc
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
        hit = max(room_along, room_across, there) < margin
        close = room_along < margin and room_across < side and there < side
    if moves and along > 0:
        ahead = min(max(v - pace * turn_cos, 0.0), v) * cfg.TTC_S
        inwards = max(-np.sign(across) * pace * turn_sin, 0.0) * cfg.TTC_S
        ttc = room_along < ahead and room_across < inwards
    return hit, close, ttc


@inner
def _moves_sideways(ego: np.void, offset: float) -> bool:
    """Return whether a proposal for this offset moves sideways so far that it is at fault if it is hit from behind."""
    return bool(abs(offset - ego["d"]) > STEERS_SIDEWAYS_M)


@compiled(r.EGOS, r.ACTORS, r.PREDICTION, r.ROLLOUT, FLOATS)
def conflicts(egos: Records, actors: Records, predicted: Records, rolled: Records, offsets: FloatArray) -> Records:
    """Return the conflicts of each proposal in each frame, [P, T]; `offsets`: [P] the proposals' offsets, m."""
    ego, out, ends_s = egos[0], np.zeros(rolled.shape, CONFLICT), rolled[0, 0]["s"]
    for p in range(rolled.shape[0]):
        for t in range(rolled.shape[1]):
            ends_s = max(ends_s, rolled[p, t]["s"])
    near = _near(ego, predicted, rolled[0, 0]["s"], ends_s)
    for n in range(len(near)):
        a = near[n]
        for p in range(len(offsets)):
            sideways, behind = _moves_sideways(ego, offsets[p]), _behind_at_first(ego, predicted[a, 0], rolled[p, 0])
            for t in range(rolled.shape[1]):
                hit, close, ttc = _conflict(ego, actors[a], predicted[a, t], rolled[p, t], sideways, behind)
                out[p, t]["hit"] |= hit
                out[p, t]["close"] |= close
                out[p, t]["ttc"] |= ttc
    return out


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


class Others(NamedTuple):
    """The other actors [A], their predictions [A, T], and the indices of those near the proposals."""

    actors: Records
    predicted: Records
    near: IntArray


@inner
def others_near(ego: np.void, actors: Records, predicted: Records, motions: Motions) -> Others:
    """Return the others, with those that come near the stretch that the proposals cover."""
    ends_s = ego["s"]
    for m in range(len(motions.s)):
        ends_s = max(ends_s, motions.s[m, -1] + ego["s"])
    return Others(actors, predicted, _near(ego, predicted, ego["s"], ends_s))


@inner
def _assess(
    ego: np.void, route: Records, others: Others, motions: Motions, p: int, rolled: Records, assessment: np.void
) -> None:
    """Roll a proposal out into `rolled`, [T], compare it with the others, and fill its `ProposalResult`."""
    roll(ego, motions, p, rolled)
    if len(others.near) > 0:
        place_footprints(ego, route, rolled)
    sideways, collides, touches = _moves_sideways(ego, motions.heads_for[p]), FRAMES, False
    close = np.zeros(FRAMES, np.bool_)
    for n in range(len(others.near)):
        a = others.near[n]
        actor, behind = others.actors[a], _behind_at_first(ego, others.predicted[a, 0], rolled[0])
        for t in range(collides):  # what comes after a collision does not count
            hit, near, ttc = _conflict(ego, actor, others.predicted[a, t], rolled[t], sideways, behind)
            close[t] |= near
            touches |= ttc
            if hit:
                collides = t
                break
    brakes = p >= len(motions.of) - BRAKING
    assessment["allowed"] = collides == FRAMES and (brakes or _keeps_lanes(rolled, route, ego["width"] / 2))
    assessment["collides"], assessment["impact"] = collides, rolled[min(collides, FRAMES - 1)]["speed"]
    assessment["close"], assessment["touches"], assessment["done"] = close.sum(), touches, True


@inner
def _points(ego: np.void, motions: Motions, p: int, most_m: float, assessment: np.void) -> float:
    """Return the score of a proposal; -1 if it was assessed and is not allowed.

    The score of a proposal that was not assessed is an upper bound: without conflicts, each summand is as large as it
    can be, and so is their rounded sum. `most_m`: the largest progress of an allowed proposal, m.
    """
    if assessment["done"] and not assessment["allowed"]:
        return -1.0
    offset, acceleration = motions.heads_for[p], motions.acceleration[motions.of[p]]
    error = offset - ego["d"]
    lateral = ego["forward"] ** 2 * abs(error) / decay_length(ego["forward"], error, ego["sharpest"]) ** 2
    comfort = acceleration > -cfg.COMFORT_BRAKING_MPS2 and lateral < cfg.COMFORT_LATERAL_MPS2
    off_middle_m = 0.5 * abs(offset) + 0.5 * abs(error)
    progress = progress_of(ego, motions, p)
    return float(
        cfg.PROGRESS_WEIGHT * (min(progress / most_m, 1.0) if most_m > 1.0 else 1.0)
        + (0.0 if assessment["touches"] else cfg.TTC_WEIGHT)
        + (cfg.COMFORT_WEIGHT if comfort else 0.0)
        + cfg.CLEARANCE_WEIGHT * (1.0 - assessment["close"] / FRAMES)
        - cfg.CENTRING_WEIGHT * min(off_middle_m / cfg.CENTRING_SCALE_M, 1.0)
    )


@inner
def _farthest(ego: np.void, motions: Motions, assessments: Records) -> int:
    """Return the proposal with the largest progress of those that were not assessed; there must be one."""
    farthest = -1
    for p in range(len(assessments)):
        if assessments[p]["done"]:
            continue
        if farthest < 0 or progress_of(ego, motions, p) > progress_of(ego, motions, farthest):
            farthest = p
    return farthest


@inner
def _largest(points: FloatArray) -> int:
    """Return the index of the largest value, the first of equal ones."""
    best = 0
    for p in range(len(points)):
        if points[p] > points[best]:
            best = p
    return best


@inner
def best_proposal(ego: np.void, route: Records, others: Others, motions: Motions) -> int:
    """Return the best proposal; if all collide or leave the lanes, the one with the latest collision, then the slowest.

    The scores depend on the largest progress of an allowed proposal, so the proposals are assessed in the order of
    their progress until one is allowed; usually that is the first. After that, the proposal with the largest bound is
    assessed, until the largest value is a score.
    """
    count, most_m = len(motions.of), 0.0
    assessments, points, rolled = np.zeros(count, PROPOSAL_RESULT), np.empty(count), np.empty(FRAMES, ROLLED)
    for _ in range(count):
        p = _farthest(ego, motions, assessments)
        _assess(ego, route, others, motions, p, rolled, assessments[p])
        if assessments[p]["allowed"]:
            most_m = max(most_m, progress_of(ego, motions, p))
            break
    for p in range(count):
        points[p] = _points(ego, motions, p, most_m, assessments[p])
    best = _largest(points)
    while not assessments[best]["done"]:
        _assess(ego, route, others, motions, best, rolled, assessments[best])
        points[best] = _points(ego, motions, best, most_m, assessments[best])
        best = _largest(points)
    return best if points[best] >= 0 else _least_bad(assessments)


@inner
def _least_bad(assessments: Records) -> int:
    """Return the proposal to follow if none is allowed, from the assessments [P] of all."""
    latest = 0
    for p in range(len(assessments)):
        latest = max(latest, assessments[p]["collides"])
    emergency = latest < FRAMES and TIMES_S[min(latest, FRAMES - 1)] < cfg.EMERGENCY_S
    best = 0
    for p in range(1, len(assessments)):
        impact, least = assessments[p]["impact"], assessments[best]["impact"]
        collides, latest = assessments[p]["collides"], assessments[best]["collides"]
        # For collisions within 2 s the impact speed decides first, for later ones the time of the collision.
        if emergency:
            better = impact < least or (impact == least and collides > latest)
        else:
            better = collides > latest or (collides == latest and impact < least)
        if better:
            best = p
    return best
