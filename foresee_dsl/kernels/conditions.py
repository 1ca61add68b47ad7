"""The measures of scenario conditions: between two actors, and between an actor and the area of a junction.

Actors are rows of the state table.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import Box, Mover, apart, posed
from foresee_dsl.kernels.compiling import ANY_TABLE, FLOAT, FLOATS, INT, TABLE, compiled, inner
from foresee_dsl.kernels.lines import nearest_on_segment

STILL_MPS = 1e-9
"""A closing speed below this is a rounding error, m/s: with it, two actors come 3 m nearer to each other in a
century."""
SURE_M = 1e-6
"""Distance to the border of an area below which `beside_area` returns `UNSURE`, m. Ours: a thousand times the rounding
error of a point at 10 km."""
INSIDE, UNSURE, OUTSIDE = -1, 0, 1


@inner
def _gap(a: Box, b: Box) -> float:
    if np.isnan(a.x + a.y + a.heading + b.x + b.y + b.heading + a.length + a.width + b.length + b.width):
        return np.nan
    return apart(a, b)


@compiled(TABLE, ANY_TABLE, INT, INT)
def gap(states: FloatArray, sizes: FloatArray, actor: int, other: int) -> float:
    """Return the distance of two actors' footprints, m: 0 if they overlap, NaN if a value is NaN.

    `states`: [A, >=3] x, y, heading. `sizes`: [A, 2] length, width.
    """
    return _gap(posed(states[actor], sizes[actor]), posed(states[other], sizes[other]))


@compiled(TABLE, ANY_TABLE, INT, INT, FLOAT)
def gap_within(states: FloatArray, sizes: FloatArray, actor: int, other: int, within: float) -> float:
    """Return `gap`, or infinity if the circles around the footprints show that it exceeds `within`, m."""
    a, b = posed(states[actor], sizes[actor]), posed(states[other], sizes[other])
    dx, dy = b.x - a.x, b.y - a.y
    most = within + SURE_M + (np.hypot(a.length, a.width) + np.hypot(b.length, b.width)) / 2
    if dx * dx + dy * dy > most * most and most > 0.0:
        return np.inf
    return _gap(a, b)


@inner
def _mover(states: FloatArray, sizes: FloatArray, k: int) -> Mover:
    return Mover(states[k, 0], states[k, 1], states[k, 2], states[k, 3], sizes[k, 0], sizes[k, 1])


@compiled(TABLE, ANY_TABLE, INT, INT)
def time_to_touch(states: FloatArray, sizes: FloatArray, actor: int, other: int) -> float:
    """Return the time until two actors' footprints touch if both keep heading and speed, s (TTC).

    It is 0 if they overlap now, infinite if they never will, and NaN if a value is NaN. Exact: each of the four
    directions at right angles to the sides separates the footprints outside one interval of time; they overlap where
    all four intervals do. The definition is that of Westhofen et al., "Criticality Metrics for Automated Driving"
    (Archives of Computational Methods in Engineering, 2023).

    `states`: [A, >=4] x, y, heading, speed. `sizes`: [A, 2] length, width.
    """
    a, b = _mover(states, sizes, actor), _mover(states, sizes, other)
    ca, sa, cb, sb = cos(a.heading), sin(a.heading), cos(b.heading), sin(b.heading)
    dx, dy = b.x - a.x, b.y - a.y
    vx, vy = b.speed * cb - a.speed * ca, b.speed * sb - a.speed * sa
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    begin, end = 0.0, np.inf
    for k in range(4):
        if k == 0:
            nx, ny, reach = ca, sa, a.length + c * b.length + s * b.width
        elif k == 1:
            nx, ny, reach = -sa, ca, a.width + s * b.length + c * b.width
        elif k == 2:
            nx, ny, reach = cb, sb, b.length + c * a.length + s * a.width
        else:
            nx, ny, reach = -sb, cb, b.width + s * a.length + c * a.width
        apart, speed = dx * nx + dy * ny, vx * nx + vy * ny
        if np.isnan(apart) or np.isnan(speed):
            return np.nan
        if abs(speed) < STILL_MPS:
            if abs(apart) > reach / 2:
                return np.inf
            continue
        first, last = (-reach / 2 - apart) / speed, (reach / 2 - apart) / speed
        if last < first:
            first, last = last, first
        begin = first if first > begin else begin
        end = last if last < end else end
    return float(begin) if begin <= end else np.inf


@inner
def _turned_left(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@inner
def _cut(a: FloatArray, b: FloatArray, border: FloatArray) -> bool:
    """Return whether the side from `a` to `b` crosses a border, [4] its two end points."""
    x0, y0, x1, y1 = border[0], border[1], border[2], border[3]
    return bool(
        (_turned_left(a[0], a[1], b[0], b[1], x0, y0) > 0) != (_turned_left(a[0], a[1], b[0], b[1], x1, y1) > 0)
        and (_turned_left(x0, y0, x1, y1, a[0], a[1]) > 0) != (_turned_left(x0, y0, x1, y1, b[0], b[1]) > 0)
    )


@inner
def _depth(x: float, y: float, borders: FloatArray) -> float:
    """Return the distance of a point from the nearest border of an area, m: positive inside, negative outside."""
    nearest, inside = np.inf, False
    for k in range(len(borders)):
        x0, y0, x1, y1 = borders[k, 0], borders[k, 1], borders[k, 2], borders[k, 3]
        nearest = min(nearest, nearest_on_segment(x - x0, y - y0, x1 - x0, y1 - y0)[1])
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
    return float(np.sqrt(nearest)) if inside else -float(np.sqrt(nearest))


@inner
def _corners(box: Box) -> FloatArray:
    c, s = cos(box.heading), sin(box.heading)
    corners = np.empty((4, 2))
    for k in range(4):
        along = box.length / 2 if k in (0, 3) else -box.length / 2
        left = box.width / 2 if k < 2 else -box.width / 2
        corners[k, 0], corners[k, 1] = box.x + c * along - s * left, box.y + s * along + c * left
    return corners


@inner
def _by_corners(corners: FloatArray, borders: FloatArray) -> int:
    """Return `INSIDE` if a corner of a footprint is in an area, `OUTSIDE` if no corner is, or `UNSURE`."""
    for k in range(4):
        depth = _depth(corners[k, 0], corners[k, 1], borders)
        if depth > SURE_M:
            return INSIDE
        if not depth < -SURE_M:
            return UNSURE
    return OUTSIDE


@inner
def _touched(box: Box, corners: FloatArray, borders: FloatArray) -> bool:
    """Return whether a border crosses a footprint or ends near it."""
    c, s = cos(box.heading), sin(box.heading)
    for m in range(len(borders)):
        x, y = borders[m, 0] - box.x, borders[m, 1] - box.y
        if max(abs(x * c + y * s) - box.length / 2, abs(y * c - x * s) - box.width / 2) <= SURE_M:
            return True
        for k in range(4):
            if _cut(corners[k], corners[(k + 1) % 4], borders[m]):
                return True
    return False


@compiled(TABLE, ANY_TABLE, INT, TABLE, FLOATS)
def beside_area(states: FloatArray, sizes: FloatArray, actor: int, borders: FloatArray, bounds: FloatArray) -> int:
    """Return whether a part of an actor's footprint is in an area: `INSIDE`, `OUTSIDE`, or `UNSURE` near its border.

    `states`, `sizes`: as for `gap`. `borders`: [M, 4] the end points of all sides of the area, also of its holes; empty
    if they are unknown. `bounds`: [4] west, south, east, north of it.
    """
    box = posed(states[actor], sizes[actor])
    if len(borders) == 0 or np.isnan(box.x + box.y + box.heading):
        return UNSURE
    reach = np.hypot(box.length, box.width) / 2 + SURE_M
    if not (bounds[0] - reach <= box.x <= bounds[2] + reach and bounds[1] - reach <= box.y <= bounds[3] + reach):
        return OUTSIDE
    corners = _corners(box)
    side = _by_corners(corners, borders)
    return UNSURE if side == OUTSIDE and _touched(box, corners, borders) else side
