"""The centrelines of a network's lanes as arrays, for kernels."""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class LaneTable(NamedTuple):
    """The lines of all lanes (`compile.polyline.Polyline`), one after the other.

    Attributes:
        numbers: of each lane id.
        first: [L + 1] where each lane's points begin; those of lane k are `first[k]` up to `first[k + 1]`.
        x, y: [P] m. marks: [P] m along the lane, from 0. angles: [P] rad, continuous along a lane.
    """

    numbers: dict[str, int]
    first: IntArray
    x: FloatArray
    y: FloatArray
    marks: FloatArray
    angles: FloatArray


_KNOWN: WeakKeyDictionary[RoadNetwork, LaneTable] = WeakKeyDictionary()
"""The children of a clip drive on the same network."""


def lane_table(network: RoadNetwork) -> LaneTable:
    """Return the table of a network; made once."""
    table = _KNOWN.get(network)
    if table is None:
        table = _KNOWN[network] = _made(network)
    return table


def _made(network: RoadNetwork) -> LaneTable:
    lines = [lane.line for lane in network.lanes.values()]
    points = np.array([point for line in lines for point in line.xy], dtype=np.float64).reshape(-1, 2)
    return LaneTable(
        numbers={lane: number for number, lane in enumerate(network.lanes)},
        first=np.cumsum([0, *(len(line.xy) for line in lines)], dtype=np.int64),
        x=points[:, 0].copy(),
        y=points[:, 1].copy(),
        marks=np.array([mark for line in lines for mark in line.marks], dtype=np.float64),
        angles=np.array([angle for line in lines for angle in line.angles], dtype=np.float64),
    )
