"""Cross-entropy and multi-armed bandit sampling, as VerifAI offers them.

Sources: Dreossi et al., "VerifAI: A Toolkit for the Formal Design and Analysis of Artificial Intelligence-Based
Systems", CAV 2019 (section 3: cross-entropy over a product of buckets); Viswanadha et al., "Parallel and
Multi-objective Falsification with Scenic and VerifAI", RV 2021 (section 3: the bandit sampler, upper confidence bounds
of the buckets of each dimension). Written from these papers and not taken from the package `verifai`: version 2.2
installs 40 packages (a game engine, a mesh library, OpenCV), requires an old `attrs`, and its samplers draw from
NumPy's global generator, which two searches in one process would share.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_study.search.protocol import Proposals

BUCKETS = 5
"""Number of buckets of each dimension (VerifAI's default in both samplers)."""


class _BucketSearch(ABC):
    """A search that chooses a bucket of each dimension, and draws a point in it; one run after the other."""

    thres: float

    @abstractmethod
    def _begun(self, dimensions: int) -> FloatArray:
        """Return what is known about the buckets before any run, [K, D, BUCKETS]."""

    @abstractmethod
    def _chosen(self, table: FloatArray, runs: int, rng: np.random.Generator) -> IntArray:
        """Return the bucket of each dimension, [D]."""

    @abstractmethod
    def _learn(self, table: FloatArray, buckets: IntArray, *, good: bool) -> None:
        """Update the table; `good`: whether the run's margin was below the threshold."""

    def proposals(self, dimensions: int, rng: np.random.Generator) -> Proposals:
        """Draw points one by one, each from what all runs before have shown."""
        table, runs = self._begun(dimensions), 0
        while True:
            buckets = self._chosen(table, runs, rng)
            values = (buckets + rng.random(dimensions)) / BUCKETS
            (evaluation,) = yield [tuple(map(float, values))]
            runs += 1
            self._learn(table, buckets, good=evaluation.margin < self.thres)


@dataclass(frozen=True)
class CrossEntropy(_BucketSearch):
    """Cross-entropy sampling: the buckets of good runs become more probable.

    Attributes:
        alpha: share of its probability that a bucket keeps after a good run (VerifAI's default).
        thres: margin below which a run is good. VerifAI's default is 0, a violation; here a margin never is negative,
            and 1 is a near miss. Ours: with 0, most searches of a few runs would never learn.
    """

    name: str = "cross_entropy"
    alpha: float = 0.9
    thres: float = 1.0

    def _begun(self, dimensions: int) -> FloatArray:
        return np.full((1, dimensions, BUCKETS), 1 / BUCKETS)

    def _chosen(self, table: FloatArray, runs: int, rng: np.random.Generator) -> IntArray:
        del runs
        return np.array([rng.choice(BUCKETS, p=row / row.sum()) for row in table[0]], dtype=np.intp)

    def _learn(self, table: FloatArray, buckets: IntArray, *, good: bool) -> None:
        if good:
            table[0] *= self.alpha
            table[0, np.arange(len(buckets)), buckets] += 1 - self.alpha


@dataclass(frozen=True)
class Bandit(_BucketSearch):
    """Multi-armed bandit sampling: the bucket with the largest upper confidence bound on its share of good runs.

    The bound is share + sqrt(2 ln t / n) after n of t runs (UCB1, Auer et al. 2002; RV 2021, section 3); ties are
    broken at random. `thres`: as for `CrossEntropy`.
    """

    name: str = "bandit"
    thres: float = 1.0

    def _begun(self, dimensions: int) -> FloatArray:
        table = np.zeros((2, dimensions, BUCKETS))
        table[0] = 1.0  # each bucket counts as drawn once, so that the bound is finite
        return table

    def _chosen(self, table: FloatArray, runs: int, rng: np.random.Generator) -> IntArray:
        counts, good = table
        bound = good / counts + np.sqrt(2 * np.log(runs + 1) / counts)
        return np.array([rng.choice(np.flatnonzero(np.isclose(row, row.max()))) for row in bound], dtype=np.intp)

    def _learn(self, table: FloatArray, buckets: IntArray, *, good: bool) -> None:
        at = np.arange(len(buckets)), buckets
        table[0][at] += 1
        table[1][at] += good
