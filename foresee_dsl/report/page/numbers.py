"""Encodes numbers for a page as whole numbers, each as its difference from the previous one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

CM = 100.0
"""Centimetres per metre: positions and distances are rounded to 1 cm, speeds to 1 cm/s, headings to 1 mrad (an error of
3 mm at a bus's bumper, 6 m from its centre)."""
MRAD = 1000.0


def deltas(values: NDArray[np.float64], per_unit: float) -> list[int]:
    """Return the first value and then the differences, in units of 1 / `per_unit`; rounding errors do not add up."""
    whole = np.rint(values * per_unit).astype(np.int64)
    return [int(v) for v in np.diff(whole, prepend=0)]


def line(points: Iterable[Sequence[float]]) -> list[int]:
    """Return a line as `[x, y, dx, dy, dx, dy, ...]`, cm."""
    array = np.array([tuple(point)[:2] for point in points], dtype=np.float64).reshape(-1, 2)
    whole = np.rint(array * CM).astype(np.int64)
    return [int(v) for v in np.diff(whole, axis=0, prepend=np.zeros((1, 2), dtype=np.int64)).ravel()]


def toggles(flags: NDArray[np.bool_]) -> list[int]:
    """Return the indices at which a flag changes; it is false before the first."""
    changes = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0))
    return [int(k) for k in changes]
