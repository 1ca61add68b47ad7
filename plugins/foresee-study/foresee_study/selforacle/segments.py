"""Divides a run into segments between consecutive waypoints, each with the mean of its pictures'
reconstruction errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.trace import Trace, X, Y

_BACK, _ON = 3, 30
"""The next waypoint that the ego passes is searched among this number of waypoints behind the last passed one and ahead
of it. Ours: 6 m and 60 m of route, so that a route that returns to a place is not cut short at that place."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a run between two waypoints. `first`, `last`: its frames. `error`: mean error of its pictures."""

    first: int
    last: int
    error: float

    @property
    def middle(self) -> int:
        """Return the frame in the middle of the segment."""
        return (self.first + self.last) // 2


def segments_of(trace: Trace, frames: NDArray[np.intp], errors: FloatArray) -> list[Segment]:
    """Return a run's segments in the order of time, without the segments that have no picture.

    Args:
        trace: the run.
        frames: [N] frames of which pictures were drawn.
        errors: [N] the reconstruction errors of these pictures.
    """
    passed = waypoints_passed(trace)
    changes = np.flatnonzero(np.diff(passed)) + 1
    starts = np.concatenate(([0], changes))
    ends = np.concatenate((changes - 1, [trace.frames - 1]))
    segments = []
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        inside = (frames >= first) & (frames <= last)
        if inside.any():
            segments.append(Segment(first, last, float(errors[inside].mean())))
    return segments


def waypoints_passed(trace: Trace) -> NDArray[np.intp]:
    """Return the number of waypoints that the ego had passed at each frame, [T]; the number never decreases."""
    points, ego = trace.waypoints, trace.states[:, 0, [X, Y]]
    passed = np.zeros(trace.frames, np.intp)
    if len(points) < 2:
        return passed
    ahead = np.gradient(points, axis=0)
    at = 0
    for frame, place in enumerate(ego):
        low, high = max(at - _BACK, 0), min(at + _ON, len(points))
        offset = place - points[low:high]
        gaps = np.hypot(offset[:, 0], offset[:, 1])
        nearest = int(gaps.argmin()) if frame else int(np.hypot(*(place - points).T).argmin())
        k = low + nearest if frame else nearest
        beyond = float((place - points[k]) @ ahead[k]) >= 0
        at = max(at, k + beyond)
        passed[frame] = at
    return passed
