"""Geometry of boxes: do two overlap, how far are they apart, and are a vehicle's wheels on the road.

A box is a footprint: a rectangle given by its centre, the heading of its long axis, its length and its width. Overlap
is exact (separating axes); boxes that only touch count as overlapping.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.compiling import ANY_TABLE, BYTE_TABLE, CUBE, FLOAT, FLOATS, TABLE, compiled, inner

IntArray = NDArray[np.intp]
Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]

WHOLE = 1
"""Of a square of the network's area: it is known to lie on the drivable area altogether."""


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
        """Where it is now."""
        return Box(self.x, self.y, self.heading, self.length, self.width)

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity (m/s) east and north."""
        return self.speed * cos(self.heading), self.speed * sin(self.heading)


@inner
def _box(row: FloatArray) -> Box:
    return Box(row[0], row[1], row[2], row[3], row[4])


@inner
def _posed(pose: FloatArray, size: FloatArray) -> Box:
    return Box(pose[0], pose[1], pose[2], size[0], size[1])


@inner
def overlap(a: Box, b: Box) -> bool:
    """Say whether two boxes share a point; False where a value is NaN."""
    dx, dy = b.x - a.x, b.y - a.y
    ca, sa, cb, sb = np.cos(a.heading), np.sin(a.heading), np.cos(b.heading), np.sin(b.heading)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    # Written as a chain of "<=" so that NaN answers False.
    shares: bool = (
        abs(dx * ca + dy * sa) <= (a.length + c * b.length + s * b.width) / 2
        and abs(dy * ca - dx * sa) <= (a.width + s * b.length + c * b.width) / 2
        and abs(dx * cb + dy * sb) <= (b.length + c * a.length + s * a.width) / 2
        and abs(dy * cb - dx * sb) <= (b.width + s * a.length + c * a.width) / 2
    )
    return shares


@inner
def _corners_apart(of: Box, to: Box) -> float:
    """Return the distance between a box and the nearest corner of another (`of`), m."""
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
    """Return how far two boxes are apart, m."""
    if overlap(a, b):
        return 0.0
    # Two convex shapes that do not overlap are nearest at a corner of one of them.
    return min(_corners_apart(b, a), _corners_apart(a, b))


@compiled(TABLE, TABLE)
def gaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return [N] m, how far boxes ([N, 5] the fields of `Box`) are apart, 0 where they overlap, NaN where one holds a
    NaN."""
    found = np.empty(a.shape[0])
    for k in range(a.shape[0]):
        found[k] = np.nan if np.isnan(a[k].sum() + b[k].sum()) else apart(_box(a[k]), _box(b[k]))
    return found


@inner
def _reach(a: FloatArray, b: FloatArray) -> float:
    """Return how far apart the centres of two boxes may be when they touch, of their lengths and widths."""
    return float((np.hypot(a[0], a[1]) + np.hypot(b[0], b[1])) / 2)


@compiled(CUBE, TABLE, FLOATS)
def gaps_to_first(poses: FloatArray, sizes: FloatArray, within: FloatArray) -> FloatArray:
    """Return the distances between the first actor and each other one over time, [K, T], m.

    Infinite where one is absent (NaN) or where the centres say that it is more than `within`.

    Args:
        poses: [1 + K, T, 3] x, y, heading. sizes: [1 + K, 2] length, width. within: [K] m.
    """
    found = np.empty((poses.shape[0] - 1, poses.shape[1]))
    for k in range(found.shape[0]):
        most = within[k] + _reach(sizes[0], sizes[k + 1])
        for t in range(found.shape[1]):
            dx, dy = poses[k + 1, t, 0] - poses[0, t, 0], poses[k + 1, t, 1] - poses[0, t, 1]
            near = dx * dx + dy * dy <= most * most  # a NaN is not
            found[k, t] = (
                apart(_posed(poses[0, t], sizes[0]), _posed(poses[k + 1, t], sizes[k + 1])) if near else np.inf
            )
    return found


@compiled(CUBE, TABLE, TABLE, FLOAT)
def ever_within(paths: FloatArray, other: FloatArray, sizes: FloatArray, radius: float) -> bool:
    """Say whether a box comes within `radius` m of another ([T, 3], NaN where absent) on any of its paths, [N, T,
    3]."""
    outer = radius + _reach(sizes[0], sizes[1])
    inside = radius + (min(sizes[0, 0], sizes[0, 1]) + min(sizes[1, 0], sizes[1, 1])) / 2
    for n in range(paths.shape[0]):
        for t in range(paths.shape[1]):
            dx, dy = other[t, 0] - paths[n, t, 0], other[t, 1] - paths[n, t, 1]
            squared = dx * dx + dy * dy
            # The circles inside the boxes are near enough; those around them are, and then the boxes may be.
            if squared <= inside * inside:
                return True
            if squared <= outer * outer and apart(_posed(paths[n, t], sizes[0]), _posed(other[t], sizes[1])) <= radius:
                return True
    return False


@compiled(TABLE, TABLE)
def overlaps_of(a: FloatArray, b: FloatArray) -> Flags:
    """Return [N], which boxes overlap; arguments as `gaps`."""
    found = np.empty(a.shape[0], dtype=np.bool_)
    for k in range(a.shape[0]):
        found[k] = overlap(_box(a[k]), _box(b[k]))
    return found


@inner
def _hits(box: Box, poses: FloatArray, sizes: FloatArray) -> IntArray:
    """Return which of some footprints a footprint overlaps; see `hits`."""
    found = np.empty(poses.shape[0], dtype=np.intp)
    count = 0
    reach = np.hypot(box.length, box.width)
    for k in range(poses.shape[0]):
        dx, dy = poses[k, 0] - box.x, poses[k, 1] - box.y
        # Circles around the boxes first: hardly any other actor is this near. A NaN is not.
        most = (reach + sizes[k, 0] + sizes[k, 1]) / 2
        if dx * dx + dy * dy <= most * most and overlap(box, _posed(poses[k], sizes[k])):
            found[count] = k
            count += 1
    return found[:count]


@compiled(FLOATS, ANY_TABLE, ANY_TABLE)
def hits(box: FloatArray, poses: FloatArray, sizes: FloatArray) -> IntArray:
    """Return which of some footprints the box `box` ([5] the fields of `Box`) overlaps, ascending.

    `poses`: [K, >=3] x, y, heading of the others; NaN where absent. `sizes`: [K, 2] length, width.
    """
    return _hits(_box(box), poses, sizes)


@compiled(FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT)
def wheels(x: float, y: float, heading: float, front: float, rear: float, left: float) -> FloatArray:
    """Return [4, 2] m, a point for each wheel of a footprint: front left, rear left, rear right, front right.

    `front`, `rear`: how far ahead of its centre the axles are. `left`: how far from the middle the points are, m.
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
    """Whether all of some points ([N, 2] m) lie in squares that are known to be whole; see `drivable_area.Squares`."""
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
    """Whether the ego touches no other actor, and its wheels stand in squares that are known to be whole.

    `states`: [1 + K, >=3] x, y, heading of the ego and of the others; NaN where absent. `sizes`: [K, 2] of the others.
    `ego`: [5] its length and width, and what `wheels` needs. The rest is `drivable_area.Squares`'.
    """
    if _hits(_posed(states[0], ego), states[1:], sizes).size > 0:
        return False
    return all_whole(
        wheels(states[0, 0], states[0, 1], states[0, 2], ego[2], ego[3], ego[4]), left, bottom, cell, known
    )


# --- plain Python and numpy -------------------------------------------------------------------------------------------


def corners(boxes: FloatArray | Box) -> FloatArray:
    """Return the corners of boxes, [..., 5]: [..., 4, 2] m, front left, rear left, rear right, front right
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
    """Say whether two boxes share a point; False where a value is NaN."""
    return bool(overlaps_of(np.array([a], dtype=np.float64), np.array([b], dtype=np.float64))[0])


def box_distances(ego: FloatArray | Box, others: FloatArray) -> FloatArray:
    """Return the distances between one box, [5], and many, [K, 5]: [K] m, 0 where they overlap, NaN where absent."""
    return _distances(np.asarray(ego, dtype=np.float64), np.asarray(others, dtype=np.float64))


def pairwise_box_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance between two footprints, [T, 5] each, frame by frame: 0 where they overlap, NaN where
    absent."""
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
