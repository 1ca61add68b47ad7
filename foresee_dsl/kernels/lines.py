"""Geometry of lines: the nearest point, positions along a line, and intersections of two paths.

Lanes and routes are arrays of `LineVertex`; recorded paths, which need no lengths, are tables of points. There are two
searches for the nearest point: on a lane around the last result, and on a recorded path of a thousand segments by
blocks of segments. Their distances differ in the last bit, because one subtracts the nearest point of the segment and
the other moves the origin there; both are kept, because the ranking of risky points depends on all bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, INTS, TABLE, compiled, inner
from foresee_dsl.kernels.records import array_of, dtype_of

SEARCH_M = 12.0
"""Distance around its last position on a line within which a vehicle is searched first, m; as in `Polyline.project`."""
SHORTEST_M2 = 1e-12
"""A division uses at least this square of a segment's length, m^2. Ours: a micrometre, so that two equal points do not
cause a division by zero."""
_BLOCK = 16
"""Number of segments of a path with a common bounding box. Ours: about the root of a path's number of segments, where
boxes and segments cost the same."""
_WEST, _SOUTH, _EAST, _NORTH = range(4)
_CLEAR_M = 1e-6
"""Bounding boxes nearer to each other than this (m; m^2 where squares of distances are compared) may touch. Ours: a
thousand times the rounding error of coordinates of some kilometres."""


class LineVertex(NamedTuple):
    """A vertex of a line: x, y (m), the length along the line (m), the line's heading there (rad, continuous)."""

    x: float
    y: float
    along: float
    heading: float


class SpeedPoint(NamedTuple):
    """The speed limit (m/s) at a length along a line (m)."""

    along: float
    speed: float


VERTICES, SPEED_POINTS = array_of(LineVertex), array_of(SpeedPoint)


def vertices(xy: Any, along: Sequence[float] | FloatArray, heading: Sequence[float] | FloatArray) -> Records:  # noqa: ANN401  rows of two numbers, of any kind
    """Return a line as an array of `LineVertex`: its points [N, 2] m, lengths [N] m, headings [N] rad."""
    line = np.empty(len(along), dtype_of(LineVertex))
    points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    line["x"], line["y"], line["along"], line["heading"] = points[:, 0], points[:, 1], along, heading
    return line


def speed_points(along: Sequence[float], speed: Sequence[float]) -> Records:
    """Return speed limits along a line as an array of `SpeedPoint`."""
    points = np.empty(len(along), dtype_of(SpeedPoint))
    points["along"], points["speed"] = along, speed
    return points


@inner
def last_up_to(line: Records, first: int, end: int, s: float) -> int:
    """Return the last index in first..end (exclusive) whose length along the line is at most `s`; else first - 1."""
    low, high = first, end
    while low < high:
        middle = (low + high) // 2
        if s < line[middle]["along"]:
            high = middle
        else:
            low = middle + 1
    return low - 1


@inner
def share_of_segment(px: float, py: float, dx: float, dy: float) -> float:
    """Return where on a segment the nearest point of its line is: 0 at the beginning of the segment, 1 at its end.

    `px`, `py`: the point. `dx`, `dy`: the segment's end. Both are relative to the segment's begin.
    """
    return (px * dx + py * dy) / max(dx * dx + dy * dy, SHORTEST_M2)


@inner
def nearest_on_segment(px: float, py: float, dx: float, dy: float) -> tuple[float, float]:
    """Return `share_of_segment`, and the square of the distance between the point and the segment, m^2."""
    share = share_of_segment(px, py, dx, dy)
    inside = min(max(share, 0.0), 1.0)
    px -= inside * dx
    py -= inside * dy
    return share, px * px + py * py


@inner
def _nearest(x: float, y: float, line: Records, low: int, high: int) -> tuple[int, float]:
    """Return the segment of low..high (exclusive) nearest to a point, and its nearest point as a share of its
    length.
    """
    best, at, share = np.inf, low, 0.0
    for k in range(low, high):
        a, b = line[k], line[k + 1]
        t, away = nearest_on_segment(x - a["x"], y - a["y"], b["x"] - a["x"], b["y"] - a["y"])
        if away < best:
            best, at, share = away, k, t
    return at, share


@inner
def _foot(x: float, y: float, near_s: float, line: Records, first: int, end: int) -> tuple[int, float]:
    """Return the segment nearest to a point, and the foot's share of it; see `along`."""
    last = end - 1
    k, t, is_nearest = first, 0.0, False
    if not np.isnan(near_s):
        low = min(max(last_up_to(line, first, end, near_s - SEARCH_M), first), last - 1)
        high = min(max(last_up_to(line, first, end, near_s + SEARCH_M) + 1, low + 1), last)
        k, t = _nearest(x, y, line, low, high)
        # At an end of the window that is not an end of the line, a nearer point may lie beyond the window.
        is_nearest = not (k == low and t < 0.0 and low > first) and not (k == high - 1 and t > 1.0 and high < last)
    if not is_nearest:
        k, t = _nearest(x, y, line, first, last)
    if k > first:
        t = max(t, 0.0)
    if k < last - 1:
        t = min(t, 1.0)
    return k, t


@inner
def along(x: float, y: float, near_s: float, line: Records, first: int, end: int) -> float:
    """Return the length along a line nearest to a point, m; below 0 or above the line's length beyond its ends.

    The search begins around `near_s` (NaN: the whole line). `first`, `end`: range of this line's vertices in `line`.
    """
    k, t = _foot(x, y, near_s, line, first, end)
    a, b = line[k], line[k + 1]
    length: float = a["along"] + t * np.hypot(b["x"] - a["x"], b["y"] - a["y"])
    return length


@inner
def heading_at(s: float, line: Records, first: int, end: int) -> float:
    """Return the heading of a line at a length, rad."""
    k = min(max(last_up_to(line, first, end, s), first), end - 2)
    a, b = line[k], line[k + 1]
    inside = min(max((s - a["along"]) / (b["along"] - a["along"]), 0.0), 1.0)
    heading: float = a["heading"] + inside * (b["heading"] - a["heading"])
    return heading


@inner
def place_at(s: float, line: Records) -> tuple[float, float, float]:
    """Return x, y and heading of a line at a length, as `Polyline.at`: straight on beyond the ends."""
    k = min(max(last_up_to(line, 0, line.size, s), 0), line.size - 2)
    a, b = line[k], line[k + 1]
    t = (s - a["along"]) / (b["along"] - a["along"])
    inside = min(max(t, 0.0), 1.0)
    heading = a["heading"] + inside * (b["heading"] - a["heading"])
    return a["x"] + t * (b["x"] - a["x"]), a["y"] + t * (b["y"] - a["y"]), heading


@inner
def speed_at(s: float, points: Records, first: int, end: int) -> float:
    """Return the speed limit interpolated between the points first..end (exclusive); constant beyond the ends."""
    k = last_up_to(points, first, end, s)
    if k < first:
        return float(points[first]["speed"])
    if k >= end - 1:
        return float(points[end - 1]["speed"])
    a, b = points[k], points[k + 1]
    share = (s - a["along"]) / max(b["along"] - a["along"], 1e-9)
    return float(a["speed"] + share * (b["speed"] - a["speed"]))


@compiled(FLOAT, FLOAT, FLOAT, VERTICES)
def project(x: float, y: float, near_s: float, line: Records) -> tuple[float, float]:
    """Return the length along a line nearest to a point, and the point's distance to its left, m; see `along`."""
    k, t = _foot(x, y, near_s, line, 0, line.size)
    a, b = line[k], line[k + 1]
    dx, dy = b["x"] - a["x"], b["y"] - a["y"]
    px, py = x - a["x"], y - a["y"]
    lateral = np.copysign(np.hypot(px - t * dx, py - t * dy), dx * py - dy * px)
    return a["along"] + t * np.hypot(dx, dy), lateral


# --- recorded paths: tables of points --------------------------------------------------------------------------------


@inner
def _bounds(path: FloatArray) -> FloatArray:
    """Return west, south, east and north of each block of segments, [B, 4]."""
    segments = len(path) - 1
    bounds = np.empty(((segments + _BLOCK - 1) // _BLOCK, 4))
    for block in range(len(bounds)):
        first = block * _BLOCK
        last = min(first + _BLOCK, segments)
        west = east = path[first, 0]
        south = north = path[first, 1]
        for k in range(first + 1, last + 1):
            west, east = min(west, path[k, 0]), max(east, path[k, 0])
            south, north = min(south, path[k, 1]), max(north, path[k, 1])
        bounds[block, _WEST], bounds[block, _SOUTH] = west, south
        bounds[block, _EAST], bounds[block, _NORTH] = east, north
    return bounds


@inner
def _apart(a: FloatArray, b: FloatArray) -> bool:
    """Return whether two bounding boxes have no point in common."""
    return bool(
        a[_WEST] > b[_EAST] + _CLEAR_M
        or b[_WEST] > a[_EAST] + _CLEAR_M
        or a[_SOUTH] > b[_NORTH] + _CLEAR_M
        or b[_SOUTH] > a[_NORTH] + _CLEAR_M
    )


@inner
def _segments_cut(a: FloatArray, i: int, b: FloatArray, k: int, sine: float) -> bool:
    """Return whether segment i of a path and k of another one intersect at an angle of at least this sine."""
    rx, ry = a[i + 1, 0] - a[i, 0], a[i + 1, 1] - a[i, 1]
    sx, sy = b[k + 1, 0] - b[k, 0], b[k + 1, 1] - b[k, 1]
    cross = rx * sy - ry * sx
    if cross == 0.0:
        return False
    x, y = b[k, 0] - a[i, 0], b[k, 1] - a[i, 1]
    t = (x * sy - y * sx) / cross
    u = (x * ry - y * rx) / cross
    if not (0.0 <= t <= 1.0 and 0.0 <= u <= 1.0):
        return False
    return bool(abs(cross) / (math.hypot(rx, ry) * math.hypot(sx, sy)) >= sine)


@compiled(TABLE, TABLE, FLOAT)
def paths_cut(a: FloatArray, b: FloatArray, sine: float) -> bool:
    """Return whether two paths ([N, 2], [M, 2]) intersect at an angle of at least this sine.

    Two recorded paths have a million pairs of segments, few of them near each other: blocks of segments whose bounding
    boxes are apart are skipped.
    """
    if len(a) < 2 or len(b) < 2:
        return False
    theirs = _bounds(b)
    for ours, bound in enumerate(_bounds(a)):
        for other in range(len(theirs)):
            if _apart(bound, theirs[other]):
                continue
            for i in range(ours * _BLOCK, min((ours + 1) * _BLOCK, len(a) - 1)):
                for k in range(other * _BLOCK, min((other + 1) * _BLOCK, len(b) - 1)):
                    if _segments_cut(a, i, b, k, sine):
                        return True
    return False


@inner
def _to_bound(x: float, y: float, bound: FloatArray) -> float:
    """Return the square of the distance between a point and a bounding box."""
    dx = max(bound[_WEST] - x, x - bound[_EAST], 0.0)
    dy = max(bound[_SOUTH] - y, y - bound[_NORTH], 0.0)
    return float(dx * dx + dy * dy)


@inner
def _share(x: float, y: float, path: FloatArray, k: int) -> float:
    """Return `share_of_segment` of segment k of a path."""
    return share_of_segment(x - path[k, 0], y - path[k, 1], path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])


@inner
def _to_segment(x: float, y: float, path: FloatArray, k: int) -> float:
    """Return the square of the distance between a point and segment k of a path."""
    share = min(max(_share(x, y, path, k), 0.0), 1.0)
    dx = x - (path[k, 0] + share * (path[k + 1, 0] - path[k, 0]))
    dy = y - (path[k, 1] + share * (path[k + 1, 1] - path[k, 1]))
    return float(dx * dx + dy * dy)


@compiled(TABLE, TABLE, FLOATS, INTS, FLOATS)
def feet_on_path(
    points: FloatArray, path: FloatArray, gaps: FloatArray, nearest: NDArray[np.int64], shares: FloatArray
) -> None:
    """Project points [N, 2] onto a path [M, 2], M >= 2.

    Fills, for each point, `gaps` (the distance, m), `nearest` (the nearest segment) and `shares` (`share_of_segment`).
    """
    bounds = _bounds(path)
    segments = len(path) - 1
    best = 0
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        # The search begins with the nearest segment of the previous point, which is usually near the best one.
        least = _to_segment(x, y, path, best)
        for block in range(len(bounds)):
            if _to_bound(x, y, bounds[block]) > least + _CLEAR_M:
                continue
            for k in range(block * _BLOCK, min((block + 1) * _BLOCK, segments)):
                squared = _to_segment(x, y, path, k)
                if squared < least or (squared == least and k < best):
                    least, best = squared, k
        gaps[n] = math.sqrt(least)
        nearest[n] = best
        shares[n] = _share(x, y, path, best)
