"""Criticality metrics: time to collision, post-encroachment time, deceleration to avoid a crash, gaps, distances.

Definitions follow Westhofen et al., "Criticality Metrics for Automated Driving" (Archives of Computational Methods in
Engineering, 2023), sections on TTC, PET and DRAC. Infinity means "never".
"""

from __future__ import annotations

from math import cos, inf, isnan, nan, sin

import numpy as np

from foresee_dsl.kernels.boxes import FloatArray, Mover, box_overlap, pairwise_box_distance
from foresee_dsl.simulate.trace import STEP_S

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


def ttcs(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return `ttc` for many pairs.

    Args:
        a, b: [..., 6] x, y, heading, speed, length, width; they broadcast.

    Returns:
        [...] s: 0 where they overlap, infinity where they never will, NaN where either is absent.
    """
    delta = b[..., :2] - a[..., :2]
    velocity = _velocity(b) - _velocity(a)
    begin: FloatArray = np.zeros(delta.shape[:-1])
    end: FloatArray = np.full(delta.shape[:-1], inf)
    for angle in (a[..., 2], a[..., 2] + np.pi / 2, b[..., 2], b[..., 2] + np.pi / 2):
        c, s = np.cos(angle), np.sin(angle)
        apart, speed = delta[..., 0] * c + delta[..., 1] * s, velocity[..., 0] * c + velocity[..., 1] * s
        reach = (_extent(a, angle) + _extent(b, angle)) / 2
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            one, two = (-reach - apart) / speed, (reach - apart) / speed
        still = np.abs(speed) < STILL_MPS
        within = np.abs(apart) <= reach
        first = np.where(still, np.where(within, -inf, inf), np.minimum(one, two))
        last = np.where(still, np.where(within, inf, -inf), np.maximum(one, two))
        begin, end = np.maximum(begin, first), np.minimum(end, last)
    absent = np.isnan(delta).any(axis=-1) | np.isnan(velocity).any(axis=-1)
    return np.where(absent, np.nan, np.where(begin <= end, begin, inf))


def eta(distance_m: float, speed_mps: float) -> float:
    """Return the time (s) to a place `distance_m` ahead at this speed, not under 1 m/s; infinity once it is behind."""
    return distance_m / max(speed_mps, SLOWEST_MPS) if distance_m >= 0 else inf


def gap(follower: Mover, leader: Mover) -> float:
    """Return the room (m) between the follower's front and the leader's nearest end, along the follower's heading.

    Negative when the leader is beside or behind. How far it is to the side plays no role.
    """
    c, s = cos(follower.heading), sin(follower.heading)
    ahead = (leader.x - follower.x) * c + (leader.y - follower.y) * s
    turned = leader.heading - follower.heading
    shadow = leader.length * abs(cos(turned)) + leader.width * abs(sin(turned))
    return ahead - (follower.length + shadow) / 2


def drac(closing_mps: float, gap_m: float) -> float:
    """Return the deceleration (m/s^2) with which the follower just avoids the leader, were that to keep its speed.

    Args:
        closing_mps: the follower's speed less the leader's.
        gap_m: room between them.

    Returns:
        0 when the gap does not shrink, infinity when it shrinks and there is none left.
    """
    if closing_mps <= 0:
        return 0.0
    return closing_mps * closing_mps / (2 * gap_m) if gap_m > 0 else inf


def pet(a: FloatArray, b: FloatArray, *, step_s: float = STEP_S, horizon_s: float = 10.0) -> float:
    """Return the post-encroachment time: the time between one leaving a spot and the other coming to the same spot.

    It is the smallest time by which one of the two trajectories would have to be shifted for the footprints to touch,
    to the nearest step above.

    Args:
        a, b: [T, 5] footprints (x, y, heading, length, width) at the same frames, NaN where absent.
        step_s: time between frames.
        horizon_s: the longest time looked for. Ours: nobody calls two passages 10 s apart a conflict.

    Returns:
        s: 0 when they touch, infinity when there is no common spot within the horizon.
    """
    frames = min(len(a), len(b))
    for lag in range(min(frames, round(horizon_s / step_s) + 1)):
        early, late = slice(0, frames - lag), slice(lag, frames)
        if box_overlap(a[early], b[late]).any() or box_overlap(b[early], a[late]).any():
            return lag * step_s
    return inf


def minimum_distance(a: FloatArray, b: FloatArray) -> tuple[float, int]:
    """Return the smallest distance (m) between two footprints and the first frame where it occurs.

    Args:
        a, b: [T, 5] footprints at the same frames, NaN where absent.

    Returns:
        (infinity, -1) when they are never there together.
    """
    distance = pairwise_box_distance(a, b)
    if not len(distance) or np.isnan(distance).all():
        return inf, -1
    frame = int(np.nanargmin(distance))
    return float(distance[frame]), frame


def _velocity(bodies: FloatArray) -> FloatArray:
    heading, speed = bodies[..., 2], bodies[..., 3]
    return np.stack([speed * np.cos(heading), speed * np.sin(heading)], axis=-1)


def _extent(bodies: FloatArray, angle: FloatArray) -> FloatArray:
    """Length of each body's shadow on a line in direction `angle`."""
    turned = angle - bodies[..., 2]
    shadow: FloatArray = bodies[..., 4] * np.abs(np.cos(turned)) + bodies[..., 5] * np.abs(np.sin(turned))
    return shadow
