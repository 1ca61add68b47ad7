"""Are points on the drivable area? Remembered by squares that lie wholly on it, as most points are in one."""

from __future__ import annotations

from math import floor
from weakref import WeakKeyDictionary

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import WHOLE, all_whole

CELL_M = 0.5
"""The side of a square. Ours: a wheel keeps 0.6 m to the edge of a lane of 3.3 m, and comes through 200 in a run."""
_MOST_CELLS = 4_000_000
"""Squares of a network: with more, they are larger. Ours: 4 MB, a square kilometre with the smallest."""
_UNKNOWN, _PARTLY = 0, 2

_KNOWN: WeakKeyDictionary[RoadNetwork, Squares] = WeakKeyDictionary()
"""The children of a clip drive on the same one."""


def squares_of(network: RoadNetwork) -> Squares:
    """Return what is known of a network's squares; remembered."""
    known = _KNOWN.get(network)
    if known is None:
        known = _KNOWN[network] = Squares(network)
    return known


class Squares:
    """What is known of a network's squares.

    Attributes:
        left, bottom: the corner of the first, m. cell: their side, m.
        known: [columns, rows] 1 for those that lie wholly on the drivable area, 2 for others, 0 for those not yet
            looked at.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._area = network.drivable_around
        left, bottom, right, top = network.bounds
        self.left, self.bottom = left, bottom
        self.cell = max(CELL_M, float(np.sqrt((right - left) * (top - bottom) / _MOST_CELLS)))
        shape = floor((right - left) / self.cell) + 1, floor((top - bottom) / self.cell) + 1
        self.known = np.zeros(shape, dtype=np.uint8)

    def hold(self, points: FloatArray) -> bool:
        """Say whether all of some points ([N, 2] m) lie on the drivable area."""
        return all_whole(points, self.left, self.bottom, self.cell, self.known) or all(
            self._holds(x, y) for x, y in points.tolist()
        )

    def _holds(self, x: float, y: float) -> bool:
        column, row = floor((x - self.left) / self.cell), floor((y - self.bottom) / self.cell)
        if not (0 <= column < self.known.shape[0] and 0 <= row < self.known.shape[1]):
            return False
        if self.known[column, row] == _UNKNOWN:
            left, bottom = self.left + column * self.cell, self.bottom + row * self.cell
            square = shapely.box(left, bottom, left + self.cell, bottom + self.cell)
            self.known[column, row] = WHOLE if shapely.contains_properly(self._area(x, y), square) else _PARTLY
        return self.known[column, row] == WHOLE or bool(shapely.contains_xy(self._area(x, y), x, y))
