"""Distances, minima and paths over whole traces, vectorised."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.simulate.collision import pairwise_box_distance
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


def footprints(trace: Trace, actor: int) -> FloatArray:
    """Return an actor's boxes, [T, 5]: x, y of the centre (m), heading (rad), length, width (m); NaN where absent."""
    info = trace.actors[actor]
    boxes = np.empty((trace.frames, 5))
    boxes[:, :3] = trace.states[:, actor, [X, Y, HEADING]]
    boxes[:, 3:] = (info.length_m, info.width_m)
    return boxes


def distances_to_ego(trace: Trace, actor: int, *, within_m: float = math.inf) -> FloatArray:
    """Return the distance between the footprints of the ego and an actor, [T], m.

    Infinite where one of them is absent, and where the centres alone say that it exceeds `within_m`: those frames are
    not computed.
    """
    ego, other = footprints(trace, 0), footprints(trace, actor)
    result = np.full(trace.frames, np.inf)
    centres = np.hypot(ego[:, 0] - other[:, 0], ego[:, 1] - other[:, 1])
    reach = (math.hypot(*ego[0, 3:]) + math.hypot(*other[0, 3:])) / 2 if trace.frames else 0.0
    near = np.flatnonzero(centres <= within_m + reach)  # NaN compares false: absent
    if near.size:
        result[near] = pairwise_box_distance(ego[near], other[near])
    return result


def local_minima(distance_m: FloatArray, *, within_m: float, prominence_m: float) -> list[tuple[int, int]]:
    """Find every local minimum of a distance that is within a radius.

    A plateau counts once; the first and the last frame of an actor's presence count where the distance falls towards
    them.

    Args:
        distance_m: [T], infinite where there is none.
        within_m: larger minima are left out.
        prominence_m: two minima between which the distance rises by less than this over the farther one are one.

    Returns:
        Of each minimum the frame, and the last frame up to which the distance stays within the prominence of it (the
        end of a plateau), in order of time.
    """
    if not distance_m.size:
        return []
    starts = np.flatnonzero(np.r_[True, distance_m[1:] != distance_m[:-1]])
    value = distance_m[starts]
    before, after = np.r_[np.inf, value[:-1]], np.r_[value[1:], np.inf]
    kept: list[int] = []
    for frame in starts[(value < before) & (value < after) & (value <= within_m)].tolist():
        if kept:
            here, previous = distance_m[frame], distance_m[kept[-1]]
            if distance_m[kept[-1] : frame].max() - max(here, previous) < prominence_m:
                kept[-1] = frame if here < previous else kept[-1]
                continue
        kept.append(frame)
    return [(frame, _valley_end(distance_m, frame, prominence_m)) for frame in kept]


def _valley_end(distance_m: FloatArray, frame: int, prominence_m: float) -> int:
    above = np.flatnonzero(distance_m[frame:] >= distance_m[frame] + prominence_m)
    return frame + int(above[0]) - 1 if above.size else len(distance_m) - 1


def thinned_path(points: FloatArray, step_m: float) -> FloatArray:
    """Return a recorded path without absent points and with points at least `step_m` apart, [N, 2].

    The last point is kept. One point (or none) is left of an actor that stood.
    """
    points = np.asarray(points[~np.isnan(points).any(axis=1)], dtype=np.float64)
    if len(points) < 2:
        return points
    gone = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    if gone[-1] < step_m:
        return points[:1]
    marks = np.arange(0.0, gone[-1], step_m)
    keep = np.unique(np.r_[np.searchsorted(gone, marks), len(points) - 1])
    thinned: FloatArray = points[keep]
    return thinned


def feet_on_path(points: FloatArray, path: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Project points onto a polyline.

    Args:
        points: [N, 2]. path: [M, 2], M >= 1.

    Returns:
        The distance to the polyline, [N], m; and whether the foot lies beside it, [N], rather than beyond an end.
    """
    if len(path) < 2:
        return np.hypot(*(points - path[0]).T), np.zeros(len(points), dtype=np.bool_)
    start, along = path[:-1], np.diff(path, axis=0)
    squared = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.einsum("nmk,mk->nm", points[:, None, :] - start[None], along) / squared
    feet = start[None] + np.clip(share, 0.0, 1.0)[..., None] * along[None]
    gaps = np.hypot(*np.moveaxis(points[:, None, :] - feet, -1, 0))
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(points))
    at = share[rows, nearest]
    beyond = ((nearest == 0) & (at < 0.0)) | ((nearest == len(along) - 1) & (at > 1.0))
    return gaps[rows, nearest], ~beyond


def paths_cut(a: FloatArray, b: FloatArray, *, angle_rad: float) -> bool:
    """Say whether two polylines ([N, 2], [M, 2]) cut each other at an angle of at least `angle_rad`."""
    if len(a) < 2 or len(b) < 2:
        return False
    p, r = a[:-1][:, None], np.diff(a, axis=0)[:, None]
    q, s = b[:-1][None], np.diff(b, axis=0)[None]
    cross = r[..., 0] * s[..., 1] - r[..., 1] * s[..., 0]
    apart = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (apart[..., 0] * s[..., 1] - apart[..., 1] * s[..., 0]) / cross
        u = (apart[..., 0] * r[..., 1] - apart[..., 1] * r[..., 0]) / cross
        sine = np.abs(cross) / (np.hypot(r[..., 0], r[..., 1]) * np.hypot(s[..., 0], s[..., 1]))
        hit = (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1) & (sine >= math.sin(angle_rad))
    return bool(hit.any())


def enters_from_side(points: FloatArray, path: FloatArray, *, half_width_m: float) -> bool:
    """Say whether a recorded path ([N, 2]) comes into the corridor along another ([M, 2]) across its side.

    One that lies in the corridor from the beginning, or comes in over an end of it (a leader, a follower), does not.
    """
    if not len(points) or len(path) < 2:
        return False
    gap, beside = feet_on_path(points, path)
    inside = (gap <= half_width_m) & beside
    return bool((inside[1:] & ~inside[:-1] & beside[:-1]).any())
