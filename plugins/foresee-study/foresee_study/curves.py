"""Cumulative failures over time: the runs of a campaign in the order in which it makes them, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from hashlib import sha256

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_study.measured import Child, Measured, MeasuredClip
from foresee_study.statistics.bootstrap import Interval, percentiles

RESAMPLES = 1000
"""How often the test cases are drawn anew. Ours: each draw takes 0.1 ms."""
SEED = 20_26


class Clock(StrEnum):
    """What time is counted."""

    SIMULATED = "simulated"
    WALL = "wall"

    def of(self, took: Child | MeasuredClip | Measured) -> float:
        """Return the time that something took, s."""
        return took.simulated_s if self is Clock.SIMULATED else took.wall_s


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


@dataclass(frozen=True)
class _Parts:
    """The clips of a campaign with their children, in order.

    Attributes:
        case: the number of each one's test case. took_s: how long it took. found_s: when its collisions were found,
            from its beginning. count, sum_s: how many these are, and the sum of these times.
    """

    case: IntArray
    took_s: FloatArray
    found_s: tuple[FloatArray, ...]
    count: FloatArray
    sum_s: FloatArray

    def end_s(self, times: FloatArray) -> float:
        """Return how long all of them take, each as many times as `times` says."""
        return float(times @ self.took_s)

    def area(self, times: FloatArray, end_s: float) -> float:
        """Return the area under their curve up to a time, with each of them in a row as many times as `times` says."""
        ends = np.cumsum(times * self.took_s)
        starts = ends - times * self.took_s
        whole = ends <= end_s
        # A part that is there k times begins at its start, one length later, and so on.
        all_s = times * self.count * starts + self.count * self.took_s * times * (times - 1) / 2 + times * self.sum_s
        area = float((times * self.count * end_s - all_s)[whole].sum())
        for k in np.flatnonzero(~whole & (starts < end_s)):
            for again in range(int(times[k])):
                found = starts[k] + again * self.took_s[k] + self.found_s[k]
                area += float(np.maximum(end_s - found, 0.0).sum())
        return area


def _parts(measured: Measured, clock: Clock) -> _Parts:
    ordered = sorted(measured.usable, key=lambda case: sha256(case.name.encode()).digest())
    rows = []
    for number, case in enumerate(ordered):
        for clip in case.clips:
            ends = np.cumsum([clock.of(clip), *map(clock.of, clip.children)])
            collided = np.array([child.verdict.is_collision for child in clip.children], dtype=bool)
            rows.append((clip.position, number, float(ends[-1]), ends[1:][collided]))
    rows.sort(key=lambda row: row[:2])
    found = tuple(row[3] for row in rows)
    return _Parts(
        case=np.array([row[1] for row in rows], dtype=np.int64),
        took_s=np.array([row[2] for row in rows]),
        found_s=found,
        count=np.array([len(one) for one in found], dtype=float),
        sum_s=np.array([one.sum() for one in found]),
    )


def curve(measured: Measured, clock: Clock = Clock.SIMULATED) -> Curve:
    """Return the curve of a campaign: clips of first rank with their children, then those of second rank, and so on.

    As in the paper, the clock begins after the test cases' own runs, which every ranker has in common. Within a rank
    the test cases follow each other in the order of their names' hashes, so that no family is always the last.
    """
    parts = _parts(measured, clock)
    starts = np.concatenate([[0.0], np.cumsum(parts.took_s)])
    times = [found + start for found, start in zip(parts.found_s, starts, strict=False)]
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
        """The first area divided by the second; NaN where that is 0."""
        return self.first / self.second if self.second else float("nan")


def compared_areas(
    first: Sequence[Measured], second: Sequence[Measured], clock: Clock = Clock.SIMULATED
) -> tuple[Areas, Areas]:
    """Compare two rankers' areas, repetition by repetition: up to the earlier end, and up to the later one.

    Up to the earlier of the two ends both had equal time; up to the later one the curve that ended first stays flat.
    """
    sides = [(_parts(a, clock), _parts(b, clock)) for a, b in zip(first, second, strict=False)]
    count = max((int(parts.case.max(initial=-1)) + 1 for pair in sides for parts in pair), default=0)
    rng = np.random.default_rng(SEED)
    drawn_times = rng.multinomial(count, np.full(count, 1 / count), size=RESAMPLES) if count else np.zeros((0, 0))
    times: FloatArray = drawn_times.astype(float)
    both = []
    for end in (min, max):
        own, theirs, ends = _areas(sides, np.ones(count), end)
        drawn = [_areas(sides, weights, end)[:2] for weights in times]
        ratios = np.array([a / b if b else np.nan for a, b in drawn])
        both.append(Areas(own, theirs, ends / max(len(sides), 1), percentiles(ratios)))
    return both[0], both[1]


def _areas(
    sides: Sequence[tuple[_Parts, _Parts]], weights: FloatArray, end: Callable[[float, float], float]
) -> tuple[float, float, float]:
    """Return the areas of both sides and the ends, summed over repetitions, with each test case counted the given
    number of times."""
    sums = [0.0, 0.0, 0.0]
    for pair in sides:
        times = [weights[parts.case] for parts in pair]
        end_s = end(*(parts.end_s(k) for parts, k in zip(pair, times, strict=True)))
        for k in (0, 1):
            sums[k] += pair[k].area(times[k], end_s)
        sums[2] += end_s
    return sums[0], sums[1], sums[2]
