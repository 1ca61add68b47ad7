"""The measures of conditions in plain Python: the kernels must give the same bits."""

from __future__ import annotations

from math import cos, hypot, inf, sin

from foresee_dsl.kernels.boxes import Box, Mover, corner_points, overlaps


def plain_distance(a: Box, b: Box) -> float:
    """Return how far two boxes are apart, m."""
    return 0.0 if overlaps(a, b) else min(_corners_to_box(a, b), _corners_to_box(b, a))


def _corners_to_box(of: Box, to: Box) -> float:
    c, s = cos(to.heading), sin(to.heading)
    return min(
        hypot(
            max(abs((x - to.x) * c + (y - to.y) * s) - to.length / 2, 0.0),
            max(abs((y - to.y) * c - (x - to.x) * s) - to.width / 2, 0.0),
        )
        for x, y in corner_points(of)
    )


def plain_ttc(a: Mover, b: Mover) -> float:
    """Return the time until two footprints touch, s: they overlap where the intervals of all four directions do."""
    dx, dy = b.x - a.x, b.y - a.y
    (ax, ay), (bx, by) = a.velocity, b.velocity
    vx, vy = bx - ax, by - ay
    ca, sa, cb, sb = cos(a.heading), sin(a.heading), cos(b.heading), sin(b.heading)
    c, s = abs(ca * cb + sa * sb), abs(ca * sb - sa * cb)
    along_a, across_a = a.length + c * b.length + s * b.width, a.width + s * b.length + c * b.width
    along_b, across_b = b.length + c * a.length + s * a.width, b.width + s * a.length + c * a.width
    begin, end = 0.0, inf
    for nx, ny, reach in ((ca, sa, along_a), (-sa, ca, across_a), (cb, sb, along_b), (-sb, cb, across_b)):
        apart, speed = dx * nx + dy * ny, vx * nx + vy * ny
        if abs(speed) < 1e-9:
            if abs(apart) > reach / 2:
                return inf
            continue
        first, last = sorted(((-reach / 2 - apart) / speed, (reach / 2 - apart) / speed))
        begin, end = max(begin, first), min(end, last)
    return begin if begin <= end else inf
