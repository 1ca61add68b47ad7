"""The rankers `selforacle` and `selforacle_conv`: they rank parts of a run whose pictures an autoencoder reconstructs
badly.

The parts are segments between consecutive waypoints, each with the mean of its pictures' reconstruction errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.protocol import RiskyPoint, Surroundings
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y
from foresee_study.selforacle.pictures import classes_seen, looked_at, pictures_of
from foresee_study.selforacle.watcher import watcher_of

_BACK, _ON = 3, 30
"""The next waypoint that the ego passes is searched among this number of waypoints behind the last passed one and ahead
of it. Ours: 6 m and 60 m of route, so that a route that returns to a place is not cut short at that place."""


@dataclass(frozen=True)
class SelfOracleSettings:
    """Settings that the paper leaves open.

    Attributes:
        same_moment_s: a segment counts as the same moment as a better segment if their middles are less than this
            apart, s. Ours: 1 s, as for the encounters of the forecaster; neighbouring segments of 2 m show almost the
            same picture.
    """

    same_moment_s: float = 1.0


@dataclass(frozen=True)
class SelfOracleRanker:
    """Ranks the segments above the threshold, the largest error first (paper, section 4.3.1); the point is a segment's
    middle.

    A segment below the threshold counts as nominal and gives no risky point, so there are as many points as alarms.
    """

    settings: SelfOracleSettings = field(default_factory=SelfOracleSettings)
    surroundings: Surroundings | None = None
    name: str = "selforacle"

    def within(self, surroundings: Surroundings) -> Self:
        """Return the ranker of runs in these surroundings; see `NeedsSurroundings`."""
        return replace(self, surroundings=surroundings)

    def weights_hash(self, driver: str) -> str:
        """Return the hash of the weights and the threshold for a driver; see `Learned`."""
        return watcher_of(self.name, driver).sha256

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the segments of a run; see `Ranker.rank`. The seed has no effect.

        Raises:
            ForeseeError: there are no weights for the run's driver, or the surroundings are not known.
        """
        del seed, after_s
        threshold = watcher_of(self.name, _driver_of(trace)).threshold
        earliest = math.ceil(before_s / STEP_S - 1e-9)
        alarms = [s for s in self.segments(trace) if s.error > threshold and s.middle >= earliest]
        chosen: list[Segment] = []
        for segment in sorted(alarms, key=lambda s: (-s.error, s.first)):
            if all(abs(segment.middle - other.middle) * STEP_S >= self.settings.same_moment_s for other in chosen):
                chosen.append(segment)
        return tuple(_point(trace, segment, rank, threshold) for rank, segment in enumerate(chosen, start=1))

    def segments(self, trace: Trace) -> list[Segment]:
        """Return all segments of a run, in the order of time, with their errors.

        Raises:
            ForeseeError: see `rank`.
        """
        if self.surroundings is None:
            raise ForeseeError(
                f"the ranker {self.name} draws the camera's pictures, for which it needs the run's test case"
            )
        watcher = watcher_of(self.name, _driver_of(trace))
        frames = looked_at(trace)
        errors = watcher.errors(pictures_of(classes_seen(trace, self.surroundings, frames)))
        return segments_of(trace, frames, errors)


@dataclass(frozen=True)
class ConvolutionalRanker(SelfOracleRanker):
    """The ranker `selforacle_conv`: the same as `selforacle`, but with a convolutional autoencoder."""

    name: str = "selforacle_conv"


def _driver_of(trace: Trace) -> str:
    return str(trace.meta.get("driver", ""))


def _point(trace: Trace, segment: Segment, rank: int, threshold: float) -> RiskyPoint:
    times, at = segment.error / threshold, segment.middle
    why = f"unusual picture: error {times:.2f} times the threshold at {trace.time_s[at]:.2f} s"
    return RiskyPoint.without_actor(trace, rank, at, round(times, 6), why)


# ---- the segments of a run -------------------------------------------------------------------------------------------


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
