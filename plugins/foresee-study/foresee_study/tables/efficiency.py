"""rq3: collisions an hour, the area under the curve of cumulative collisions, and how soon they are found."""

from __future__ import annotations

from itertools import product

from foresee_study.curves import Clock, compared_areas, curve
from foresee_study.measured import Counted, MeasuredCampaign
from foresee_study.questions import CLIPS_S
from foresee_study.results import Results, mean, mean_count, paired
from foresee_study.settings import CHOSEN_S, EXHAUSTIVE
from foresee_study.tables.rankers import shown_rankers
from foresee_study.tables.table import Column, Row, Table, section

SHARES = (0.25, 0.5, 1.0)
"""Times at which the curves are read, as shares of the shortest campaign's time."""
WALL = "_wall"
"""Suffix of the names of tables about wall time, which differ from machine to machine."""


def efficiency(results: Results) -> tuple[Table, ...]:
    """Return the tables of rq3, for simulated and for wall time."""
    return (*(_an_hour(results, clock) for clock in Clock), *(_areas(results, clock) for clock in Clock))


def _name(name: str, clock: Clock) -> str:
    return name + (WALL if clock is Clock.WALL else "")


def _an_hour(results: Results, clock: Clock) -> Table:
    columns = (
        Column("collisions"), Column("hours", digits=3), Column("collisions an hour", digits=1),
        Column("findings an hour", digits=1), Column("avoidable an hour", digits=1),
        Column("more than exhaustive, %", digits=1),
    )  # fmt: skip
    rows: list[Row] = []
    for driver, clip_s in product(results.drivers, CLIPS_S):
        everything = results.of_campaign(driver, EXHAUSTIVE, clip_s)
        slowest = _rate(everything, Counted.COLLISIONS, clock)
        lines = []
        for ranker in (*shown_rankers(results), EXHAUSTIVE):
            campaigns = results.of_campaign(driver, ranker, clip_s)
            if not campaigns:
                continue
            rates = [_rate(campaigns, what, clock) for what in Counted]
            more = 100 * (rates[0] / slowest - 1) if slowest and rates[0] is not None and ranker != EXHAUSTIVE else None
            hours = mean(clock.of(m) / 3600 for m in campaigns)
            lines.append(Row(ranker, (mean(m.count(Counted.COLLISIONS) for m in campaigns), hours, *rates, more)))
        if clip_s == CHOSEN_S or everything:
            rows += section(f"{driver}, clips of {clip_s:g} s", lines)
    note = "Time of clips and children, without the test cases' own runs; wall time is that of one core."
    return Table(_name("rq3", clock), f"RQ3: collisions an hour of {clock.value} time", columns, tuple(rows), "ranker",
                 (note,))  # fmt: skip


def _rate(campaigns: tuple[MeasuredCampaign, ...], what: Counted, clock: Clock) -> float | None:
    hours = mean(clock.of(m) / 3600 for m in campaigns)
    number = mean_count(campaigns, what)
    return number / hours if hours and number is not None else None


def _areas(results: Results, clock: Clock) -> Table:
    columns = (
        Column("area", ("first",), 0), Column("area", ("second",), 0), Column("ratio"), Column("low", ("95 %",)),
        Column("high", ("95 %",)), Column("common end, h", digits=3), Column("ratio to the later end"),
        *(Column(f"at {100 * share:.0f} %", ("collisions, first",), 1) for share in SHARES),
        *(Column(f"at {100 * share:.0f} %", ("collisions, second",), 1) for share in SHARES),
    )  # fmt: skip
    rows: list[Row] = []
    for driver in results.drivers:
        own = results.of_campaign(driver, "foresee")
        lines = []
        for other in (*shown_rankers(results), EXHAUSTIVE):
            theirs = results.of_campaign(driver, other)
            if other == "foresee" or not own or not theirs:
                continue
            sides = paired(own, theirs)
            if not sides[0]:
                continue
            areas, later = compared_areas(*sides, clock)
            curves = [[curve(m, clock) for m in side] for side in sides]
            read = [mean(line.at(share * areas.end_s) for line in side) for side in curves for share in SHARES]
            lines.append(
                Row(f"against {other}", (
                    areas.first, areas.second, areas.ratio, *areas.interval, areas.end_s / 3600, later.ratio, *read,
                ))
            )  # fmt: skip
        rows += section(f"{driver}: foresee", lines)
    notes = (
        "Area under the curve of cumulative collisions, in collisions times seconds, up to the earlier of the two "
        "ends; with the interval of the ratio by bootstrap over test cases and repetitions. Up to the later end, the "
        "curve that ended first stays constant. Both sides are means of the repetitions that both have; a search "
        "without repetitions is compared with each repetition of the other.",
    )
    return Table(_name("rq3_areas", clock), f"RQ3: areas under the curves, {clock.value} time", columns, tuple(rows),
                 notes=notes)  # fmt: skip
