"""What the tests of pictures share: a straight street, no actors, and the pixels that are drawn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane

NOBODY = np.empty((0, 6))
NO_GROUPS = np.empty(0, dtype=np.int64)


def street(
    width_m: float = 4.0, turn_rad: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), **more: Any
) -> RoadNetwork:
    """One lane from (-200, 0) to (200, 0), then turned and moved."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    ends = tuple((x * c + shift[0], x * s + shift[1]) for x in (-200.0, 200.0))
    lane = Lane("road_0", "road", 0, ends, 400.0, 13.9, width_m, frozenset({"car"}), False)
    parts = {"edges": {}, "junctions": {}, "movements": (), "crossings": {}, "walking_areas": {}, "footways": ()}
    return RoadNetwork(lanes={lane.id: lane}, **parts, **more)


def rows_and_columns(plane: np.ndarray) -> tuple[set[int], set[int]]:
    rows, columns = np.nonzero(plane)
    return set(rows.tolist()), set(columns.tolist())
