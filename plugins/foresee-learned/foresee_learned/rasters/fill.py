"""Fills shapes: a pixel belongs to a shape if its middle does, so that neighbouring shapes never share a pixel.

Coordinates are in pixels, x to the right and y down; pixel (row, column) has its middle at (column + 0.5, row + 0.5).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import Window
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_learned.kernels import pictures
from foresee_learned.kernels.pictures import SNAP


def toggle_outlines(bits: NDArray[np.uint8], rings: Iterable[FloatArray], bit: int) -> None:
    """Toggle a bit where the outlines of a layer cross the rows' middles; `filled` turns toggles into areas.

    `bits`: [H, W] toggles, changed in place. `rings`: closed or open outlines, [N, 2] pixels; a hole is a ring too.
    """
    starts, ends = [], []
    for ring in rings:
        points = np.round(np.asarray(ring, dtype=np.float64) * SNAP) / SNAP
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
    column = np.maximum(np.ceil(np.round(x * SNAP) / SNAP - 0.5), 0).astype(np.int64)
    inside = column < width  # an edge that begins to the right of the picture toggles nothing in it
    np.bitwise_xor.at(bits.reshape(-1), row[inside] * width + column[inside], np.uint8(bit))


def filled(bits: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return areas from toggles: along each row a bit is set from one toggle to the next."""
    return np.bitwise_xor.accumulate(bits, axis=1, dtype=np.uint8)


def box_pixels(boxes: FloatArray, window: Window) -> tuple[IntArray, IntArray]:
    """Return the pixels of oriented boxes: [P] index of the box, ascending, and [P] flat index of the window's pixel.

    `boxes`: [K, 6] middle x, y; cosine and sine of the long side's direction; length, width; all in pixels of the whole
    picture. Outside of the window nothing is drawn.
    """
    box, pixel = pictures.box_pixels(boxes, window.top, window.left, window.rows, window.columns)
    return box, pixel


def _runs(first: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Return two arrays over all numbers of some runs, one run after the other: the index of the run, and the number.

    Each run has `count` numbers from `first` on.
    """
    index = np.repeat(np.arange(len(first)), count)
    number = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    return index, number
