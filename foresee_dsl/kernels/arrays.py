"""Names of numpy array types for signatures, by the type of the elements; and arrays that cannot be written to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Hashes = NDArray[np.uint64]
Records = NDArray[np.void]
"""An array of a record type of `records`."""
Record = Any
"""One element of an array of records."""


def read_only(array: FloatArray) -> FloatArray:
    """Return a view of an array that cannot be written to: it is shared with later users, such as a driver's runs."""
    view = array.view()
    view.setflags(write=False)
    return view
