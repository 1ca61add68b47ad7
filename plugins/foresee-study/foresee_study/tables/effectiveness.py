"""rq1: collisions by length of the clips and number of risky points; by ranking; share of the exhaustive search."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

from foresee_study.measured import Counted, MeasuredCampaign, MeasuredClip
from foresee_study.questions import CLIPS_S, POINTS
from foresee_study.results import Results, mean, mean_count, total
from foresee_study.settings import EXHAUSTIVE
from foresee_study.statistics import compare
from foresee_study.tables.comparing import Compared, comparison_table
from foresee_study.tables.table import Column, Row, RowKind, Table, Value, family_rows, section

NOTES = (
    "#RPs: risky points, one clip each; #C: collisions (F1 to F5) among their children; both are "
    "means of the repetitions. E: the exhaustive search, with a clip for each second.",
)


def effectiveness(results: Results) -> tuple[Table, ...]:
    """Return the tables of rq1."""
    return (
        _breakdown(results),
        *(_ranking(results, clip_s) for clip_s in CLIPS_S if any(
            results.of_campaign(driver, "proximity", clip_s) for driver in results.drivers
        )),
        _where(results),
        _rates(results),
        _statistics(results),
    )  # fmt: skip


def _breakdown(results: Results) -> Table:
    columns = tuple(
        column
        for clip_s in CLIPS_S
        for column in (
            *(Column(title, (f"clip duration = {clip_s:g} s", str(n))) for n in POINTS for title in ("#RPs", "#C.")),
            Column("#C.", (f"clip duration = {clip_s:g} s", "E")),
        )
    )
    rows: list[Row] = []
    for driver in results.drivers:
        lines = [
            [value for clip_s in CLIPS_S for value in _configurations(results, driver, family, clip_s)]
            for family in results.families
        ]
        rows += family_rows(driver, results.families, lines)
    return Table(
        "rq1", "RQ1: effectiveness. Collisions by scenario, configuration and driver", columns, tuple(rows), "n_rp",
        NOTES,
    )  # fmt: skip


def _configurations(results: Results, driver: str, family: str, clip_s: float) -> Iterator[float | None]:
    for n in POINTS:
        yield from _pair(results.of_campaign(driver, "foresee", clip_s, points=n, family=family))
    yield mean(m.count(Counted.COLLISIONS) for m in results.of_campaign(driver, EXHAUSTIVE, clip_s, family=family))


def _pair(campaigns: tuple[MeasuredCampaign, ...]) -> tuple[float | None, float | None]:
    return mean(m.clips for m in campaigns), mean(m.count(Counted.COLLISIONS) for m in campaigns)


def _ranking(results: Results, clip_s: float) -> Table:
    """Return the paper's second table of rq2, which compares the ranking by proximity with the whole forecast."""
    ranked = (("proximity", "Proximity rank"), ("foresee", "Risk-based rank"))
    columns = tuple(Column(title, (head, str(n))) for _, head in ranked for n in POINTS for title in ("#RPs", "#C."))
    rows: list[Row] = []
    for driver in results.drivers:
        lines = [
            [v for ranker, _ in ranked for n in POINTS
             for v in _pair(results.of_campaign(driver, ranker, clip_s, points=n, family=family))]
            for family in results.families
        ]  # fmt: skip
        of_driver = family_rows(driver, results.families, lines)
        if not of_driver:
            continue
        sums = [total(column) for column in zip(*lines, strict=True)]
        rates: list[Value] = []
        for points, collisions in zip(sums[::2], sums[1::2], strict=True):
            rates += [None, collisions / points if points and collisions is not None else None]
        rows += [*of_driver, Row("#C / #RP", tuple(rates), RowKind.SUM)]
    title = f"RQ1: effectiveness of the risk-based ranking, clips of {clip_s:g} s"
    return Table(f"rq1_ranking_{clip_s:g}s", title, columns, tuple(rows), "n_rp", NOTES)


def _rates(results: Results) -> Table:
    """Return the table of collisions, findings and avoidable findings per risky point, and their shares of the
    exhaustive search's.
    """
    columns = tuple(
        Column(title, (what.value,), digits)
        for what in Counted
        for title, digits in (("number", 2), ("a risky point", 3), ("of exhaustive, %", 1))
    )
    rows: list[Row] = []
    for driver, clip_s in product(results.drivers, CLIPS_S):
        everything = results.of_campaign(driver, EXHAUSTIVE, clip_s)
        lines = []
        for ranker in ("foresee", "proximity"):
            for n in POINTS:
                campaigns = results.of_campaign(driver, ranker, clip_s, points=n)
                if campaigns:
                    lines.append(Row(f"{ranker}, n_rp {n}", tuple(_shares(campaigns, everything))))
        if everything:
            lines.append(Row("exhaustive", tuple(_shares(everything, everything))))
        rows += section(f"{driver}, clips of {clip_s:g} s", lines)
    note = (
        "Numbers are means of the repetitions, and a share is the quotient of two means. Avoidable findings have a "
        "share only if reference drivers drove the failures of the exhaustive search, too."
    )
    return Table("rq1_rates", "RQ1: results per risky point, and the share of the exhaustive search", columns,
                 tuple(rows), "ranking", (note,))  # fmt: skip


def _shares(campaigns: tuple[MeasuredCampaign, ...], everything: tuple[MeasuredCampaign, ...]) -> Iterator[Value]:
    points = mean(m.clips for m in campaigns)
    for what in Counted:
        number = mean_count(campaigns, what)
        most = mean_count(everything, what)
        yield number
        yield number / points if points and number is not None else None
        yield 100 * number / most if most and number is not None else None


PLACES = (
    "at a moment that foresee studies", "up to half a clip later", "up to half a clip earlier", "farther away",
)  # fmt: skip
"""Where a second of the exhaustive search lies, by its distance from the nearest risky point of foresee."""
_SAME_S = 0.5
"""Largest distance from a moment that is still the same, s: the search studies whole seconds."""


class Place(NamedTuple):
    """Some seconds of the exhaustive search: where they lie, and how many clips, mutants and collisions they have."""

    name: str
    clips: float
    children: float
    collisions: float


def _where(results: Results) -> Table:
    """Return a table of where the collisions of the exhaustive search lie, by the nearest risky point of foresee."""
    columns = (
        Column("seconds, %", digits=1), Column("collisions", digits=1), Column("collisions, %", digits=1),
        Column("of the mutants, %", digits=1),
    )  # fmt: skip
    rows: list[Row] = []
    for driver, clip_s in product(results.drivers, CLIPS_S):
        if (places := where_collisions_lie(results, driver, clip_s)) is not None:
            clips, collisions = sum(place.clips for place in places), sum(place.collisions for place in places)
            lines = [
                Row(place.name, (
                    100 * place.clips / clips, place.collisions, 100 * place.collisions / collisions,
                    100 * place.collisions / place.children if place.children else None,
                ))
                for place in places
            ]  # fmt: skip
            rows += section(f"{driver}, clips of {clip_s:g} s", lines)
    notes = (
        "Each second of the exhaustive search by its distance from foresee's nearest risky point; means over foresee's "
        "repetitions. Of the mutants: the share that collides.",
    )
    return Table("rq1_where", "RQ1: where the collisions of the exhaustive search lie", columns, tuple(rows), "seconds",
                 notes)  # fmt: skip


def where_collisions_lie(results: Results, driver: str, clip_s: float) -> tuple[Place, ...] | None:
    """Return the seconds of the exhaustive search by their distance from foresee's nearest risky point; means of
    foresee's repetitions. None if one of the two was not run, the search has no collision, or foresee's file does not
    record its moments.
    """
    ranked = results.of_campaign(driver, "foresee", clip_s)
    searched = results.of_campaign(driver, EXHAUSTIVE, clip_s)
    moments = [clip.at_s for m in ranked for case in m.usable for clip in case.clips]
    if not searched or not moments or None in moments or not searched[0].count(Counted.COLLISIONS):
        return None
    clips, collisions, children = Counter[str](), Counter[str](), Counter[str]()
    for own in ranked:
        for name, clip in _placed(own, searched[0]):
            clips[name] += 1
            children[name] += len(clip.children)
            collisions[name] += sum(child.verdict.is_collision for child in clip.children)
    count = len(ranked)
    return tuple(Place(name, clips[name] / count, children[name] / count, collisions[name] / count) for name in PLACES)


def _placed(own: MeasuredCampaign, searched: MeasuredCampaign) -> Iterator[tuple[str, MeasuredClip]]:
    """Yield the clips of the exhaustive search, each with its place, in test cases that are usable in both."""
    points = {case.name: [clip.at_s for clip in case.clips if clip.at_s is not None] for case in own.usable}
    for case in searched.usable:
        for clip in case.clips if case.name in points else ():
            # The search studies each whole second from the first one on whose clip lies in the run.
            at_s = clip.at_s if clip.at_s is not None else math.ceil(searched.before_s) + clip.position
            apart_s = min((at_s - point_s for point_s in points[case.name]), key=abs, default=math.inf)
            if abs(apart_s) <= _SAME_S:
                yield PLACES[0], clip
            elif abs(apart_s) <= searched.clip_s / 2:
                yield PLACES[1 if apart_s > 0 else 2], clip
            else:
                yield PLACES[3], clip


def _statistics(results: Results) -> Table:
    compared = [
        Compared(f"{driver}, clips of {clip_s:g} s, n_rp {n}", what.value, compare(pairs))
        for driver, clip_s, n, what in product(results.drivers, CLIPS_S, POINTS, Counted)
        if (pairs := results.pairs(driver, "foresee", "proximity", what, clip_s, n))
    ]
    return comparison_table("rq1_statistics", "RQ1: foresee (first) against proximity (second)", compared)
