"""Are points on the drivable area? Remembered by squares that lie on it altogether, as most points do."""

from __future__ import annotations

from collections.abc import Iterable
from math import floor
from weakref import WeakKeyDictionary

import shapely

from foresee_dsl.compile.geometry import RoadNetwork

CELL_M = 0.5
"""The side of a square. Ours: a wheel keeps 0.6 m to the edge of a lane of 3.3 m, and comes through 200 in a run."""

_KNOWN: WeakKeyDictionary[RoadNetwork, dict[tuple[int, int], bool]] = WeakKeyDictionary()
"""Whether squares lie on the drivable area altogether: the children of a clip drive on the same one."""


def on_road(network: RoadNetwork, points: Iterable[tuple[float, float]]) -> bool:
    """Say whether all of some points (m) lie on the drivable area."""
    known = _KNOWN.get(network)
    if known is None:
        known = _KNOWN.setdefault(network, {})
    for x, y in points:
        cell = floor(x / CELL_M), floor(y / CELL_M)
        whole = known.get(cell)
        if whole is None:
            whole = known[cell] = _whole(network, *cell)
        if not whole and not shapely.contains_xy(network.drivable, x, y):
            return False
    return True


def _whole(network: RoadNetwork, column: int, row: int) -> bool:
    x, y = column * CELL_M, row * CELL_M
    return bool(shapely.contains_properly(network.drivable, shapely.box(x, y, x + CELL_M, y + CELL_M)))
