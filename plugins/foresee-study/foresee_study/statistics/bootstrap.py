"""Bootstrap intervals over test cases: all repetitions of a test case are resampled together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray

RESAMPLES = 10_000
"""Number of resamples. Ours: with it the ends of an interval vary by less than 1 % between seeds."""
SHARE = 0.95
SEED = 20_26
"""Seed of the resamples; it is fixed, so that equal results give equal intervals."""


class Interval(NamedTuple):
    """The middle 95 % of the values of the resamples; NaN if too many resamples have no value."""

    low: float
    high: float


def ratio_interval(numerators: Sequence[float], denominators: Sequence[float]) -> Interval:
    """Return the interval of the ratio of two sums, each of a value for every test case."""
    return percentiles(resampled_ratios(numerators, denominators))


def resampled_ratios(numerators: Sequence[float], denominators: Sequence[float]) -> FloatArray:
    """Return the ratio of the sums in each resample of the test cases; infinite or NaN over a sum of 0."""
    weights = resamples(len(numerators))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios: FloatArray = (weights @ np.asarray(numerators, float)) / (weights @ np.asarray(denominators, float))
    return ratios


def resamples(count: int) -> FloatArray:
    """Return how often each of `count` test cases is drawn, one row per resample."""
    rng = np.random.default_rng(SEED)
    if not count:
        return np.zeros((RESAMPLES, 0))
    return rng.multinomial(count, np.full(count, 1 / count), size=RESAMPLES).astype(float)


def percentiles(values: FloatArray) -> Interval:
    """Return the middle 95 % of the values that are not NaN; an end may be infinite. Both ends are NaN if more than a
    twentieth of the values are NaN.
    """
    ordered = np.sort(values[~np.isnan(values)])
    if len(ordered) < 0.95 * len(values) or not len(ordered):
        return Interval(math.nan, math.nan)
    ends = [ordered[round(share * (len(ordered) - 1))] for share in ((1 - SHARE) / 2, (1 + SHARE) / 2)]
    return Interval(*map(float, ends))
