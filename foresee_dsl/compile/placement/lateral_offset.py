"""A path moved to the side: what `line 0.60 m` makes of the path that its author wrote.

Plain numbers, no numpy: `foresee check` places actors with it.
"""

from __future__ import annotations

import math
from itertools import pairwise

from foresee_dsl.compile.roads.polyline import XY, Points, distance, distinct, interpolate, lengths, whole_millimetres

LINE_OVER_M = 5.0
"""Over so much of its path somebody goes over to its `line`. Ours: 0.6 m of it are 7 deg, which reads as a walker who
crosses obliquely; 4 s for a walker, about 1 s for somebody on a bicycle."""
_SHARPEST = 0.5
"""Cosine of half the turn at a corner; in sharper ones the parallel line would run far out (a mitre of two widths)."""


def moved_aside(path: Points, along_m: float, left_m: float) -> Points:
    """Return a path that leaves its own line at a length and runs beside it after `LINE_OVER_M` more.

    Up to that length it is what it was. It comes to its end beside the old one, also where less is left.

    Args:
        path: its points, m.
        along_m: where it begins to leave.
        left_m: how far to the left it is to run; negative for the right.
    """
    marks = lengths(path)
    begins = min(max(along_m, 0.0), marks[-1])
    over = max(min(LINE_OVER_M, marks[-1] - begins), 1e-6)
    kept = [point for point, mark in zip(path, marks, strict=True) if mark < begins]
    bends = [(begins, 0.0)]
    bends += [(mark, left_m * min((mark - begins) / over, 1.0)) for mark in marks if mark > begins]
    if begins + over < marks[-1]:
        bends.append((begins + over, left_m))
    new = whole_millimetres(_beside(path, marks, mark, left) for mark, left in sorted(bends))
    return distinct((*kept, *new))


def _beside(path: Points, marks: tuple[float, ...], mark: float, left_m: float) -> XY:
    """Return the point beside a length of a path; at a corner, where the parallels of both sides meet."""
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
