"""Exact tests of two samples: rank-sum, signed-rank, and sign flips; ties included, two-sided."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foresee_dsl.errors import ForeseeError
from foresee_dsl.kernels.arrays import FloatArray, IntArray

SIGNIFICANT = 0.05
"""A smaller p is called more than chance (paper, section 4.5, RQ2)."""
MOST_EXACT = 60
"""Values of both samples together up to which the rank-sum test is exact (ours: 60 take 20 ms, 120 a second); with
more, the normal approximation with its correction for ties differs from it in the fourth digit."""


class TooFewUnitsError(ForeseeError):
    """So few units that no outcome, however clear, could give a p under `SIGNIFICANT`."""


@dataclass(frozen=True)
class Tested:
    """The outcome of a test.

    Attributes:
        p: probability of what was seen, or of something as far from equal, where both samples are alike.
        statistic: the test's own. units: how many values or pairs it is about.
    """

    p: float
    statistic: float
    units: int


def rank_sum(first: Sequence[float], second: Sequence[float]) -> Tested:
    """Test whether two independent samples are alike (Wilcoxon 1945, Mann and Whitney 1947), with U of the first.

    Raises:
        TooFewUnitsError: as of three against three.
    """
    from scipy.stats import mannwhitneyu, rankdata

    n, m = len(first), len(second)
    _refuse(2 / math.comb(n + m, n) if n and m else 1.0, f"{n} against {m} values")
    ranks = rankdata([*first, *second])
    u = float(ranks[:n].sum()) - n * (n + 1) / 2
    if n + m > MOST_EXACT:
        return Tested(float(mannwhitneyu(first, second, method="asymptotic").pvalue), u, n + m)
    ways = _subset_sums(np.rint(2 * ranks).astype(np.int64), n)
    at = round(2 * float(ranks[:n].sum()))
    return Tested(_two_sided(ways, at), u, n + m)


def signed_rank(first: Sequence[float], second: Sequence[float]) -> Tested:
    """Test whether the differences of pairs lie around zero (Wilcoxon 1945); equal pairs are left out.

    Raises:
        TooFewUnitsError: as of five pairs.
    """
    from scipy.stats import rankdata

    differences = np.subtract(first, second, dtype=float)
    _refuse(2.0 ** (1 - len(differences)), f"{len(differences)} pairs")
    differences = differences[differences != 0]
    if not len(differences):
        return Tested(1.0, 0.0, len(first))
    ranks = np.rint(2 * rankdata(np.abs(differences))).astype(np.int64)
    positive = int(ranks[differences > 0].sum())
    ways = _flipped_sums(ranks)
    smaller = min(positive, int(ranks.sum()) - positive) / 2
    return Tested(_two_sided(ways, positive), smaller, len(first))


def sign_flips(differences: Sequence[int]) -> Tested:
    """Test by permutation whether whole numbers lie around zero: under chance each could as well have the other sign.

    All sign changes are counted, not a sample of them (Fisher 1935).

    Raises:
        TooFewUnitsError: as of five numbers.
    """
    _refuse(2.0 ** (1 - len(differences)), f"{len(differences)} differences")
    sizes = np.abs(np.array(differences, dtype=np.int64))
    positive = int(sum(d for d in differences if d > 0))
    return Tested(_two_sided(_flipped_sums(sizes), positive), float(sum(differences)), len(differences))


def _refuse(smallest_p: float, what: str) -> None:
    if smallest_p > SIGNIFICANT:
        raise TooFewUnitsError(
            f"{what} are too few for a test: even if they were wholly apart, p would be {smallest_p:.2g}"
        )


def _subset_sums(values: IntArray, size: int) -> FloatArray:
    """Return, for each sum, how many subsets of this size have it."""
    ways = np.zeros((size + 1, int(values.sum()) + 1))
    ways[0, 0] = 1
    for value in values:
        for k in range(size, 0, -1):
            ways[k, value:] += ways[k - 1, : ways.shape[1] - value]
    found: FloatArray = ways[size]
    return found


def _flipped_sums(values: IntArray) -> FloatArray:
    """Return, for each sum, the probability that it is that of a random subset: each value with probability 1/2."""
    ways = np.zeros(int(values.sum()) + 1)
    ways[0] = 1
    for value in values:
        more = np.zeros_like(ways)
        more[value:] = ways[: len(ways) - value]
        ways = (ways + more) / 2
    return ways


def _two_sided(ways: FloatArray, at: int) -> float:
    """Return twice the smaller tail that begins at a place, at most 1."""
    total = float(ways.sum())
    below, above = float(ways[: at + 1].sum()) / total, float(ways[at:].sum()) / total
    return min(1.0, 2 * min(below, above))
