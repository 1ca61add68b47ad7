"""Criticality metrics of a single moment that conditions ask for: time to collision, time to a place.

Definitions follow Westhofen et al., "Criticality Metrics for Automated Driving" (Archives of Computational Methods in
Engineering, 2023), section on TTC. Infinity means "never".
"""

from __future__ import annotations

from math import cos, inf, isnan, nan, sin

from foresee_dsl.kernels.boxes import Mover

SLOWEST_MPS = 1.0
"""`eta` counts with at least this speed (the language's definition), so that a standing vehicle has a finite one."""

STILL_MPS = 1e-9
"""A closing speed under this is rounding: at the largest distances of a town it would take a century to meet."""


def ttc(a: Mover, b: Mover) -> float:
    """Return the time (s) until two footprints touch when both keep heading and speed.

    Exact: each of the four directions at right angles to the sides separates the footprints outside one interval of
    time; they overlap where all four intervals do.

    Returns:
        0 when they overlap now, infinity when they never will, NaN where a value is NaN.
    """
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
        if isnan(apart) or isnan(speed):
            return nan
        if abs(speed) < STILL_MPS:
            if abs(apart) > reach / 2:
                return inf
            continue
        first, last = sorted(((-reach / 2 - apart) / speed, (reach / 2 - apart) / speed))
        begin, end = max(begin, first), min(end, last)
    return begin if begin <= end else inf


def eta(distance_m: float, speed_mps: float) -> float:
    """Return the time (s) to a place `distance_m` ahead at this speed, not under 1 m/s; infinity once it is behind."""
    return distance_m / max(speed_mps, SLOWEST_MPS) if distance_m >= 0 else inf
