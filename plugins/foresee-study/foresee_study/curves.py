"""Curves of cumulative failures over time, as if the runs of a campaign were done one after the other in their
order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from hashlib import sha256

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_study.measured import Child, MeasuredCampaign, MeasuredClip
from foresee_study.statistics.bootstrap import Interval, drawn_repetitions, percentiles, resamples

RESAMPLES = 1000
"""Number of resamples. Ours: each of them takes 0.1 ms."""


class Clock(StrEnum):
    """The kind of time over which failures are counted."""

    SIMULATED = "simulated"
    WALL = "wall"

    def of(self, item: Child | MeasuredClip | MeasuredCampaign) -> float:
        """Return the time of a campaign, clip or child, s."""
        return item.simulated_s if self is Clock.SIMULATED else item.wall_s


@dataclass(frozen=True)
class Curve:
    """Collisions over time.

    Attributes:
        times_s: times at which collisions were found, ascending. end_s: end of the campaign.
    """

    times_s: FloatArray
    end_s: float

    def area(self, end_s: float) -> float:
        """Return the area under the curve up to a time, in collisions times seconds; after its end the curve is
        constant.
        """
        return float(np.maximum(end_s - self.times_s, 0.0).sum())

    def at(self, time_s: float) -> int:
        """Return the number of collisions found up to a time."""
        return int(np.searchsorted(self.times_s, time_s, side="right"))


@dataclass(frozen=True)
class _Parts:
    """The clips of a campaign with their children, in order.

    Attributes:
        case: number of each clip's test case. took_s: duration of each clip with its children, s. found_s: times at
            which the clip's collisions were found, counted from the clip's beginning, s. count, sum_s: number of these
            times for each clip, and their sum, s.
    """

    case: IntArray
    took_s: FloatArray
    found_s: tuple[FloatArray, ...]
    count: FloatArray
    sum_s: FloatArray

    def end_s(self, times: FloatArray) -> float:
        """Return the total duration (s), with each clip repeated `times` times."""
        return float(times @ self.took_s)

    def area(self, times: FloatArray, end_s: float) -> float:
        """Return the area under the curve up to a time, with each clip repeated `times` times in a row."""
        ends = np.cumsum(times * self.took_s)
        starts = ends - times * self.took_s
        whole = ends <= end_s
        # The first repetition of a clip begins at its start, the second one clip's duration later, and so on.
        all_s = times * self.count * starts + self.count * self.took_s * times * (times - 1) / 2 + times * self.sum_s
        area = float((times * self.count * end_s - all_s)[whole].sum())
        for k in np.flatnonzero(~whole & (starts < end_s)):
            for again in range(int(times[k])):
                times_s = starts[k] + again * self.took_s[k] + self.found_s[k]
                area += float(np.maximum(end_s - times_s, 0.0).sum())
        return area


def _parts(measured: MeasuredCampaign, clock: Clock, names: Sequence[str]) -> _Parts:
    """Return the parts of a campaign; `names`: all test cases, whose places in it are their numbers."""
    numbers = {name: number for number, name in enumerate(names)}
    rows = []
    for case in measured.usable:
        number = numbers[case.name]
        for clip in case.clips:
            ends = np.cumsum([clock.of(clip), *map(clock.of, clip.children)])
            collided = np.array([child.verdict.is_collision for child in clip.children], dtype=bool)
            rows.append((clip.position, number, float(ends[-1]), ends[1:][collided]))
    rows.sort(key=lambda row: row[:2])
    found_s = tuple(row[3] for row in rows)
    return _Parts(
        case=np.array([row[1] for row in rows], dtype=np.int64),
        took_s=np.array([row[2] for row in rows]),
        found_s=found_s,
        count=np.array([len(times) for times in found_s], dtype=float),
        sum_s=np.array([times.sum() for times in found_s]),
    )


def _in_order(campaigns: Iterable[MeasuredCampaign]) -> list[str]:
    """Return the names of all usable test cases, by their hashes."""
    names = {case.name for measured in campaigns for case in measured.usable}
    return sorted(names, key=lambda name: sha256(name.encode()).digest())


def curve(measured: MeasuredCampaign, clock: Clock = Clock.SIMULATED) -> Curve:
    """Return the curve of a campaign: clips of first rank with their children, then those of second rank, and so on.

    As in the paper, time begins after the runs of the test cases themselves, which all rankers have in common. Within a
    rank the test cases are in the order of their names' hashes, so that no family is always last.
    """
    parts = _parts(measured, clock, _in_order([measured]))
    starts = np.concatenate([[0.0], np.cumsum(parts.took_s)])
    times = [part_s + start for part_s, start in zip(parts.found_s, starts, strict=False)]
    return Curve(np.concatenate(times) if times else np.zeros(0), float(starts[-1]))


@dataclass(frozen=True)
class Areas:
    """The areas under two curves up to a common end, summed over all repetitions.

    Attributes:
        first, second: the areas, collisions times seconds. end_s: mean of the common ends, s. interval: interval of the
            ratio of the areas.
    """

    first: float
    second: float
    end_s: float
    interval: Interval

    @property
    def ratio(self) -> float:
        """Return the first area divided by the second; NaN if the second is 0."""
        return self.first / self.second if self.second else float("nan")


def compared_areas(
    first: Sequence[MeasuredCampaign], second: Sequence[MeasuredCampaign], clock: Clock = Clock.SIMULATED
) -> tuple[Areas, Areas]:
    """Compare two rankers' areas by repetition: up to the earlier end, and up to the later one.

    Up to the earlier end both had equal time; up to the later end the curve that ended first is constant.
    """
    names = _in_order((*first, *second))
    sides = [(_parts(a, clock, names), _parts(b, clock, names)) for a, b in zip(first, second, strict=False)]
    owners = [(measured.driver, measured.repetition) for measured in first[: len(sides)]]
    drawn_cases, drawn_sides = resamples(len(names), RESAMPLES), drawn_repetitions(owners, RESAMPLES)
    both = []
    for end in (min, max):
        own, theirs, ends = _areas(sides, np.ones(len(names)), np.ones(len(sides)), end)
        ratios = []
        for k in range(RESAMPLES if names else 0):
            a, b, _ = _areas(sides, drawn_cases[k], [drawn_sides[owner][k] for owner in owners], end)
            ratios.append(a / b if b else np.nan)
        both.append(Areas(own, theirs, ends / max(len(sides), 1), percentiles(np.array(ratios))))
    return both[0], both[1]


def _areas(
    sides: Sequence[tuple[_Parts, _Parts]],
    weights: FloatArray,
    counts: Sequence[float] | FloatArray,
    end: Callable[[float, float], float],
) -> tuple[float, float, float]:
    """Return the area under the curve of each side and the common end of the curves, each summed over the repetitions,
    with test cases weighted by `weights`, and each repetition counted `counts` times.
    """
    sums = [0.0, 0.0, 0.0]
    for pair, count in zip(sides, counts, strict=True):
        if not count:
            continue
        times = [weights[parts.case] for parts in pair]
        end_s = end(*(parts.end_s(k) for parts, k in zip(pair, times, strict=True)))
        for k in (0, 1):
            sums[k] += count * pair[k].area(times[k], end_s)
        sums[2] += count * end_s
    return sums[0], sums[1], sums[2]
