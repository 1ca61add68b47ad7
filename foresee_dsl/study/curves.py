"""Cumulative failures over time: the runs of a campaign in the order in which it makes them, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.study.measured import Child, Measured, MeasuredClip
from foresee_dsl.study.statistics.bootstrap import Interval, percentiles

RESAMPLES = 1000
"""Ours: each resample is a campaign of its own to go through, 1 ms each."""
SEED = 20_26


class Clock(StrEnum):
    """What time is counted."""

    SIMULATED = "simulated"
    WALL = "wall"


@dataclass(frozen=True)
class Curve:
    """Collisions over time.

    Attributes:
        times_s: when each was found, rising. end_s: when the campaign was over.
    """

    times_s: FloatArray
    end_s: float

    def area(self, end_s: float) -> float:
        """Return the area under it up to a time, in collisions times seconds; after its end it stays flat."""
        return float(np.maximum(end_s - self.times_s, 0.0).sum())

    def at(self, time_s: float) -> int:
        """Return how many were found by then."""
        return int(np.searchsorted(self.times_s, time_s, side="right"))

    @property
    def per_hour(self) -> float:
        """Collisions an hour; NaN of a campaign that took no time."""
        return len(self.times_s) / (self.end_s / 3600) if self.end_s else float("nan")


def curve(measured: Measured, clock: Clock = Clock.SIMULATED) -> Curve:
    """Return the curve of a campaign: clips of first rank with their children, then those of second rank, and so on.

    As in the paper, the clock begins after the test cases' own runs, which every ranker has in common. Within a rank
    the test cases follow each other in the order of their names' hashes, so that no family is always the last.
    """
    return _curve(list(_runs(measured, clock)))


@dataclass(frozen=True)
class _Part:
    """A clip with its children: how long they took, and when collisions were found, from its beginning."""

    case: int
    position: int
    times_s: FloatArray
    took_s: float


def _runs(measured: Measured, clock: Clock) -> Iterator[_Part]:
    from hashlib import sha256

    def length(run: MeasuredClip | Child) -> float:
        return run.simulated_s if clock is Clock.SIMULATED else run.wall_s

    ordered = sorted(measured.usable, key=lambda case: sha256(case.name.encode()).digest())
    parts = []
    for number, case in enumerate(ordered):
        for clip in case.clips:
            ends = np.cumsum([length(clip), *map(length, clip.children)])
            found = np.array([child.verdict.is_collision for child in clip.children], dtype=bool)
            parts.append(_Part(number, clip.position, ends[1:][found], float(ends[-1])))
    yield from sorted(parts, key=lambda part: (part.position, part.case))


def _curve(parts: Sequence[_Part]) -> Curve:
    starts = np.concatenate([[0.0], np.cumsum([part.took_s for part in parts])])
    times = [part.times_s + start for part, start in zip(parts, starts, strict=False)]
    return Curve(np.concatenate(times) if times else np.zeros(0), float(starts[-1]))


@dataclass(frozen=True)
class Areas:
    """The areas under two curves up to a common end, of all repetitions together.

    Attributes:
        first, second: the areas, collisions times seconds. end_s: the mean of the ends. interval: of the ratio.
    """

    first: float
    second: float
    end_s: float
    interval: Interval

    @property
    def ratio(self) -> float:
        """How many times the second the first is; NaN over 0."""
        return self.first / self.second if self.second else float("nan")


def compared_areas(
    first: Sequence[Measured], second: Sequence[Measured], clock: Clock = Clock.SIMULATED, *, latest: bool = False
) -> Areas:
    """Compare two rankers' areas, repetition by repetition.

    The common end is the earlier of the two, so that both had equal time; with `latest` the later one, and the curve
    that ended first stays flat until then.
    """
    sides = [(list(_runs(a, clock)), list(_runs(b, clock))) for a, b in zip(first, second, strict=False)]
    areas = [_areas(a, b, latest=latest) for a, b in sides]
    count = max((part.case + 1 for pair in sides for parts in pair for part in parts), default=0)
    rng = np.random.default_rng(SEED)
    ratios = []
    for _ in range(RESAMPLES if count else 0):
        drawn = rng.multinomial(count, np.full(count, 1 / count))
        both = [_areas(_drawn(a, drawn), _drawn(b, drawn), latest=latest) for a, b in sides]
        ratios.append(np.divide(sum(x[0] for x in both), sum(x[1] for x in both) or np.nan))
    totals = [float(sum(one[k] for one in areas)) for k in range(3)]
    return Areas(totals[0], totals[1], totals[2] / max(len(areas), 1), percentiles(np.array(ratios, dtype=float)))


def _areas(first: Sequence[_Part], second: Sequence[_Part], *, latest: bool) -> tuple[float, float, float]:
    curves = _curve(first), _curve(second)
    end_s = (max if latest else min)(one.end_s for one in curves)
    return curves[0].area(end_s), curves[1].area(end_s), end_s


def _drawn(parts: Sequence[_Part], times: np.ndarray[tuple[int], np.dtype[np.int64]]) -> list[_Part]:
    return [part for part in parts for _ in range(times[part.case])]
