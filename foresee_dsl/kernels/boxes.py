"""Kernels over footprints: who touches whom, and whether wheels are on the road (see `drivers.compiled`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.compiling import ANY_TABLE, BYTE_TABLE, CUBE, FLOAT, FLOATS, TABLE, compiled, inner

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]

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


@inner
def _corners_apart(
    dx: float, dy: float, cos: float, sin: float, length: float, width: float, c: float, s: float, m: float, wide: float
) -> float:
    """Return the distance between a box and the nearest corner of another, m.

    Args:
        dx, dy: from the box's centre to the other's. cos, sin, length, width: the box's heading and size.
        c, s, m, wide: the other's.
    """
    nearest = np.inf
    for k in range(4):
        along = m / 2 if k % 2 else -m / 2
        left = wide / 2 if k in (0, 1) else -wide / 2
        x, y = dx + c * along - s * left, dy + s * along + c * left
        ahead = max(abs(x * cos + y * sin) - length / 2, 0.0)
        beside = max(abs(y * cos - x * sin) - width / 2, 0.0)
        nearest = min(nearest, ahead * ahead + beside * beside)
    return float(np.sqrt(nearest))


@inner
def _gap(
    ax: float, ay: float, ah: float, am: float, aw: float, bx: float, by: float, bh: float, bm: float, bw: float
) -> float:
    """Return how far two boxes are apart, m: of each x, y, heading, length, width."""
    dx, dy = bx - ax, by - ay
    if overlap(dx, dy, ah, am, aw, bh, bm, bw):
        return 0.0
    # Two convex shapes that do not overlap are nearest at a corner of one of them.
    ca, sa, cb, sb = np.cos(ah), np.sin(ah), np.cos(bh), np.sin(bh)
    return min(
        _corners_apart(dx, dy, ca, sa, am, aw, cb, sb, bm, bw),
        _corners_apart(-dx, -dy, cb, sb, bm, bw, ca, sa, am, aw),
    )


@compiled(TABLE, TABLE)
def gaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return [N] m, how far boxes are apart, 0 where they overlap, NaN where one of them holds a NaN.

    Args:
        a, b: [N, 5] x, y, heading, length, width.
    """
    found = np.empty(a.shape[0])
    for k in range(a.shape[0]):
        ax, ay, ah, am, aw = a[k]
        bx, by, bh, bm, bw = b[k]
        if np.isnan(ax + ay + ah + am + aw + bx + by + bh + bm + bw):
            found[k] = np.nan
        else:
            found[k] = _gap(ax, ay, ah, am, aw, bx, by, bh, bm, bw)
    return found


@inner
def _reach(am: float, aw: float, bm: float, bw: float) -> float:
    """Return how far apart the centres of two boxes of these lengths and widths may be when they touch."""
    return float((np.hypot(am, aw) + np.hypot(bm, bw)) / 2)


@compiled(CUBE, TABLE, FLOATS)
def gaps_to_first(poses: FloatArray, sizes: FloatArray, within: FloatArray) -> FloatArray:
    """Return the distances between the first actor and each other one over time, [K, T], m.

    Infinite where one is absent (NaN) or where the centres say that it is more than `within`.

    Args:
        poses: [1 + K, T, 3] x, y, heading. sizes: [1 + K, 2] length, width. within: [K] m.
    """
    found = np.empty((poses.shape[0] - 1, poses.shape[1]))
    am, aw = sizes[0]
    for k in range(found.shape[0]):
        bm, bw = sizes[k + 1]
        most = within[k] + _reach(am, aw, bm, bw)
        for t in range(found.shape[1]):
            ax, ay, ah = poses[0, t]
            bx, by, bh = poses[k + 1, t]
            dx, dy = bx - ax, by - ay
            near = dx * dx + dy * dy <= most * most  # a NaN is not
            found[k, t] = _gap(ax, ay, ah, am, aw, bx, by, bh, bm, bw) if near else np.inf
    return found


@compiled(CUBE, TABLE, TABLE, FLOAT)
def ever_within(ways: FloatArray, other: FloatArray, sizes: FloatArray, radius: float) -> bool:
    """Say whether a box comes within a distance of another on any of its ways.

    Args:
        ways: [N, T, 3] its poses. other: [T, 3] the other's. sizes: [2, 2] of both. NaN where absent. radius: m.
    """
    am, aw = sizes[0]
    bm, bw = sizes[1]
    outer = radius + _reach(am, aw, bm, bw)
    inside = radius + (min(am, aw) + min(bm, bw)) / 2
    for n in range(ways.shape[0]):
        for t in range(ways.shape[1]):
            ax, ay, ah = ways[n, t]
            bx, by, bh = other[t]
            dx, dy = bx - ax, by - ay
            squared = dx * dx + dy * dy
            # The circles inside the boxes are near enough; those around them are, and then the boxes may be.
            if squared <= inside * inside:
                return True
            if squared <= outer * outer and _gap(ax, ay, ah, am, aw, bx, by, bh, bm, bw) <= radius:
                return True
    return False


@compiled(TABLE, TABLE)
def overlaps_of(a: FloatArray, b: FloatArray) -> Flags:
    """Return [N], which boxes overlap; arguments as `gaps`."""
    found = np.empty(a.shape[0], dtype=np.bool_)
    for k in range(a.shape[0]):
        ax, ay, ah, am, aw = a[k]
        bx, by, bh, bm, bw = b[k]
        found[k] = overlap(bx - ax, by - ay, ah, am, aw, bh, bm, bw)
    return found


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
