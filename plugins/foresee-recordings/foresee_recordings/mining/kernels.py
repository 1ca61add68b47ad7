"""Inner loops over pairs of rows; each calls the kernel with which the core evaluates the same measure in a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.compiling import ANY_TABLE, FLOAT, FLOATS, INTS, TABLE, compiled
from foresee_dsl.kernels.conditions import SURE_M, gap, gap_within, time_to_touch

Rows = NDArray[np.int64]


@compiled(TABLE, ANY_TABLE, INTS, INTS, FLOATS)
def gaps(states: FloatArray, sizes: FloatArray, actor: Rows, other: Rows, out: FloatArray) -> None:
    """Fill `out` with the distance between the footprints of two rows each, m; see `kernels.conditions.gap`."""
    for k in range(len(actor)):
        out[k] = gap(states, sizes, actor[k], other[k])


@compiled(TABLE, ANY_TABLE, INTS, INTS, FLOATS)
def times_to_touch(states: FloatArray, sizes: FloatArray, actor: Rows, other: Rows, out: FloatArray) -> None:
    """Fill `out` with the time until the footprints of two rows touch, s; see `kernels.conditions.time_to_touch`."""
    for k in range(len(actor)):
        out[k] = time_to_touch(states, sizes, actor[k], other[k])


@compiled(TABLE, ANY_TABLE, INTS, INTS, FLOATS, FLOATS)
def gaps_within(
    states: FloatArray, sizes: FloatArray, actor: Rows, other: Rows, within: FloatArray, out: FloatArray
) -> None:
    """Fill `out` as `gaps` does, but with infinity where a gap certainly exceeds `within`, [R] m, which is faster."""
    for k in range(len(actor)):
        out[k] = gap_within(states, sizes, actor[k], other[k], within[k])


@compiled(TABLE, ANY_TABLE, INTS, INTS, FLOAT, FLOATS)
def times_to_touch_within(
    states: FloatArray, sizes: FloatArray, actor: Rows, other: Rows, within: float, out: FloatArray
) -> None:
    """Fill `out` as `times_to_touch` does, but with infinity where the actors certainly need more than `within`, s."""
    for k in range(len(actor)):
        a, b = actor[k], other[k]
        dx, dy = states[b, 0] - states[a, 0], states[b, 1] - states[a, 1]
        reach = (np.hypot(sizes[a, 0], sizes[a, 1]) + np.hypot(sizes[b, 0], sizes[b, 1])) / 2
        reach += (abs(states[a, 3]) + abs(states[b, 3])) * within + SURE_M
        far = dx * dx + dy * dy > reach * reach
        out[k] = np.inf if far else time_to_touch(states, sizes, a, b)
