"""Finds the lanes near a point with a grid over their centrelines, without numpy or shapely (see `polyline`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from foresee_dsl.compile.roads.polyline import distance_to
from foresee_dsl.compile.roads.topology import Lane

_CELL_M = 50.0
"""Ours: a town's lanes are 50 to 150 m long, so that each is in a few cells and a cell holds a junction's lanes."""
_REACHES_M = (10.0, 100.0, 1000.0)
"""Radii, m, in which the nearest lane is sought before all lanes are compared (ours)."""


class LaneIndex:
    """Lanes by the cells of a grid that the bounding box of their centreline touches."""

    def __init__(self, lanes: Iterable[Lane]) -> None:
        """Take the lanes; answers keep their order."""
        self._lanes = tuple(lanes)
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._boxes: list[tuple[float, float, float, float]] = []
        for k, lane in enumerate(self._lanes):
            xs, ys = zip(*lane.shape, strict=True)
            self._boxes.append((min(xs), min(ys), max(xs), max(ys)))
            for cell in _cells(*self._boxes[-1]):
                self._cells.setdefault(cell, []).append(k)

    def within(self, x: float, y: float, reach_m: float) -> list[tuple[float, Lane]]:
        """Return the lanes whose centreline comes so near to a point, with the distance."""
        found = ((distance_to(x, y, lane.shape), lane) for lane in self._may_be_within(x, y, reach_m))
        return [one for one in found if one[0] <= reach_m]

    def any_within(self, x: float, y: float, reach_m: float) -> bool:
        """Say whether a lane's centreline comes so near to a point."""
        return any(distance_to(x, y, lane.shape) <= reach_m for lane in self._may_be_within(x, y, reach_m))

    def _may_be_within(self, x: float, y: float, reach_m: float) -> Iterator[Lane]:
        """Yield the lanes whose bounding box comes so near to a point, in their order."""
        low_x, low_y, high_x, high_y = x - reach_m, y - reach_m, x + reach_m, y + reach_m
        near = set()
        for cell in _cells(low_x, low_y, high_x, high_y):
            for k in self._cells.get(cell, ()):
                left, bottom, right, top = self._boxes[k]
                if left <= high_x and right >= low_x and bottom <= high_y and top >= low_y:
                    near.add(k)
        yield from (self._lanes[k] for k in sorted(near))

    def nearest(self, x: float, y: float) -> tuple[float, tuple[Lane, ...]]:
        """Return the distance of the nearest lane's centreline, and all that are so near; infinite for no lanes."""
        for reach in _REACHES_M:
            found = self.within(x, y, reach)
            if found:
                break
        else:
            found = [(distance_to(x, y, lane.shape), lane) for lane in self._lanes]
        away = min((away for away, _ in found), default=math.inf)
        return away, tuple(lane for at, lane in found if at == away)


def _cells(low_x: float, low_y: float, high_x: float, high_y: float) -> list[tuple[int, int]]:
    columns = range(math.floor(low_x / _CELL_M), math.floor(high_x / _CELL_M) + 1)
    rows = range(math.floor(low_y / _CELL_M), math.floor(high_y / _CELL_M) + 1)
    return [(column, row) for column in columns for row in rows]
