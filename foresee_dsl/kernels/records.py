"""The records that kernels work on: numpy's structured types, each declared once as a named tuple.

A kernel takes arrays of such records and reads `actors[a]["speed"]`, which numba compiles to one load and plain Python
understands too. Arrays of records are handed over in 0.5 us each; a named tuple would take 3 us (numba 0.68.1).
"""

from __future__ import annotations

from functools import cache
from typing import get_type_hints

import numpy as np

from foresee_dsl.kernels.compiling import Kind


@cache
def dtype_of(record: type) -> np.dtype[np.void]:
    """Return the numpy type of a named tuple whose fields are floats, integers and booleans.

    Always the same object: a kernel's call recognises it without comparing fields.
    """
    return np.dtype(list(get_type_hints(record).items()), align=True)


def array_of(record: type, dimensions: int = 1) -> Kind:
    """Return the type of an array of such records, in one piece."""
    return Kind(dtype_of(record), dimensions)
