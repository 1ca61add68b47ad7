"""Intervals by bootstrap over test cases: all repetitions of a test case are drawn together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray

RESAMPLES = 10_000
"""Draws with replacement (ours: the ends of an interval then move by less than 1 % from seed to seed)."""
SHARE = 0.95
SEED = 20_26
"""The seed of the draws: the same results give the same intervals."""


class Interval(NamedTuple):
    """The middle 95 % of what the resamples gave; NaN where too many have no value."""

    low: float
    high: float


def ratio_interval(numerators: Sequence[float], denominators: Sequence[float]) -> Interval:
    """Return the interval of the ratio of two sums, each of a value for every test case."""
    return percentiles(resampled_ratios(numerators, denominators))


def resampled_ratios(numerators: Sequence[float], denominators: Sequence[float]) -> FloatArray:
    """Return the ratio of the sums in each resample of the test cases; infinite or NaN over a sum of 0."""
    weights = resamples(len(numerators))
    with np.errstate(divide="ignore", invalid="ignore"):
        found: FloatArray = (weights @ np.asarray(numerators, float)) / (weights @ np.asarray(denominators, float))
    return found


def resamples(count: int) -> FloatArray:
    """Return how often each of so many test cases is drawn, a row a resample."""
    rng = np.random.default_rng(SEED)
    if not count:
        return np.zeros((RESAMPLES, 0))
    return rng.multinomial(count, np.full(count, 1 / count), size=RESAMPLES).astype(float)


def percentiles(values: FloatArray) -> Interval:
    """Return the middle 95 % of the values; an infinite end is infinite, and NaN where a twentieth are NaN."""
    known = np.sort(values[~np.isnan(values)])
    if len(known) < 0.95 * len(values) or not len(known):
        return Interval(math.nan, math.nan)
    ends = [known[round(share * (len(known) - 1))] for share in ((1 - SHARE) / 2, (1 + SHARE) / 2)]
    return Interval(*map(float, ends))
