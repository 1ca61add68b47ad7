"""A map in characters: the ground in braille dots, the ego in blocks. It can be read without colours.

A character has two by four dots and is about twice as high as wide, so the dots are square.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter

import numpy as np
import shapely
from numpy.typing import NDArray
from rich.text import Text

from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.drawing.shapes import Shape
from foresee_dsl.report.drawing.sheet import DrawnPart

_BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the dots of a braille character, by row and column (Unicode 2800 and following)."""
_QUADRANTS = " ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█"
"""Block characters by the sum of their filled quarters: upper left 1, upper right 2, lower left 4, lower right 8."""
_NOSES = {"ego": "▶◥▲◤◀◣▼◢", "opponent": "→↗↑↖←↙↓↘"}
"""Signs for the direction of a vehicle, by eighths of a turn, counter-clockwise from the right."""
_NOSE_DOTS = 4.0
"""A vehicle shorter than this on the screen has no sign for its direction, dots."""
_POINT_DOTS = 3.0
"""An actor shorter than this on the screen is drawn as a single sign, dots."""
POINTS = {"ego": "◆", "opponent": "●", "other": "o", "parked": "·", "ghost": "○"}
"""Signs of small bodies, by the kind of their part."""
_TEXTURES = {
    "road": "lines",
    "marking": "lines",
    "stop_line": "lines",
    "crossing": "dots",
    "slippery": "dots",
    "building": "shades",
}
"""How the ground is drawn, by paint. A paint that is not listed is left out, because dots cannot show it."""
_DASHES = 12
"""Number of dashes and gaps across a window. Ours: with it a dash is several dots long in windows of all sizes."""


class Screen:
    """A screen of dots, and of signs that replace the dots of a character.

    What is drawn later covers what was drawn earlier.
    """

    def __init__(self, side_m: float, columns: int, rows: int) -> None:
        self._columns, self._rows = columns, rows
        self._per_m = 2 * columns / side_m
        self._left_m, self._top_m = side_m / 2, 2 * rows / self._per_m
        self._bits = np.zeros((rows, columns), np.int64)
        self._styles = np.full((rows, columns), "", dtype=object)
        self._signs = np.full((rows, columns), "", dtype=object)
        y, x = np.mgrid[0 : 4 * rows, 0 : 2 * columns]
        self._x_m = (x + 0.5) / self._per_m - self._left_m
        self._y_m = self._top_m - (y + 0.5) / self._per_m

    def draw(self, parts: Sequence[DrawnPart]) -> None:
        """Draw the parts of a map: the ground, and then the bodies on it."""
        bodies = []
        for part in parts:
            if part.kind in POINTS:
                bodies.append(part)
            else:
                for shape in part.shapes:
                    self._ground(shape)
        # Small actors are drawn last, because at a contact the ego would cover a pedestrian.
        for part in sorted(bodies, key=self._is_point):
            self._body(part)

    def _ground(self, shape: Shape) -> None:
        style = PAINTS[shape.paint].terminal
        match _TEXTURES.get(shape.paint, ""):
            case "lines":
                self._draw(self._lines(shape), style)
            case "dots":
                rows, columns = np.indices(self._x_m.shape)
                self._draw(self._inside(shape) & ((rows + columns) % 2 == 0), style)
            case "shades":  # the characters of which at least half the dots are inside
                full = self._inside(shape).reshape(self._rows, 4, self._columns, 2).sum(axis=(1, 3)) >= 4
                self._signs[full], self._styles[full] = "░", style

    def _lines(self, shape: Shape) -> BoolArray:
        """Return the dots on the lines of a shape, but not those along the edges of the window."""
        dots = np.zeros(self._x_m.shape, np.bool_)
        dash_m = 2 * self._left_m / _DASHES if shape.dash else 0.0
        edge = self._left_m - 0.02
        for ring in shape.rings:
            marks = self._along(np.vstack([ring, ring[:1]]) if shape.closed else ring)
            if dash_m:
                marks = marks[(marks[:, 2] // dash_m) % 2 == 0]
            inside = (np.abs(marks[:, 0]) < edge) & (np.abs(marks[:, 1]) < edge)
            self._put(dots, marks[inside])
        return dots

    def _is_point(self, part: DrawnPart) -> bool:
        """Return whether a body is drawn as a single sign."""
        return self._length(part.shapes[0].rings[0]) < _POINT_DOTS

    def _length(self, outline: FloatArray) -> float:
        """Return the length of a body, dots."""
        opposite = outline[0] - outline[len(outline) // 2 - 1]
        return float(np.hypot(*opposite)) * self._per_m

    def _body(self, part: DrawnPart) -> None:
        """Draw a body: the ego in blocks, the opponent filled, all others as outlines."""
        style, shape = PAINTS[part.kind].terminal, part.shapes[0]
        (outline,) = shape.rings
        if self._is_point(part):
            self._sign(outline.mean(axis=0), POINTS[part.kind], style)
            return
        edge = np.zeros(self._x_m.shape, np.bool_)
        self._put(edge, self._along(np.vstack([outline, outline[:1]])))
        inside = self._inside(shape)
        if part.kind == "ego":
            self._blocks(inside if inside.any() else edge, style)
        elif part.kind == "opponent":
            self._draw(inside | edge, style, over=True)
        else:
            self._draw(edge, style, over=True)
        length = self._length(outline)
        if length >= _NOSE_DOTS and len(part.shapes) > 1 and part.kind in _NOSES:
            front = (outline[0] + outline[3]) / 2
            back = outline.mean(axis=0) - front
            heading_rad = math.atan2(-back[1], -back[0])
            self._sign(
                front + back * min(2.0 / length, 1.0), _NOSES[part.kind][round(heading_rad / (math.pi / 4)) % 8], style
            )

    def text(self) -> list[Text]:
        """Return the rows of the screen."""
        rows = []
        for row in range(self._rows):
            signs = (sign or (chr(0x2800 + bits) if bits else " ")
                     for sign, bits in zip(self._signs[row], self._bits[row].tolist(), strict=True))  # fmt: skip
            line = Text()
            for style, part in groupby(zip(self._styles[row], signs, strict=True), key=itemgetter(0)):
                line.append("".join(sign for _, sign in part), style=style or None)
            rows.append(line)
        return rows

    def _along(self, points: FloatArray) -> FloatArray:
        """Return points along a line that are less than a dot apart: [N, 3], x, y and distance along the line, m."""
        steps = np.hypot(*np.diff(points, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        marks = np.linspace(0.0, along[-1], max(math.ceil(along[-1] * self._per_m * 2), 2))
        return np.column_stack([np.interp(marks, along, points[:, 0]), np.interp(marks, along, points[:, 1]), marks])

    def _put(self, dots: BoolArray, marks: FloatArray) -> None:
        column = np.floor((marks[:, 0] + self._left_m) * self._per_m).astype(int)
        row = np.floor((self._top_m - marks[:, 1]) * self._per_m).astype(int)
        within = (column >= 0) & (column < dots.shape[1]) & (row >= 0) & (row < dots.shape[0])
        dots[row[within], column[within]] = True

    def _inside(self, shape: Shape) -> BoolArray:
        inside = np.zeros(self._x_m.shape, np.bool_)
        for ring in shape.rings:
            inside ^= shapely.contains_xy(shapely.Polygon(ring), self._x_m, self._y_m)
        return inside

    def _cells(self, dots: BoolArray) -> NDArray[np.int64]:
        """Return the braille bits of the dots, one number for each character."""
        parts = dots.reshape(self._rows, 4, self._columns, 2)
        bits: NDArray[np.int64] = np.einsum("ricj,ij->rc", parts.astype(np.int64), np.array(_BRAILLE))
        return bits

    def _draw(self, dots: BoolArray, style: str, *, over: bool = False) -> None:
        """Add dots to the characters; with `over`, they replace what these characters showed before."""
        bits = self._cells(dots)
        touched = bits > 0
        if over:
            self._bits[touched] = 0
            self._signs[touched] = ""
        self._bits |= bits
        self._styles[touched] = style

    def _blocks(self, dots: BoolArray, style: str) -> None:
        # The axes are rows, upper or lower half, columns, left or right half.
        halves = dots.reshape(self._rows, 2, 2, self._columns, 2).any(axis=2).astype(np.int64)
        number = np.asarray(np.einsum("ricj,ij->rc", halves, np.array(((1, 2), (4, 8)))), np.int64)
        filled = number > 0
        self._signs[filled] = np.array(list(_QUADRANTS), dtype=object)[number][filled]
        self._styles[filled] = style

    def _sign(self, at: FloatArray, sign: str, style: str) -> None:
        column = math.floor((float(at[0]) + self._left_m) * self._per_m / 2)
        row = math.floor((self._top_m - float(at[1])) * self._per_m / 4)
        if 0 <= row < self._rows and 0 <= column < self._columns:
            self._signs[row, column], self._styles[row, column] = sign, style
