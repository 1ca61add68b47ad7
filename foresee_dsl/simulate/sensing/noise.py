"""Noise as a function of seed, object and time: no state, so that a clip has its parent's noise at the same moment.

Each value is drawn by itself from a 64-bit hash. A normal value is the sum of the hash's four quarters as uniform
numbers (Irwin-Hall): whole numbers, additions and one product, so that every machine draws the same; logarithms and
cosines differ in the last bit between mathematical libraries. The sum lies within 3.47 standard deviations, and its
share beyond two is 4.3 % (a normal distribution's: 4.6 %).

What drifts is a cubic B-spline through such values at knots: smooth, bounded, and a function of time as well.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from foresee_dsl.kernels.arrays import Hashes
from foresee_dsl.kernels.noise import hashes, normals_over


def key_of(seed: int, name: str) -> int:
    """Return the key of a stream of numbers: 64 bits of SHA-256 over a run's seed and an object's name."""
    digest = hashlib.sha256(f"foresee 1 sensing\0{seed}\0{name}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


def keys_of(seed: int, names: Sequence[str], streams: int) -> Hashes:
    """Return the keys of several streams of each name, [N, streams]."""
    keys = np.array([key_of(seed, name) for name in names], dtype=np.uint64)
    return hashes(keys, np.arange(streams, dtype=np.int64))


class Streams:
    """The noise of some objects.

    Attributes:
        keys: [N, 2 C + 2] of what drifts, of what does not, of the chances, and of when these change.
        scales: [2, C] standard deviations of what drifts and of what does not.
    """

    _BLOCK = 64

    def __init__(self, seed: int, names: Sequence[str], slow_shares: Sequence[float], slow_frames: int) -> None:
        """Prepare the streams of some objects.

        `slow_shares`: for each channel the share of the variance that drifts; `slow_frames`: between the drift's knots.
        """
        shares = np.array(slow_shares, dtype=np.float64)
        self.keys = keys_of(seed, names, 2 * len(shares) + 2)
        self.scales = np.sqrt(np.stack([shares, 1.0 - shares]))
        self._slow_frames = slow_frames
        self._first = self._end = 0
        self._rows: list[list[list[float]]] = []

    def normals(self, frame: int) -> list[list[float]]:
        """Return the errors at an absolute frame, in standard deviations: of each object one a channel, drawn in blocks
        of frames."""
        if not self._first <= frame < self._end:
            self._first = frame - frame % self._BLOCK
            self._end = self._first + self._BLOCK
            block = normals_over(self.keys, self.scales, self._slow_frames, self._first, self._BLOCK)
            self._rows = block.tolist()
        return self._rows[frame - self._first]
