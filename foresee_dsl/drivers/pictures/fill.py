"""Filling shapes: a pixel belongs to a shape when its middle does, so that neighbours never share one.

Coordinates are in pixels, x to the right and y down; pixel (row, column) has its middle at (column + 0.5, row + 0.5).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.pictures.layout import Window
from foresee_dsl.kernels.arrays import FloatArray, IntArray

_SNAP = 1024
"""Edges are rounded to this part of a pixel before they are compared with middles: sines and cosines that differ in
their last digit from machine to machine then give the same pixels (ours)."""
_PARALLEL = 1e-9
"""An edge whose direction has so small a part across a row is parallel to it."""


def toggle_outlines(bits: NDArray[np.uint8], rings: Iterable[FloatArray], bit: int) -> None:
    """Toggle a bit where the outlines of a layer cross the rows' middles; `filled` turns toggles into areas.

    `bits`: [H, W] toggles, changed in place. `rings`: closed or open outlines, [N, 2] pixels; a hole is a ring too.
    """
    starts, ends = [], []
    for ring in rings:
        points = np.round(np.asarray(ring, dtype=np.float64) * _SNAP) / _SNAP
        starts.append(points)
        ends.append(np.roll(points, -1, axis=0))
    if not starts:
        return
    (x0, y0), (x1, y1) = np.concatenate(starts).T, np.concatenate(ends).T
    down = y1 >= y0
    x0, y0, x1, y1 = np.where(down, (x0, y0, x1, y1), (x1, y1, x0, y0))
    height, width = bits.shape
    first = np.clip(np.ceil(y0 - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(y1 - 0.5), 0, height).astype(np.int64)
    edge, row = _runs(first, np.maximum(last - first, 0))
    slope = (x1 - x0)[edge] / (y1 - y0)[edge]
    x = x0[edge] + (row + 0.5 - y0[edge]) * slope
    column = np.maximum(np.ceil(np.round(x * _SNAP) / _SNAP - 0.5), 0).astype(np.int64)
    inside = column < width  # what begins to the right of the picture toggles nothing in it
    np.bitwise_xor.at(bits.reshape(-1), row[inside] * width + column[inside], np.uint8(bit))


def filled(bits: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return areas from toggles: along each row a bit is set from one toggle to the next."""
    return np.bitwise_xor.accumulate(bits, axis=1, dtype=np.uint8)


def box_pixels(boxes: FloatArray, window: Window) -> tuple[IntArray, IntArray]:
    """Return the pixels of oriented boxes: [P] index of the box, ascending, and [P] flat index of the window's pixel.

    `boxes`: [K, 6] middle x, y; cosine and sine of the long side's direction; length, width; all in pixels of the whole
    picture. Outside of the window nothing is drawn.
    """
    bottom, right = window.top + window.rows, window.left + window.columns
    x, y, c, s, length, width = (boxes[:, k, None] for k in range(6))
    reach_y = (np.abs(s) * length + np.abs(c) * width) / 2
    top = np.clip(np.ceil(y - reach_y - 0.5) - 1, window.top, bottom)[:, 0].astype(np.int64)
    below = np.clip(np.floor(y + reach_y - 0.5) + 2, window.top, bottom)[:, 0].astype(np.int64)
    box, row = _runs(top, np.maximum(below - top, 0))
    if not len(box):
        return box, row
    x, y, c, s, length, width = boxes[box].T
    dy = row + 0.5 - y
    # A pixel's middle is inside when |c * dx + s * dy| is up to half the length, and the same across: two stretches.
    low_a, high_a = _stretch(c, s, dy, length / 2)
    low_b, high_b = _stretch(-s, c, dy, width / 2)
    first = np.ceil(_snapped(x + np.maximum(low_a, low_b)) - 0.5)
    end = np.ceil(_snapped(x + np.minimum(high_a, high_b)) - 0.5)
    first = np.clip(first, window.left, right).astype(np.int64)
    end = np.clip(end, window.left, right).astype(np.int64)
    run, column = _runs(first, np.maximum(end - first, 0))
    return box[run], (row[run] - window.top) * window.columns + column - window.left


def _stretch(
    slope: FloatArray, slope_down: FloatArray, dy: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return from where to where along a row |slope * dx + slope_down * dy| <= half; an empty stretch for nowhere.

    Where the edge is parallel to the row, its upper bound counts and its lower one does not, as left and right do.
    """
    parallel = np.abs(slope) < _PARALLEL
    half = _snapped(half)
    safe = np.where(parallel, 1.0, slope)
    offset = slope_down * dy
    one, other = (-half - offset) / safe, (half - offset) / safe
    down = _snapped(np.abs(slope_down) * dy)
    whole = (down >= -half) & (down < half)
    low = np.where(parallel, np.where(whole, -np.inf, np.inf), np.minimum(one, other))
    high = np.where(parallel, np.where(whole, np.inf, -np.inf), np.maximum(one, other))
    return low, high


def _snapped(values: FloatArray) -> FloatArray:
    return np.round(values * _SNAP) / _SNAP


def _runs(first: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Return for runs of `count` numbers from `first` on: the run's index and the number, of all, one after the
    other."""
    index = np.repeat(np.arange(len(first)), count)
    number = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    return index, number
