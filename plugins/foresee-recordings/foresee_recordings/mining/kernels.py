"""Inner loops over pairs of rows; each calls the kernel with which the core evaluates the same measure in a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.compiling import ANY_TABLE, FLOATS, INTS, TABLE, compiled
from foresee_dsl.kernels.conditions import gap, time_to_touch

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
