"""The time to collision in plain Python: the kernel must give the same bits."""

from __future__ import annotations

from math import cos, inf, sin

from foresee_dsl.kernels.boxes import Mover


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
