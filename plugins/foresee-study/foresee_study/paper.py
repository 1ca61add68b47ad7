"""The paper's figures, each with its section, and the functions that compute ours from a study.

The paper's two drivers have stand-ins here: `fusion_safe` for InterFuser, `fusion` for TransFuser.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType

import numpy as np

from foresee_study.curves import compared_areas
from foresee_study.measured import Counted, MeasuredCampaign, MeasuredCase
from foresee_study.questions import HEAVY_WEATHER
from foresee_study.results import TOGETHER, Results, counts_of
from foresee_study.settings import CHOSEN_S, EXHAUSTIVE, POINTS
from foresee_study.statistics.bootstrap import (
    Counts,
    Interval,
    Repetition,
    percentiles,
    ratio_interval,
    resampled_ratios,
    sum_of,
)
from foresee_study.tables.complementarity import Iteration, iterations

STANDS_FOR: Mapping[str, str] = MappingProxyType(
    {"fusion_safe": "InterFuser", "fusion": "TransFuser", TOGETHER: "two drivers together"}
)
"""For each of our drivers, the driver of the paper with whose figures it is compared. Any other driver is compared with
the paper's two together, or with InterFuser if the paper has no such figure."""
_MODULAR = "frenetix"
_NAMES: Mapping[str, str] = MappingProxyType({**STANDS_FOR, _MODULAR: "Apollo"})
"""The same with the paper's modular driver, Apollo, which the paper runs in two towns of rq5 only."""


class Unit(StrEnum):
    """The unit of a figure. `neutral`: the value that means no difference; NaN if there is none. `sign`: what stands
    behind a value; "" if the figure's description has the unit.
    """

    neutral: float
    sign: str

    def __new__(cls, value: str, neutral: float, sign: str) -> Unit:
        """Make a member."""
        unit = str.__new__(cls, value)
        unit._value_, unit.neutral, unit.sign = value, neutral, sign
        return unit

    MORE = "% more", 0.0, " %"
    TIMES = "times", 1.0, " times"
    SHARE = "%", math.nan, " %"
    RATE = "a risky point", math.nan, ""
    NUMBER = "", math.nan, ""


@dataclass(frozen=True)
class Ours:
    """Our value of a figure, and its bootstrap interval over test cases and repetitions, if it has one."""

    value: float
    interval: Interval | None = None


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper.

    Attributes:
        question: name of the question.
        what: the figure in words.
        section: its section in the paper.
        values: the paper's values, by the driver of ours that is compared with its driver.
        ours: computes our value for a driver, or for all.
        headline: whether the page of results states it; tables have every figure.
    """

    question: str
    what: str
    unit: Unit
    section: str
    values: Mapping[str, float]
    ours: Callable[[Results, str], Ours | None] = field(compare=False)
    headline: bool = True

    @property
    def title(self) -> str:
        """Return the figure in words, with its unit."""
        return f"{self.what},{self.unit.sign}" if self.unit.sign else self.what

    def of(self, driver: str) -> tuple[str, float]:
        """Return the driver of the paper that one of ours is compared with, and that driver's figure."""
        like = next(name for name in (driver, TOGETHER, "fusion_safe") if name in self.values)
        return _NAMES[like], self.values[like]


def _drivers(results: Results, driver: str) -> tuple[str, ...]:
    return results.drivers if driver == TOGETHER else (driver,)


def _campaigns(
    results: Results, driver: str, ranker: str, clip_s: float = CHOSEN_S, points: int = POINTS, preset: str = ""
) -> tuple[MeasuredCampaign, ...]:
    return tuple(
        m
        for name in _drivers(results, driver)
        for m in results.of_campaign(name, ranker, clip_s, points=points, preset=preset)
    )


def _in_common(
    results: Results, driver: str, ranker: str, clip_s: float
) -> tuple[tuple[MeasuredCampaign, ...], tuple[MeasuredCampaign, ...]]:
    """Return foresee's campaigns and another ranker's, for the drivers and repetitions that both rankers have."""
    own, theirs = (_campaigns(results, driver, name, clip_s) for name in ("foresee", ranker))
    common = {(m.driver, m.repetition) for m in own} & {(m.driver, m.repetition) for m in theirs}
    own, theirs = (tuple(m for m in side if (m.driver, m.repetition) in common) for side in (own, theirs))
    return own, theirs


def _ratio(above: Counts, below: Counts) -> Ours | None:
    over, under = sum_of(above), sum_of(below)
    return Ours(over / under, ratio_interval(above, below)) if under else None


def _collisions(of: MeasuredCase | MeasuredCampaign) -> float:
    return float(of.count(Counted.COLLISIONS))


def _hours(case: MeasuredCase) -> float:
    return case.derived_s / 3600


def a_risky_point(ranker: str, clip_s: float, points: int) -> Callable[[Results, str], Ours | None]:
    """Return a function that computes the collisions per risky point."""

    def ours(results: Results, driver: str) -> Ours | None:
        campaigns = _campaigns(results, driver, ranker, clip_s, points)
        return _ratio(counts_of(campaigns, _collisions), counts_of(campaigns, lambda case: float(len(case.clips))))

    return ours


def of_exhaustive(clip_s: float) -> Callable[[Results, str], Ours | None]:
    """Return a function that computes foresee's collisions as a share of the exhaustive search's, %.

    It is the mean of foresee's repetitions divided by the mean of the search's, over the drivers that were searched.
    The search usually has one repetition; foresee's result in only that repetition would depend on its seed.
    """

    def ours(results: Results, driver: str) -> Ours | None:
        own: dict[Repetition, Mapping[str, float]] = {}
        everything: dict[Repetition, Mapping[str, float]] = {}
        for name in _drivers(results, driver):
            ranked, searched = (_campaigns(results, name, ranker, clip_s) for ranker in ("foresee", EXHAUSTIVE))
            if ranked and searched:
                own |= counts_of(ranked, _collisions, divided_by=len(ranked))
                everything |= counts_of(searched, _collisions, divided_by=len(searched))
        return _scaled(_ratio(own, everything), 100)

    return ours


def more_than(ranker: str) -> Callable[[Results, str], Ours | None]:
    """Return a function that computes how many more collisions foresee has than a ranker, %."""

    def ours(results: Results, driver: str) -> Ours | None:
        own, theirs = _in_common(results, driver, ranker, CHOSEN_S)
        return _scaled(_ratio(counts_of(own, _collisions), counts_of(theirs, _collisions)), 100, less=100)

    return ours


def more_an_hour(clip_s: float) -> Callable[[Results, str], Ours | None]:
    """Return a function that computes how many more collisions per hour foresee finds than the exhaustive search, %.

    It counts the drivers with which the search was done. All repetitions count, because a rate does not need equal
    numbers of them.
    """

    def ours(results: Results, driver: str) -> Ours | None:
        everything = _campaigns(results, driver, EXHAUSTIVE, clip_s)
        searched = {m.driver for m in everything}
        own = tuple(m for m in _campaigns(results, driver, "foresee", clip_s) if m.driver in searched)
        rates, drawn = [], []
        for campaigns in (own, everything):
            collisions, hours = (counts_of(campaigns, value) for value in (_collisions, _hours))
            rates.append(_ratio(collisions, hours))
            drawn.append(resampled_ratios(collisions, hours))
        if rates[0] is None or rates[1] is None or not rates[1].value:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            interval = percentiles(drawn[0] / drawn[1])
        return _scaled(Ours(rates[0].value / rates[1].value, interval), 100, less=100)

    return ours


def area_over(ranker: str) -> Callable[[Results, str], Ours | None]:
    """Return a function that divides foresee's area under the curve by a ranker's, up to the earlier end."""

    def ours(results: Results, driver: str) -> Ours | None:
        sides = _in_common(results, driver, ranker, CHOSEN_S)
        if not sides[0]:
            return None
        areas, _ = compared_areas(*sides)
        return None if math.isnan(areas.ratio) else Ours(areas.ratio, areas.interval)

    return ours


def of_drivefuzz(results: Results, driver: str) -> Ours | None:
    """Return how many further failing test cases foresee finds, % of DriveFuzz's failing test cases."""
    return _of_drivefuzz(results, driver, lambda iteration, case: case.name in iteration.split.forecast)


def children_of_drivefuzz(results: Results, driver: str) -> Ours | None:
    """Return foresee's failing mutants in test cases in which DriveFuzz found no failure, % of DriveFuzz's failing test
    cases.
    """

    def failing(iteration: Iteration, case: MeasuredCase) -> int:
        searched = case.name in iteration.split.forecast | iteration.split.left
        return sum(child.verdict.is_failure for child in case.children) if searched else 0

    return _of_drivefuzz(results, driver, failing)


def _of_drivefuzz(results: Results, driver: str, count: Callable[[Iteration, MeasuredCase], int]) -> Ours | None:
    ours: defaultdict[Repetition, Counter[str]] = defaultdict(Counter)
    theirs: defaultdict[Repetition, Counter[str]] = defaultdict(Counter)
    for repetition, iteration in _iterations(results, driver):
        for case in iteration.forecast.cases:
            ours[repetition][case.name] += count(iteration, case)
            theirs[repetition][case.name] += case.name in iteration.split.fuzzed
    return _scaled(_ratio(ours, theirs), 100)


def _iterations(results: Results, driver: str) -> Iterator[tuple[Repetition, Iteration]]:
    """Yield the iterations of rq4, each with its driver and repetition."""
    for name in _drivers(results, driver):
        for both in iterations(results, name):
            yield from (((name, both[0].forecast.repetition), iteration) for iteration in both)


def weather_collisions(results: Results, driver: str) -> Ours | None:
    """Return the share of clips that collide in heavy weather, %."""
    return _share_colliding(_campaigns(results, driver, "foresee", preset=HEAVY_WEATHER))


def town_collisions(town: str) -> Callable[[Results, str], Ours | None]:
    """Return a function that computes the share of foresee's mutants that collide in a town, %."""

    def ours(results: Results, driver: str) -> Ours | None:
        drivers = _drivers(results, driver)
        return _share_colliding(tuple(m for name in drivers for m in results.of_campaign(name, "foresee", group=town)))

    return ours


def _share_colliding(campaigns: tuple[MeasuredCampaign, ...]) -> Ours | None:
    children = counts_of(campaigns, lambda case: float(len(list(case.children))))
    return _scaled(_ratio(counts_of(campaigns, _collisions), children), 100)


def _scaled(ours: Ours | None, by: float, *, less: float = 0.0) -> Ours | None:
    if ours is None:
        return None
    ends = Interval(*(end * by - less for end in ours.interval)) if ours.interval is not None else None
    return Ours(ours.value * by - less, ends)


def _both(interfuser: float, transfuser: float, together: float | None = None) -> Mapping[str, float]:
    values = {"fusion_safe": interfuser, "fusion": transfuser}
    return MappingProxyType(values if together is None else {**values, TOGETHER: together})


_RQ1, _RQ2, _RQ3 = "4.5, RQ1", "4.5, RQ2", "4.5, RQ3"
FIGURES = (
    PaperFigure("rq1", "collisions a risky point, foresee, clips of 6 s, n_rp 4", Unit.RATE, f"{_RQ1}, table 2",
                _both(0.2651, 0.046), a_risky_point("foresee", 6, 4), headline=False),
    PaperFigure("rq1", "collisions a risky point, foresee, clips of 10 s, n_rp 1", Unit.RATE, f"{_RQ1}, table 2",
                _both(0.2727, 0.160), a_risky_point("foresee", 10, 1), headline=False),
    PaperFigure("rq1", "collisions a risky point, foresee, clips of 10 s, n_rp 2", Unit.RATE, f"{_RQ1}, table 2",
                _both(0.3276, 0.167), a_risky_point("foresee", 10, 2), headline=False),
    PaperFigure("rq1", "collisions a risky point, foresee, clips of 10 s, n_rp 4", Unit.RATE, f"{_RQ1}, table 2",
                _both(0.3419, 0.156), a_risky_point("foresee", 10, 4)),
    PaperFigure("rq1", "collisions a risky point, proximity, clips of 10 s, n_rp 4", Unit.RATE, f"{_RQ2}, table 4",
                _both(0.09, 0.09), a_risky_point("proximity", 10, 4), headline=False),
    PaperFigure("rq1", "foresee's share of the exhaustive search, clips of 6 s, n_rp 4", Unit.SHARE, _RQ1,
                {"fusion_safe": 26.94}, of_exhaustive(6), headline=False),
    PaperFigure("rq1", "foresee's share of the exhaustive search, clips of 10 s, n_rp 4", Unit.SHARE, _RQ1,
                {"fusion_safe": 40.14}, of_exhaustive(10)),
    PaperFigure("rq2", "more collisions than random", Unit.MORE, _RQ2, _both(186.69, 37.06, 128.70),
                more_than("random")),
    PaperFigure("rq2", "more collisions than selforacle", Unit.MORE, _RQ2, _both(44.09, 21.38, 38.09),
                more_than("selforacle")),
    PaperFigure("rq3", "more collisions an hour than exhaustive, clips of 6 s", Unit.MORE, _RQ3,
                {"fusion_safe": 269.76}, more_an_hour(6), headline=False),
    PaperFigure("rq3", "more collisions an hour than exhaustive, clips of 10 s", Unit.MORE, _RQ3,
                {"fusion_safe": 318.29}, more_an_hour(10)),
    PaperFigure("rq3", "area under the curve, over random", Unit.TIMES, _RQ3, _both(2.62, 1.74, 2.49),
                area_over("random")),
    PaperFigure("rq3", "area under the curve, over selforacle", Unit.TIMES, _RQ3, _both(1.44, 1.27, 1.42),
                area_over("selforacle")),
    PaperFigure("rq4", "foresee's additional failing test cases, of DriveFuzz's", Unit.SHARE, "4.5, RQ4, table 5",
                _both(93.94, 45.95), of_drivefuzz),
    PaperFigure("rq4", "the same, if the paper's 31 and 17 are failing children", Unit.SHARE, "4.5, RQ4, table 5",
                _both(93.94, 45.95), children_of_drivefuzz),
    *(
        PaperFigure("rq5", f"mutants that collide in {town}", Unit.SHARE, "4.5, RQ5, table 6", values,
                    town_collisions(town))
        for town, values in {
            "town01": {**_both(100 * 32 / 238, 100 * 16 / 205), _MODULAR: 100 * 16 / 80},
            "town02": _both(100 * 47 / 160, 100 * 1 / 143),
            "town03": {**_both(100 * 27 / 512, 100 * 30 / 324), _MODULAR: 100 * 9 / 64},
        }.items()
    ),
    PaperFigure("rq5", "clips that collide in heavy weather", Unit.SHARE, "4.5, RQ5, table 6",
                _both(100 * 36 / 539, 100 * 10 / 237, 100 * 46 / 776), weather_collisions),
)  # fmt: skip
"""The paper's headline figures. In towns: the table's sums of failures, divided by its test cases; for Apollo in Town03
without the five runs that got stuck, which are not collisions. The paper's areas are in collisions times seconds of the
paper's own clock, so only ratios can be compared."""
A_CHILD: Mapping[tuple[str, str], float] = MappingProxyType({
    ("fusion_safe", "foresee"): 93.66 / 1116, ("fusion_safe", "random"): 32.67 / 1116,
    ("fusion_safe", "selforacle"): 65.00 / 1116, ("fusion", "foresee"): 28.33 / 695, ("fusion", "random"): 20.67 / 695,
    ("fusion", "selforacle"): 23.34 / 695, (TOGETHER, "foresee"): 121.99 / 1811, (TOGETHER, "random"): 53.34 / 1811,
    (TOGETHER, "selforacle"): 88.34 / 1811,
})  # fmt: skip
"""Collisions per mutant (section 4.5, table 3): the table's sums of collisions for a driver, divided by the driver's
number of test cases, which the table states once for all rankers."""


def a_child_of_paper(driver: str, ranker: str) -> float | None:
    """Return the paper's collisions per mutant, for the paper's driver that this one is compared with."""
    return A_CHILD.get((driver if driver in STANDS_FOR else TOGETHER, ranker))


def children_colliding(results: Results, driver: str, ranker: str) -> tuple[float, float] | None:
    """Return the shares of foresee's and of another ranker's mutants that collide, with clips of the chosen length.

    It counts the drivers and repetitions that both rankers have; None if foresee or the other ranker has no mutant.
    """
    shares = []
    for pairs in _in_common(results, driver, ranker, CHOSEN_S):
        children = sum(len(m.children_run) for m in pairs)
        if not children:
            return None
        shares.append(sum(map(_collisions, pairs)) / children)
    return shares[0], shares[1]
