"""Names of numpy array types for signatures, by the type of the elements."""

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
