"""Finds the pixels of a picture that boxes cover; `rasters.fill` explains their coordinates."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.kernels.compiling import INT, TABLE, compiled, inner

SNAP = 1024
"""Edges are rounded to this fraction of a pixel before they are compared with middles of pixels. Ours: sines and
cosines differ in their last digit from machine to machine, and then still give the same pixels."""
PARALLEL = 1e-9
"""An edge whose direction has a smaller component across a row than this counts as parallel to it."""


@inner
def _snapped(value: float) -> float:
    return float(np.rint(value * SNAP) / SNAP)


@inner
def _clipped(value: float, least: int, most: int) -> int:
    if not value > least:  # written with `not` so that NaN gives `least` as well
        return least
    return int(min(value, most))


@inner
def _stretch(slope: float, slope_down: float, dy: float, half: float) -> tuple[float, float]:
    """Return the stretch along a row in which |slope * dx + slope_down * dy| <= half; an empty stretch if there is
    none.

    If the edge is parallel to the row, the middle of a pixel on its upper bound counts as inside, and the middle of a
    pixel on its lower bound does not, as on the left and the right.
    """
    half = _snapped(half)
    if abs(slope) < PARALLEL:
        down = _snapped(abs(slope_down) * dy)
        return (-np.inf, np.inf) if -half <= down < half else (np.inf, -np.inf)
    offset = slope_down * dy
    first, other = (-half - offset) / slope, (half - offset) / slope
    return min(first, other), max(first, other)


@compiled(TABLE, INT, INT, INT, INT)
def box_pixels(boxes: FloatArray, top: int, left: int, rows: int, columns: int) -> IntArray:
    """Return the pixels of oriented boxes in a window of a picture, [2, P]: the index of the box, ascending, and the
    flat index of the window's pixel.

    Args:
        boxes: [K, 6] middle x, y; cosine and sine of the long side's direction; length, width; in pixels of the whole
            picture.
        top, left, rows, columns: the window.
    """
    bottom, right = top + rows, left + columns
    first_row, end_row = np.empty(len(boxes), np.int64), np.empty(len(boxes), np.int64)
    lines = 0
    for k in range(len(boxes)):
        y, c, s = boxes[k, 1], boxes[k, 2], boxes[k, 3]
        reach = (abs(s) * boxes[k, 4] + abs(c) * boxes[k, 5]) / 2
        first_row[k] = _clipped(np.ceil(y - reach - 0.5) - 1, top, bottom)
        end_row[k] = max(_clipped(np.floor(y + reach - 0.5) + 2, top, bottom), first_row[k])
        lines += end_row[k] - first_row[k]
    spans, line, pixels = np.empty((lines, 2), np.int64), 0, 0
    for k in range(len(boxes)):
        x, y, c, s = boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3]
        for row in range(first_row[k], end_row[k]):
            dy = row + 0.5 - y
            # The middle of a pixel is inside if |c * dx + s * dy| is at most half the length, and the same holds across
            # with the width.
            low_a, high_a = _stretch(c, s, dy, boxes[k, 4] / 2)
            low_b, high_b = _stretch(-s, c, dy, boxes[k, 5] / 2)
            first = _clipped(np.ceil(_snapped(x + max(low_a, low_b)) - 0.5), left, right)
            end = max(_clipped(np.ceil(_snapped(x + min(high_a, high_b)) - 0.5), left, right), first)
            spans[line, 0], spans[line, 1] = first, end
            line += 1
            pixels += end - first
    pieces, line, pixel = np.empty((2, pixels), np.int64), 0, 0
    for k in range(len(boxes)):
        for row in range(first_row[k], end_row[k]):
            for column in range(spans[line, 0], spans[line, 1]):
                pieces[0, pixel], pieces[1, pixel] = k, (row - top) * columns + column - left
                pixel += 1
            line += 1
    return pieces
