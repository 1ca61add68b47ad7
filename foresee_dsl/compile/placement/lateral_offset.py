"""Shifts a path sideways: what the statement `line 0.60 m` does to the path of its actor.

Plain numbers, no numpy: `foresee check` places actors with it.
"""

from __future__ import annotations

import math
from itertools import pairwise

from foresee_dsl.compile.roads.polyline import XY, Points, distance, distinct, interpolate, lengths, whole_millimetres

LINE_OVER_M = 5.0
"""Length of path, m, over which an actor moves to its `line`. Ours: with 0.6 m sideways that is 7 deg, like a
pedestrian who crosses obliquely; it takes a pedestrian 4 s and a bicycle about 1 s."""
_SHARPEST = 0.5
"""Cosine of half the turn at a corner; in sharper corners the offset line is cut at two widths, as it would run far
out (ours)."""


def shifted(path: Points, along_m: float, left_m: float) -> Points:
    """Return a path that is the same up to a length, and runs beside the old one from `LINE_OVER_M` later on.

    It ends beside the old end even where less than that is left.

    Args:
        path: its points, m.
        along_m: where it starts to leave, m along the path.
        left_m: how far to the left it runs, m; negative for the right.
    """
    marks = lengths(path)
    begins = min(max(along_m, 0.0), marks[-1])
    over = max(min(LINE_OVER_M, marks[-1] - begins), 1e-6)
    before = [point for point, mark in zip(path, marks, strict=True) if mark < begins]
    bends = [(begins, 0.0)]
    bends += [(mark, left_m * min((mark - begins) / over, 1.0)) for mark in marks if mark > begins]
    if begins + over < marks[-1]:
        bends.append((begins + over, left_m))
    new = whole_millimetres(_beside(path, marks, mark, left) for mark, left in sorted(bends))
    return distinct((*before, *new))


def _beside(path: Points, marks: tuple[float, ...], mark: float, left_m: float) -> XY:
    """Return the point beside a length of a path; at a corner, where the offset lines of both sides meet."""
    x = interpolate(mark, marks, [p[0] for p in path])
    y = interpolate(mark, marks, [p[1] for p in path])
    sides = [(a, b) for (a, b), (s, t) in zip(pairwise(path), pairwise(marks), strict=True) if s <= mark <= t and s < t]
    normals = [(-(b[1] - a[1]) / distance(a, b), (b[0] - a[0]) / distance(a, b)) for a, b in sides]
    nx, ny = (sum(n[k] for n in normals) / len(normals) for k in (0, 1))
    size = math.hypot(nx, ny)  # the cosine of half the turn
    if size < 1e-9:  # it turns round
        return x + left_m * normals[0][0], y + left_m * normals[0][1]
    reach = left_m / (size * max(size, _SHARPEST))
    return x + reach * nx, y + reach * ny
