"""Kernels over lines that are given as arrays of points (`compile.polyline.Polyline`); see `drivers.compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.compiling import FLOAT, FLOATS, compiled, inner

FloatArray = NDArray[np.float64]

AROUND_M = 12.0
"""So far around the last place a vehicle is looked for on its line; as `Polyline.project` does."""


@inner
def last_up_to(marks: FloatArray, first: int, end: int, s: float) -> int:
    """Return the last of first..end (exclusive) whose mark is not over `s`; first - 1 where there is none."""
    low, high = first, end
    while low < high:
        middle = (low + high) // 2
        if s < marks[middle]:
            high = middle
        else:
            low = middle + 1
    return low - 1


@inner
def _nearest(x: float, y: float, xs: FloatArray, ys: FloatArray, low: int, high: int) -> tuple[int, float]:
    """Return the segment of low..high (exclusive) nearest to a point, and the share of it where the foot is."""
    best, at, share = np.inf, low, 0.0
    for k in range(low, high):
        dx, dy = xs[k + 1] - xs[k], ys[k + 1] - ys[k]
        px, py = x - xs[k], y - ys[k]
        t = (px * dx + py * dy) / max(dx * dx + dy * dy, 1e-12)
        inside = min(max(t, 0.0), 1.0)
        px -= inside * dx
        py -= inside * dy
        away = px * px + py * py
        if away < best:
            best, at, share = away, k, t
    return at, share


@inner
def _foot(
    x: float, y: float, near_s: float, xs: FloatArray, ys: FloatArray, marks: FloatArray, first: int, end: int
) -> tuple[int, float]:
    """Return the segment nearest to a point, and the share of it where the foot is; see `along`."""
    last = end - 1
    k, t, found = first, 0.0, False
    if not np.isnan(near_s):
        low = min(max(last_up_to(marks, first, end, near_s - AROUND_M), first), last - 1)
        high = min(max(last_up_to(marks, first, end, near_s + AROUND_M) + 1, low + 1), last)
        k, t = _nearest(x, y, xs, ys, low, high)
        # At an end of the window, not of the line, something nearer may lie beyond.
        found = not (k == low and t < 0.0 and low > first) and not (k == high - 1 and t > 1.0 and high < last)
    if not found:
        k, t = _nearest(x, y, xs, ys, first, last)
    if k > first:
        t = max(t, 0.0)
    if k < last - 1:
        t = min(t, 1.0)
    return k, t


@inner
def along(
    x: float, y: float, near_s: float, xs: FloatArray, ys: FloatArray, marks: FloatArray, first: int, end: int
) -> float:
    """Return the length along a line nearest to a point, as `Polyline.project` does.

    Args:
        x, y: the point, m. near_s: where it is looked for first, NaN for everywhere.
        xs, ys, marks: points (m) of lines, and how far along its line each is. first, end: those of this one.
    """
    k, t = _foot(x, y, near_s, xs, ys, marks, first, end)
    length: float = marks[k] + t * np.hypot(xs[k + 1] - xs[k], ys[k + 1] - ys[k])
    return length


@inner
def heading_at(s: float, marks: FloatArray, angles: FloatArray, first: int, end: int) -> float:
    """Return the heading of a line at a length, rad."""
    k = min(max(last_up_to(marks, first, end, s), first), end - 2)
    inside = min(max((s - marks[k]) / (marks[k + 1] - marks[k]), 0.0), 1.0)
    angle: float = angles[k] + inside * (angles[k + 1] - angles[k])
    return angle


@inner
def place_at(
    s: float, xs: FloatArray, ys: FloatArray, marks: FloatArray, angles: FloatArray
) -> tuple[float, float, float]:
    """Return x, y and heading of a line at a length, as `Polyline.at` does: beyond the ends it goes on straight."""
    k = min(max(last_up_to(marks, 0, marks.size, s), 0), marks.size - 2)
    t = (s - marks[k]) / (marks[k + 1] - marks[k])
    inside = min(max(t, 0.0), 1.0)
    heading = angles[k] + inside * (angles[k + 1] - angles[k])
    return xs[k] + t * (xs[k + 1] - xs[k]), ys[k] + t * (ys[k + 1] - ys[k]), heading


@inner
def value_at(s: float, marks: FloatArray, values: FloatArray) -> float:
    """Return the value at a mark, between its neighbours; beyond the ends the first or last."""
    k = last_up_to(marks, 0, marks.size, s)
    if k < 0:
        return float(values[0])
    if k >= marks.size - 1:
        return float(values[-1])
    share = (s - marks[k]) / max(marks[k + 1] - marks[k], 1e-9)
    return float(values[k] + share * (values[k + 1] - values[k]))


@compiled(FLOAT, FLOAT, FLOAT, FLOATS, FLOATS, FLOATS)
def project(
    x: float, y: float, near_s: float, xs: FloatArray, ys: FloatArray, marks: FloatArray
) -> tuple[float, float]:
    """Return the length along a line nearest to a point, and how far to the left of it that is, m; see `along`."""
    k, t = _foot(x, y, near_s, xs, ys, marks, 0, marks.size)
    dx, dy = xs[k + 1] - xs[k], ys[k + 1] - ys[k]
    px, py = x - xs[k], y - ys[k]
    lateral = np.copysign(np.hypot(px - t * dx, py - t * dy), dx * py - dy * px)
    return marks[k] + t * np.hypot(dx, dy), lateral
