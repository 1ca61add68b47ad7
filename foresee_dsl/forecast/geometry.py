"""Computes distances, minima and paths over whole traces with numpy or compiled kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foresee_dsl.kernels import lines
from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.kernels.boxes import ever_within, gaps_to_first
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y


def distances_to_ego(trace: Trace, actors: Sequence[int], within_m: FloatArray | None = None) -> FloatArray:
    """Return the distances between the footprints of the ego and of K actors, [K, T], m.

    A distance is infinite where one of them is absent, and where the distance between the centres shows already that it
    exceeds the actor's radius in `within_m`, [K] m.
    """
    columns, radii = [0, *actors], np.full(len(actors), np.inf) if within_m is None else _whole(within_m)
    poses = trace.states[:, columns][..., [X, Y, HEADING]].transpose(1, 0, 2)
    gaps: FloatArray = gaps_to_first(_whole(poses), _sizes(trace, columns), radii)
    return gaps


def ever_near(trace: Trace, actor: int, ways: FloatArray, first: int, radius_m: float) -> bool:
    """Return whether the ego, on any of N other ways, comes within a radius of an actor on its recorded way.

    `ways`: [N, T, 3] poses of the ego from frame `first` on. `radius_m`: largest distance between the footprints.
    """
    other = trace.states[first : first + ways.shape[1], actor][:, [X, Y, HEADING]]
    return bool(ever_within(_whole(ways), _whole(other), _sizes(trace, [0, actor]), radius_m))


def _sizes(trace: Trace, actors: Sequence[int]) -> FloatArray:
    return np.array([(trace.actors[k].length_m, trace.actors[k].width_m) for k in actors])


def local_minima(distance_m: FloatArray, *, within_m: float, prominence_m: float) -> list[tuple[int, int]]:
    """Return every local minimum of a distance that is within a radius.

    A plateau counts once; the first and the last frame of an actor's presence count where the distance falls towards
    them.

    Args:
        distance_m: [T], infinite where an actor is absent.
        within_m: larger minima are left out.
        prominence_m: two minima count as one if, between their frames, the distance rises by less than this above the
            larger minimum.

    Returns:
        For each minimum its frame, and the last frame up to which the distance exceeds the minimum by less than the
        prominence (the end of a plateau). In order of time.
    """
    if not (distance_m <= within_m).any():
        return []
    starts = np.concatenate(([0], np.flatnonzero(distance_m[1:] != distance_m[:-1]) + 1))
    value = np.concatenate(([np.inf], distance_m[starts], [np.inf]))
    here = value[1:-1]
    minima: list[int] = []
    for frame in starts[(here < value[:-2]) & (here < value[2:]) & (here <= within_m)].tolist():
        if minima:
            now, previous = distance_m[frame], distance_m[minima[-1]]
            if distance_m[minima[-1] : frame].max() - max(now, previous) < prominence_m:
                minima[-1] = frame if now < previous else minima[-1]
                continue
        minima.append(frame)
    return [(frame, _valley_end(distance_m, frame, prominence_m)) for frame in minima]


def _valley_end(distance_m: FloatArray, frame: int, prominence_m: float) -> int:
    above = np.flatnonzero(distance_m[frame:] >= distance_m[frame] + prominence_m)
    return frame + int(above[0]) - 1 if above.size else len(distance_m) - 1


def thinned_path(points: FloatArray, step_m: float) -> FloatArray:
    """Return a recorded path without absent points, and with points at least `step_m` apart, [N, 2].

    The last point is kept. For an actor that stood, the path has one point or none.
    """
    points = np.asarray(points[~np.isnan(points).any(axis=1)], dtype=np.float64)
    if len(points) < 2:
        return points
    steps = points[1:] - points[:-1]
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))))
    if gone[-1] < step_m:
        return points[:1]
    keep = np.zeros(len(points), dtype=np.bool_)
    keep[np.searchsorted(gone, np.arange(0.0, gone[-1], step_m))] = True
    keep[-1] = True
    thinned: FloatArray = points[keep]
    return thinned


def feet_on_path(points: FloatArray, path: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the distances of points [N, 2] to a polyline [M, 2], M >= 1: [N] m.

    Also return, [N], whether the nearest point of the line lies beside the point, rather than at an end of the line.
    """
    if len(path) < 2:
        return np.hypot(*(points - path[0]).T), np.zeros(len(points), dtype=np.bool_)
    gap, share = np.empty(len(points)), np.empty(len(points))
    nearest = np.empty(len(points), dtype=np.int64)
    lines.feet_on_path(_whole(points), _whole(path), gap, nearest, share)
    beyond = ((nearest == 0) & (share < 0.0)) | ((nearest == len(path) - 2) & (share > 1.0))
    return gap, ~beyond


def paths_cut(a: FloatArray, b: FloatArray, *, angle_rad: float) -> bool:
    """Return whether two polylines ([N, 2], [M, 2]) intersect at an angle of at least `angle_rad`."""
    return bool(lines.paths_cut(_whole(a), _whole(b), math.sin(angle_rad)))


def enters_from_side(points: FloatArray, path: FloatArray, *, half_width_m: float) -> bool:
    """Return whether a recorded path ([N, 2]) enters the corridor along another ([M, 2]) from the side.

    A path that lies in the corridor from the beginning, or enters it at an end (a leader, a follower), does not count.
    """
    if not len(points) or len(path) < 2:
        return False
    gap, beside = feet_on_path(points, path)
    inside = (gap <= half_width_m) & beside
    return bool((inside[1:] & ~inside[:-1] & beside[:-1]).any())


def _whole(points: FloatArray) -> FloatArray:
    return np.ascontiguousarray(points, dtype=np.float64)
