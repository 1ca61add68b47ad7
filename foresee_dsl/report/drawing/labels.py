"""Places names near their objects so that the names cover neither each other nor the bodies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

LETTER = 0.66
"""Width of a letter as a multiple of the font's size. Ours: the mean of DejaVu Sans Bold, a wide font."""
LINE = 1.25
"""Height of a line as a multiple of the font's size."""
_RINGS = (1.0, 2.2, 3.6, 5.2)
"""Distances from its object at which a label may be placed, in lines; near ones are tried first. Ours: farther away a
reader cannot relate the label to its object."""
_CHUNK = 1.0
"""Ratio of length to height of the boxes that together approximate a slanted name. Ours."""


class LabelBox(NamedTuple):
    """A box with the sides left, top, right and bottom, px; y points downwards."""

    left: float
    top: float
    right: float
    bottom: float

    def touches(self, other: LabelBox) -> bool:
        """Return whether two boxes overlap."""
        return (
            self.left < other.right and other.left < self.right and self.top < other.bottom and other.top < self.bottom
        )

    def inside(self, other: LabelBox) -> bool:
        """Return whether this box lies within another one."""
        return (
            self.left >= other.left
            and self.right <= other.right
            and self.top >= other.top
            and self.bottom <= other.bottom
        )

    @property
    def middle(self) -> tuple[float, float]:
        """Return the centre of the box, px."""
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2


def width_of(text: str, size: float) -> float:
    """Return the approximate width of a text in a font of this size, px."""
    return LETTER * size * len(text)


class Room:
    """The boxes of a map that are occupied."""

    def __init__(self, whole: LabelBox) -> None:
        self.whole = whole
        self._taken: list[LabelBox] = []
        self._better_free: list[LabelBox] = []

    def take(self, *boxes: LabelBox) -> None:
        """Mark boxes as taken."""
        self._taken += boxes

    def spare(self, *boxes: LabelBox) -> None:
        """Mark boxes that labels avoid if there is another place for them, such as the actors' ways."""
        self._better_free += boxes

    def free(self, box: LabelBox) -> bool:
        """Return whether a box is within the map and not taken."""
        return box.inside(self.whole) and not any(box.touches(taken) for taken in self._taken)

    def beside(self, thing: LabelBox, width: float, height: float, *, insist: bool) -> LabelBox | None:
        """Take the nearest free place for a label beside a thing, and return it.

        With `insist`, distant places are tried as well, which need a line to the thing; if none is free, the place that
        covers the fewest boxes is taken. Without it, None is returned if no near place is free.
        """
        there = list(_around(thing, width, height, _RINGS if insist else _RINGS[:2]))
        free = [box for box in there if self.free(box)]
        clear = (box for box in free if not any(box.touches(way) for way in self._better_free))
        box = next(clear, free[0] if free else None)
        if box is None:
            if not insist:
                return None
            pushed = [_pushed(box, self.whole) for box in there]
            box = min(pushed, key=lambda box: sum(box.touches(taken) for taken in self._taken))
        self.take(box)
        return box

    def along(self, x: float, y: float, angle_rad: float, width: float, height: float) -> bool:
        """Take the place of a slanted label with its middle at a point, if it is free."""
        count = max(math.ceil(width / (height * _CHUNK)), 1)
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        half = height / 2
        marks = [(k + 0.5) / count * width - width / 2 for k in range(count)]
        boxes = [LabelBox(x + t * c - half, y + t * s - half, x + t * c + half, y + t * s + half) for t in marks]
        if not all(self.free(box) for box in boxes):
            return False
        self.take(*boxes)
        return True


def _around(thing: LabelBox, width: float, height: float, rings: Sequence[float]) -> Iterator[LabelBox]:
    """Yield places beside a thing, near places first, in the order right, left, above, below, and the diagonals."""
    x, y = thing.middle
    wide, high = (thing.right - thing.left) / 2, (thing.bottom - thing.top) / 2
    for ring in rings:
        off = 3 + (ring - 1) * height
        for dx, dy in ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (1, 1), (-1, -1), (-1, 1)):
            cx = x + dx * (wide + off + width / 2)
            cy = y + dy * (high + off + height / 2)
            yield LabelBox(cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2)


def _pushed(box: LabelBox, whole: LabelBox) -> LabelBox:
    """Return a box, moved so that it lies within another box."""
    dx = max(whole.left - box.left, 0.0) or min(whole.right - box.right, 0.0)
    dy = max(whole.top - box.top, 0.0) or min(whole.bottom - box.bottom, 0.0)
    return LabelBox(box.left + dx, box.top + dy, box.right + dx, box.bottom + dy)


def wrapped(text: str, size: float, width: float, lines: int) -> Sequence[str]:
    """Return a text in at most `lines` lines of this width; if the text is longer, the last line ends with `…`."""
    import textwrap

    letters = max(int(width / (LETTER * 0.9 * size)), 8)
    rows = textwrap.wrap(text, letters, break_long_words=True, break_on_hyphens=False)
    if len(rows) > lines:
        rows = [*rows[: lines - 1], f"{rows[lines - 1][: letters - 1].rstrip()}…"]
    return rows
