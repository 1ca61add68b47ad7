"""A panel in characters: the map in braille dots, the ego in blocks; it is readable without colours.

A character has two by four dots and is about twice as high as wide, so the dots are square.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from rich.text import Text

from foresee_dsl.report.ground import FloatArray, Layer, lines_of
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.panels import Footprint, Panel, Role, Strip
from foresee_dsl.report.strip import caption_of, legend_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

BoolArray = NDArray[np.bool_]

WIDEST, NARROWEST = 40, 26
"""Largest and smallest width of a panel with its frame, columns. Ours: in a window of 24 m a road of two lanes is at
least six dots wide."""
PAIR_WIDEST = 32
"""Largest width of a panel beside the parent's, columns. Ours: with wider panels two moments do not fit on a screen."""
_GAP = 1
"""Columns between two panels."""
_BRAILLE = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the dots of a braille character, by row and column (Unicode 2800 and following)."""
_QUADRANTS = " ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█"
"""Block characters by the sum of upper left 1, upper right 2, lower left 4 and lower right 8."""
_EGO_NOSES, _OTHER_NOSES = "▶◥▲◤◀◣▼◢", "→↗↑↖←↙↓↘"
"""Signs for the direction of a vehicle, by eighths of a turn, counter-clockwise from the right."""
_NOSE_DOTS = 4.0
"""A vehicle shorter than this on the screen gets no direction sign, dots."""
_POINT_DOTS = 3.0
"""An actor shorter than this on the screen is drawn as a single sign, dots."""
_POINTS = {Role.EGO: "◆", Role.OPPONENT: "●", Role.OTHER: "o", Role.PARKED: "·", Role.GHOST: "○"}
STYLES: dict[Layer | Role, str] = {
    Layer.ROAD: "dim",
    Layer.MARKING: "dim",
    Layer.STOP_LINE: "dim",
    Layer.CROSSING: "",
    Layer.SLIPPERY: "cyan",
    Layer.BUILDING: "yellow dim",
    Role.PARKED: "",
    Role.OTHER: "yellow",
    Role.GHOST: "magenta",
    Role.OPPONENT: "bold red",
    Role.EGO: "bold blue",
}


def strip_lines(strip: Strip, width: int) -> Iterator[Text]:
    """Yield the lines of a strip for a screen `width` columns wide."""
    if not strip.panels:
        return
    per_row, wide = layout(len(strip.panels), width)
    for start in range(0, len(strip.panels), per_row):
        yield from _row(strip.panels[start : start + per_row], wide)


def pair_lines(parent: Strip, child: Strip, width: int) -> Iterator[Text]:
    """Yield two strips of the same moments side by side: at each moment the parent's panel, then the child's."""
    pairs = [(was, now) for now in child.panels for was in parent.panels if was.snapshot.letter == now.snapshot.letter]
    if not pairs:
        return
    per_row = max(1, min((width + _GAP) // (2 * (NARROWEST + _GAP)), len(pairs)))
    wide = min((width + _GAP) // (2 * per_row) - _GAP, PAIR_WIDEST)
    titles = [f"{shortened(title, wide):<{wide}}" for title in (parent.title, child.title)]
    for start in range(0, len(pairs), per_row):
        row = pairs[start : start + per_row]
        yield Text((" " * _GAP).join(titles * len(row)).rstrip(), style="bold")
        yield from _row([panel for pair in row for panel in pair], wide)


def _row(panels: Sequence[Panel], wide: int) -> Iterator[Text]:
    for parts in zip(*(panel_lines(panel, wide) for panel in panels), strict=True):
        yield Text(" " * _GAP).join(parts)


def layout(count: int, width: int) -> tuple[int, int]:
    """Return the number of panels per row, and the columns of each, for a number of panels and a screen's width."""
    fit = max(1, min((width + _GAP) // (NARROWEST + _GAP), count))
    rows = math.ceil(count / fit)
    per_row = math.ceil(count / rows)
    return per_row, max(min((width + _GAP) // per_row - _GAP, WIDEST), min(width, NARROWEST))


def panel_lines(panel: Panel, width: int) -> list[Text]:
    """Return a panel with its frame: the moment above, the ego's speed, the gap and the window's side below."""
    columns = max(width - 2, 4)
    caption, figures = caption_of(panel)
    letter, side = panel.snapshot.letter, f" ↔{panel.side_m:g} m"
    caption = shortened(caption, columns - 4)
    figures = shortened(figures, columns - len(side))
    top = Text.assemble("┌", (letter, "bold"), " ", caption, " ", "─" * (columns - len(letter) - 2 - len(caption)), "┐")
    rest = columns - len(figures) - len(side)
    bottom = Text.assemble("└", figures, " " if rest else "", "─" * (rest - 1), side, "┘")
    rows = [Text.assemble("│", row, "│") for row in canvas(panel, columns, columns // 2)]
    return [top, *rows, bottom]


def canvas(panel: Panel, columns: int, rows: int) -> list[Text]:
    """Return the rows of characters inside a panel's frame."""
    screen = _Screen(panel.side_m, columns, rows)
    screen.lines(Layer.ROAD, panel.ground.get(Layer.ROAD))
    screen.lines(Layer.MARKING, panel.ground.get(Layer.MARKING), dashes_m=panel.side_m / 12)
    screen.lines(Layer.STOP_LINE, panel.ground.get(Layer.STOP_LINE))
    screen.checked(Layer.CROSSING, panel.ground.get(Layer.CROSSING))
    screen.checked(Layer.SLIPPERY, panel.ground.get(Layer.SLIPPERY))
    screen.shaded(Layer.BUILDING, panel.ground.get(Layer.BUILDING))
    # Small actors are drawn last, because at a contact the ego would cover a pedestrian.
    for footprint in sorted(panel.footprints, key=screen.is_point):
        screen.footprint(footprint)
    return screen.text()


class _Screen:
    """A screen of dots, and of signs that replace the dots of a character; later ones cover earlier ones."""

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

    def lines(self, name: Layer, shape: BaseGeometry | None, dashes_m: float = 0.0) -> None:
        """Draw the lines of a shape (the outlines of its polygons), except along the edges of the window."""
        if shape is None:
            return
        dots = np.zeros(self._x_m.shape, np.bool_)
        for points in lines_of(shape):
            marks = self._along(points)
            if dashes_m:
                marks = marks[(marks[:, 2] // dashes_m) % 2 == 0]
            edge = self._left_m - 0.02
            inside = (np.abs(marks[:, 0]) < edge) & (np.abs(marks[:, 1]) < edge)
            self._put(dots, marks[inside])
        self._draw(dots, STYLES[name])

    def checked(self, name: Layer, shape: BaseGeometry | None) -> None:
        """Fill a shape with every second dot."""
        if shape is not None:
            rows, columns = np.indices(self._x_m.shape)
            self._draw(self._inside(shape) & ((rows + columns) % 2 == 0), STYLES[name])

    def shaded(self, name: Layer, shape: BaseGeometry | None) -> None:
        """Fill a shape with shading: each character of which at least half the dots are inside."""
        if shape is not None:
            full = self._inside(shape).reshape(self._rows, 4, self._columns, 2).sum(axis=(1, 3)) >= 4
            self._signs[full], self._styles[full] = "░", STYLES[name]

    def is_point(self, footprint: Footprint) -> bool:
        """Return whether an actor is drawn as a single sign."""
        return float(np.hypot(*(footprint.corners[0] - footprint.corners[1]))) * self._per_m < _POINT_DOTS

    def footprint(self, body: Footprint) -> None:
        """Draw an actor: the ego in blocks, the opponent filled, all others as outlines."""
        style = STYLES[body.role]
        length = float(np.hypot(*(body.corners[0] - body.corners[1]))) * self._per_m
        if self.is_point(body):
            self._sign(body.middle, _POINTS[body.role], style)
            return
        outline = np.vstack([body.corners, body.corners[:1]])
        edge = np.zeros(self._x_m.shape, np.bool_)
        self._put(edge, self._along(outline))
        inside = self._inside(shapely.Polygon(body.corners))
        if body.role is Role.EGO:
            dots = inside if inside.any() else edge
            self._blocks(dots, style)
        elif body.role is Role.OPPONENT:
            self._draw(inside | edge, style, over=True)
        else:
            self._draw(edge, style, over=True)
        if (
            length >= _NOSE_DOTS
            and body.kind not in ("obstacle", "pedestrian")
            and body.role in (Role.EGO, Role.OPPONENT)
        ):
            noses = _EGO_NOSES if body.role is Role.EGO else _OTHER_NOSES
            front = (body.corners[0] + body.corners[3]) / 2
            nose = front + (body.middle - front) * min(2.0 / length, 1.0)
            self._sign(nose, noses[round(body.heading_rad / (math.pi / 4)) % 8], style)

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
        """Return points on a line less than a dot apart: [N, 3], x, y and distance along the line, m."""
        steps = np.hypot(*np.diff(points, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        marks = np.linspace(0.0, along[-1], max(math.ceil(along[-1] * self._per_m * 2), 2))
        return np.column_stack([np.interp(marks, along, points[:, 0]), np.interp(marks, along, points[:, 1]), marks])

    def _put(self, dots: BoolArray, marks: FloatArray) -> None:
        column = np.floor((marks[:, 0] + self._left_m) * self._per_m).astype(int)
        row = np.floor((self._top_m - marks[:, 1]) * self._per_m).astype(int)
        within = (column >= 0) & (column < dots.shape[1]) & (row >= 0) & (row < dots.shape[0])
        dots[row[within], column[within]] = True

    def _inside(self, shape: BaseGeometry) -> BoolArray:
        inside: BoolArray = shapely.contains_xy(shape, self._x_m, self._y_m)
        return inside

    def _cells(self, dots: BoolArray) -> NDArray[np.int64]:
        """Return the braille bits of the dots, one number for each character."""
        parts = dots.reshape(self._rows, 4, self._columns, 2)
        bits: NDArray[np.int64] = np.einsum("ricj,ij->rc", parts.astype(np.int64), np.array(_BRAILLE))
        return bits

    def _draw(self, dots: BoolArray, style: str, *, over: bool = False) -> None:
        """Add dots to the characters; with `over`, they replace the former contents of these characters."""
        bits = self._cells(dots)
        touched = bits > 0
        if over:
            self._bits[touched] = 0
            self._signs[touched] = ""
        self._bits |= bits
        self._styles[touched] = style

    def _blocks(self, dots: BoolArray, style: str) -> None:
        # [rows, upper or lower, columns, left or right]
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


_SWATCHES = {Role.EGO: "█▲", Role.OPPONENT: "⣿", Role.OTHER: "⣏⣹", Role.PARKED: "⣏⣹", Role.GHOST: "⣏⣹"}


def legend_lines(strips: Sequence[Strip], width: int) -> Iterator[Text]:
    """Yield the legend of the signs, in lines of at most `width` columns."""
    entries: list[Text] = []
    for role, name in legend_of(strips):
        entries.append(Text.assemble((f"{_SWATCHES[role]} {_POINTS[role]}", STYLES[role]), f" {name}"))
    layers = {layer for strip in strips for panel in strip.panels for layer in panel.ground}
    if Layer.BUILDING in layers:
        entries.append(Text.assemble(("░", STYLES[Layer.BUILDING]), " building"))
    if Layer.CROSSING in layers:
        entries.append(Text("⢕ crossing"))
    if Layer.SLIPPERY in layers:
        entries.append(Text.assemble(("⢕", STYLES[Layer.SLIPPERY]), " slippery"))
    line = Text()
    for entry in entries:
        if line and len(line) + 3 + len(entry) > width:
            yield line
            line = Text()
        line = Text.assemble(line, "   ", entry) if line else entry
    yield line
