"""search and default: what rankers, searches from the literature and the default search find in equal time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from foresee_dsl.campaign.settings import CampaignSettings
from foresee_study.measured import Counted, MeasuredCampaign, MeasuredClip
from foresee_study.results import TOGETHER, Results, counts_of, mean
from foresee_study.settings import EXHAUSTIVE, POINTS
from foresee_study.statistics import Pair, compare
from foresee_study.statistics.bootstrap import Interval, ratio_interval, sum_of
from foresee_study.tables.comparing import Compared, comparison_table
from foresee_study.tables.table import Column, Row, Table, Value, section

OURS = "reach"
"""The ranker with which all others are compared."""
DEFAULT = "the default"
"""The technique in the table of the default search."""
_ROUNDING_S = 1e-6
"""A run that ends this long after the time to which a campaign is cut, s, still fits into it: times are sums of floats.
"""
Techniques = dict[str, tuple[MeasuredCampaign, ...]]
"""The repetitions of each ranker and search with one driver."""


def searches(results: Results) -> tuple[Table, ...]:
    """Return the tables of the question `search`; none without the results of a search."""
    by_driver = {driver: techniques(results, driver) for driver in results.drivers}
    return rates(results), _statistics("search_statistics", "Search", OURS, by_driver)


def default_search(results: Results) -> tuple[Table, ...]:
    """Return the tables of the question `default`; without rows if no default search was run."""
    numbers = (CampaignSettings.risky_points, POINTS)
    compared = {(driver, n): beside_default(results, driver, n) for driver in results.drivers for n in numbers}
    rows: list[Row] = []
    for (driver, points), own in compared.items():
        rows += section(f"{driver}, {points} points", _rows(own, stories(results.exhaustive(driver))))
    for points in numbers:
        each = [own for (_, n), own in compared.items() if n == points and own]
        if len(each) > 1:
            shared = [name for name in each[0] if all(name in own for own in each)]
            compared[TOGETHER, points] = {name: tuple(m for own in each for m in own[name]) for name in shared}
    by_heading = {f"{driver}, {points} points": own for (driver, points), own in compared.items()}
    title = "The default search and the others at equal simulated time"
    return (
        Table("default", title, _columns(), tuple(rows), "technique", (_CUT, _RATES, _STEERED)),
        _statistics("default_statistics", title, DEFAULT, by_heading),
    )


def beside_default(results: Results, driver: str, points: int) -> Techniques:
    """Return the default search with at most `points` risky points of a test case, and all other techniques, cut to its
    mean simulated time; empty without a default search with this driver."""
    own = tuple(
        m.first_points(points)
        for m in results.campaigns
        if (m.driver, m.ranker, m.preset) == (driver, CampaignSettings.ranker, CampaignSettings.preset)
    )
    if not own:
        return {}
    simulated_s = sum(m.simulated_s for m in own) / len(own)
    others = {name: tuple(within(m, simulated_s) for m in each) for name, each in _others(results, driver).items()}
    return {DEFAULT: own, **others}


def techniques(results: Results, driver: str) -> Techniques:
    """Return the rankers, cut to the simulated time that the searches had, and then the searches; empty if no search
    was run with this driver."""
    own = _others(results, driver)
    budgets = {m.budget_s for each in own.values() for m in each if m.budget_s is not None}
    if len(budgets) != 1:
        return {}
    (budget_s,) = budgets
    return {
        name: tuple(m if m.budget_s is not None else within(m, budget_s * len(m.usable)) for m in each)
        for name, each in own.items()
    }


def _others(results: Results, driver: str) -> dict[str, list[MeasuredCampaign]]:
    """Return the repetitions of each ranker and search with the study's preset, without the exhaustive search."""
    own: defaultdict[str, list[MeasuredCampaign]] = defaultdict(list)
    for m in sorted(results.with_beside(driver), key=lambda m: (m.budget_s is not None, m.ranker, m.repetition)):
        if m.ranker != EXHAUSTIVE:
            own[m.ranker if m.allocation == "even" else f"{m.ranker}, {m.allocation}"].append(m)
    return own


def within(measured: MeasuredCampaign, simulated_s: float) -> MeasuredCampaign:
    """Return the part of a campaign that fits into a simulated time, in the order of its runs: rank by rank, and test
    cases of a rank by name."""
    kept: defaultdict[str, list[MeasuredClip]] = defaultdict(list)
    ordered = sorted(
        ((clip.position, k, case.name, clip) for k, case in enumerate(measured.usable) for clip in case.clips),
        key=lambda entry: entry[:2],
    )
    for _, _, name, clip in ordered:
        if clip.simulated_s > simulated_s + _ROUNDING_S:
            break
        simulated_s -= clip.simulated_s
        count = 0
        for child in clip.children:
            if child.simulated_s > simulated_s + _ROUNDING_S:
                break
            simulated_s -= child.simulated_s
            count += 1
        kept[name].append(replace(clip, children=clip.children[:count]))
        if count < len(clip.children):
            break
    return replace(measured, cases=tuple(replace(case, clips=tuple(kept[case.name])) for case in measured.cases))


def rates(results: Results) -> Table:
    """Return what each technique finds, in numbers and per simulated hour."""
    rows = [
        row
        for driver in results.drivers
        for row in section(driver, _rows(techniques(results, driver), stories(results.exhaustive(driver))))
    ]
    return Table("search", "Search: rankers and searches at equal simulated time", _columns(), tuple(rows), "technique",
                 (_CUT_TO_SEARCHES, _RATES, _STEERED))  # fmt: skip


def _columns() -> tuple[Column, ...]:
    return (
        Column("hours"), Column("clips", digits=0), Column("children", digits=0),
        *(Column(what.value, digits=1) for what in Counted),
        *(Column(title, (f"{what.value} an hour",), 1) for what in Counted for title in ("mean", "low", "high")),
        Column("steered into the ego, % of findings", digits=0), Column("stories of the exhaustive search", digits=1),
        Column("of", digits=0), Column("repetitions"),
    )  # fmt: skip


_CUT_TO_SEARCHES = (
    "Simulated time of clips and mutants; rankers are cut to the time that the searches had, in the order of their "
    "runs, and some need less."
)
_CUT = (
    f"{DEFAULT[0].upper()}{DEFAULT[1:]}: the search of `foresee campaign` ({CampaignSettings.ranker}, "
    f"{CampaignSettings.preset}), with at most this number of risky points in each test case. The others are cut to "
    "its mean simulated time of clips and mutants, in the order of their runs: the first risky points of all test "
    "cases, then the second."
)
_RATES = (
    "Findings: stories of a campaign. Low, high: 95 % by bootstrap over test cases and repetitions, of the rate of the "
    "stories of each test case, scaled to the rate of the campaign's."
)
_STEERED = (
    "Steered into the ego: the mutation turned the wheels, or moved the line, of the actor that the ego collides "
    "with, towards the ego before the contact, and this actor moved (its story says so). Stories of the exhaustive "
    "search: how many of its findings are found."
)


def _rows(techniques: Techniques, every: frozenset[str]) -> list[Row]:
    return [Row(name, tuple(_values(campaigns, every))) for name, campaigns in techniques.items()]


def _values(campaigns: Sequence[MeasuredCampaign], every: frozenset[str]) -> Iterator[Value]:
    hours = sum(m.simulated_s for m in campaigns) / 3600
    yield hours / len(campaigns)
    yield mean(m.clips for m in campaigns)
    yield mean(len(m.children_run) for m in campaigns)
    yield from (mean(m.count(what) for m in campaigns) for what in Counted)
    for what in Counted:
        rate = sum(m.count(what) for m in campaigns) / hours if hours else None
        yield rate
        yield from _interval(campaigns, what, rate)
    steered = [_steered_share(m) for m in campaigns]
    yield mean(share for share in steered if share is not None) if any(s is not None for s in steered) else None
    yield mean(len(every & stories((m,))) for m in campaigns) if every else None
    yield len(every) or None
    yield len(campaigns)


def _interval(campaigns: Sequence[MeasuredCampaign], what: Counted, rate: float | None) -> Interval:
    counts = counts_of(campaigns, lambda case: case.count(what))
    hours = counts_of(campaigns, lambda case: case.derived_s / 3600)
    if rate is None or not sum_of(counts):
        return Interval(np.nan, np.nan)
    scale = rate / (sum_of(counts) / sum_of(hours))
    low, high = ratio_interval(counts, hours)
    return Interval(scale * low, scale * high)


def _steered_share(measured: MeasuredCampaign) -> float | None:
    """Return the share of the findings in which an actor was steered into the ego, %; None if there is no finding, or
    if the file does not say it."""
    steered = {child.story: child.steered for child in measured.children_run if child.verdict.is_collision}
    if not steered or None in steered.values():
        return None
    return 100 * sum(map(bool, steered.values())) / len(steered)


def stories(campaigns: Sequence[MeasuredCampaign]) -> frozenset[str]:
    """Return the stories of all findings."""
    return frozenset(child.story for m in campaigns for child in m.children_run if child.verdict.is_collision)


def _statistics(name: str, title: str, ours: str, by_heading: dict[str, Techniques]) -> Table:
    rows = [
        Compared(heading, f"{ours} over {other}: {what.value}", compare(_pairs(own[ours], others, what)))
        for heading, own in by_heading.items()
        if ours in own
        for other, others in own.items()
        if other != ours
        for what in Counted
    ]
    return comparison_table(name, f"{title}: {ours} over each other technique", rows)


def _pairs(first: Sequence[MeasuredCampaign], second: Sequence[MeasuredCampaign], what: Counted) -> list[Pair]:
    """Return the units that two techniques share, with one driver or several."""
    sides = [{(m.driver, m.repetition, c.name): c for m in side for c in m.usable} for side in (first, second)]
    several = len({m.driver for m in first}) > 1
    return [
        Pair(unit[2], unit[1], sides[0][unit].count(what), sides[1][unit].count(what), unit[0] if several else "")
        for unit in sorted(sides[0].keys() & sides[1].keys())
    ]
