"""Footprints as oriented boxes: do two overlap, and how far apart are they.

A box is a rectangle given by five numbers: x, y of its centre (m), heading of its long axis (rad, counter-clockwise
from east), length and width (m). Overlap is exact (separating axes); boxes that only touch count as overlapping.
Single pairs are computed with plain floats, sets with numpy; NaN marks an absent actor, which hits nothing.
"""

from __future__ import annotations

from math import cos, hypot, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.boxes import gaps, hits, overlap, overlaps_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Box(NamedTuple):
    """A footprint: centre (m), heading (rad), length and width (m)."""

    x: float
    y: float
    heading: float
    length: float
    width: float


class Mover(NamedTuple):
    """A footprint that moves along its heading: as `Box`, with speed (m/s)."""

    x: float
    y: float
    heading: float
    speed: float
    length: float
    width: float

    @property
    def box(self) -> Box:
        """Where it is now."""
        return Box(self.x, self.y, self.heading, self.length, self.width)

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity (m/s) east and north."""
        return self.speed * cos(self.heading), self.speed * sin(self.heading)


def corners(boxes: FloatArray | Box) -> FloatArray:
    """Return the corners of one box or many.

    Args:
        boxes: [..., 5] x, y, heading, length, width.

    Returns:
        [..., 4, 2] m: front left, rear left, rear right, front right (counter-clockwise).
    """
    b = np.asarray(boxes, dtype=np.float64)
    along = b[..., 3, None] / 2 * np.array([1.0, -1.0, -1.0, 1.0])
    left = b[..., 4, None] / 2 * np.array([1.0, 1.0, -1.0, -1.0])
    c, s = np.cos(b[..., 2, None]), np.sin(b[..., 2, None])
    return np.stack([b[..., 0, None] + c * along - s * left, b[..., 1, None] + s * along + c * left], axis=-1)


def corner_points(box: Box) -> list[tuple[float, float]]:
    """Return the corners of one box as plain floats, in the order of `corners`."""
    c, s = cos(box.heading), sin(box.heading)
    ax, ay = c * box.length / 2, s * box.length / 2
    lx, ly = -s * box.width / 2, c * box.width / 2
    x, y = box.x, box.y
    return [
        (x + ax + lx, y + ay + ly),
        (x - ax + lx, y - ay + ly),
        (x - ax - lx, y - ay - ly),
        (x + ax - lx, y + ay - ly),
    ]


def overlaps(a: Box, b: Box) -> bool:
    """Whether two boxes share a point; False where a value is NaN."""
    return bool(overlap(b.x - a.x, b.y - a.y, a.heading, a.length, a.width, b.heading, b.length, b.width))


def ego_hits(
    ego_pose: FloatArray | tuple[float, float, float],
    ego_size: FloatArray | tuple[float, float],
    poses: FloatArray,
    sizes: FloatArray,
) -> IntArray:
    """Return which of the others the ego's footprint overlaps.

    Args:
        ego_pose: x, y, heading. ego_size: length, width.
        poses: [K, 3] x, y, heading; NaN where absent. sizes: [K, 2] length, width.

    Returns:
        Indices into `poses`, ascending.
    """
    x, y, heading = (float(v) for v in ego_pose)
    length, width = (float(v) for v in ego_size)
    return hits(x, y, heading, length, width, poses, sizes)


def box_distance(a: Box, b: Box) -> float:
    """Return the smallest distance (m) between two boxes, 0 when they overlap, NaN where a value is NaN."""
    if overlaps(a, b):
        return 0.0
    # Two convex shapes that do not overlap are nearest at a corner of one of them.
    return min(_corners_to_box(a, b), _corners_to_box(b, a))


def _corners_to_box(of: Box, to: Box) -> float:
    c, s = cos(to.heading), sin(to.heading)
    half_length, half_width = to.length / 2, to.width / 2
    nearest = float("inf")
    for px, py in corner_points(of):
        dx, dy = px - to.x, py - to.y
        d = hypot(max(abs(dx * c + dy * s) - half_length, 0.0), max(abs(dy * c - dx * s) - half_width, 0.0))
        # `not >=` keeps a NaN.
        if not d >= nearest:
            nearest = d
    return nearest


def box_distances(ego: FloatArray | Box, others: FloatArray) -> FloatArray:
    """Return the distances between one box and many.

    Args:
        ego: [5]. others: [K, 5].

    Returns:
        [K] m, 0 where they overlap, NaN where absent.
    """
    return _distances(np.asarray(ego, dtype=np.float64), np.asarray(others, dtype=np.float64))


def pairwise_box_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance between two footprints, frame by frame.

    Args:
        a: [T, 5]. b: [T, 5] (or shapes that broadcast, the last axis being the box).

    Returns:
        [T] m, 0 where they overlap, NaN where either is absent.
    """
    return _distances(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))


def box_overlap(a: FloatArray, b: FloatArray) -> NDArray[np.bool_]:
    """Return which boxes overlap, frame by frame: [..., 5] and [..., 5] to [...]; False where either is absent."""
    one, other = np.broadcast_arrays(a, b)
    found: NDArray[np.bool_] = overlaps_of(_rows(one), _rows(other)).reshape(one.shape[:-1])
    return found


def _distances(a: FloatArray, b: FloatArray) -> FloatArray:
    one, other = np.broadcast_arrays(a, b)
    found: FloatArray = gaps(_rows(one), _rows(other)).reshape(one.shape[:-1])
    return found


def _rows(boxes: FloatArray) -> FloatArray:
    return np.ascontiguousarray(boxes, dtype=np.float64).reshape(-1, 5)
