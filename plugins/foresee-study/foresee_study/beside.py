"""Compares the paper's figures with ours, as a table and in sentences, for the pages of a study."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from foresee_dsl.derive.presets import PAPER, PAPER_BRIEF, PAPER_LATE
from foresee_study.paper import FIGURES, STANDS_FOR, Ours, PaperFigure, Unit, a_child_of_paper, children_colliding
from foresee_study.results import TOGETHER, Results
from foresee_study.settings import CHOSEN_S
from foresee_study.tables.effectiveness import where_collisions_lie
from foresee_study.tables.table import Column, Row, Table, Value, section

NEAR = 1.25
"""Factor within which two figures are called close. Ours."""


def beside(results: Results, question: str) -> Table:
    """Return a table of the paper's figures and ours for a question."""
    drivers = (*results.drivers, *((TOGETHER,) if len(results.drivers) > 1 else ()))
    figures = [figure for figure in FIGURES if figure.question == question]
    ours = {driver: [figure.ours(results, driver) for figure in figures] for driver in drivers}
    compared = [driver for driver in drivers if any(ours[driver])]
    if compared[1:] == [TOGETHER]:
        compared.pop()  # with only one driver, the figures of all drivers together are those of that driver
    columns = [Column(title, (driver,)) for driver in compared for title in ("paper", "ours", "95 %")]
    rows: list[Row] = []
    for k, figure in enumerate(figures):
        values: list[Value] = []
        for driver in compared:
            values += [figure.of(driver)[1], *_values([ours[driver][k]])]
        if any(value is not None for value in values[1::3]):
            rows.append(Row(f"{figure.title} ({figure.section})", tuple(values)))
    names = [f"{driver} stands for {STANDS_FOR[driver]}" for driver in results.drivers if driver in STANDS_FOR]
    others = (
        "Any other driver is compared with the paper's two together, or with InterFuser if there is no such figure."
    )
    notes = [f"Here {' and '.join(names)}. {others}" if names else others]
    if question == "rq4":
        notes += [
            f"DriveFuzz's budget with {driver} is not the paper's, but {budget}."
            for driver in results.drivers
            if (budget := _other_budget(results, driver))
        ]
    return Table(f"{question}_paper", f"{question.upper()}: the paper's figures and ours", tuple(columns), tuple(rows),
                 "figure", tuple(notes))  # fmt: skip


def readings(results: Results) -> Table:
    """Return the paper's figures of rq2 and rq3 beside ours in each reading of the paper that was run."""
    columns = [Column("paper"), *(Column(title, (name,)) for name in results.readings for title in ("ours", "95 %"))]
    rows: list[Row] = []
    if len(results.readings) > 1:
        each = [replace(results, preset=name) for name in results.readings]
        ran = [{m.driver for m in results.campaigns if m.preset == name} for name in results.readings]
        together = len(ran[0]) > 1 and all(drivers == ran[0] for drivers in ran)
        for driver in (*results.drivers, *((TOGETHER,) if together else ())):
            lines = [
                Row(figure.title, (figure.of(driver)[1], *_values(ours)))
                for figure in FIGURES
                if figure.question in {"rq2", "rq3"} and all(ours := [figure.ours(r, driver) for r in each])
            ]
            rows += section(driver, lines)
    readings_run = "; ".join(f"{name}: {_READINGS.get(name, 'see its preset')}" for name in results.readings)
    notes = (f"What the paper leaves open is read so, by preset: {readings_run}.",)
    return Table("rq2_readings", "RQ2 and RQ3: the paper's figures in each reading of its mutation", tuple(columns),
                 tuple(rows), "figure", notes)  # fmt: skip


_READINGS = {
    PAPER.name: "the steering angle is held for the whole clip",
    PAPER_LATE.name: "from 1 s before the risky point to the clip's end",
    PAPER_BRIEF.name: "for the clip's first second",
}


def _values(ours: list[Ours | None]) -> Iterator[Value]:
    for own in ours:
        yield own.value if own else None
        yield _ends(own)


def _ends(ours: Ours | None) -> Value:
    if ours is None or ours.interval is None or math.isnan(ours.interval.low):
        return None
    if math.isinf(ours.interval.high):  # some resamples have nothing to compare with
        return f"at least {_short(ours.interval.low)}"
    return f"{_short(ours.interval.low)} to {_short(ours.interval.high)}"


def _short(value: float) -> str:
    digits = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return Column("", digits=digits).text(value)


def in_words(results: Results, question: str, *, headlines: bool = False) -> tuple[str, ...]:
    """Return a sentence for each figure of a question that the paper also has, and for each driver.

    Args:
        results: the study's results.
        question: name of the question.
        headlines: only the main figures, for all drivers together if the paper has that figure.
    """
    sentences: list[str] = []
    for figure in FIGURES:
        if figure.question != question or (headlines and not figure.headline):
            continue
        together = (TOGETHER,) if len(results.drivers) > 1 and TOGETHER in figure.values else ()
        drivers = together if headlines and together else (*results.drivers, *together)
        sentences += [sentence for driver in drivers for sentence in _sentences(results, figure, driver)]
    return tuple(sentences)


def _sentences(results: Results, figure: PaperFigure, driver: str) -> Iterator[str]:
    ours, (name, paper) = figure.ours(results, driver), figure.of(driver)
    if ours is None:
        return
    who = "all drivers together" if driver == TOGETHER else f"`{driver}`"
    unit = figure.unit.sign
    ends = _ends(ours)
    between = f" ({ends})" if ends is not None else ""
    what = f"{figure.what[0].upper()}{figure.what[1:]}, {who}"
    beside_paper = f"the paper's {name} {_short(paper)}{unit}"
    if figure.question == "rq4" and (budget := _other_budget(results, driver)):
        yield f"{what}, with another budget than the paper's ({budget}): {_short(ours.value)}{unit}{between}. " \
              f"With about one mutated run a test case and iteration, {beside_paper}."  # fmt: skip
        return
    judged = f"{_judged(ours, paper, figure.unit)}{_why(results, figure, driver)}{_elsewhere(results, figure, driver)}"
    yield f"{what}: {_short(ours.value)}{unit}{between}, {beside_paper}. {judged}"


def _other_budget(results: Results, driver: str) -> str:
    """Return the budget with which DriveFuzz ran with a driver; "" for the paper's, one mutated run a test case and
    iteration.
    """
    own = {(f.cycles, f.mutations) for f in results.fuzzings if driver in (f.driver, TOGETHER)} - {(1, 1)}
    return ", ".join(
        f"{cycles} cycle{'s' * (cycles > 1)} of {mutations} mutation{'s' * (mutations > 1)}"
        for cycles, mutations in sorted(own)
    )


def _judged(ours: Ours, paper: float, unit: Unit) -> str:
    inside = ours.interval is not None and ours.interval.low <= paper <= ours.interval.high
    neutral = unit.neutral
    if inside:
        judged = "The paper's value lies within our interval"
    elif paper > 0 and ours.value > 0 and 1 / NEAR <= ours.value / paper <= NEAR:
        judged = "The two are close"
    else:
        judged = f"Ours is {'larger' if ours.value > paper else 'smaller'}"
    if math.isnan(neutral):
        return f"{judged}."
    same = (ours.value - neutral) * (paper - neutral) > 0
    certain = ours.interval is not None and not ours.interval.low <= neutral <= ours.interval.high
    direction = "the direction is the same" if same else "the direction is the opposite"
    if ours.value == neutral:
        return f"{judged}; here there is no difference."
    if ours.interval is None or math.isnan(ours.interval.low):
        return f"{judged}; {direction}."
    return f"{judged}; {direction}, and {'it is more than chance' if certain else 'it may be chance'} by its interval."


def _why(results: Results, figure: PaperFigure, driver: str) -> str:
    """Return a sentence about a comparison of two rankers: whether foresee's rate or the other ranker's causes the
    difference from the paper; "" for other comparisons.
    """
    if figure.question != "rq2" or figure.unit is not Unit.MORE:
        return ""
    other = figure.what.rpartition(" ")[2]
    shares = children_colliding(results, driver, other)
    own_paper, theirs_paper = (a_child_of_paper(driver, name) for name in ("foresee", other))
    if shares is None or own_paper is None or theirs_paper is None:
        return ""
    own, theirs = shares
    rates = (
        f" A child collides in {100 * own:.1f} % of foresee's runs (paper: {100 * own_paper:.1f} %) and in "
        f"{100 * theirs:.1f} % of {other}'s (paper: {100 * theirs_paper:.1f} %)"
    )
    if not own or not theirs:
        return f"{rates}."
    by_own, by_theirs = math.log(own / own_paper), math.log(theirs / theirs_paper)
    if abs(by_own) > 2 * abs(by_theirs):
        return f"{rates}: the difference to the paper is mostly foresee's own rate."
    if abs(by_theirs) > 2 * abs(by_own):
        return f"{rates}: the difference to the paper is mostly the rate of {other}."
    return f"{rates}: both rates differ from the paper's."


def _elsewhere(results: Results, figure: PaperFigure, driver: str) -> str:
    """Return a sentence about where the exhaustive search's collisions lie, for foresee's share of them; "" for other
    figures.
    """
    if figure.question != "rq1" or figure.unit is not Unit.SHARE or driver == TOGETHER:
        return ""
    clip_s = 6.0 if "6 s" in figure.what else CHOSEN_S
    places = where_collisions_lie(results, driver, clip_s)
    if places is None:
        return ""
    every = sum(place.collisions for place in places)
    same, later, earlier, _ = (f"{100 * place.collisions / every:.0f} %" for place in places)
    apart = f"{clip_s / 2:g} s"
    return (
        f" Of the search's collisions {same} lie at a second that foresee studies, {later} up to {apart} later and "
        f"{earlier} up to {apart} earlier: near the same encounters, but with another beginning of the mutation."
    )
