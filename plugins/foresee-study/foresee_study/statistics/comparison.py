"""Compares two techniques on the same units, and computes all figures of a table's row; the tests are exact."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foresee_dsl.kernels.arrays import BoolArray, IntArray
from foresee_study.statistics.bootstrap import Counts, Interval, Repetition, ratio_interval
from foresee_study.statistics.effects import a12, cohens_d

FEWEST_CASES = 6
"""Minimum number of test cases for a test: with five, no outcome has an exact p under 0.05 (2 / 2**5 = 0.0625)."""


@dataclass(frozen=True)
class Pair:
    """One unit, a test case in one repetition with one driver, with the counts of both techniques."""

    case: str
    repetition: int
    first: float
    second: float
    driver: str = ""


@dataclass(frozen=True)
class NotTested:
    """The reason why there is no p value."""

    reason: str


@dataclass(frozen=True)
class PairedComparison:
    """The comparison of two techniques on the same units.

    Attributes:
        first, second: the sums over all units. pairs, cases: number of units and of test cases.
        a12, d: effect sizes over the units. interval: interval of the ratio of the sums, see `bootstrap`.
        signed_rank: p value of Wilcoxon's test over the units that differ. flips: p value of the exact permutation of
            whole test cases, which does not treat repetitions of one test case as independent; or the reason why there
            is none.
    """

    first: float
    second: float
    pairs: int
    cases: int
    a12: float
    d: float
    interval: Interval
    signed_rank: float | NotTested
    flips: float | NotTested

    @property
    def ratio(self) -> float:
        """Return the first sum divided by the second; infinite if only the second is 0, NaN if both are."""
        if not self.second:
            return math.inf if self.first else math.nan
        return self.first / self.second

    @property
    def change_percent(self) -> float:
        """Return the difference of the first sum from the second, in % of the second."""
        return (self.ratio - 1) * 100


def compare(pairs: Sequence[Pair]) -> PairedComparison:
    """Return the comparison of two techniques; with fewer than six test cases there is no test, regardless of the
    repetitions.

    Repetitions of one test case are not independent units: three repetitions against three, without an overlap, give
    exactly p = 0.10; the 0.0495 of the normal approximation is an artefact.
    """
    first, second = [p.first for p in pairs], [p.second for p in pairs]
    sums: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    for pair in pairs:
        sums[pair.case][0] += pair.first
        sums[pair.case][1] += pair.second
    totals = list(sums.values())
    by_rank, by_flips = _tested(first, second, totals)
    return PairedComparison(
        first=sum(first),
        second=sum(second),
        pairs=len(pairs),
        cases=len(totals),
        a12=a12(first, second),
        d=cohens_d(first, second),
        interval=ratio_interval(*_counts(pairs)),
        signed_rank=by_rank,
        flips=by_flips,
    )


def _counts(pairs: Sequence[Pair]) -> tuple[Counts, Counts]:
    """Return the counts of both techniques by driver and repetition."""
    first: dict[Repetition, dict[str, float]] = {(pair.driver, pair.repetition): {} for pair in pairs}
    second: dict[Repetition, dict[str, float]] = {(pair.driver, pair.repetition): {} for pair in pairs}
    for pair in pairs:
        first[pair.driver, pair.repetition][pair.case] = pair.first
        second[pair.driver, pair.repetition][pair.case] = pair.second
    return first, second


def _tested(
    first: Sequence[float], second: Sequence[float], totals: Sequence[Sequence[float]]
) -> tuple[float | NotTested, float | NotTested]:
    if len(totals) < FEWEST_CASES:
        repeated = f", {len(first)} units with their repetitions," if len(first) > len(totals) else ""
        reason = NotTested(f"{len(totals)} test cases{repeated} are too few for a test, which needs {FEWEST_CASES}")
        return reason, reason
    return signed_rank(first, second), sign_flips([round(a - b) for a, b in totals])


def signed_rank(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the p value of the hypothesis that the differences of pairs are symmetric around zero (Wilcoxon 1945);
    pairs without a difference are left out.
    """
    from scipy.stats import rankdata

    differences = np.subtract(first, second, dtype=float)
    differences = differences[differences != 0]
    return _two_sided(np.rint(2 * rankdata(np.abs(differences))).astype(np.int64), differences > 0)


def sign_flips(differences: Sequence[int]) -> float:
    """Return the p value, by permutation, of the hypothesis that whole numbers are symmetric around zero: by chance
    alone, each number could have the other sign as well.

    All changes of signs are counted, not a sample of them (Fisher 1935).
    """
    numbers = np.array(differences, dtype=np.int64)
    return _two_sided(np.abs(numbers), numbers > 0)


def _two_sided(sizes: IntArray, positive: BoolArray) -> float:
    """Return twice the smaller tail, at most 1, of the sum of the positive sizes, if each sign is equally likely."""
    ways = np.zeros(int(sizes.sum()) + 1)  # for each sum, the probability that a random subset has this sum
    ways[0] = 1
    for size in sizes:
        more = np.zeros_like(ways)
        more[size:] = ways[: len(ways) - size]
        ways = (ways + more) / 2
    at = int(sizes[positive].sum())
    total = float(ways.sum())
    below, above = float(ways[: at + 1].sum()) / total, float(ways[at:].sum()) / total
    return min(1.0, 2 * min(below, above))
