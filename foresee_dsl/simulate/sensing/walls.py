"""The walls of buildings, which hide what is behind them: those near the eye, looked up as it moves."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.kernels.sight import walls_near

FloatArray = NDArray[np.float64]

_AROUND_M = 10.0
"""The walls near the eye are looked up again when it has moved this far."""


@lru_cache(maxsize=8)
def _sides(buildings: tuple[Points, ...]) -> FloatArray:
    """Return where the sides of buildings begin, counter-clockwise, and how they go on, [M, 4] m: once a network."""
    outlines = [np.array(outline, dtype=np.float64).reshape(-1, 2) for outline in buildings]
    outlines = [outline[::-1] if _area(outline) < 0 else outline for outline in outlines if len(outline) > 2]
    sides = [np.concatenate([outline, np.roll(outline, -1, axis=0) - outline], axis=1) for outline in outlines]
    return np.concatenate([np.empty((0, 4)), *sides])


def _area(outline: FloatArray) -> float:
    """Twice the signed area, positive when the outline runs counter-clockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


class Walls:
    """The outlines of buildings. An eye inside one sees out of it, and through it."""

    def __init__(self, buildings: Iterable[Points], reach_m: float) -> None:
        """Take up outlines, open or closed, in either direction.

        Args:
            buildings: outlines, m. reach_m: how far lines of sight go at most.
        """
        self._all = self._near = _sides(tuple(tuple(outline) for outline in buildings))
        self._reach_m = reach_m + 2 * _AROUND_M
        self._looked_up: tuple[float, float] | None = None

    def near(self, x: float, y: float) -> FloatArray:
        """Return the walls that lines of sight from an eye may meet, and some more: [M, 4], m, where one begins and how
        it goes on."""
        at = self._looked_up
        if at is None or abs(x - at[0]) > _AROUND_M or abs(y - at[1]) > _AROUND_M:
            self._looked_up = (x, y)
            self._near = self._all[walls_near(x, y, self._all, self._reach_m)]
        return self._near
