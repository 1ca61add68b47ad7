"""Computes with the lines of roads as plain numbers: lengths, points along them, and lines beside them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from foresee_dsl.language import model as m

XY = tuple[float, float]


def number(value: m.Value | None, default: float = 0.0) -> float:
    """Return a value in SI units; the default if the value is absent, or not known because it is a parameter."""
    return value.si if isinstance(value, m.Quantity) else default


def wrapped(angle_rad: float) -> float:
    """Return an angle between -pi and pi."""
    return (angle_rad + math.pi) % math.tau - math.pi


def xy(point: m.Point) -> XY:
    """Return a point's coordinates, m."""
    return number(point.x), number(point.y)


def marks(line: Sequence[XY]) -> list[float]:
    """Return the length up to each point of a line, m."""
    steps = (math.dist(a, b) for a, b in itertools.pairwise(line))
    return list(itertools.accumulate(steps, initial=0.0))


def at(line: Sequence[XY], s: float) -> tuple[XY, float]:
    """Return the point at a length along a line, m, and the heading there, rad; beyond an end, the line continues
    straight."""
    along = marks(line)
    k = next((k for k in range(1, len(line)) if s <= along[k]), len(line) - 1)
    (x0, y0), (x1, y1) = line[k - 1], line[k]
    step = max(along[k] - along[k - 1], 1e-9)
    t = (s - along[k - 1]) / step
    return (x0 + t * (x1 - x0), y0 + t * (y1 - y0)), math.atan2(y1 - y0, x1 - x0)


def beside(point: XY, heading_rad: float, right_m: float, ahead_m: float = 0.0) -> XY:
    """Return the point at a lateral distance (to the right) and a distance ahead of a place with a heading, m."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return point[0] + ahead_m * c + right_m * s, point[1] + ahead_m * s - right_m * c


def with_points_at(line: Sequence[XY], lengths: Sequence[float]) -> list[XY]:
    """Return a line with additional points at some lengths; its course does not change."""
    along = marks(line)
    new = [(s, at(line, s)[0]) for s in lengths if all(abs(s - mark) > 1e-6 for mark in along)]
    return [point for _, point in sorted([*zip(along, line, strict=True), *dict(new).items()])]


def shifted(line: Sequence[XY], right_m: Sequence[float]) -> list[XY]:
    """Return a line moved to its right, at each point by its own distance, m; corners are mitred, very sharp ones cut
    short."""
    normals = []
    for (x0, y0), (x1, y1) in itertools.pairwise(line):
        length = max(math.hypot(x1 - x0, y1 - y0), 1e-9)
        normals.append(((y1 - y0) / length, -(x1 - x0) / length))
    moved = []
    for k, ((x, y), distance) in enumerate(zip(line, right_m, strict=True)):
        (ax, ay), (bx, by) = normals[max(k - 1, 0)], normals[min(k, len(normals) - 1)]
        scale = distance / max(1 + ax * bx + ay * by, 0.5)
        moved.append((x + (ax + bx) * scale, y + (ay + by) * scale))
    return moved


def shift_right(line: Sequence[XY], distance: float) -> list[XY]:
    """Return a line moved to its right by one distance, m; see `shifted`."""
    return shifted(line, [distance] * len(line)) if distance else list(line)


def curve(a: XY, heading_a: float, b: XY, heading_b: float, step_m: float = 4.0) -> list[XY]:
    """Return a smooth line (a cubic Bezier curve) between two points with their headings, both ends included."""
    reach = math.dist(a, b) / 3
    c, d = beside(a, heading_a, 0.0, reach), beside(b, heading_b, 0.0, -reach)
    steps = max(round(math.dist(a, b) / step_m), 4)
    bent = []
    for k in range(steps + 1):
        t = k / steps
        weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3)
        points = zip(weights, (a, c, d, b), strict=True)
        xs, ys = zip(*((w * x, w * y) for w, (x, y) in points), strict=True)
        bent.append((sum(xs), sum(ys)))
    return bent
