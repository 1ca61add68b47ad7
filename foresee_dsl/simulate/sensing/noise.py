"""Noise as a function of seed, object and time: no state, so that a clip has its parent's noise at the same moment.

Each value is drawn by itself from a 64-bit hash. A normal value is the sum of the hash's four quarters as uniform
numbers (Irwin-Hall): whole numbers, additions and one product, so that every machine draws the same; logarithms and
cosines differ in the last bit between mathematical libraries. The sum lies within 3.47 standard deviations, and its
share beyond two is 4.3 % (a normal distribution's: 4.6 %).

What drifts is a cubic B-spline through such values at knots: smooth, bounded, and a function of time as well.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Hashes = NDArray[np.uint64]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31 = np.uint64(30), np.uint64(27), np.uint64(31)
"""Constants of splitmix64 (Steele, Lea, Flood 2014)."""
_SHIFTS = (np.uint64(16), np.uint64(32), np.uint64(48))
_QUARTER = np.uint64(0xFFFF)
_UNIFORM_BITS = np.uint64(11)
_SPLINE_SD = math.sqrt(0.479)
"""Standard deviation of a B-spline through independent values of variance 1, over all places: the integral of the
squared weights is 151/315."""


def key_of(seed: int, name: str) -> int:
    """Return the key of a stream of numbers: 64 bits of SHA-256 over a run's seed and an object's name."""
    digest = hashlib.sha256(f"foresee 1 sensing\0{seed}\0{name}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


def mixed(keys: Hashes, counters: NDArray[np.int64]) -> Hashes:
    """Return a hash of each key and counter (broadcast against each other)."""
    z = keys + counters.astype(np.uint64) * _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    hashes: Hashes = z ^ (z >> _S31)
    return hashes


def normals(hashes: Hashes) -> FloatArray:
    """Return numbers of mean 0 and standard deviation 1, one a hash."""
    total = hashes & _QUARTER
    for shift in _SHIFTS:
        total += (hashes >> shift) & _QUARTER
    values: FloatArray = (total.astype(np.float64) - 2.0 * 65535.0) * (math.sqrt(3.0) / 65536.0)
    return values


def uniforms(hashes: Hashes) -> FloatArray:
    """Return numbers from 0 (included) to 1, one a hash."""
    values: FloatArray = (hashes >> _UNIFORM_BITS).astype(np.float64) * 2.0**-53
    return values


def drift(keys: Hashes, frames: NDArray[np.int64], spacing: int) -> FloatArray:
    """Return smooth noise of standard deviation 1.

    Args:
        keys: [K] streams. frames: [F] absolute frames, one after the other. spacing: frames between knots.

    Returns:
        [F, K].
    """
    knots, rest = np.divmod(frames, spacing)
    first = int(knots[0]) - 1
    values = normals(mixed(keys, np.arange(first, int(knots[-1]) + 3, dtype=np.int64)[:, None]))
    u = (rest / spacing)[:, None]
    k = knots - 1 - first
    whole = values[k] * (1 - u) ** 3 + values[k + 3] * u**3
    whole += values[k + 1] * (3 * u**3 - 6 * u**2 + 4) + values[k + 2] * (-3 * u**3 + 3 * u**2 + 3 * u + 1)
    smooth: FloatArray = whole / (6.0 * _SPLINE_SD)
    return smooth


class Streams:
    """The noise of some objects, drawn a block of frames at a time (drawing costs the same for one frame as for many).

    Attributes:
        channels: numbers an object.
    """

    _BLOCK = 32

    def __init__(
        self, seed: int, names: Sequence[str], slow_shares: Sequence[float], slow_frames: int, hold_frames: int = 1
    ) -> None:
        """Prepare streams.

        Args:
            seed: the run's. names: of the objects.
            slow_shares: for each channel the share of the variance that drifts.
            slow_frames: between the drift's knots. hold_frames: how long a number of `chances` stays.
        """
        self.channels = len(slow_shares)
        keys = np.array([key_of(seed, name) for name in names], dtype=np.uint64).reshape(-1, 1)
        streams = mixed(keys, np.arange(2 * self.channels + 2, dtype=np.int64))  # [N, streams]
        self._slow = streams[:, : self.channels].reshape(-1)
        self._quick = streams[:, self.channels : 2 * self.channels].reshape(-1)
        self._chance, self._phase = streams[:, -2], (streams[:, -1] >> _UNIFORM_BITS).astype(np.int64)
        shares = np.array(slow_shares, dtype=np.float64)
        self._slow_scale, self._quick_scale = np.sqrt(shares), np.sqrt(1.0 - shares)
        self._slow_frames, self._hold = slow_frames, hold_frames
        self._block: int | None = None
        self._normals = self._chances = np.empty((0, 0))

    def normals(self, frame: int) -> FloatArray:
        """Return the objects' errors at an absolute frame, in standard deviations, [N, channels]."""
        self._draw(frame)
        row: FloatArray = self._normals[frame % self._BLOCK]
        return row

    def chances(self, frame: int) -> FloatArray:
        """Return a number from 0 to 1 for each object at an absolute frame, [N]; it stays for `hold_frames`."""
        self._draw(frame)
        row: FloatArray = self._chances[frame % self._BLOCK]
        return row

    def _draw(self, frame: int) -> None:
        block = frame // self._BLOCK
        if block == self._block:
            return
        self._block = block
        frames = np.arange(block * self._BLOCK, (block + 1) * self._BLOCK, dtype=np.int64)
        shape = (self._BLOCK, -1, self.channels)
        slow = drift(self._slow, frames, self._slow_frames).reshape(shape)
        quick = normals(mixed(self._quick, frames[:, None])).reshape(shape)
        self._normals = slow * self._slow_scale + quick * self._quick_scale
        slots = (frames[:, None] + self._phase % self._hold) // self._hold
        self._chances = uniforms(mixed(self._chance, slots))
