"""The fastest safe speed, by a small linear programme in closed form (after InterFuser's safety controller).

    maximise v1, where for each step k = 1 .. N of T seconds
        the way driven, (v0 + v1) T/2 + ... + (v(k-1) + vk) T/2, is at most free_m[k]
        -braking T <= vk - v(k-1) <= acceleration T,   0 <= vk <= most_mps

InterFuser has two steps of 0.5 s, and drives at most 5 m/s. The more steps, the farther it looks ahead: N T seconds of
braking.

Whatever v1 is, braking as hard as allowed from then on gives the least way at every later step. So v1 is feasible where
the ways of that braking are. At step k they are a sum of the speeds max(0, v1 - (i-1) braking T), weighed 2 for i < k
and 1 for i = k; and such a sum is at most a number where all sums of its first m terms, without the max, are. Each of
these is a bound on v1 that can be written down; the least of them is the answer.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.protocol import FloatArray


class Speeds(NamedTuple):
    """What bounds the speeds: `step_s`: T. `most_mps`; `acceleration_mps2`, `braking_mps2`: both positive."""

    step_s: float
    most_mps: float
    acceleration_mps2: float
    braking_mps2: float


def fastest_safe_speed(now_mps: float, free_m: FloatArray, bounds: Speeds) -> float | None:
    """Return the highest speed for the end of the first step, m/s; None where no speed is safe.

    Args:
        now_mps: v0. free_m: [N] how far the ego may have come at the end of each step, infinite where nothing binds.
        bounds: the rest.
    """
    step, fall = bounds.step_s, bounds.braking_mps2 * bounds.step_s
    weights, falls = _sums(len(free_m))
    room = 2.0 * free_m / step - now_mps
    binding = ((room[:, None] + fall * falls) / weights).min(initial=np.inf)
    highest = min(float(binding), bounds.most_mps, now_mps + bounds.acceleration_mps2 * step)
    return highest if highest >= max(now_mps - fall, 0.0) else None


@lru_cache(maxsize=4)
def _sums(steps: int) -> tuple[FloatArray, FloatArray]:
    """Return, for the first m speeds of step k ([k, m]), the sum of their weights, and of the weighted multiples of
    `fall` by which they are slower than v1; where m > k those of m = k."""
    term = np.arange(steps)
    weight = np.where(term[None, :] < term[:, None], 2.0, np.where(term[None, :] == term[:, None], 1.0, 0.0))
    return np.cumsum(weight, axis=1), np.cumsum(weight * term, axis=1)
