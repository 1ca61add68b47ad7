"""The numpy arrays that signatures name, by the type of their elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Hashes = NDArray[np.uint64]
Records = NDArray[np.void]
"""Of a record type of `records`."""
