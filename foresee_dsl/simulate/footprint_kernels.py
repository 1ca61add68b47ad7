"""Kernels over footprints: who touches whom, and whether wheels are on the road (see `drivers.compiled`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.compiled import ANY_TABLE, BYTE_TABLE, FLOAT, FLOATS, TABLE, compiled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Bytes = NDArray[np.uint8]

WHOLE = 1
"""Of a square of the network's area: it is known to lie on the drivable area altogether."""


@compiled(FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT)
def overlap(
    dx: float, dy: float, heading: float, length: float, width: float, other: float, other_m: float, other_wide: float
) -> bool:
    """Whether two boxes share a point; False where a value is NaN.

    Args:
        dx, dy: from the one's centre to the other's, m. heading, length, width: of the one, rad and m.
        other, other_m, other_wide: heading, length and width of the other.
    """
    ca, sa, cb, sb = np.cos(heading), np.sin(heading), np.cos(other), np.sin(other)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    # Written as a chain of "<=" so that NaN answers False.
    shares: bool = (
        abs(dx * ca + dy * sa) <= (length + c * other_m + s * other_wide) / 2
        and abs(dy * ca - dx * sa) <= (width + s * other_m + c * other_wide) / 2
        and abs(dx * cb + dy * sb) <= (other_m + c * length + s * width) / 2
        and abs(dy * cb - dx * sb) <= (other_wide + s * length + c * width) / 2
    )
    return shares


@compiled(FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, ANY_TABLE, ANY_TABLE)
def hits(
    x: float, y: float, heading: float, length: float, width: float, poses: FloatArray, sizes: FloatArray
) -> IntArray:
    """Return which of some footprints a footprint overlaps, ascending.

    Args:
        x, y, heading, length, width: the footprint, m and rad.
        poses: [K, >=3] x, y, heading of the others; NaN where absent. sizes: [K, 2] length, width.
    """
    found = np.empty(poses.shape[0], dtype=np.intp)
    count = 0
    reach = np.hypot(length, width)
    for k in range(poses.shape[0]):
        dx, dy = poses[k, 0] - x, poses[k, 1] - y
        # Circles around the boxes first: hardly anyone is this near. A NaN is not.
        most = (reach + sizes[k, 0] + sizes[k, 1]) / 2
        if not dx * dx + dy * dy <= most * most:
            continue
        if overlap(dx, dy, heading, length, width, poses[k, 2], sizes[k, 0], sizes[k, 1]):
            found[count] = k
            count += 1
    return found[:count]


@compiled(FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT)
def wheels(x: float, y: float, heading: float, front: float, rear: float, left: float) -> FloatArray:
    """Return [4, 2] m, a point for each wheel: front left, rear left, rear right, front right.

    Args:
        x, y, heading: of the footprint, m and rad.
        front, rear: how far ahead of its centre the axles are. left: how far from the middle the points are, m.
    """
    c, s = np.cos(heading), np.sin(heading)
    points = np.empty((4, 2))
    for k in range(4):
        along = front if k in (0, 3) else rear
        across = left if k in (0, 1) else -left
        points[k, 0], points[k, 1] = x + c * along - s * across, y + s * along + c * across
    return points


@compiled(TABLE, FLOAT, FLOAT, FLOAT, BYTE_TABLE)
def all_whole(points: FloatArray, left: float, bottom: float, cell: float, known: Bytes) -> bool:
    """Whether all of some points ([N, 2] m) lie in squares that are known to be whole; see `on_road.Squares`."""
    for k in range(points.shape[0]):
        column, row = np.floor((points[k, 0] - left) / cell), np.floor((points[k, 1] - bottom) / cell)
        if not (0 <= column < known.shape[0] and 0 <= row < known.shape[1]):  # NaN neither
            return False
        if known[int(column), int(row)] != WHOLE:
            return False
    return True


@compiled(TABLE, TABLE, FLOATS, FLOAT, FLOAT, FLOAT, BYTE_TABLE)
def drives_on(
    states: FloatArray, sizes: FloatArray, ego: FloatArray, left: float, bottom: float, cell: float, known: Bytes
) -> bool:
    """Whether the ego touches nobody, and its wheels stand in squares that are known to be whole.

    Args:
        states: [1 + K, >=3] x, y, heading of the ego and of the others; NaN where absent. sizes: [K, 2] of the others.
        ego: [5] its length and width, and what `wheels` needs.
        left, bottom, cell, known: of `on_road.Squares`.
    """
    x, y, heading = states[0, 0], states[0, 1], states[0, 2]
    if hits(x, y, heading, ego[0], ego[1], states[1:], sizes).size > 0:
        return False
    return all_whole(wheels(x, y, heading, ego[2], ego[3], ego[4]), left, bottom, cell, known)
