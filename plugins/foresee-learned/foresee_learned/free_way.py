"""Computes the length along the waypoints up to which the way is free of others, now and in the next seconds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, VehicleLimits
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.records import dtype_of
from foresee_learned import settings as cfg
from foresee_learned.kernels.waypoints import Rules, bounds
from foresee_learned.outputs import Occupied

_TIMES_S: FloatArray = np.array(cfg.PREDICTED_S)
_ENDS_S: FloatArray = cfg.DECISION_S * np.arange(1, cfg.STEPS + 1, dtype=np.float64)
_AHEAD = attrgetter("ahead_m")


class FreeWay(NamedTuple):
    """The free length of the way along the waypoints, and the object that limits it.

    Attributes:
        free_m: [N] largest length that the ego may have covered after each step of the linear programme, m; infinite
            without a limit.
        first: the object with the smallest limit at the earliest step, or None.
        first_m: its limit, m.
    """

    free_m: FloatArray
    first: Occupied | None
    first_m: float


class Basis(NamedTuple):
    """The speeds from which a decision was computed (m/s), and where each comes from.

    Attributes:
        planned_mps: the waypoints' speed.
        safe_mps: the highest safe speed; None if no speed is safe.
        stop: the stop line that applies, and its distance, m.
    """

    planned_mps: float
    safe_mps: float | None
    way: FreeWay
    stop: tuple[JunctionPassage, float] | None


def rules_of(
    vehicle: VehicleLimits, side_m: float = cfg.SIDE_MARGIN_M, small_margin_m: float = cfg.SMALL_MARGIN_M
) -> Records:
    """Return the vehicle's footprint and its rules in the form that the kernel takes, [1].

    Args:
        side_m: lateral clearance on both sides.
        small_margin_m: enlargement of small objects on each side.
    """
    rules = Rules(
        length=vehicle.length_m,
        width=vehicle.width_m,
        margin=cfg.MARGIN_M,
        side=side_m,
        small=cfg.SMALL_M,
        small_margin=small_margin_m,
        beside=cfg.BESIDE_M,
        sample=cfg.SAMPLE_M,
        step=cfg.DECISION_S,
        soon=cfg.SOON_S,
        slow=cfg.SLOW_MPS,
        slow_soon=cfg.SLOW_SOON_S,
        standing=cfg.SPEED_ERROR_MPS,
    )
    return np.array([rules], dtype_of(Rules))


def free_way(waypoints: FloatArray, others: Sequence[Occupied], rules: Records) -> FreeWay:
    """Return the free length along waypoints ([N, 2] m ahead and to the left; the ego is at 0, 0)."""
    ahead = sorted((occupied for occupied in others if occupied.ahead_m > 0.0), key=_AHEAD)[: cfg.MOST_OBJECTS]
    if ahead:
        rows = [(o.ahead_m, o.left_m, o.heading_rad, o.length_m, o.width_m, o.speed_mps) for o in ahead]
        free = bounds(waypoints, np.array(rows), _TIMES_S, _ENDS_S, rules)
        least = free.min(axis=0)
        bound = np.isfinite(least)
        if bound.any():
            step = int(bound.argmax())
            first = int(free[:, step].argmin())
            return FreeWay(least, ahead[first], float(free[first, step]))
    return FreeWay(np.full(cfg.STEPS, np.inf), None, math.inf)
