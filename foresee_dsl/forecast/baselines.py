"""The rankers with which the paper compares its forecaster (section 4.3), except the learned one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from foresee_dsl.forecast.foresee import close_encounters, passes
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

_REACHED_M = 2.0
"""Distance to the recorded path above which a waypoint was not reached, m. Ours: the spacing of the waypoints."""


@dataclass(frozen=True)
class ProximityRanker:
    """Ranks by step 1a only: each close encounter, in order of appearance (paper, section 4.3.2)."""

    settings: ForeseeSettings = field(default_factory=ForeseeSettings)
    name: str = "proximity"

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the close encounters of a run; see `Ranker.rank`. The seed has no effect."""
        del seed, after_s
        encounters = close_encounters(trace, self.settings, before_s=before_s)
        return tuple(
            RiskyPoint(
                rank=rank,
                frame=e.frame,
                time_s=float(trace.time_s[e.frame]),
                actor=trace.actors[e.actor].id,
                group="close",
                distance_m=e.distance_m,
                trajectory_distance_m=math.nan,
                score=1 / rank,
                why=f"close: {passes(trace, e)}",
            )
            for rank, e in enumerate(encounters, start=1)
        )


@dataclass(frozen=True)
class RandomRanker:
    """Ranks the waypoints of the ego's route in random order, without replacement, each at the frame where the ego was
    nearest.

    Waypoints that the ego did not reach, or reached in the first `before_s` seconds, are left out; two waypoints at one
    frame count once.
    """

    name: str = "random"

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Draw moments of a run; see `Ranker.rank`."""
        del after_s
        frames = _waypoint_frames(trace)
        frames = frames[frames >= math.ceil(before_s / STEP_S - 1e-9)]
        drawn = np.random.default_rng(np.random.SeedSequence(seed)).permutation(frames)
        return tuple(
            RiskyPoint.without_actor(
                trace, rank, int(frame), 1 / rank, f"random waypoint, passed at {trace.time_s[frame]:.2f} s"
            )
            for rank, frame in enumerate(drawn, start=1)
        )


@dataclass(frozen=True)
class ExhaustiveRanker:
    """Ranks every whole second from `before_s` on (paper, section 4.3.1), in order of time."""

    name: str = "exhaustive"

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """List the seconds of a run; see `Ranker.rank`. The seed has no effect."""
        del seed, after_s
        seconds = range(math.ceil(before_s - 1e-9), math.floor(trace.duration_s + 1e-9) + 1)
        return tuple(
            RiskyPoint.without_actor(trace, rank, trace.frame_at(second), 1 / rank, f"every second: {second:.2f} s")
            for rank, second in enumerate(seconds, start=1)
        )


def _waypoint_frames(trace: Trace) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the frames at which the ego was nearest to each waypoint that it reached, ascending."""
    if not len(trace.waypoints) or not trace.frames:
        return np.empty(0, dtype=np.intp)
    ego = trace.states[:, 0, [X, Y]]
    gaps = np.hypot(*np.moveaxis(trace.waypoints[:, None, :] - ego[None], -1, 0))
    gaps = np.where(np.isnan(gaps), np.inf, gaps)
    nearest = gaps.argmin(axis=1)
    reached = gaps[np.arange(len(gaps)), nearest] <= _REACHED_M
    return np.unique(nearest[reached])
