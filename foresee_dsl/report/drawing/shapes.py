"""The shapes of a scene in metres, which all back ends draw: the ground of its roads and the bodies of its actors.

As JSON they are for the canvas of a page, which draws them at any scale (`templates/report/scene.js`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.report.drawing.ground import LINES, Ground, Layer, lines_of, rings_of, zebra

LINE_M, STOP_LINE_M = 0.15, 0.3
"""Width of lines on the ground, and of stop lines, m. Ours: German ones are 0.12 m and 0.5 m wide (guideline RMS); a
thicker stop line would hide the signal's colour on it."""
DASH_M = 1.5
"""Length of a dash of a marking, and of the gap after it, m. Ours: in German towns both are 3 m long, which a small
picture would show as a single dash."""
THINNEST_PX, THICKEST_PX = 0.5, 1.6
"""Smallest and largest width of a line on the ground, px; the limits of wider lines are larger in proportion. Ours: not
too thin to see, and not thicker than a pencil line."""
LEAST_DASH_PX = 2.5
"""Smallest length of a dash, px (ours)."""
_SMALLEST_PX = 15.0
"""A body shorter than this gets a disc behind it, px. Ours: the size that an eye notices and a fingertip hits."""
DISC_PX = 10.0
"""Radius of the disc behind a small body, px."""
_LEAST_BODY_PX, _LEAST_PERSON_PX, _LEAST_BACKGROUND_PX = 5.0, 3.5, 2.0
"""Smallest length of a body, smallest radius of a person, and smallest radius of a person in the background traffic,
px. Ours."""
_LEAST_FRONT_PX = 6.0
"""A vehicle shorter than this does not show which end is the front, px. Ours."""
SCREEN_SHARE = 0.22
"""Distance of the windscreen from the front, as a share of the vehicle's length; the windscreen shows which end is the
front. Ours."""
_BACKGROUND = ("traffic", "parked")
"""Paints of bodies that get no disc behind them, even if they are small."""


@dataclass(frozen=True)
class Shape:
    """Outlines (filled by the even-odd rule) or lines in one paint.

    Their coordinates are those of a map (m, y upwards) or of the sheet around the maps (px, y downwards).

    Attributes:
        paint: name of a paint. rings: [N, 2] points of each outline or line. closed: whether the rings are outlines.
            width: width of the line, px. width_m: width of a line on the ground, m, which replaces `width` if it is
            set.
        dash: lengths of the dashes and gaps, px; m if `width_m` is set.
    """

    paint: str
    rings: tuple[FloatArray, ...]
    closed: bool = True
    width: float = 1.0
    width_m: float = 0.0
    dash: tuple[float, ...] = ()

    def line_px(self, px_per_m: float) -> tuple[float, tuple[float, ...]]:
        """Return the width of the line and the lengths of its dashes in a map of this scale, px."""
        if not self.width_m:
            return self.width, self.dash
        share = self.width_m / LINE_M
        width = share * min(max(LINE_M * px_per_m, THINNEST_PX), THICKEST_PX)
        return width, tuple(max(length * px_per_m, LEAST_DASH_PX) for length in self.dash)


def ground_shapes(ground: Ground, *, bars: bool = True, tolerance_m: float = 0.0) -> Iterator[Shape]:
    """Yield the shapes of a ground from back to front.

    Args:
        ground: the layers. bars: whether crossings are drawn as bars; otherwise as areas, for a picture that is too
            coarse for bars.
        tolerance_m: error by which lines may be simplified, m.
    """
    for layer in Layer:
        if (shape := ground.get(layer)) is None:
            continue
        if layer is Layer.CROSSING and bars:
            shape = zebra(shape)
        elif layer is not Layer.STOP_LINE and tolerance_m:
            shape = shape.simplify(tolerance_m)
        lined = layer in LINES
        if rings := tuple(lines_of(shape) if lined else rings_of(shape)):
            width_m = STOP_LINE_M if layer is Layer.STOP_LINE else LINE_M
            dash = (DASH_M, DASH_M) if layer is Layer.MARKING else ()
            yield Shape(layer.value, rings, not lined, width_m=width_m, dash=dash)


def body_shapes(corners: FloatArray, kind: str, paint: str, px_per_m: float = math.inf) -> tuple[Shape, ...]:
    """Return the shapes of a body from back to front: a disc behind a small body, the outline, the windscreen of a
    vehicle.

    Args:
        corners: [4, 2] m: front left, rear left, rear right, front right. kind: the model's class.
        paint: name of its paint. px_per_m: the map's scale, at which a small body is drawn larger; inf: true to scale.
    """
    middle = corners.mean(axis=0)
    length_m = float(np.hypot(*(corners[0] - corners[1])))
    length_px = length_m * px_per_m if length_m else 0.0
    shapes = []
    if length_px < _SMALLEST_PX and paint not in _BACKGROUND:
        shapes.append(Shape(f"{paint}-halo", (disc(middle, DISC_PX / px_per_m),), width=0.0))
    if kind == "pedestrian":
        least_px = _LEAST_BACKGROUND_PX if paint == "traffic" else _LEAST_PERSON_PX
        shapes.append(Shape(paint, (disc(middle, max(length_m / 2, least_px / px_per_m)),)))
    else:
        outline = corners
        if length_px < _LEAST_BODY_PX:
            outline = (corners - middle) * (_LEAST_BODY_PX / max(length_px, 0.1)) + middle
        shapes.append(Shape(paint, (outline,), width=0.8))
        if kind != "obstacle" and length_px > _LEAST_FRONT_PX:
            front_left, rear_left, rear_right, front_right = outline
            back = rear_left - front_left
            nose = (front_left + front_right) / 2 + 0.02 * back
            left, right = front_left + SCREEN_SHARE * back, front_right + SCREEN_SHARE * (rear_right - front_right)
            shapes.append(Shape("plate", (np.array([left, nose, right]),), width=0.0))
    return tuple(shapes)


def ghost_shape(corners: FloatArray) -> Shape:
    """Return the outline of a body at its place in another run, or before a change."""
    return Shape("ghost", (corners,), width=1.3, dash=(3.0, 3.0))


def disc(middle: FloatArray, radius: float) -> FloatArray:
    """Return the outline of a disc."""
    turns = np.linspace(0, 2 * math.pi, 24, endpoint=False)
    return np.column_stack((middle[0] + radius * np.cos(turns), middle[1] + radius * np.sin(turns)))


def arrow(line: FloatArray, size: float) -> FloatArray:
    """Return an arrowhead of a size at a line's end."""
    end = line[-1]
    back = next((p for p in line[::-1] if np.hypot(*(end - p)) > size / 2), line[0])
    way = end - back
    ahead = way / max(float(np.hypot(*way)), 1e-6)
    aside = np.array((-ahead[1], ahead[0]))
    return np.array([end, end - size * ahead + size * 0.42 * aside, end - size * ahead - size * 0.42 * aside])


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
