"""Polylines with positions along them: the arithmetic of lanes and routes.

It uses plain numbers, not numpy, because `foresee check` places all actors with it, and the import of numpy would take
a third of the time allowed for a check. Drivers and the simulator, which compute with arrays, use `points`, `s` and
`heading`.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise, starmap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

XY = tuple[float, float]
"""A point, m."""
Points = tuple[XY, ...]
"""Points of a line or an outline, m."""

STEP_M = 1.0
"""Largest distance between neighbouring points, m (the driver protocol promises it)."""
MERGE_M = 0.05
"""Distance below which two points are treated as one, m: netconvert 1.28 rounds to 1 cm by default, so the direction of
a segment of 1 cm is meaningless."""
SPIKE_M = 0.5
"""A reversal shorter than this is a fault of the map, m. Such faults occur where two lanes join (CARLA's Town01 has six
of 0.2 m).
"""
CURVATURE_SPAN_M = 5.0
"""The curvature is computed from the change of heading over this length, m (ours: netconvert's turns have a corner
every 2 to 4 m).
"""
_WINDOW_M = 12.0
"""Length before and after a hint in which the nearest point is searched, m (ours: a vehicle moves at most 3 m a
step)."""
_SAMPLE_EVERY = 16
"""One in this number of segments is used for a first bound of a point's distance to the line (ours, measured)."""
_SKIP_BEYOND_M2 = 4.0
"""Segments are skipped if the squared distance of a point exceeds the squared bound by at least this, m^2. If it
exceeds the bound by less, computing how many can be skipped costs more than it saves (ours, measured).
"""
_ROUNDING_M = 1e-6
"""Margin of the bound, m, so that rounding errors cannot skip the nearest segment."""
_NARROW_WINDOW_M, _ON_LINE_M = 2.0, 0.5
"""Length of the line that is searched before and after the hint, if the point is within `_ON_LINE_M` of the line, m.
Ours: a vehicle at 70 km/h drives about 2 m in two steps, and lines turn with a radius of at least 3 m."""


def as_array(field: str) -> cached_property[FloatArray]:
    """Return a property that holds a field as a float64 array, created on first use."""

    def convert(line: object) -> FloatArray:
        import numpy as np

        return np.array(getattr(line, field), dtype=np.float64)

    return cached_property(convert)


@dataclass(frozen=True, eq=False)
class Polyline:
    """A directed polyline.

    Attributes:
        xy: N points, N >= 2, at most 1 m apart.
        marks: position of each point along the line, m, from 0.
        angles: direction at each point, rad, counter-clockwise from east, continuous (they may leave -pi..pi).
    """

    xy: Points
    marks: tuple[float, ...]
    angles: tuple[float, ...]

    @classmethod
    def of(cls, points: Iterable[Sequence[float]] | FloatArray) -> Polyline:
        """Return a polyline through points (or an [N, 2] array) of any spacing."""
        fine = subdivide(as_line(points))
        s = lengths(fine)
        return cls(fine, s, headings(fine, s))

    @property
    def length_m(self) -> float:
        """Length of the line, m."""
        return self.marks[-1]

    points = as_array("xy")
    """The points, [N, 2] m."""
    s = as_array("marks")
    """The positions of the points along the line, [N] m."""
    heading = as_array("angles")
    """The directions at the points, [N] rad."""

    @cached_property
    def curvature(self) -> FloatArray:
        """The curvature at the points, [N] 1/m, left positive, over a span of 5 m."""
        import numpy as np

        half = CURVATURE_SPAN_M / 2
        ahead, behind = np.minimum(self.s + half, self.s[-1]), np.maximum(self.s - half, 0.0)
        turned = np.interp(ahead, self.s, self.heading) - np.interp(behind, self.s, self.heading)
        return np.asarray(turned / np.maximum(ahead - behind, 1e-6), dtype=np.float64)

    def at(self, s: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """Return x, y and heading (-pi..pi) at a position along the line, m, `offset_m` to its left; beyond its ends
        the line continues straight."""
        marks = self.marks
        k = min(max(bisect_right(marks, s) - 1, 0), len(marks) - 2)
        span = marks[k + 1] - marks[k]
        t = (s - marks[k]) / span
        (x0, y0), (x1, y1) = self.xy[k], self.xy[k + 1]
        inside = min(max(t, 0.0), 1.0)
        heading = self.angles[k] + inside * (self.angles[k + 1] - self.angles[k])
        x, y = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
        return float(x - offset_m * math.sin(heading)), float(y + offset_m * math.cos(heading)), wrap(heading)

    def project(self, x: float, y: float, near_s: float | None = None) -> tuple[float, float]:
        """Return the position along the line nearest to a point, m, and the distance sideways (left positive). Before
        the line's beginning the position is negative, after its end it exceeds `length_m`.

        The nearest point is searched within 12 m of `near_s`, which is faster and finds the right pass if the line
        passes the point twice; if it is not there, on the whole line.
        """
        last = len(self._segments)
        px, py = float(x), float(y)
        if near_s is not None:
            if (nearest := self._on_line(px, py, near_s)) is not None:
                return self._result(*nearest, px, py)
            low = min(max(bisect_right(self.marks, near_s - _WINDOW_M) - 1, 0), last - 1)
            high = min(max(bisect_right(self.marks, near_s + _WINDOW_M), low + 1), last)
            k, t = self._nearest(px, py, low, high)
            # if the window ends before the line does, a nearer point may lie beyond
            if not (k == low and t < 0.0 and low > 0) and not (k == high - 1 and t > 1.0 and high < last):
                return self._result(k, t, px, py)
        return self._result(*self._nearest(px, py, 0, last), px, py)

    def _on_line(self, x: float, y: float, near_s: float) -> tuple[int, float] | None:
        """Return the nearest segment, and the nearest point on it as a share of its length, for a point almost on the
        line and close to `near_s`; else None.

        No other point within 12 m can be nearer in that case, because lines do not bend that sharply.
        """
        low = max(bisect_right(self.marks, near_s - _NARROW_WINDOW_M) - 1, 0)
        high = min(bisect_right(self.marks, near_s + _NARROW_WINDOW_M), len(self._segments))
        if low >= high:
            return None
        k, t = self._nearest(x, y, low, high)
        if (k == low and t < 0.0) or (k == high - 1 and t > 1.0):
            return None
        x0, y0, dx, dy, _ = self._segments[k]
        inside = min(max(t, 0.0), 1.0)
        return (k, t) if abs(x - x0 - inside * dx) + abs(y - y0 - inside * dy) < _ON_LINE_M else None

    @cached_property
    def _segments(self) -> tuple[tuple[float, float, float, float, float], ...]:
        """The segments, each with x and y of its beginning, x and y of its extent, and 1 / squared length."""
        return tuple(
            (x0, y0, x1 - x0, y1 - y0, 1.0 / max((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0), 1e-12))
            for (x0, y0), (x1, y1) in pairwise(self.xy)
        )

    def _nearest(self, x: float, y: float, low: int, high: int) -> tuple[int, float]:
        """Return the segment of low..high (exclusive) nearest to a point, and the nearest point on it as a share.

        Over d metres along the line, the distance to the point decreases by at most d metres. So if it exceeds the
        bound by d metres, the next d metres of the line are skipped.
        """
        segments, marks = self._segments, self.marks
        bound = math.inf  # m^2: the nearest point is no farther away
        for x0, y0, *_ in segments[low:high:_SAMPLE_EVERY] if high - low > 2 * _SAMPLE_EVERY else ():
            px, py = x - x0, y - y0
            bound = min(bound, px * px + py * py)
        bound_m = math.sqrt(bound) + _ROUNDING_M
        best, at, share, k = math.inf, low, 0.0, low
        while k < high:
            x0, y0, dx, dy, inverse = segments[k]
            px, py = x - x0, y - y0
            from_start = px * px + py * py
            if (
                from_start > bound + _SKIP_BEYOND_M2
                and (clear := marks[k] + math.sqrt(from_start) - bound_m) > marks[k + 1]
            ):
                k = bisect_right(marks, clear, k, high) - 1 if clear < marks[high] else high
                continue
            t = (px * dx + py * dy) * inverse
            inside = 0.0 if t < 0.0 else (1.0 if t > 1.0 else t)
            px -= inside * dx
            py -= inside * dy
            away = px * px + py * py
            if away < best:
                best, at, share = away, k, t
            k += 1
        return at, share

    def _result(self, k: int, t: float, x: float, y: float) -> tuple[float, float]:
        """Return position and sideways distance of a point whose nearest point is at share t of segment k."""
        x0, y0, sx, sy, inverse = self._segments[k]
        low = -math.inf if k == 0 else 0.0
        high = math.inf if k == len(self._segments) - 1 else 1.0
        t = min(max(t, low), high)
        px, py = x - x0, y - y0
        distance = math.hypot(px - t * sx, py - t * sy)
        return self.marks[k] + t / math.sqrt(inverse), math.copysign(distance, sx * py - sy * px)


@lru_cache(maxsize=128)
def line_of(path: Points) -> Polyline:
    """Return `Polyline.of` a path, cached because the children of a clip have the same paths."""
    return Polyline.of(path)


def wrap(angle_rad: float) -> float:
    """Return the same angle within -pi..pi."""
    return math.remainder(angle_rad, math.tau)


def as_line(points: Iterable[Sequence[float]] | FloatArray) -> Points:
    """Return points (or an [N, 2] array) as tuples of Python floats."""
    return tuple((float(x), float(y)) for x, y in points)


def whole_millimetres(points: Iterable[XY]) -> Points:
    """Return the points of a path rounded as in clips, so that a child's path is exactly its parent's."""
    return tuple((round(x * 1000.0) / 1000.0, round(y * 1000.0) / 1000.0) for x, y in points)


def distance(a: XY, b: XY) -> float:
    """Return the distance of two points, m."""
    return math.hypot(b[0] - a[0], b[1] - a[1])


def direction(a: XY, b: XY) -> float:
    """Return the direction from one point to another, rad, counter-clockwise from east."""
    return math.atan2(b[1] - a[1], b[0] - a[0])


def distance_to(x: float, y: float, points: Points) -> float:
    """Return the distance from a point to a polyline, m."""
    best = math.inf
    for (x0, y0), (x1, y1) in pairwise(points):
        dx, dy, px, py = x1 - x0, y1 - y0, x - x0, y - y0
        squared = dx * dx + dy * dy
        share = min(max((px * dx + py * dy) / squared, 0.0), 1.0) if squared > 0 else 0.0
        best = min(best, math.hypot(px - share * dx, py - share * dy))
    return best


def lengths(points: Sequence[XY]) -> tuple[float, ...]:
    """Return the position of each point along the line, m."""
    return tuple(accumulate(starmap(distance, pairwise(points)), initial=0.0))


def interpolate(at: float, marks: Sequence[float], values: Sequence[float]) -> float:
    """Return the value at a mark, interpolated between its neighbours; beyond the ends the first or last value."""
    if at <= marks[0]:
        return values[0]
    if at >= marks[-1]:
        return values[-1]
    k = bisect_right(marks, at) - 1
    return (values[k + 1] - values[k]) / (marks[k + 1] - marks[k]) * (at - marks[k]) + values[k]


def stretch(points: Sequence[XY], from_m: float, to_m: float) -> Points:
    """Return the stretch of a line between two positions along it; a single point if they are equal."""
    marks, (xs, ys) = lengths(points), zip(*points, strict=True)
    first, last = ((interpolate(at, marks, xs), interpolate(at, marks, ys)) for at in (from_m, to_m))
    if to_m - from_m < 1e-6:
        return (first,)
    inner = (point for point, at in zip(points, marks, strict=True) if from_m + 1e-6 < at < to_m - 1e-6)
    return (first, *inner, last)


def first_ahead(last: Sequence[float], points: Sequence[Sequence[float]]) -> int:
    """Return the index of the first of a lane's points that lies ahead of a line's last point, because lanes of maps
    overlap a little where they join; the number of points if none does."""
    for k, point in enumerate(points):
        dx, dy = point[0] - last[0], point[1] - last[1]
        ahead = (points[1][0] - points[0][0], points[1][1] - points[0][1]) if len(points) > 1 else (dx, dy)
        if math.hypot(dx, dy) >= MERGE_M and dx * ahead[0] + dy * ahead[1] > 0:
            return k
    return len(points)


def headings(points: Sequence[XY], s: Sequence[float]) -> tuple[float, ...]:
    """Return the direction at each point, rad, continuous; at a corner the weighted mean of the two directions."""
    directions: list[float] = []
    for angle in starmap(direction, pairwise(points)):
        if directions and abs(angle - directions[-1]) >= math.pi:
            angle = directions[-1] + wrap(angle - directions[-1])  # noqa: PLW2901 - the same direction
        directions.append(angle)
    angles = [directions[0]]
    for k, (d0, d1) in enumerate(pairwise(directions)):
        before, after = s[k + 1] - s[k], s[k + 2] - s[k + 1]
        # the shorter segment weighs more: its middle is nearer to the corner
        angles.append((d0 * after + d1 * before) / (before + after))
    return (*angles, directions[-1])


def distinct(points: Sequence[XY]) -> Points:
    """Return the points without those that (nearly) repeat the previous one, and without spikes; the ends stay."""
    apart = [points[0]]
    for point in points[1:]:
        if distance(apart[-1], point) >= MERGE_M:
            apart.append(point)
    if len(apart) == 1:
        (x, y), end = points[0], points[-1]
        return points[0], end if end != points[0] else (x + MERGE_M, y)
    apart[-1] = points[-1]
    without_spikes = [apart[0]]
    for a, b, c in zip(apart, apart[1:], apart[2:], strict=False):
        back = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0
        if not (back and min(distance(a, b), distance(b, c)) < SPIKE_M):
            without_spikes.append(b)
    return (*without_spikes, points[-1])


def subdivide(points: Sequence[XY]) -> Points:
    """Return the same polyline with points at most `STEP_M` apart; its corners stay."""
    corners = distinct(points)
    s = lengths(corners)
    fine: list[XY] = []
    for k, ((x0, y0), (x1, y1)) in enumerate(pairwise(corners)):
        span = s[k + 1] - s[k]
        count = max(math.ceil(span / STEP_M - 1e-9), 1)
        fine.append((x0, y0))
        for i in range(1, count):
            along = s[k] + i * (span / count) - s[k]
            fine.append((x0 + (x1 - x0) / span * along, y0 + (y1 - y0) / span * along))
    return (*fine, corners[-1])


def inside(point: XY, outline: Points) -> bool:
    """Return whether a point is inside a closed outline (even-odd rule)."""
    x, y = point
    odd = False
    for (x0, y0), (x1, y1) in pairwise((*outline, outline[0])):
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            odd = not odd
    return odd


def crosses(first: Sequence[XY], second: Sequence[XY]) -> bool:
    """Return whether two lines of points cross; touching at an end does not count."""
    return any(
        _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0
        for a, b in pairwise(first)
        for c, d in pairwise(second)
    )


def _side(a: XY, b: XY, c: XY) -> float:
    """Return a positive number if c lies to the left of the line from a to b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
