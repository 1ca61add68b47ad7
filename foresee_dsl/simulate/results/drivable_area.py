"""Tests whether points lie on the drivable area; a cache of squares that lie wholly on it answers most questions."""

from __future__ import annotations

from math import floor

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import per_network
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import WHOLE, all_whole

CELL_M = 0.5
"""Side of a square, m. Ours: in a lane of 3.3 m a car's wheel is 0.6 m from the edge, so squares of this size fit
between wheel and edge; a wheel passes about 200 of them in a run."""
_MOST_CELLS = 4_000_000
"""Maximum number of squares of a network; in a larger network the squares are larger. Ours: 4 MB, or a square kilometre
of the smallest squares."""
_UNKNOWN, _PARTLY = 0, 2


class Squares:
    """The squares of a network; each is tested when a point first falls into it.

    Attributes:
        left, bottom: the lower left corner of the first square, m. cell: side of a square, m.
        states: [columns, rows] 1 for a square that lies wholly on the drivable area, 2 for a square that does not, 0
            for a square that was not tested yet.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._area = network.drivable_around
        left, bottom, right, top = network.bounds
        self.left, self.bottom = left, bottom
        self.cell = max(CELL_M, float(np.sqrt((right - left) * (top - bottom) / _MOST_CELLS)))
        shape = floor((right - left) / self.cell) + 1, floor((top - bottom) / self.cell) + 1
        self.states = np.zeros(shape, dtype=np.uint8)

    def hold(self, points: FloatArray) -> bool:
        """Return whether all points ([N, 2] m) lie on the drivable area."""
        return all_whole(points, self.left, self.bottom, self.cell, self.states) or all(
            self._holds(x, y) for x, y in points.tolist()
        )

    def _holds(self, x: float, y: float) -> bool:
        column, row = floor((x - self.left) / self.cell), floor((y - self.bottom) / self.cell)
        if not (0 <= column < self.states.shape[0] and 0 <= row < self.states.shape[1]):
            return False
        if self.states[column, row] == _UNKNOWN:
            left, bottom = self.left + column * self.cell, self.bottom + row * self.cell
            square = shapely.box(left, bottom, left + self.cell, bottom + self.cell)
            self.states[column, row] = WHOLE if shapely.contains_properly(self._area(x, y), square) else _PARTLY
        return self.states[column, row] == WHOLE or bool(shapely.contains_xy(self._area(x, y), x, y))


squares_of = per_network(Squares)
"""Return the squares of a network."""
