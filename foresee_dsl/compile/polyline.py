"""Polylines with a length along them: the arithmetic under lanes and routes."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STEP_M = 1.0
"""Largest distance of neighbouring points (the driver protocol asks for it)."""
MERGE_M = 0.05
"""Points nearer than this are one: netconvert rounds to 1 cm, and the direction of a 1 cm segment means nothing."""
SPIKE_M = 0.5
"""A turn back by less than this is a slip of a map where two lanes were joined (CARLA's Town01 has six, of 0.2 m)."""
CURVATURE_SPAN_M = 5.0
"""Curvature is the change of heading over this length (ours: netconvert's turns have corners every 2 to 4 m)."""
_WINDOW_M = 12.0
"""How far around a hint the nearest point is sought (ours: a vehicle moves 3 m a step at most)."""


@dataclass(frozen=True, eq=False)
class Polyline:
    """A directed polyline.

    Attributes:
        points: [N, 2] m, N >= 2, at most 1 m apart.
        s: [N] m, length along it from 0.
        heading: [N] rad, counter-clockwise from east, continuous (it may leave -pi..pi).
    """

    points: FloatArray
    s: FloatArray
    heading: FloatArray

    @classmethod
    def of(cls, points: FloatArray) -> Polyline:
        """Make one from [N, 2] points of any spacing."""
        fine = subdivide(points)
        s = lengths(fine)
        return cls(points=fine, s=s, heading=headings(fine, s))

    @property
    def length_m(self) -> float:
        """The whole length."""
        return float(self.s[-1])

    @cached_property
    def curvature(self) -> FloatArray:
        """[N] 1/m, left positive, over a span of 5 m."""
        half = CURVATURE_SPAN_M / 2
        ahead, behind = np.minimum(self.s + half, self.s[-1]), np.maximum(self.s - half, 0.0)
        turned = np.interp(ahead, self.s, self.heading) - np.interp(behind, self.s, self.heading)
        return np.asarray(turned / np.maximum(ahead - behind, 1e-6), dtype=np.float64)

    def at(self, s: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """Return x, y and heading (-pi..pi) at a length; beyond the ends it goes on straight.

        Args:
            s: m along the line.
            offset_m: sideways, left positive.
        """
        marks = self._marks
        k = min(max(bisect_right(marks, s) - 1, 0), len(marks) - 2)
        span = marks[k + 1] - marks[k]
        t = (s - marks[k]) / span
        (x0, y0), (x1, y1) = self.points[k], self.points[k + 1]
        inside = min(max(t, 0.0), 1.0)
        heading = float(self.heading[k] + inside * (self.heading[k + 1] - self.heading[k]))
        x, y = float(x0 + t * (x1 - x0)), float(y0 + t * (y1 - y0))
        return x - offset_m * math.sin(heading), y + offset_m * math.cos(heading), wrap(heading)

    @overload
    def project(self, x: float, y: float, near_s: float | None = None) -> tuple[float, float]: ...
    @overload
    def project(self, x: FloatArray, y: FloatArray, near_s: None = None) -> tuple[FloatArray, FloatArray]: ...

    def project(
        self, x: float | FloatArray, y: float | FloatArray, near_s: float | None = None
    ) -> tuple[float, float] | tuple[FloatArray, FloatArray]:
        """Return the length along the line nearest to a point, and the distance sideways (left positive).

        Before the beginning and after the end the length goes on (negative, or over `length_m`).

        Args:
            x: m, a number or [K]. y: likewise.
            near_s: look only within 12 m of this length, which is faster and keeps to the right branch where the
                line passes twice; everywhere when the point is not found there.
        """
        if isinstance(x, np.ndarray):
            return self._project_many(x, np.asarray(y))
        if near_s is not None:
            found = self._project_one(float(x), float(y), near_s)
            if found is not None:
                return found
        s, lateral = self._project_many(np.array([x], dtype=np.float64), np.array([y], dtype=np.float64))
        return float(s[0]), float(lateral[0])

    @cached_property
    def _marks(self) -> list[float]:
        return [float(v) for v in self.s]

    @cached_property
    def _segments(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        step = np.diff(self.points, axis=0)
        return (
            np.ascontiguousarray(self.points[:-1, 0]),
            np.ascontiguousarray(self.points[:-1, 1]),
            np.ascontiguousarray(step[:, 0]),
            np.ascontiguousarray(step[:, 1]),
            1.0 / np.maximum(np.einsum("ij,ij->i", step, step), 1e-12),
        )

    def _project_one(self, x: float, y: float, near_s: float) -> tuple[float, float] | None:
        marks, last = self._marks, len(self._marks) - 2
        low = min(max(bisect_right(marks, near_s - _WINDOW_M) - 1, 0), last)
        high = min(max(bisect_right(marks, near_s + _WINDOW_M), low + 1), last + 1)
        x0, y0, dx, dy, inverse = (a[low:high] for a in self._segments)
        px, py = x - x0, y - y0
        t = (px * dx + py * dy) * inverse
        inside = np.minimum(np.maximum(t, 0.0), 1.0)
        ex, ey = px - inside * dx, py - inside * dy
        k = int((ex * ex + ey * ey).argmin())
        at_low, at_high = k == 0 and t[0] < 0.0, low + k == high - 1 and t[k] > 1.0
        if (at_low and low > 0) or (at_high and high <= last):
            return None
        return self._result(low + k, float(t[k]), float(px[k]), float(py[k]))

    def _project_many(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        x0, y0, dx, dy, inverse = self._segments
        px, py = x[:, None] - x0, y[:, None] - y0
        t = (px * dx + py * dy) * inverse
        inside = np.clip(t, 0.0, 1.0)
        best = ((px - inside * dx) ** 2 + (py - inside * dy) ** 2).argmin(axis=1)
        rows = np.arange(len(x))
        pairs = [
            self._result(int(k), float(t[i, k]), float(px[i, k]), float(py[i, k]))
            for i, k in zip(rows, best, strict=True)
        ]
        out = np.array(pairs, dtype=np.float64).reshape(-1, 2)
        return out[:, 0], out[:, 1]

    def _result(self, k: int, t: float, px: float, py: float) -> tuple[float, float]:
        """Length and sideways distance for a point (relative to point k) whose foot is at share t of segment k."""
        _, _, dx, dy, inverse = self._segments
        last = len(self._marks) - 2
        low = -math.inf if k == 0 else 0.0
        high = math.inf if k == last else 1.0
        t = min(max(t, low), high)
        sx, sy = float(dx[k]), float(dy[k])
        side = sx * py - sy * px
        distance = math.hypot(px - t * sx, py - t * sy)
        return self._marks[k] + t / math.sqrt(float(inverse[k])), math.copysign(distance, side)


def wrap(angle_rad: float) -> float:
    """Return the same angle within -pi..pi."""
    return math.remainder(angle_rad, math.tau)


def whole_millimetres(points: FloatArray) -> FloatArray:
    """Return the points of a body's path as clips write them: a child's path is then exactly its parent's."""
    return np.asarray(np.round(points, 3), dtype=np.float64)


def lengths(points: FloatArray) -> FloatArray:
    """Return [N] m: the length along [N, 2] points."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate(([0.0], np.cumsum(steps)))


def headings(points: FloatArray, s: FloatArray) -> FloatArray:
    """Return [N] rad, continuous: at a corner the mean of the two directions."""
    step = np.diff(points, axis=0)
    directions = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    if len(directions) == 1:
        return np.repeat(directions, 2)
    weights = np.diff(s)
    before, after = weights[:-1], weights[1:]
    # the nearer (shorter) segment says more about the direction at the corner
    middle = (directions[:-1] * after + directions[1:] * before) / (before + after)
    return np.concatenate((directions[:1], middle, directions[-1:]))


def distinct(points: FloatArray) -> FloatArray:
    """Return the points without those that (nearly) repeat the one before, and without spikes; the ends stay."""
    kept = [points[0]]
    for point in points[1:]:
        if np.hypot(*(point - kept[-1])) >= MERGE_M:
            kept.append(point)
    if len(kept) == 1:
        end = points[-1] if np.any(points[-1] != points[0]) else points[0] + (MERGE_M, 0.0)
        return np.array([points[0], end])
    kept[-1] = points[-1]
    return _without_spikes(np.array(kept))


def _without_spikes(points: FloatArray) -> FloatArray:
    step = np.diff(points, axis=0)
    back = (step[:-1] * step[1:]).sum(axis=1) < 0
    short = np.minimum(np.hypot(*step[:-1].T), np.hypot(*step[1:].T)) < SPIKE_M
    return np.delete(points, 1 + np.flatnonzero(back & short), axis=0)


def subdivide(points: FloatArray, step_m: float = STEP_M) -> FloatArray:
    """Return the same polyline with points at most `step_m` apart; its corners stay."""
    corners = distinct(np.asarray(points, dtype=np.float64))
    s = lengths(corners)
    counts = np.maximum(np.ceil(np.diff(s) / step_m - 1e-9), 1).astype(int)
    marks = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(s[:-1], s[1:], counts, strict=True)]
    fine = np.concatenate([*marks, s[-1:]])
    return np.column_stack((np.interp(fine, s, corners[:, 0]), np.interp(fine, s, corners[:, 1])))
