"""Computes the costs of candidate trajectories, checks them for collisions, and chooses the cheapest one without a
collision.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foresee_dsl.drivers.pdm.situation import RoadSituation
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.arrays import BoolArray, Records
from foresee_dsl.kernels.pdm.records import ROLLED
from foresee_dsl.kernels.pdm.scoring import conflicts
from foresee_dsl.kernels.pdm.settings import SENSED_STANDS_MPS
from foresee_frenetix import settings as cfg
from foresee_frenetix.behaviour import STRIDE, Behaviour
from foresee_frenetix.plan import MOTION, TIMES_S, Motion, Plan
from foresee_frenetix.planner import Candidates

LEAVES_M = 0.05
"""Distance by which a candidate may leave the lanes, m. Ours: rounding and smoothing of the lanes' edges."""
PASSES_M = 0.3
"""Distance by which a sample may pass its stop, m. Ours: stops are planned half a metre before the line."""


def at_frames(situation: RoadSituation, prediction: Records) -> Records:
    """Return a prediction at the frames of a plan, in which moving actors grow longer with time, because their speed
    may change.

    Otherwise the cheapest plan would pass just behind (or in front of) a crossing actor, and collide in the next step.
    """
    frames = prediction[:, ::STRIDE].copy()
    doubt = np.minimum(cfg.DOUBT_MPS * TIMES_S, cfg.DOUBT_M)
    frames["half_length"] += np.where(situation.actors["speed"][:, None] > SENSED_STANDS_MPS, doubt, cfg.CORNER_M)
    return frames


def choose(
    situation: RoadSituation, behaviour: Behaviour, prediction: Records, candidates: Candidates, last: Plan | None
) -> int | None:
    """Return the index of the cheapest candidate that keeps to the lanes, the stop place and its distance to all
    others.

    None if no candidate does. `prediction`: at the frames of a plan. `last`: the plan that is driven now.
    """
    cost = _cost(situation, behaviour, candidates, last)
    order = np.flatnonzero(np.isfinite(cost))
    order = order[np.argsort(cost[order], kind="stable")]
    best, best_cost = None, np.inf
    # Nearness to others only adds to a cost, so the search ends if the cheapest of a batch costs more than the best so
    # far.
    for first in range(0, len(order), cfg.BATCH):
        batch = order[first : first + cfg.BATCH]
        if cost[batch[0]] >= best_cost:
            break
        conflict = _conflicts(situation, candidates.take(batch), candidates.offset[batch], prediction)
        near, pressed = conflict["close"].mean(axis=1), conflict["ttc"].mean(axis=1)
        total = cost[batch] + cfg.NEAR_WEIGHT * near + cfg.PRESSED_WEIGHT * pressed
        total = np.where(conflict["hit"].any(axis=1), np.inf, total)
        k = int(total.argmin())
        if total[k] < best_cost:
            best, best_cost = int(batch[k]), float(total[k])
    return best


def joined(candidates: Candidates, plans: Sequence[Plan]) -> Candidates:
    """Return the candidates with further plans that the library did not create; the cost of such a plan is the cost of
    its offset.
    """
    if not plans:
        return candidates
    rows = {name: np.vstack([getattr(motion, name) for motion in (candidates, *plans)]) for name in MOTION}
    offset = np.concatenate([candidates.offset, [plan.offset for plan in plans]])
    cost = np.concatenate([candidates.cost, [cfg.OFFSET_WEIGHT * abs(plan.offset) for plan in plans]])
    return Candidates(**rows, offset=offset, cost=cost, samples=(*candidates.samples, *(None for _ in plans)))


def is_free(situation: RoadSituation, behaviour: Behaviour, prediction: Records, plan: Plan) -> bool:
    """Return whether a plan that begins now is free of collisions and does not pass the stop; arguments as `choose`."""
    front_s = float(plan.s[-1]) + situation.vehicle.wheelbase_m + situation.vehicle.front_overhang_m
    if behaviour.stop_s is not None and front_s > behaviour.stop_s + PASSES_M:
        return False
    return not bool(_conflicts(situation, plan, np.array([plan.offset]), prediction)["hit"].any())


def _cost(situation: RoadSituation, behaviour: Behaviour, candidates: Candidates, last: Plan | None) -> FloatArray:
    """Return the cost of each candidate, [P], without the cost of nearness to others; infinite if it is not allowed."""
    vehicle, route = situation.vehicle, situation.route
    front = candidates.s + vehicle.wheelbase_m + vehicle.front_overhang_m
    speed = candidates.speed
    most = route.between("profile", candidates.s)
    # Speed itself counts, not its difference from the allowed speed; otherwise driving slowly where the allowed speed
    # is low would be cheapest.
    cost = candidates.cost - cfg.SLOW_WEIGHT * speed.mean(axis=1)
    if last is not None:
        cost += cfg.CHANGE_WEIGHT * np.abs(candidates.offset - last.offset)
    which = np.abs(candidates.offset[:, None] - behaviour.offsets).argmin(axis=1)
    leaders = behaviour.leaders[which]
    gap = leaders["s"] - front
    wished = cfg.MINIMUM_GAP_M + cfg.HEADWAY_S * speed
    cost += cfg.HEADWAY_WEIGHT * np.clip(1.0 - gap / wished, 0.0, 2.0).mean(axis=1)
    braking = 2 * cfg.COMFORT_BRAKING_MPS2
    room = np.maximum(gap - cfg.MINIMUM_GAP_M - cfg.REACTION_S * speed, 0.0)
    most = np.minimum(most, np.sqrt(leaders["speed"] ** 2 + braking * room))
    allowed = ~_leaves_lanes(situation, candidates)
    if behaviour.stop_s is not None:
        room = behaviour.stop_s - front
        if situation.ego.forward < cfg.CREEP_MPS and behaviour.stop_s - situation.ego.front_s < cfg.HOLD_M:
            most = np.zeros_like(most)  # the stop is near enough, so stop here instead of creeping closer
        most = np.minimum(most, np.sqrt(braking * np.maximum(room, 0.0)))
        allowed &= (room > -PASSES_M).all(axis=1) | (speed[:, 0] < cfg.CREEP_MPS)
    cost += cfg.FAST_WEIGHT * (np.maximum(speed - most, 0.0) ** 2).mean(axis=1)
    return np.where(allowed, cost, np.inf)


def _leaves_lanes(situation: RoadSituation, candidates: Candidates) -> BoolArray:
    """Return which candidates leave the lanes farther than the car does now, [P]."""
    route, half = situation.route, situation.vehicle.width_m / 2
    k = route.indices(candidates.s)
    out = np.maximum(candidates.d + half - route.columns["left"][k], half - candidates.d - route.columns["right"][k])
    return np.asarray(out.max(axis=1) > np.maximum(out[:, 0], 0.0) + LEAVES_M)


def _conflicts(situation: RoadSituation, motion: Motion, offset: FloatArray, prediction: Records) -> Records:
    """Return the conflicts by `pdm`'s rules, [P, T], of motions ([P, T], or one: [T]) that head for offsets ([P])."""
    back, cos, sin = situation.ego.centre, np.cos(motion.heading), np.sin(motion.heading)
    rolled = np.zeros((len(offset), len(TIMES_S)), ROLLED)
    rolled["s"], rolled["d"], rolled["speed"] = motion.s, motion.d, motion.speed
    rolled["x"], rolled["y"] = motion.x + back * cos, motion.y + back * sin
    rolled["cos"], rolled["sin"] = cos, sin
    marks: Records = conflicts(situation.egos, situation.actors, prediction, rolled, offset)
    return marks
