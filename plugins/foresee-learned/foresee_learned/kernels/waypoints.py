"""Kernels for a path of waypoints: the point to steer for, and how far the others allow the ego to drive along it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.boxes import Box, overlap
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, TABLE, compiled, inner
from foresee_dsl.kernels.records import array_of

Record = Any
"""A record within a kernel."""


class Rules(NamedTuple):
    """The ego's footprint, and the rules by which others limit its way (the driver's settings explain the values).

    Attributes:
        length, width: size of the ego, m.
        margin: free length in front of another, side: free width on either side, m.
        small, small_margin: an object shorter than `small` is enlarged by `small_margin` on each side, m.
        beside: apparent overlap with an object beside the ego that is tolerated, m.
        sample: distance between the places of the ego along the path that are examined, m.
        step: time between two limits, s.
        soon: an object limits the way if it is in the way by this time, s; slow_soon: the same for objects slower than
            `slow`, m/s.
        standing: objects slower than this stand, m/s.
    """

    length: float
    width: float
    margin: float
    side: float
    small: float
    small_margin: float
    beside: float
    sample: float
    step: float
    soon: float
    slow: float
    slow_soon: float
    standing: float


RULES = array_of(Rules)
_SLACK_S = 1e-9


@inner
def _lengths(path: FloatArray) -> FloatArray:
    """Return the lengths along a polyline at its points, [N] m."""
    along = np.zeros(path.shape[0])
    for k in range(1, path.shape[0]):
        along[k] = along[k - 1] + np.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
    return along


@inner
def _at(s: float, along: FloatArray, values: FloatArray) -> float:
    """Return an interpolated value; the operations are in the same order as in `numpy.interp`, so that the result has
    the same bits.
    """
    last = along.shape[0] - 1
    if s <= along[0]:
        return float(values[0])
    if s >= along[last]:
        return float(values[last])
    k = 0
    while along[k + 1] <= s:
        k += 1
    if along[k] == s:
        return float(values[k])
    return float((values[k + 1] - values[k]) / (along[k + 1] - along[k]) * (s - along[k]) + values[k])


@compiled(TABLE, FLOAT, FLOAT, FLOAT)
def aim(path: FloatArray, x: float, y: float, ahead_m: float) -> FloatArray:
    """Return [3]: x and y of a point of a path ([N, 2] m), and the path's length, m. The point is `ahead_m` along the
    path beyond the path's nearest point to x, y.

    Beyond its end the path continues straight, in the direction of its last metre, because single waypoints of a slow
    car are close together and jitter.
    """
    along = _lengths(path)
    nearest, foot, whole = np.inf, 0.0, along[-1]
    for k in range(path.shape[0] - 1):
        dx, dy = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        away_x, away_y = x - path[k, 0], y - path[k, 1]
        squared = dx * dx + dy * dy
        share = min(max((away_x * dx + away_y * dy) / max(squared, 1e-9), 0.0), 1.0)
        off_x, off_y = away_x - share * dx, away_y - share * dy
        off = off_x * off_x + off_y * off_y
        if off < nearest:
            nearest, foot = off, along[k] + share * np.sqrt(squared)
    xs, ys = path[:, 0], path[:, 1]
    target = np.empty(3)
    target[2] = whole
    s = foot + ahead_m
    if s <= whole:
        target[0], target[1] = _at(s, along, xs), _at(s, along, ys)
        return target
    back = max(whole - 1.0, 0.0)
    back_x, back_y = _at(back, along, xs), _at(back, along, ys)
    share = (s - back) / (whole - back)
    target[0], target[1] = back_x + share * (xs[-1] - back_x), back_y + share * (ys[-1] - back_y)
    return target


@compiled(TABLE, TABLE, FLOATS, FLOATS, RULES)
def bounds(
    waypoints: FloatArray, others: FloatArray, times_s: FloatArray, ends_s: FloatArray, rules: Records
) -> FloatArray:
    """Return how far along a path each of the others allows the ego to go, [others, ends] m; infinite without a limit.

    Args:
        waypoints: [N, 2] m ahead and to the left; the ego is at 0, 0.
        others: [K, 6] ahead, left (m), heading (rad), length, width (m), speed (m/s).
        times_s: times at which the others are placed.
        ends_s: times of the limits.
        rules: [1].
    """
    rule = rules[0]
    limits = np.full((others.shape[0], ends_s.shape[0]), np.inf)
    places = _places(waypoints, rule["sample"])
    if places.shape[0] == 0:
        return limits
    blocked = np.empty(times_s.shape[0])
    for k in range(others.shape[0]):
        if _blocked(places, others[k], times_s, rule, blocked):
            _bound(blocked, others[k], times_s, ends_s, rule, limits[k])
    return limits


@inner
def _places(waypoints: FloatArray, sample: float) -> FloatArray:
    """Return the ego's places along the waypoints, [K, 4]: length along them (m), x, y (m), heading (rad)."""
    path = np.zeros((waypoints.shape[0] + 1, 2))
    path[1:] = waypoints
    s = _lengths(path)
    whole = s[-1]
    if whole < sample:
        return np.empty((0, 4))
    places = np.zeros((int(np.ceil(whole / sample)), 4))
    for k in range(places.shape[0]):
        along = k * sample
        places[k, 0], places[k, 1], places[k, 2] = along, _at(along, s, path[:, 0]), _at(along, s, path[:, 1])
        if k > 0:
            # The heading is that of a chord of a metre, because waypoints of a slow car are close together and jitter.
            before, after = max(along - sample, 0.0), min(along + sample, whole)
            dx = _at(after, s, path[:, 0]) - _at(before, s, path[:, 0])
            dy = _at(after, s, path[:, 1]) - _at(before, s, path[:, 1])
            places[k, 3] = np.arctan2(dy, dx)
    return places


@inner
def _blocked(places: FloatArray, other: FloatArray, times_s: FloatArray, rule: Record, blocked: FloatArray) -> bool:
    """Write, for each of the times, the smallest length along the path at which the ego would meet another actor, m;
    infinite if it would not meet it.

    Return whether it meets the actor at any of the times.
    """
    ahead, left, heading, length, width, speed = other[0], other[1], other[2], other[3], other[4], other[5]
    if length < rule["small"]:
        length, width = length + 2.0 * rule["small_margin"], width + 2.0 * rule["small_margin"]
    if speed < rule["standing"]:
        speed = 0.0
    cos, sin = np.cos(heading), np.sin(heading)
    wide = rule["width"] + 2.0 * rule["side"]
    reach = (np.hypot(rule["length"], wide) + np.hypot(length, width)) / 2.0
    # An object that touches the wider footprint where the ego is now, but is beside it, is being passed, not
    # approached.
    across = (abs(length * sin) + abs(width * cos)) / 2.0
    beside = abs(left) - across >= rule["width"] / 2.0 - rule["beside"]
    meets = False
    for t in range(times_s.shape[0]):
        x, y = ahead + speed * times_s[t] * cos, left + speed * times_s[t] * sin
        blocked[t] = np.inf
        for k in range(places.shape[0]):
            # Circles around the boxes are compared first, because hardly any other is near.
            dx, dy = x - places[k, 1], y - places[k, 2]
            if dx * dx + dy * dy <= reach * reach and overlap(
                Box(places[k, 1], places[k, 2], places[k, 3], rule["length"], wide), Box(x, y, heading, length, width)
            ):
                if t == 0 and k == 0 and beside:
                    blocked[:] = np.inf
                    return False
                blocked[t] = places[k, 0]
                meets = True
                break
    return meets


@inner
def _bound(
    blocked: FloatArray, other: FloatArray, times_s: FloatArray, ends_s: FloatArray, rule: Record, limits: FloatArray
) -> None:
    """Write, for each step, how far another actor allows the ego to drive along the path until the step's end, m.

    A step's limit is the smallest length at the times around the step's end, as in InterFuser, because the other actor
    may be half a step late.
    """
    speed = other[5]
    soon_s = rule["slow_soon"] if speed < rule["slow"] else rule["soon"]
    binds = False
    for t in range(times_s.shape[0]):
        binds = binds or (times_s[t] <= soon_s and np.isfinite(blocked[t]))
    if not binds:
        return
    on_mps = max((speed if speed >= rule["standing"] else 0.0) * np.cos(other[2]), 0.0)
    for k in range(ends_s.shape[0]):
        least, near = np.inf, False
        for t in range(times_s.shape[0]):
            if abs(times_s[t] - ends_s[k]) <= rule["step"] + _SLACK_S:
                least, near = min(least, blocked[t]), True
        if not near:
            # After the predicted time the actor is assumed to move along the way as fast as it moves ahead now.
            least = blocked[-1] + on_mps * (ends_s[k] - times_s[-1])
        limits[k] = max(least - rule["margin"], 0.0)
