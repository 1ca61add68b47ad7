"""Finds outlines of buildings that enclose no area or cross themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from foresee_dsl.helps import Help, remove
from foresee_dsl.language.streets.lines import XY

FLAT_M2 = 1e-6
"""Area below which an outline encloses nothing, m^2 (ours: 1 mm^2, the rounding of the points' coordinates)."""


def fault_of(name: str, *, crosses: bool) -> tuple[str, Help]:
    """Return the message and the help for an outline that crosses itself, or that has no area."""
    if crosses:
        message, help = (
            f"the outline of building '{name}' crosses or touches itself",
            "write its corners in their order",
        )
    else:
        message, help = (
            f"the outline of building '{name}' has no area",
            "move a corner away from the line of the others",
        )
    return message, help + ", or " + remove("remove it")


def is_flat(outline: Sequence[XY]) -> bool:
    """Return whether all corners lie on one line."""
    (x0, y0), far = outline[0], max(outline, key=lambda corner: math.dist(corner, outline[0]))
    dx, dy = far[0] - x0, far[1] - y0
    return all(abs(dx * (y - y0) - dy * (x - x0)) < FLAT_M2 for x, y in outline)


def crosses_itself(outline: Sequence[XY]) -> bool:
    """Return whether two walls of an outline cross or touch, other than neighbours at their corner."""
    corners = [corner for k, corner in enumerate(outline) if corner != outline[k - 1]]
    walls = [(corners[k - 1], corners[k]) for k in range(len(corners))]
    order = sorted(range(len(walls)), key=lambda k: min(walls[k][0][0], walls[k][1][0]))
    for n, k in enumerate(order):
        right = max(walls[k][0][0], walls[k][1][0])
        for other in order[n + 1 :]:
            if min(walls[other][0][0], walls[other][1][0]) > right:
                break
            if (other - k) % len(walls) in (1, len(walls) - 1):
                first, second = (k, other) if (other - k) % len(walls) == 1 else (other, k)
                if _turns_back(walls[first][0], walls[first][1], walls[second][1]):
                    return True
            elif _meet(*walls[k], *walls[other]):
                return True
    return False


def _side(a: XY, b: XY, c: XY) -> float:
    """Return on which side of the line from `a` to `b` a point lies: positive for left, 0 on the line."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _turns_back(a: XY, b: XY, c: XY) -> bool:
    ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return _side(a, b, c) == 0 and ahead < 0


def _meet(a: XY, b: XY, c: XY, d: XY) -> bool:
    """Return whether two walls have a point in common."""
    sides = _side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b)
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    on = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(side == 0 and _within(*wall) for side, wall in zip(sides, on, strict=True))


def _within(a: XY, b: XY, c: XY) -> bool:
    return min(a[0], b[0]) <= c[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= c[1] <= max(a[1], b[1])
