"""Where paths cut each other and how far points are from a path: inner loops, compiled to machine code.

Two paths of a drive have a thousand pieces each, so a million pairs, of which hardly any are near each other. Pieces
are taken in blocks; where a block's frame is too far away, none of its pieces is looked at. See `drivers.compiled` for
what a kernel may use.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.compiling import FLOAT, FLOATS, INTS, TABLE, compiled, inner

_BLOCK = 16
"""Pieces of a path that share a frame. Ours: about the root of a path's number of pieces, where frames and pieces cost
the same."""
_WEST, _SOUTH, _EAST, _NORTH = range(4)
_CLEAR_M = 1e-6
"""Frames that are nearer than this may touch (in metres, or their square). Ours: rounding moves coordinates of some
kilometres by a thousandth of it."""
_SHORTEST_M2 = 1e-12
"""The square of a piece's length at least. Ours: a micrometre, so that a point that is there twice divides by no
zero."""


@inner
def _frames(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return west, south, east and north of each block of pieces, [B, 4]."""
    pieces = len(path) - 1
    frames = np.empty(((pieces + _BLOCK - 1) // _BLOCK, 4))
    for block in range(len(frames)):
        first = block * _BLOCK
        last = min(first + _BLOCK, pieces)
        west = east = path[first, 0]
        south = north = path[first, 1]
        for k in range(first + 1, last + 1):
            west, east = min(west, path[k, 0]), max(east, path[k, 0])
            south, north = min(south, path[k, 1]), max(north, path[k, 1])
        frames[block, _WEST], frames[block, _SOUTH] = west, south
        frames[block, _EAST], frames[block, _NORTH] = east, north
    return frames


@inner
def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Say whether two frames have no point in common."""
    return bool(
        a[_WEST] > b[_EAST] + _CLEAR_M
        or b[_WEST] > a[_EAST] + _CLEAR_M
        or a[_SOUTH] > b[_NORTH] + _CLEAR_M
        or b[_SOUTH] > a[_NORTH] + _CLEAR_M
    )


@inner
def _pieces_cut(a: NDArray[np.float64], i: int, b: NDArray[np.float64], k: int, sine: float) -> bool:
    """Say whether piece i of one path and piece k of another have a point in common, at an angle of this sine."""
    rx, ry = a[i + 1, 0] - a[i, 0], a[i + 1, 1] - a[i, 1]
    sx, sy = b[k + 1, 0] - b[k, 0], b[k + 1, 1] - b[k, 1]
    cross = rx * sy - ry * sx
    if cross == 0.0:
        return False
    x, y = b[k, 0] - a[i, 0], b[k, 1] - a[i, 1]
    t = (x * sy - y * sx) / cross
    u = (x * ry - y * rx) / cross
    if not (0.0 <= t <= 1.0 and 0.0 <= u <= 1.0):
        return False
    return bool(abs(cross) / (math.hypot(rx, ry) * math.hypot(sx, sy)) >= sine)


@compiled(TABLE, TABLE, FLOAT)
def cut(a: NDArray[np.float64], b: NDArray[np.float64], sine: float) -> bool:
    """Say whether two paths ([N, 2], [M, 2]) cut each other at an angle of at least this sine."""
    if len(a) < 2 or len(b) < 2:
        return False
    theirs = _frames(b)
    for ours, frame in enumerate(_frames(a)):
        for other in range(len(theirs)):
            if _apart(frame, theirs[other]):
                continue
            for i in range(ours * _BLOCK, min((ours + 1) * _BLOCK, len(a) - 1)):
                for k in range(other * _BLOCK, min((other + 1) * _BLOCK, len(b) - 1)):
                    if _pieces_cut(a, i, b, k, sine):
                        return True
    return False


@inner
def _to_frame(x: float, y: float, frame: NDArray[np.float64]) -> float:
    """Return the square of the distance between a point and a frame."""
    dx = max(frame[_WEST] - x, x - frame[_EAST], 0.0)
    dy = max(frame[_SOUTH] - y, y - frame[_NORTH], 0.0)
    return float(dx * dx + dy * dy)


@inner
def _share(x: float, y: float, path: NDArray[np.float64], k: int) -> float:
    """Return where beside piece k of a path a point lies: 0 at its begin, 1 at its end."""
    dx, dy = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
    along = (x - path[k, 0]) * dx + (y - path[k, 1]) * dy
    return float(along / max(dx * dx + dy * dy, _SHORTEST_M2))


@inner
def _to_piece(x: float, y: float, path: NDArray[np.float64], k: int) -> float:
    """Return the square of the distance between a point and piece k of a path."""
    share = min(max(_share(x, y, path, k), 0.0), 1.0)
    dx = x - (path[k, 0] + share * (path[k + 1, 0] - path[k, 0]))
    dy = y - (path[k, 1] + share * (path[k + 1, 1] - path[k, 1]))
    return float(dx * dx + dy * dy)


@compiled(TABLE, TABLE, FLOATS, INTS, FLOATS)
def project(
    points: NDArray[np.float64],
    path: NDArray[np.float64],
    gaps: NDArray[np.float64],
    nearest: NDArray[np.int64],
    shares: NDArray[np.float64],
) -> None:
    """Write for each of the points [N, 2] its distance to a path [M, 2], M >= 2, the piece that is nearest, and where
    beside that piece it lies."""
    frames = _frames(path)
    pieces = len(path) - 1
    best = 0
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        # The piece that was nearest to the point before is hardly ever far from the best.
        least = _to_piece(x, y, path, best)
        for block in range(len(frames)):
            if _to_frame(x, y, frames[block]) > least + _CLEAR_M:
                continue
            for k in range(block * _BLOCK, min((block + 1) * _BLOCK, pieces)):
                squared = _to_piece(x, y, path, k)
                if squared < least or (squared == least and k < best):
                    least, best = squared, k
        gaps[n] = math.sqrt(least)
        nearest[n] = best
        shares[n] = _share(x, y, path, best)
