"""The tables of a report: findings by family, kind, class and driver, near misses, and all numbers of the campaigns."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from foresee_dsl.avoidance.anticipating import Answer
from foresee_dsl.avoidance.judge import ANTICIPATING, R157
from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.campaign.records import CaseRunOutcome
from foresee_dsl.campaign.written import WrittenCampaign
from foresee_dsl.language.document import family_order
from foresee_dsl.report.page.entries import FindingEntry, ReportedCampaign, case_runs, failing_runs
from foresee_dsl.report.terminal.raw_numbers import family_title
from foresee_dsl.report.terminal.tables import duration
from foresee_dsl.report.verdicts import ending
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict

MOST_NEAR = 10
"""Maximum number of near misses in the overview. Ours: as many as fit on a screen."""
MOST_BROKEN = 100
"""Maximum number of broken expectations of children in a report. Ours: a few screens."""


@dataclass(frozen=True)
class Table:
    """A table of plain values; `total` is its last row, or empty."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    total: tuple[str, ...] = ()
    texts: int = 1
    """Number of columns on the left that contain text; the others contain numbers."""


PREVENTABLE = f"preventable for {ANTICIPATING}"
_PREVENTED = {answer.value for answer in Answer if answer.preventable}


def overview(sources: Sequence[ReportedCampaign], findings: Sequence[FindingEntry]) -> Iterator[Table]:
    """Yield the tables at the beginning of a report."""
    several = len(sources) > 1
    yield _by("family", findings, lambda f: family_title(f.record.family))
    yield _by("kind", findings, lambda f: f"{f.verdict} {f.label}")
    yield _by("class", findings, lambda f: f.record.class_ or "not told")
    if several:
        yield _by("driver", findings, lambda f: f.driver)
    failed = [
        (
            *((driver,) if several else ()),
            case.id,
            ended(case),
            case.reason,
            case.preventability.answer if case.preventability else "",
            case.anticipation.answer.value if case.anticipation else "",
        )
        for driver, case in case_runs(source.campaign for source in sources)
        if ended(case) != Verdict.PASS.value
    ]
    if failed:
        headings = (*(("driver",) if several else ()), "test case", "verdict", "how it ended", R157, ANTICIPATING)
        yield Table("Test cases that fail without mutation", headings, tuple(failed), texts=len(headings))
    if (broken := breaking_children(sources)).rows:
        yield broken
    if (nearest := _nearest(sources)).rows:
        yield nearest


def breaking_children(sources: Sequence[ReportedCampaign]) -> Table:
    """Return the table of the mutants that passed but broke an expectation; without rows if there are none."""
    several = len(sources) > 1
    broken = [
        (*((source.campaign.driver,) if several else ()), child.name, clip.seed, sentence)
        for source in sources
        for clip in source.campaign.clip_runs
        for child in clip.children
        if child.verdict is Verdict.PASS
        for sentence in child.broken_expectations
    ]
    headings = (*(("driver",) if several else ()), "mutant", "test case", "what")
    more = len(broken) - MOST_BROKEN
    end = (f"and {more} more: campaign.json has all", *("" for _ in headings[1:])) if more > 0 else ()
    return Table("Children that break an expectation without another failure", headings, tuple(broken[:MOST_BROKEN]),
                 end, texts=len(headings))  # fmt: skip


def ended(case: CaseRunOutcome) -> str:
    """Return a test case's verdict, or `expectation` if it passed but broke expectations."""
    return ending(case).plain


def _nearest(sources: Sequence[ReportedCampaign]) -> Table:
    """Return the runs that passed with the smallest times to collision."""
    misses: list[tuple[float, tuple[str, ...]]] = []
    campaigns = [source.campaign for source in sources]
    runs = [(case.id, case.verdict, case.near) for _, case in case_runs(campaigns)]
    runs += [(c.name, c.verdict, c.near) for campaign in campaigns for c in campaign.mutants]
    for name, verdict, near in runs:
        first = near.ttc_s if near is not None else None
        if verdict is Verdict.PASS and first is not None and math.isfinite(first.value):
            row = (name, first.actor, f"{first.time_s:.2f}", *_misses(near))
            misses.append((first.value, row))
    misses.sort()
    headings = ("run", "with", "at s", "nearest m", "TTC s", "PET s", "braking m/s²")
    return Table("Nearest misses that passed", headings, tuple(row for _, row in misses[:MOST_NEAR]), texts=2)


def _misses(near: NearMisses | None) -> tuple[str, ...]:
    """Return distance, time to collision, post-encroachment time and needed braking as texts; "" for a measure without
    a value.
    """
    values = (near.distance_m, near.ttc_s, near.pet_s, near.drac_mps2) if near is not None else (None,) * 4
    return tuple("" if v is None or math.isinf(v.value) else f"{v.value:.2f}" for v in values)


def _by(what: str, findings: Sequence[FindingEntry], key: Callable[[FindingEntry], str]) -> Table:
    """Return a table of findings and failing runs by a key, with the numbers that the careful drivers would have
    avoided.
    """
    names = list(dict.fromkeys(map(key, findings)))
    rows = [_row(name, [f for f in findings if key(f) == name]) for name in sorted(names)]
    headings = (what, "findings", "runs", *(answer.value for answer in Preventable), PREVENTABLE)
    return Table(f"By {what}", headings, tuple(rows), _row("all", findings) if len(rows) > 1 else ())


def _row(name: str, findings: Sequence[FindingEntry]) -> tuple[str, ...]:
    answers = Counter(f.preventability for f in findings)
    ahead = sum(f.anticipation in _PREVENTED for f in findings)
    counts = (len(findings), failing_runs(findings), *(answers[answer.value] for answer in Preventable), ahead)
    return (name, *map(str, counts))


def numbers(sources: Sequence[ReportedCampaign]) -> Iterator[Table]:
    """Yield the tables with all numbers of each campaign."""
    for source in sources:
        campaign, name = source.campaign, ", ".join(source.name)
        yield Table(f"The campaign {name}".strip(), ("", "value"), tuple(_figures(campaign)))
        yield _family_table(campaign, name)
        yield _operator_table(campaign, name)
        if any(child.round for clip in campaign.clip_runs for child in clip.children):
            yield _allocation_table(campaign, name)
        yield Table(
            f"Test cases {name}".strip(),
            ("test case", "verdict", "how it ended", "points", "nearest m", "TTC s", "PET s", "braking m/s²"),
            tuple(_case_row(case) for case in campaign.test_cases),
            texts=3,
        )


def _figures(campaign: WrittenCampaign) -> Iterator[tuple[str, str]]:
    yield "test cases", str(len(campaign.test_cases))
    yield "risky points", str(campaign.risky_points)
    yield "clips", str(campaign.clips)
    yield "children", str(campaign.children)
    # The overview counts findings, with the answers for their minimised mutants; these are the answers for each mutant.
    yield "failing children, as found", str(sum(campaign.failures.values()))
    for driver, answers in ((R157, campaign.preventability), (ANTICIPATING, campaign.anticipation)):
        for answer, count in answers.items():
            yield f"  {driver}: {answer}", str(count)
    failures = (child for child in campaign.mutants if child.verdict.is_failure)
    opinions = Counter((o.name, o.answer) for child in failures for o in child.opinions)
    for (judge, answer), count in opinions.items():
        yield f"  {judge}: {answer}", str(count)
    yield "simulated", _duration(campaign.simulated_s)
    yield "time it took", _duration(campaign.wall_s)
    if campaign.within is not None:
        yield "other actors of clips within 0.1 m of their parent", f"{campaign.within:.1%}"


def _kinds(campaign: WrittenCampaign) -> list[str]:
    """Return the kinds of failures of a campaign; `goal` is one of them if it has a goal."""
    return [*(verdict.value for verdict in FAILURES), *([Verdict.GOAL.value] if campaign.goal is not None else [])]


def _family_table(campaign: WrittenCampaign, campaign_name: str) -> Table:
    kinds = _kinds(campaign)
    headings = ("family", "cases", "not passed", "points", "clips", "children", *kinds, "failing children")
    families = {case.id: case.family for case in campaign.test_cases}
    rows = [
        _family_row(campaign, families, {family}, family_title(family))
        for family in sorted(set(families.values()), key=family_order)
    ]
    total = _family_row(campaign, families, set(families.values()), "all")
    return Table(f"By family {campaign_name}".strip(), headings, tuple(rows), total)


def _family_row(campaign: WrittenCampaign, families: dict[str, str], which: set[str], name: str) -> tuple[str, ...]:
    cases = [case for case in campaign.test_cases if case.family in which]
    clips = [clip for clip in campaign.clip_runs if families.get(clip.seed, "") in which]
    verdicts = Counter(child.verdict.value for clip in clips for child in clip.children)
    kinds = [verdicts[kind] for kind in _kinds(campaign)]
    counts = (
        len(cases),
        sum(ended(case) != Verdict.PASS.value for case in cases),
        sum(case.risky_points for case in cases),
        len(clips),
        sum(len(clip.children) for clip in clips),
        *kinds,
        sum(kinds),
    )
    return (name, *map(str, counts))


def _operator_table(campaign: WrittenCampaign, campaign_name: str) -> Table:
    ran: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    for clip in campaign.clip_runs:
        for child in clip.children:
            names = " + ".join(child.operators) or "none"
            ran[names] += 1
            failed[names] += child.verdict.is_failure
    rows = [(name, str(ran[name]), str(failed[name]), f"{failed[name] / ran[name]:.1%}") for name in sorted(ran)]
    return Table(f"By operator {campaign_name}".strip(), ("operators", "children", "failing", "share"), tuple(rows))


def _allocation_table(campaign: WrittenCampaign, campaign_name: str) -> Table:
    """Return the table of children by clip and round; the clips with the most children come first."""
    rounds = sorted({child.round or 0 for clip in campaign.clip_runs for child in clip.children})
    rows = []
    for clip in sorted(campaign.clip_runs, key=lambda clip: (-len(clip.children), clip.name)):
        of = Counter(child.round or 0 for child in clip.children)
        near = sum(bool(child.drawn_near) for child in clip.children)
        failing = sum(child.verdict.is_failure for child in clip.children)
        counts = (len(clip.children), *(of[number] for number in rounds), near, failing)
        rows.append((clip.name, *map(str, counts)))
    headings = ("clip", "children", *(f"round {number}" for number in rounds), "near another", "failing")
    return Table(f"Children by clip {campaign_name}".strip(), headings, tuple(rows))


def _case_row(case: CaseRunOutcome) -> tuple[str, ...]:
    measures = _misses(case.near)
    return (case.id, ended(case), case.reason, str(case.risky_points), *measures)


def _duration(seconds: float) -> str:
    return f"{duration(seconds)} {'h' if round(seconds) >= 3600 else 'min'}"
