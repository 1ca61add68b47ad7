"""Geometry of boxes: overlap, distance, and whether a vehicle's wheels are on the road.

A box is a footprint: a rectangle with a centre, the heading of its long axis, a length and a width. Overlap is exact
(separating axes); boxes that only touch count as overlapping.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.kernels.compiling import ANY_TABLE, BYTE_TABLE, CUBE, FLOAT, FLOATS, TABLE, compiled, inner

IntArray = NDArray[np.intp]
Bytes = NDArray[np.uint8]

WHOLE = 1
"""Code of a square of the network's area that lies wholly on the drivable area."""


class Box(NamedTuple):
    """A footprint: centre (m), heading (rad, counter-clockwise from east), length and width (m)."""

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
        """Return the footprint without its speed."""
        return Box(self.x, self.y, self.heading, self.length, self.width)

    @property
    def velocity(self) -> tuple[float, float]:
        """Return the velocity (m/s) to the east and to the north."""
        return self.speed * cos(self.heading), self.speed * sin(self.heading)


@inner
def _box(row: FloatArray) -> Box:
    return Box(row[0], row[1], row[2], row[3], row[4])


@inner
def posed(pose: FloatArray, size: FloatArray) -> Box:
    """Return a box from its pose (x, y, heading) and its size (length, width)."""
    return Box(pose[0], pose[1], pose[2], size[0], size[1])


@inner
def overlap(a: Box, b: Box) -> bool:
    """Return whether two boxes share a point; False if a value is NaN."""
    dx, dy = b.x - a.x, b.y - a.y
    ca, sa, cb, sb = np.cos(a.heading), np.sin(a.heading), np.cos(b.heading), np.sin(b.heading)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    # A chain of "<=", because a comparison with NaN must give False.
    shares: bool = (
        abs(dx * ca + dy * sa) <= (a.length + c * b.length + s * b.width) / 2
        and abs(dy * ca - dx * sa) <= (a.width + s * b.length + c * b.width) / 2
        and abs(dx * cb + dy * sb) <= (b.length + c * a.length + s * a.width) / 2
        and abs(dy * cb - dx * sb) <= (b.width + s * a.length + c * a.width) / 2
    )
    return shares


@inner
def _corners_apart(of: Box, to: Box) -> float:
    """Return the distance between the box `to` and the nearest corner of the box `of`, m."""
    dx, dy = of.x - to.x, of.y - to.y
    cos_to, sin_to, cos_of, sin_of = np.cos(to.heading), np.sin(to.heading), np.cos(of.heading), np.sin(of.heading)
    nearest = np.inf
    for k in range(4):
        along = of.length / 2 if k % 2 else -of.length / 2
        left = of.width / 2 if k in (0, 1) else -of.width / 2
        x, y = dx + cos_of * along - sin_of * left, dy + sin_of * along + cos_of * left
        ahead = max(abs(x * cos_to + y * sin_to) - to.length / 2, 0.0)
        beside = max(abs(y * cos_to - x * sin_to) - to.width / 2, 0.0)
        nearest = min(nearest, ahead * ahead + beside * beside)
    return float(np.sqrt(nearest))


@inner
def apart(a: Box, b: Box) -> float:
    """Return the distance of two boxes, m."""
    if overlap(a, b):
        return 0.0
    # Two convex shapes that do not overlap are nearest to each other at a corner of one of them.
    return min(_corners_apart(b, a), _corners_apart(a, b))


@compiled(TABLE, TABLE)
def gaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances of pairs of boxes ([N, 5] the fields of `Box`), [N] m: 0 if they overlap, NaN if a value is
    NaN."""
    distances = np.empty(a.shape[0])
    for k in range(a.shape[0]):
        distances[k] = np.nan if np.isnan(a[k].sum() + b[k].sum()) else apart(_box(a[k]), _box(b[k]))
    return distances


@inner
def _reach(a: FloatArray, b: FloatArray) -> float:
    """Return the largest distance of the centres of two touching boxes, m, from their lengths and widths."""
    return float((np.hypot(a[0], a[1]) + np.hypot(b[0], b[1])) / 2)


@compiled(CUBE, TABLE, FLOATS)
def gaps_to_first(poses: FloatArray, sizes: FloatArray, within: FloatArray) -> FloatArray:
    """Return the distances between the first actor and each other actor over time, [K, T], m.

    A distance is infinite if an actor is absent (NaN), or if the distance of the centres shows that it exceeds
    `within`.

    Args:
        poses: [1 + K, T, 3] x, y, heading. sizes: [1 + K, 2] length, width. within: [K] m.
    """
    distances = np.empty((poses.shape[0] - 1, poses.shape[1]))
    for k in range(distances.shape[0]):
        most = within[k] + _reach(sizes[0], sizes[k + 1])
        for t in range(distances.shape[1]):
            dx, dy = poses[k + 1, t, 0] - poses[0, t, 0], poses[k + 1, t, 1] - poses[0, t, 1]
            near = dx * dx + dy * dy <= most * most  # False for NaN
            distances[k, t] = (
                apart(posed(poses[0, t], sizes[0]), posed(poses[k + 1, t], sizes[k + 1])) if near else np.inf
            )
    return distances


@compiled(CUBE, TABLE, TABLE, FLOAT)
def ever_within(paths: FloatArray, other: FloatArray, sizes: FloatArray, radius: float) -> bool:
    """Return whether a box comes within `radius` (m) of another one on any of its paths.

    `paths`: [N, T, 3] x, y, heading. `other`: [T, 3] x, y, heading of the other box, NaN where absent. `sizes`: [2, 2]
    length and width of the box and of the other one, m.
    """
    outer = radius + _reach(sizes[0], sizes[1])
    inside = radius + (min(sizes[0, 0], sizes[0, 1]) + min(sizes[1, 0], sizes[1, 1])) / 2
    for n in range(paths.shape[0]):
        for t in range(paths.shape[1]):
            dx, dy = other[t, 0] - paths[n, t, 0], other[t, 1] - paths[n, t, 1]
            squared = dx * dx + dy * dy
            # Boxes are near enough if circles inside them are; they cannot be if circles around them are not.
            if squared <= inside * inside:
                return True
            if squared <= outer * outer and apart(posed(paths[n, t], sizes[0]), posed(other[t], sizes[1])) <= radius:
                return True
    return False


@compiled(TABLE, TABLE)
def overlaps_of(a: FloatArray, b: FloatArray) -> BoolArray:
    """Return which pairs of boxes overlap, [N]; arguments as for `gaps`."""
    overlapping = np.empty(a.shape[0], dtype=np.bool_)
    for k in range(a.shape[0]):
        overlapping[k] = overlap(_box(a[k]), _box(b[k]))
    return overlapping


@inner
def _hits(box: Box, poses: FloatArray, sizes: FloatArray) -> IntArray:
    """Return the indices of the footprints that a box overlaps; see `hits`."""
    indices = np.empty(poses.shape[0], dtype=np.intp)
    count = 0
    reach = np.hypot(box.length, box.width)
    for k in range(poses.shape[0]):
        dx, dy = poses[k, 0] - box.x, poses[k, 1] - box.y
        # Circles around the boxes are compared first, because few actors are this near. The test is False for NaN.
        most = (reach + sizes[k, 0] + sizes[k, 1]) / 2
        if dx * dx + dy * dy <= most * most and overlap(box, posed(poses[k], sizes[k])):
            indices[count] = k
            count += 1
    return indices[:count]


@compiled(FLOATS, ANY_TABLE, ANY_TABLE)
def hits(box: FloatArray, poses: FloatArray, sizes: FloatArray) -> IntArray:
    """Return the indices of the footprints that a box ([5] the fields of `Box`) overlaps, in ascending order.

    `poses`: [K, >=3] x, y, heading of the others; NaN where absent. `sizes`: [K, 2] length, width.
    """
    return _hits(_box(box), poses, sizes)


@compiled(FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT)
def wheels(x: float, y: float, heading: float, front: float, rear: float, left: float) -> FloatArray:
    """Return a point for each wheel of a footprint, [4, 2] m: front left, rear left, rear right, front right.

    `front`, `rear`: distances of the axles ahead of the centre, m. `left`: distance of the points from the middle, m.
    """
    c, s = np.cos(heading), np.sin(heading)
    points = np.empty((4, 2))
    for k in range(4):
        along = front if k in (0, 3) else rear
        across = left if k in (0, 1) else -left
        points[k, 0], points[k, 1] = x + c * along - s * across, y + s * along + c * across
    return points


@compiled(TABLE, FLOAT, FLOAT, FLOAT, BYTE_TABLE)
def all_whole(points: FloatArray, left: float, bottom: float, cell: float, squares: Bytes) -> bool:
    """Return whether all points ([N, 2] m) lie in squares with the state `WHOLE`; see `outcome.Squares`."""
    for k in range(points.shape[0]):
        column, row = np.floor((points[k, 0] - left) / cell), np.floor((points[k, 1] - bottom) / cell)
        if not (0 <= column < squares.shape[0] and 0 <= row < squares.shape[1]):  # true for NaN, too
            return False
        if squares[int(column), int(row)] != WHOLE:
            return False
    return True


@compiled(TABLE, TABLE, FLOATS, FLOAT, FLOAT, FLOAT, BYTE_TABLE)
def drives_on(
    states: FloatArray, sizes: FloatArray, ego: FloatArray, left: float, bottom: float, cell: float, squares: Bytes
) -> bool:
    """Return whether the ego touches no other actor and its wheels are in squares with the state `WHOLE`.

    `states`: [1 + K, >=3] x, y, heading of the ego and of the others; NaN where absent. `sizes`: [K, 2] length, width
    of the others.
    `ego`: [5] its length and width, then `front`, `rear`, `left` of `wheels`. The rest: see `outcome.Squares`.
    """
    if _hits(posed(states[0], ego), states[1:], sizes).size > 0:
        return False
    return all_whole(
        wheels(states[0, 0], states[0, 1], states[0, 2], ego[2], ego[3], ego[4]), left, bottom, cell, squares
    )


# --- plain Python and numpy -------------------------------------------------------------------------------------------


def corners(boxes: FloatArray | Box) -> FloatArray:
    """Return the corners of boxes ([..., 5]), [..., 4, 2] m: front left, rear left, rear right, front right
    (counter-clockwise)."""
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
    """Return whether two boxes share a point; False if a value is NaN."""
    return bool(overlaps_of(np.array([a], dtype=np.float64), np.array([b], dtype=np.float64))[0])


def box_distance(a: FloatArray | Box, b: FloatArray | Box) -> FloatArray:
    """Return the distances between boxes ([..., 5] and [..., 5]), [...] m: 0 if they overlap, NaN if one is absent."""
    a, b = np.broadcast_arrays(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))
    distances: FloatArray = gaps(_rows(a), _rows(b)).reshape(a.shape[:-1])
    return distances


def box_overlap(a: FloatArray, b: FloatArray) -> BoolArray:
    """Return which boxes ([..., 5] and [..., 5]) overlap, [...]; False if one is absent."""
    a, b = np.broadcast_arrays(a, b)
    overlapping: BoolArray = overlaps_of(_rows(a), _rows(b)).reshape(a.shape[:-1])
    return overlapping


def _rows(boxes: FloatArray) -> FloatArray:
    # A copy: numba warns when it is given an array that numpy has broadcast, even if it has the right layout.
    return np.array(boxes, dtype=np.float64, order="C").reshape(-1, 5)
