"""Noise from hashes, as kernels (see `kernels.compiling`); `simulate.sensing.noise` explains the method."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Hashes, IntArray
from foresee_dsl.kernels.compiling import INT, INTS, KEY_TABLE, KEYS, TABLE, compiled, inner

GOLDEN = 0x9E3779B97F4A7C15
MIX_1, MIX_2 = 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""Constants of splitmix64 (Steele, Lea, Flood 2014)."""
SPLINE_SD = 0.479**0.5
"""Standard deviation of a B-spline with independent coefficients of variance 1, averaged over all positions: the
integral of the squared weights is 151/315."""
NORMAL_SCALE = 3.0**0.5 / 65536.0
"""Scales the sum of four integers below 65536 to variance 1."""


@inner
def mixed(key: np.uint64, counter: int | np.int64) -> np.uint64:
    """Return a hash of a key and a counter, which may be negative."""
    steps = np.uint64(counter) if counter >= 0 else np.uint64(0) - np.uint64(-counter)
    z = key + steps * np.uint64(GOLDEN)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(MIX_1)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(MIX_2)
    return z ^ (z >> np.uint64(31))


@inner
def normal(drawn: np.uint64) -> float:
    """Return a number of mean 0 and standard deviation 1 from a hash."""
    quarter = np.uint64(0xFFFF)
    total = (drawn & quarter) + ((drawn >> np.uint64(16)) & quarter)
    total += ((drawn >> np.uint64(32)) & quarter) + (drawn >> np.uint64(48))
    return (float(total) - 2.0 * 65535.0) * NORMAL_SCALE


@inner
def uniform(drawn: np.uint64) -> float:
    """Return a number from 0 (included) to 1 from a hash."""
    return float(drawn >> np.uint64(11)) * 2.0**-53


@inner
def drift(key: np.uint64, frame: int, spacing: int) -> float:
    """Return smooth noise of standard deviation 1, with a knot every `spacing` frames."""
    knot = frame // spacing
    u = (frame - knot * spacing) / spacing
    v = 1 - u
    whole = normal(mixed(key, knot - 1)) * (v * v * v) + normal(mixed(key, knot + 2)) * (u * u * u)
    whole += normal(mixed(key, knot)) * (3 * (u * u * u) - 6 * (u * u) + 4)
    whole += normal(mixed(key, knot + 1)) * (-3 * (u * u * u) + 3 * (u * u) + 3 * u + 1)
    return whole / (6.0 * SPLINE_SD)


@inner
def error(keys: Hashes, scales: FloatArray, channel: int, frame: int, spacing: int) -> float:
    """Return one channel of an object's noise, with standard deviation 1: the drifting plus the independent part.

    Arguments as for `normals_over`; `keys`: the keys of one object.
    """
    channels = scales.shape[1]
    value = 0.0
    if scales[0, channel] > 0.0:
        value += drift(keys[channel], frame, spacing) * scales[0, channel]
    if scales[1, channel] > 0.0:
        value += normal(mixed(keys[channels + channel], frame)) * scales[1, channel]
    return value


@inner
def chance(keys: Hashes, channels: int, frame: int, hold: int) -> float:
    """Return a number from 0 to 1 that stays the same for `hold` frames; the frames at which it changes differ from
    object to object."""
    phase = np.int64(keys[2 * channels + 1] >> np.uint64(11)) % hold
    return uniform(mixed(keys[2 * channels], (frame + phase) // hold))


@compiled(KEYS, INTS)
def hashes(keys: Hashes, counters: IntArray) -> Hashes:
    """Return a hash of each key [K] with each counter [C], [K, C]."""
    table = np.empty((len(keys), len(counters)), dtype=np.uint64)
    for k in range(len(keys)):
        for c in range(len(counters)):
            table[k, c] = mixed(keys[k], counters[c])
    return table


@compiled(KEY_TABLE, TABLE, INT, INT, INT)
def normals_over(keys: Hashes, scales: FloatArray, spacing: int, first: int, frames: int) -> FloatArray:
    """Return the noise of N objects over several frames, [F, N, C].

    Args:
        keys: [N, 2 C + 2] keys of the drifting errors, the independent errors, the chances, and their phases.
        scales: [2, C] standard deviations of the drifting and the independent errors. spacing: frames between two knots
            of the drift.
        first: the first frame, absolute. frames: number of frames F.
    """
    values = np.empty((frames, len(keys), scales.shape[1]))
    for f in range(frames):
        for k in range(len(keys)):
            for channel in range(scales.shape[1]):
                values[f, k, channel] = error(keys[k], scales, channel, first + f, spacing)
    return values
