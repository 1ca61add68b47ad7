"""The streams that cross or join the ego's way, as the `pdm` driver takes them: paths on an even grid, and tables."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.protocol import FloatArray, Foe, JunctionPassage

PATH_M = 1.0
"""Spacing of the foes' paths."""
SHIFT_M, LENGTH_M, ENTRY_S, MEETS_S, LEAVES_S, OWN_S, OWN_UNTIL_S, HAS_PRIORITY = range(8)
"""Columns of `FoeTable.numbers`."""
STOP_S, EXIT_S, END_S, CROSSED = range(4)
"""Columns of `FoeTable.junctions`."""


@dataclass(frozen=True)
class FoePath:
    """A foe with its path on an even grid, prolonged straight at both ends (crossings are not).

    Attributes:
        points: [4, M] x, y, cos and sin of the tangent, `PATH_M` apart. shift_m: what the prolongation adds to lengths
            along it. length_m: length of the path as given. passage: index of the junction. index: of the foe on the
            route.
    """

    foe: Foe
    passage: int
    index: int
    points: FloatArray
    shift_m: float
    length_m: float


def any_drives(passage: JunctionPassage) -> bool:
    """Tell whether others drive across the ego's way."""
    return any(not foe.pedestrian for foe in passage.foes)


class FoeTable(NamedTuple):
    """All foes of a route, and its junctions, as the kernels take them.

    Attributes:
        numbers: [F, 8] `shift_m`, `length_m`; m along the path: its entry, begin and end of the conflict; m along the
            route: begin and end of the conflict; 1 where it has priority (else 0). walking: [F].
        points: [4, M] the paths' x, y, cos and sin, one path after the other.
        first: [F + 1] where each path begins in `points`, and where the last one ends.
        junctions: [J, 4] m along the route: its stop line, its exit, and where it is behind the ego (the exit, or the
            last of its conflicts); 1 where others drive across (else 0).
        first_of: [J + 1] the first foe of each junction, and the number of all foes.
    """

    numbers: FloatArray
    walking: NDArray[np.bool_]
    points: FloatArray
    first: NDArray[np.int64]
    junctions: FloatArray
    first_of: NDArray[np.int64]

    @classmethod
    def of(cls, foes: tuple[FoePath, ...], junctions: tuple[JunctionPassage, ...]) -> FoeTable:
        """Gather foes, which are in the order of their junctions."""
        rows = [
            (p.shift_m, p.length_m, p.foe.entry_s, *p.foe.conflict_path_s, *p.foe.conflict_s, p.foe.has_priority)
            for p in foes
        ]
        passages = [
            (j.stop_s, j.exit_s, max([j.exit_s, *(f.conflict_s[1] for f in j.foes)]), any_drives(j)) for j in junctions
        ]
        return cls(
            numbers=np.array(rows, dtype=float).reshape(-1, 8),
            walking=np.array([p.foe.pedestrian for p in foes], dtype=bool),
            points=np.concatenate([np.empty((4, 0)), *(p.points for p in foes)], axis=1),
            first=np.cumsum([0, *(p.points.shape[1] for p in foes)], dtype=np.int64),
            junctions=np.array(passages, dtype=float).reshape(-1, 4),
            first_of=np.cumsum([0, *(len(j.foes) for j in junctions)], dtype=np.int64),
        )


FOES = FoeTable.of((), ())
"""An example, for its type."""


def foe_path(foe: Foe, passage: int, index: int) -> FoePath:
    """Put a foe's path on an even grid."""
    path = np.ascontiguousarray(foe.path, dtype=np.float64)
    points, shift_m, length_m = _even(path.tobytes(), foe.pedestrian)
    return FoePath(foe, passage, index, points, shift_m, length_m)


@lru_cache(maxsize=512)  # a town's junctions: their lanes are the same in every run
def _even(path: bytes, pedestrian: bool) -> tuple[FloatArray, float, float]:
    """Return points and tangents of a path, what was put before it, and its own length."""
    points = np.frombuffer(path).reshape(-1, 2)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    keep = np.concatenate([[True], np.diff(lengths) > 1e-6])
    points, lengths = points[keep], lengths[keep]
    shift = 0.0 if pedestrian else cfg.FOE_EXTENSION_M
    s = np.arange(-shift, lengths[-1] + shift + PATH_M, PATH_M)
    x, y = prolonged(s, lengths, points[:, 0]), prolonged(s, lengths, points[:, 1])
    tx, ty = np.gradient(x), np.gradient(y)
    norm = np.maximum(np.hypot(tx, ty), 1e-9)
    return np.stack([x, y, tx / norm, ty / norm]), shift, float(lengths[-1])


def prolonged(at_s: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate, and go on straight at both ends."""
    first = (values[1] - values[0]) / (s[1] - s[0])
    last = (values[-1] - values[-2]) / (s[-1] - s[-2])
    beyond = np.minimum(at_s - s[0], 0.0) * first + np.maximum(at_s - s[-1], 0.0) * last
    return np.asarray(np.interp(at_s, s, values) + beyond)
