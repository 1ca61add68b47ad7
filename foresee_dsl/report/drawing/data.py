"""Shapes as JSON for the canvas of a page, which draws them at any scale (`templates/report/scene.js`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from foresee_dsl.report.drawing.shapes import LEAST_DASH_PX, LINE_M, THICKEST_PX, THINNEST_PX, Shape

CM = 100.0
"""Centimetres per metre: positions and distances are rounded to 1 cm."""
LIMITS = {"line_m": LINE_M, "thinnest_px": THINNEST_PX, "thickest_px": THICKEST_PX, "least_dash_px": LEAST_DASH_PX}
"""The limits of the lines on the ground (see `Shape.line_px`), which a page applies at its scale."""


def as_data(shapes: Iterable[Shape]) -> list[dict[str, Any]]:
    """Return shapes as plain data, with coordinates in cm as `line` returns them and widths as in `Shape`."""
    return [
        {
            "paint": shape.paint,
            "closed": shape.closed,
            "width": shape.width,
            "width_m": shape.width_m,
            "dash": list(shape.dash),
            "rings": [line(ring.tolist()) for ring in shape.rings],
        }
        for shape in shapes
    ]


def line(points: Iterable[Sequence[float]]) -> list[int]:
    """Return a line as its first point and the differences after it: `[x, y, dx, dy, dx, dy, ...]`, cm."""
    array = np.array([tuple(point)[:2] for point in points], dtype=np.float64).reshape(-1, 2)
    whole = np.rint(array * CM).astype(np.int64)
    return [int(v) for v in np.diff(whole, axis=0, prepend=np.zeros((1, 2), dtype=np.int64)).ravel()]
