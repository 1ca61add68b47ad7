"""rq2: rankers compared by scenario, kind of failure and driver."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import product

from foresee_dsl.simulate.results.verdict import COLLISIONS, FAILURES, Verdict
from foresee_study.measured import AVOIDERS, Counted, MeasuredCampaign, MeasuredCase, avoided
from foresee_study.results import TOGETHER, Results, mean, total
from foresee_study.statistics import compare
from foresee_study.tables.comparing import Compared, comparison_table
from foresee_study.tables.table import Column, Row, RowKind, Table, family_rows, section


def comparison(results: Results) -> tuple[Table, ...]:
    """Return the tables of rq2."""
    return (_by_kind(results), _by_family(results), _counted(results), moments(results), _statistics(results))


def shown_rankers(results: Results) -> tuple[str, ...]:
    """Return the rankers that were run with clips of the chosen length, in the paper's order: foresee last."""
    others = [r for r in results.rankers if r != "foresee"]
    return tuple(r for r in (*others, "foresee") if any(results.of_campaign(d, r) for d in results.drivers))


def _by_kind(results: Results) -> Table:
    rankers = shown_rankers(results)
    columns = (
        Column("#TCs"),
        *(Column(title, (ranker,)) for ranker in rankers for title in (*(k.value for k in COLLISIONS), "Σ", "stuck")),
    )
    rows: list[Row] = []
    sums = []
    for driver in results.drivers:
        lines = [list(_kinds(results, driver, family, rankers)) for family in results.families]
        rows += family_rows(driver, results.families, lines)
        sums.append(tuple(map(total, zip(*lines, strict=True))))
    if sum(any(value is not None for value in line) for line in sums) > 1:
        rows += section("all drivers", [Row("Total", tuple(map(total, zip(*sums, strict=True))), RowKind.SUM)])
    notes = (
        "#TCs: children of foresee's clips. F1 to F5: collisions with objects beside the road, with pedestrians, and "
        "frontal, lateral and rear collisions with vehicles; Σ: all of them. Means of the repetitions.",
    )
    return Table("rq2", "RQ2: rankers compared, clips of 10 s, n_rp = 4", columns, tuple(rows), notes=notes)


def _kinds(results: Results, driver: str, family: str, rankers: tuple[str, ...]) -> Iterator[float | None]:
    own = results.of_campaign(driver, "foresee", family=family)
    yield mean(len(m.children_run) for m in own)
    for ranker in rankers:
        campaigns = results.of_campaign(driver, ranker, family=family)
        numbers = {kind: mean(m.of_verdict(kind) for m in campaigns) for kind in FAILURES}
        yield from (numbers[kind] for kind in COLLISIONS)
        yield total(numbers[kind] for kind in COLLISIONS)
        yield numbers[Verdict.STUCK]


def _by_family(results: Results) -> Table:
    """Return the table of findings and avoidable findings by family; the paper's table counts collisions instead."""
    rankers = shown_rankers(results)
    columns = tuple(Column(what.value, (ranker,)) for ranker in rankers for what in Counted)
    rows: list[Row] = []
    for driver in results.drivers:
        lines = [
            tuple(mean(m.count(what) for m in results.of_campaign(driver, ranker, family=family))
                  for ranker in rankers for what in Counted)
            for family in results.families
        ]  # fmt: skip
        rows += family_rows(driver, results.families, lines)
    notes = (
        "Findings: collisions of one family with the same story count once. Avoidable: another driver avoids one of "
        "them, or R157's driver or the anticipating driver would have avoided it. Means of the repetitions.",
    )
    return Table("rq2_findings", "RQ2: collisions, findings and avoidable findings", columns, tuple(rows), notes=notes)


def _counted(results: Results) -> Table:
    columns = (
        Column("clips"), Column("children"), *(Column(what.value) for what in Counted),
        *(Column(what.value, ("a clip",), 3) for what in Counted), Column("avoidable, %", digits=1),
        *(Column(who, ("avoidable by",)) for who in AVOIDERS.values()),
    )  # fmt: skip
    rows: list[Row] = []
    for driver in results.drivers:
        lines = [
            Row(ranker, tuple(_totals(campaigns)))
            for ranker in shown_rankers(results)
            if (campaigns := results.of_campaign(driver, ranker))
        ]
        rows += section(driver, lines)
    note = "Avoidable, %: of the findings."
    return Table("rq2_totals", "RQ2: results of each ranker", columns, tuple(rows), "ranker", (note,))


def _totals(campaigns: tuple[MeasuredCampaign, ...]) -> Iterator[float | None]:
    clips = mean(m.clips for m in campaigns)
    numbers = {what: mean(m.count(what) for m in campaigns) for what in Counted}
    yield clips
    yield mean(len(m.children_run) for m in campaigns)
    yield from numbers.values()
    yield from (n / clips if clips and n is not None else None for n in numbers.values())
    stories, avoidable = numbers[Counted.FINDINGS], numbers[Counted.AVOIDABLE]
    yield 100 * avoidable / stories if stories and avoidable is not None else None
    yield from (mean(avoided(m, who) for m in campaigns) for who in AVOIDERS)


JUST_BEFORE_S = 1.0
"""A risky point this long or less before an encounter is just before it, s. Ours: with clips of 10 s, the mutations of
such a point act from 4 to 5 s before the encounter on."""


def moments(results: Results) -> Table:
    """Return where the rankers' risky points lie, relative to the close encounters of the same runs."""
    columns = (
        Column("moments"), Column("just before an encounter, %", digits=1), Column("all seconds, %", digits=1),
        Column("per encounter"), Column("of these", ("children that fail, %",), 1),
        Column("of the others", ("children that fail, %",), 1),
    )  # fmt: skip
    rows: list[Row] = []
    for driver in results.drivers:
        lines = [
            Row(ranker, tuple(_before_encounters(campaigns)))
            for ranker in shown_rankers(results)
            if (campaigns := results.of_campaign(driver, ranker))
            and all(case.encounters_s is not None for m in campaigns for case in m.usable)
        ]
        rows += section(driver, lines)
    notes = (
        "Encounters: the close encounters of step 1a, from which foresee chooses. Just before: at most "
        f"{JUST_BEFORE_S:g} s before the next encounter, or at it. All seconds: the share of the whole seconds, from "
        "the first clip's on, that lie so. Per encounter: moments with the same next encounter, within half a clip.",
    )
    return Table("rq2_moments", "RQ2: risky points and encounters", columns, tuple(rows), "ranker", notes)


def _before_encounters(campaigns: tuple[MeasuredCampaign, ...]) -> Iterator[float | None]:
    near: list[bool] = []
    seconds: list[bool] = []
    failed: dict[bool, list[bool]] = {True: [], False: []}
    encounters: Counter[tuple[int, str, float]] = Counter()
    for measured in campaigns:
        for case in measured.usable:
            whole = range(math.ceil(measured.before_s), math.floor(case.simulated_s) + 1)
            seconds += [_is_just_before(_next_encounter_s(case, second), second) for second in whole]
            for clip in case.clips:
                if clip.at_s is None:
                    continue
                encounter_s = _next_encounter_s(case, clip.at_s)
                near.append(_is_just_before(encounter_s, clip.at_s))
                failed[near[-1]] += [child.verdict.is_failure for child in clip.children]
                if encounter_s is not None and encounter_s - clip.at_s <= measured.after_s:
                    encounters[measured.repetition, case.name, encounter_s] += 1
    yield len(near) / len(campaigns)
    yield _percent(near)
    yield _percent(seconds)
    yield mean(encounters.values())
    yield _percent(failed[True])
    yield _percent(failed[False])


def _next_encounter_s(case: MeasuredCase, time_s: float) -> float | None:
    """Return the time of the first encounter at a moment or after it."""
    return min((at_s for at_s in case.encounters_s or () if round(at_s - time_s, 2) >= 0), default=None)


def _is_just_before(encounter_s: float | None, time_s: float) -> bool:
    return encounter_s is not None and round(encounter_s - time_s, 2) <= JUST_BEFORE_S


def _percent(answers: list[bool]) -> float | None:
    return 100 * sum(answers) / len(answers) if answers else None


def _statistics(results: Results) -> Table:
    drivers = (*results.drivers, *((TOGETHER,) if len(results.drivers) > 1 else ()))
    others = [ranker for ranker in shown_rankers(results) if ranker != "foresee"]
    compared = [
        Compared(f"{driver}: foresee against {other}", what.value, compare(pairs))
        for driver, other, what in product(drivers, others, Counted)
        if (pairs := results.pairs(driver, "foresee", other, what))
    ]
    return comparison_table("rq2_statistics", "RQ2: foresee (first) against the others (second)", compared)
