"""Bootstrap intervals over test cases and seeds: each resample draws test cases, and repetitions of each driver.

All repetitions of a drawn test case count together, because they are not independent of each other; and a repetition
counts with all its test cases, because its seed may be a lucky one for many of them (a two-way bootstrap: Owen, The
pigeonhole bootstrap, 2007).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, read_only

RESAMPLES = 10_000
"""Number of resamples. Ours: with it the ends of an interval vary by less than 1 % between seeds."""
SHARE = 0.95
SEED = 20_26
"""Seed of the resamples; it is fixed, so that equal results give equal intervals."""

Repetition = tuple[str, int]
"""The driver and the number of a repetition."""
Counts = Mapping[Repetition, Mapping[str, float]]
"""A value of each test case in each repetition; a test case without a value has 0."""


class Interval(NamedTuple):
    """The middle 95 % of the values of the resamples; NaN if too many resamples have no value."""

    low: float
    high: float


def sum_of(counts: Counts) -> float:
    """Return the sum over all test cases and repetitions."""
    return sum(sum(own.values()) for own in counts.values())


def ratio_interval(numerators: Counts, denominators: Counts) -> Interval:
    """Return the interval of the ratio of two sums over all test cases and repetitions."""
    return percentiles(resampled_ratios(numerators, denominators))


def resampled_ratios(numerators: Counts, denominators: Counts) -> FloatArray:
    """Return the ratio of the sums in each resample; infinite or NaN over a sum of 0.

    Both sums are resampled alike: with the same test cases and, where a driver has the same repetitions in both, with
    the same repetitions.
    """
    names = sorted({name for counts in (numerators, denominators) for own in counts.values() for name in own})
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios: FloatArray = resampled_sums(numerators, names) / resampled_sums(denominators, names)
    return ratios


def resampled_sums(counts: Counts, names: Sequence[str]) -> FloatArray:
    """Return the sum over the test cases of these names and all repetitions in each resample."""
    sums = np.zeros(RESAMPLES)
    drawn_cases = resamples(len(names))
    for repetition, times in drawn_repetitions(list(counts), RESAMPLES).items():
        values = counts[repetition]
        sums += times * (drawn_cases @ np.array([values.get(name, 0.0) for name in names], float))
    return sums


@lru_cache(maxsize=4)  # the rows of a table mostly have the same number of test cases; 10 MB for 120 of them
def resamples(count: int, size: int = RESAMPLES) -> FloatArray:
    """Return how often each of `count` test cases is drawn, [size, count]: one row per resample. It is read-only."""
    if not count:
        return np.zeros((size, 0))
    return _drawn(np.random.default_rng(SEED), count, size)


def _drawn(rng: np.random.Generator, count: int, size: int) -> FloatArray:
    """Return how often each of `count` equally likely things is drawn in `count` draws, [size, count]; read-only."""
    return read_only(rng.multinomial(count, np.full(count, 1 / count), size=size).astype(float))


def drawn_repetitions(repetitions: Sequence[Repetition], size: int) -> dict[Repetition, FloatArray]:
    """Return how often each repetition is drawn, [size]: for each driver, as many as it has.

    The draws of a driver depend only on the number of its repetitions, not on those of other drivers.
    """
    drivers: defaultdict[str, list[Repetition]] = defaultdict(list)
    for repetition in sorted(set(repetitions)):
        drivers[repetition[0]].append(repetition)
    drawn: dict[Repetition, FloatArray] = {}
    for driver, own in drivers.items():
        times = _drawn(np.random.default_rng([SEED, *driver.encode()]), len(own), size)
        drawn |= {repetition: times[:, k] for k, repetition in enumerate(own)}
    return drawn


def percentiles(values: FloatArray) -> Interval:
    """Return the middle 95 % of the values that are not NaN; an end may be infinite. Both ends are NaN if more than a
    twentieth of the values are NaN.
    """
    ordered = np.sort(values[~np.isnan(values)])
    if len(ordered) < 0.95 * len(values) or not len(ordered):
        return Interval(math.nan, math.nan)
    ends = [ordered[round(share * (len(ordered) - 1))] for share in ((1 - SHARE) / 2, (1 + SHARE) / 2)]
    return Interval(*map(float, ends))
