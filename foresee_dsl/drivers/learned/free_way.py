"""How far the way along the waypoints is free of the others, now and in the next seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.learned import settings as cfg
from foresee_dsl.drivers.learned.outputs import Occupied
from foresee_dsl.drivers.learned.pilot import lengths
from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, VehicleLimits
from foresee_dsl.kernels.boxes import overlaps_of


class FreeWay(NamedTuple):
    """How far the way along the waypoints is free, and which object limits it.

    Attributes:
        free_m: [N] how far the ego may have come after each step of the linear programme, infinite where nothing binds.
        first: the object that binds most at the earliest step, or None. first_m: how far its way is free.
    """

    free_m: FloatArray
    first: Occupied | None
    first_m: float


class Basis(NamedTuple):
    """What a decision was made on: speeds in m/s, and what they come from.

    Attributes:
        planned_mps: the waypoints' speed. safe_mps: the fastest safe one, None where there is none. stop: the stop line
            that binds, and how far it is away, m.
    """

    planned_mps: float
    safe_mps: float | None
    way: FreeWay
    stop: tuple[JunctionPassage, float] | None


def free_way(waypoints: FloatArray, others: Sequence[Occupied], vehicle: VehicleLimits) -> FreeWay:
    """Return how far the way is free along waypoints ([N, 2] m ahead and to the left, the ego is at 0, 0)."""
    ends_s: FloatArray = cfg.STEP_S * np.arange(1, cfg.STEPS + 1, dtype=np.float64)
    nobody = FreeWay(np.full(cfg.STEPS, np.inf), None, math.inf)
    ahead = sorted((one for one in others if one.ahead_m > 0.0), key=lambda one: one.ahead_m)[: cfg.MOST_OBJECTS]
    along, poses = _places(waypoints)
    if not ahead or not len(along):
        return nobody
    blocked = _blocked_from(along, poses, ahead, vehicle)
    free = np.array([_bound(row, one, ends_s) for row, one in zip(blocked, ahead, strict=True)])
    free = np.maximum(free - cfg.MARGIN_M, 0.0)
    least = free.min(axis=0)
    if not np.isfinite(least).any():
        return nobody
    step = int(np.isfinite(least).argmax())
    first = int(free[:, step].argmin())
    return FreeWay(least, ahead[first], float(free[first, step]))


def _places(waypoints: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ego's places along the waypoints, and how far along they are: [K] m, [K, 3] x, y, heading."""
    path = np.concatenate([np.zeros((1, 2)), waypoints])
    s = lengths(path)
    if s[-1] < cfg.SAMPLE_M:
        return np.empty(0), np.empty((0, 3))
    along = np.arange(0.0, s[-1], cfg.SAMPLE_M)
    x, y = (np.interp(along, s, path[:, k]) for k in (0, 1))
    # The chord of a metre gives the heading: waypoints of a slow car lie close together, and jitter.
    before, after = np.maximum(along - cfg.SAMPLE_M, 0.0), np.minimum(along + cfg.SAMPLE_M, s[-1])
    dx, dy = (np.interp(after, s, path[:, k]) - np.interp(before, s, path[:, k]) for k in (0, 1))
    heading = np.arctan2(dy, dx)
    heading[0] = 0.0
    return along, np.column_stack([x, y, heading])


def _blocked_from(
    along: FloatArray, poses: FloatArray, others: Sequence[Occupied], vehicle: VehicleLimits
) -> FloatArray:
    """Return how far along the ego first meets each of the others, at each of `PREDICTED_S`, [others, times] m."""
    times = np.array(cfg.PREDICTED_S)
    table = np.array([(o.ahead_m, o.left_m, o.heading_rad, o.length_m, o.width_m, _speed(o)) for o in others])
    on = table[:, 5, None] * times  # [others, times] m
    boxes = np.empty((len(others), len(times), 5))
    boxes[..., 0] = table[:, 0, None] + on * np.cos(table[:, 2, None])
    boxes[..., 1] = table[:, 1, None] + on * np.sin(table[:, 2, None])
    small = table[:, 3] < cfg.SMALL_M
    table[small, 3:5] += 2 * cfg.SMALL_MARGIN_M
    boxes[..., 2:] = table[:, None, 2:5]
    ego = np.empty((len(along), 5))
    ego[:, :3], ego[:, 3:] = poses, (vehicle.length_m, vehicle.width_m + 2 * cfg.SIDE_MARGIN_M)
    # Circles around the boxes first: hardly any other is near.
    most = (np.hypot(ego[0, 3], ego[0, 4]) + np.hypot(table[:, 3], table[:, 4])) / 2
    dx, dy = (boxes[..., k, None] - ego[:, k] for k in (0, 1))
    meets = dx * dx + dy * dy <= (most * most)[:, None, None]
    near = np.nonzero(meets)
    meets[near] = overlaps_of(ego[near[2]], boxes[near[0], near[1]])
    # What touches the wider footprint where the ego is now, but lies beside it, is passed and not approached.
    across = (abs(table[:, 3] * np.sin(table[:, 2])) + abs(table[:, 4] * np.cos(table[:, 2]))) / 2
    beside = meets[:, 0, 0] & (abs(table[:, 1]) - across >= vehicle.width_m / 2 - cfg.BESIDE_M)
    meets[beside] = False
    found: FloatArray = np.where(meets.any(axis=2), along[meets.argmax(axis=2)], np.inf)
    return found


def _bound(blocked_m: FloatArray, other: Occupied, ends_s: FloatArray) -> FloatArray:
    """Return how far along the ego may have come at the end of each step because of one object, m.

    A step's bound is the least of the times around its end, as InterFuser's: the object may be half a step late.
    """
    times = np.array(cfg.PREDICTED_S)
    soon = blocked_m[times <= (cfg.SLOW_SOON_S if other.speed_mps < cfg.SLOW_MPS else cfg.SOON_S)]
    if not np.isfinite(soon).any():
        return np.full(len(ends_s), np.inf)
    bound = np.empty(len(ends_s))
    on_mps = max(_speed(other) * math.cos(other.heading_rad), 0.0)
    for k, end_s in enumerate(ends_s.tolist()):
        near = np.abs(times - end_s) <= cfg.STEP_S + 1e-9
        # Beyond what is predicted it moves on along the way as fast as it moves ahead now.
        bound[k] = blocked_m[near].min() if near.any() else blocked_m[-1] + on_mps * (end_s - times[-1])
    return bound


def _speed(other: Occupied) -> float:
    return other.speed_mps if other.speed_mps >= cfg.SPEED_ERROR_MPS else 0.0
