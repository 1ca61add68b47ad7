"""The records of kernels: structured types of numpy, each declared once as a named tuple.

A kernel takes arrays of such records and reads `actors[a]["speed"]`, which numba compiles to one load and which also
works in plain Python. Passing an array of records takes 0.5 us; a named tuple would take 3 us (numba 0.68.1).
"""

from __future__ import annotations

from functools import cache
from typing import get_type_hints

import numpy as np

from foresee_dsl.kernels.compiling import ArgumentKind


@cache
def dtype_of(record: type) -> np.dtype[np.void]:
    """Return the numpy type of a named tuple whose fields are floats, integers and booleans.

    It is always the same object, so that a kernel's call recognises it without comparing fields.
    """
    return np.dtype(list(get_type_hints(record).items()), align=True)


def array_of(record: type, dimensions: int = 1) -> ArgumentKind:
    """Return the type of a contiguous array of such records."""
    return ArgumentKind(dtype_of(record), dimensions)
