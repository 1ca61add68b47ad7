"""A sheet: one or several maps with texts around them, from which the SVG, the PNG and the live page are drawn."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.report.drawing.ground import Bounds
from foresee_dsl.report.drawing.labels import LINE, width_of
from foresee_dsl.report.drawing.shapes import Shape

if TYPE_CHECKING:
    from pathlib import Path

PAD = 14.0
"""Margin around a sheet that stays free, px."""
_LEAST_BAR_PX = 40.0
"""Smallest length of the bar that shows the scale, px. Ours: the text on it is this long."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of letters, px: for names and text, for small text, and for the title.

    Attributes:
        room: factor by which letters are larger on a phone; names are placed for the larger letters.
    """

    text: float = 13.0
    small: float = 11.5
    title: float = 16.0
    room: float = 1.45


@dataclass(frozen=True)
class TextPlace:
    """The place in a file at which an item is written: absolute path, first line and column, last line (counted from
    1).
    """

    path: Path
    line: int
    column: int
    end_line: int


@dataclass(frozen=True)
class Words:
    """A line of text in a map or sheet, px; `anchor` says whether `x` is its left end, middle or right end; `y` is its
    middle.
    """

    paint: str
    text: str
    x: float
    y: float
    size: str = "text"
    anchor: str = "start"
    bold: bool = False
    angle_deg: float = 0.0


@dataclass(frozen=True)
class DrawnPart:
    """The shapes and words of one object, such as a body or a trigger place; `place`: where the object is written."""

    kind: str
    shapes: tuple[Shape, ...] = ()
    words: tuple[Words, ...] = ()
    title: str = ""
    name: str = ""
    place: TextPlace | None = None


@dataclass(frozen=True)
class MapFrame:
    """A map of `width` by `height` pixels: its left and top sides in the world, m, and its `scale`, pixels per
    metre.
    """

    width: float
    height: float
    left: float
    top: float
    scale: float

    @property
    def bounds(self) -> Bounds:
        """Return left, bottom, right and top of the map in the world, m."""
        wide, high = self.width / self.scale, self.height / self.scale
        return self.left, self.top - high, self.left + wide, self.top

    def pixels(self, points: FloatArray) -> FloatArray:
        """Return points of the world, [N, 2] m, in pixels; y points downwards."""
        return (points - (self.left, self.top)) * (self.scale, -self.scale)

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of the world, m, in pixels."""
        return (x - self.left) * self.scale, (self.top - y) * self.scale

    def metres(self, pixels: FloatArray) -> FloatArray:
        """Return points of the map, [N, 2] pixels, in the world, m."""
        return pixels / (self.scale, -self.scale) + (self.left, self.top)


@dataclass(frozen=True)
class Map:
    """A map at a place of a sheet, px.

    The shapes of its `parts` are in the world, m; their words are in the map, px.
    """

    x: float
    y: float
    frame: MapFrame
    parts: tuple[DrawnPart, ...]


@dataclass(frozen=True)
class Sheet:
    """A whole picture.

    The parts `around` the maps are in pixels; `label` is the picture in words, for readers who cannot see it.
    """

    width: float
    height: float
    maps: tuple[Map, ...]
    around: tuple[DrawnPart, ...]
    label: str
    sizes: Sizes


@dataclass(frozen=True)
class Key:
    """An entry of a legend: a swatch of a paint, as a `line` or an area, and its text."""

    paint: str
    text: str
    line: bool = False
    dash: tuple[float, ...] = ()


def legend(keys: Iterable[Key], width: float, top: float, sizes: Sizes) -> tuple[list[DrawnPart], float]:
    """Return the parts of a legend in rows, and the height of a sheet of this width that ends with the legend, px."""
    px = sizes.small * sizes.room
    x, y = PAD, top + px * LINE / 2
    parts: list[DrawnPart] = []
    for key in keys:
        wide = 24 + width_of(key.text, px)
        if x + wide > width - PAD and x > PAD:
            x, y = PAD, y + px * 1.6
        mark = np.array([(x, y), (x + 18, y)]) if key.line else rectangle(x + 1, y - 5, x + 17, y + 5)
        shape = Shape(key.paint, (mark,), closed=not key.line, width=3.0 if key.line else 1.0, dash=key.dash)
        parts.append(DrawnPart("key", (shape,), (Words("quiet", key.text, x + 24, y, "small"),)))
        x += wide + 14
    return parts, (y + px * LINE / 2 + PAD if parts else top)


def scale_and_north(
    frame: MapFrame, sizes: Sizes, north_rad: float = math.pi / 2
) -> tuple[DrawnPart, Sequence[FloatArray]]:
    """Return the scale bar and the north arrow in a map's corners, and the outlines of what they cover, px.

    `north_rad`: direction of north, counter-clockwise from the map's right.
    """
    steps = (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
    metres = next((m for m in steps if m * frame.scale > _LEAST_BAR_PX), 10_000)
    length, y = metres * frame.scale, frame.height - 12
    px = sizes.small * sizes.room
    plate = rectangle(6, y - px - 9, max(length, width_of(f"{metres} m", px)) + 26, frame.height - 5)
    bar = np.array([(14, y - 4), (14, y), (14 + length, y), (14 + length, y - 4)])
    turn = math.pi / 2 - north_rad
    across = np.array(((math.cos(turn), math.sin(turn)), (-math.sin(turn), math.cos(turn))))
    north = np.array([(0, -9), (6, 9), (0, 5), (-6, 9)]) @ across + (frame.width - 18, 17)
    corner = rectangle(frame.width - 28, 0, frame.width, 30)
    shapes = (
        Shape("plate", (frame.metres(plate),), width=0.0),
        Shape("scale", (frame.metres(bar),), closed=False, width=1.6),
        Shape("ink", (frame.metres(north),), width=0.6),
    )
    words = Words("ink", f"{metres} m", 18, y - 5 - px / 2, "small")
    title = "scale; north is up" if abs(turn) < 1e-9 else "scale; the arrow points north"
    return DrawnPart("scale", shapes, (words,), title), (plate, corner)


def rectangle(left: float, top: float, right: float, bottom: float) -> FloatArray:
    """Return the corners of an upright rectangle."""
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
