"""Noise as a function of seed, object and time, without state, so that a clip has its parent's noise at every moment.

Each value comes from a 64-bit hash of its own. A normal value is the sum of the hash's four quarters as uniform numbers
(Irwin-Hall): integers, additions and one product, so that every machine gets the same value; logarithms and cosines
differ in the last bit between mathematical libraries. The sum is within 3.47 standard deviations; 4.3 % of the values
are beyond two (of a normal distribution: 4.6 %).

A drifting error is a cubic B-spline with such values at its knots: smooth, bounded, and also a function of time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from foresee_dsl.kernels.arrays import Hashes
from foresee_dsl.kernels.noise import hashes, normals_over


def key_of(seed: int, name: str) -> int:
    """Return the key of a sequence of random numbers: 64 bits of SHA-256 over the run's seed and an object's name."""
    digest = hashlib.sha256(f"foresee 1 sensing\0{seed}\0{name}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


def keys_of(seed: int, names: Sequence[str], streams: int) -> Hashes:
    """Return the keys of several sequences for each name, [N, streams]."""
    keys = np.array([key_of(seed, name) for name in names], dtype=np.uint64)
    return hashes(keys, np.arange(streams, dtype=np.int64))


class Streams:
    """The noise of several objects, on C channels each.

    Attributes:
        keys: [N, 2 C + 2] keys of the drifting errors, of the independent errors, of the chances of a miss, and of the
            times at which these chances change.
        scales: [2, C] standard deviations of the drifting and of the independent errors, as shares.
    """

    _BLOCK = 64

    def __init__(self, seed: int, names: Sequence[str], slow_shares: Sequence[float], slow_frames: int) -> None:
        """Prepare the noise of these objects.

        `slow_shares`: drifting share of the variance, by channel. `slow_frames`: frames between two knots of the drift.
        """
        shares = np.array(slow_shares, dtype=np.float64)
        self.keys = keys_of(seed, names, 2 * len(shares) + 2)
        self.scales = np.sqrt(np.stack([shares, 1.0 - shares]))
        self._slow_frames = slow_frames
        self._first = self._end = 0
        self._rows: list[list[list[float]]] = []

    def normals(self, frame: int) -> list[list[float]]:
        """Return the errors at an absolute frame, in standard deviations, by object and channel; they are computed in
        blocks of frames.
        """
        if not self._first <= frame < self._end:
            self._first = frame - frame % self._BLOCK
            self._end = self._first + self._BLOCK
            block = normals_over(self.keys, self.scales, self._slow_frames, self._first, self._BLOCK)
            self._rows = block.tolist()
        return self._rows[frame - self._first]
