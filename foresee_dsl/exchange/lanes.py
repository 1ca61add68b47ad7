"""Lanes of a network as other formats describe them: their borders, the lanes beside them, before and after them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.drivers.protocol import FloatArray

_MITRE = 2.0
"""Largest stretch of an offset corner, as a multiple of the offset. Ours: bounds spikes at sharp corners."""


def lane_links(network: RoadNetwork) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return the ids of the lanes before and after each lane, by its id; a lane without any is absent."""
    before: dict[str, list[str]] = {}
    after: dict[str, list[str]] = {}
    for movement in network.movements:
        chain = (movement.from_lane, *movement.via, movement.to_lane)
        for first, second in pairwise(chain):
            if second not in after.setdefault(first, []):
                after[first].append(second)
                before.setdefault(second, []).append(first)
    return {
        lane: (tuple(before.get(lane, ())), tuple(after.get(lane, ()))) for lane in dict.fromkeys((*before, *after))
    }


def beside(network: RoadNetwork, lane: Lane, side: int) -> Lane | None:
    """Return the lane of the same edge to the left (1) or right (-1), if any."""
    edge = network.edges.get(lane.edge)
    index = lane.index + network.lanes_to(side)
    if edge is None or lane.internal or not 0 <= index < len(edge.lanes):
        return None
    return edge.lanes[index]


def shifted(line: Points, left_m: float) -> FloatArray:
    """Return a line that runs beside another, `left_m` to its left, with mitred corners, [N, 2]."""
    points = np.asarray(line, dtype=np.float64)[:, :2]
    legs = np.diff(points, axis=0)
    legs /= np.maximum(np.linalg.norm(legs, axis=1, keepdims=True), 1e-9)
    normals = np.stack((-legs[:, 1], legs[:, 0]), axis=1)
    before, after = np.vstack((normals[:1], normals)), np.vstack((normals, normals[-1:]))
    corners = before + after
    corners /= np.maximum(np.linalg.norm(corners, axis=1, keepdims=True), 1e-9)
    stretch = np.minimum(1 / np.maximum(np.einsum("ij,ij->i", corners, after), 1e-9), _MITRE)
    line_beside: FloatArray = points + left_m * corners * stretch[:, None]
    return line_beside
