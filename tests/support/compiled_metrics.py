"""Measures of a single pair by the compiled functions."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.boxes import Mover
from foresee_dsl.kernels.conditions import time_to_touch


def ttc(a: Mover, b: Mover) -> float:
    """Return the time (s) until two footprints touch when both keep heading and speed."""
    both = np.array((a, b), dtype=np.float64)
    return float(time_to_touch(both, both[:, 4:], 0, 1))
