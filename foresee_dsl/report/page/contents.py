"""The contents of a report on finished campaigns: the findings with their runs, and the raw numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.avoidance.responsibility import FOLDED
from foresee_dsl.campaign.assembly import reference_trace
from foresee_dsl.campaign.driving import case_file_name
from foresee_dsl.campaign.findings.diagnosing import diagnosis_of
from foresee_dsl.campaign.findings.sureness import sureness_of
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome, WrittenFinding
from foresee_dsl.campaign.results import breaking_only
from foresee_dsl.campaign.triage.decisions import counted_decisions
from foresee_dsl.campaign.triage.standing import standing_of_written
from foresee_dsl.campaign.written import WrittenCampaign, read_campaign_folder
from foresee_dsl.report.page.entries import FindingEntry, ReportedCampaign, case_runs, failing_runs
from foresee_dsl.report.page.runs import FailingRun, Reader
from foresee_dsl.report.page.tables import Table, breaking_children, ended, numbers, overview
from foresee_dsl.report.safe_text import counted
from foresee_dsl.report.verdicts import not_deterministic, unused_clips
from foresee_dsl.simulate.results.verdict import EXPECTATION, FAILURES, Verdict

MOST_RUNS = 25
"""Maximum number of runs of a finding that a report shows; it gives only the names of further runs. Ours: more runs
with the same story show nothing new."""
MOST_PLAYBACKS = 400
"""Number of playbacks after which further findings show only their representative. Ours: at 15 kB and 0.08 s each, 400
take 6 MB and 30 s."""
_WITHOUT_NOTE = (Verdict.PASS, *FAILURES, Verdict.GOAL)
"""Verdicts that need no note at the top of the report, because it shows failures as findings."""


@dataclass(frozen=True)
class Contents:
    """The contents of a report.

    Attributes:
        notes: what a reader should know first: the campaign was interrupted, steps could not be run, an older version
            wrote the file.
        overview, numbers: the tables before and after the findings.
        breaking: the table of the mutants that break only an expectation, which is also in the overview.
    """

    title: str
    headline: str
    subtitle: str
    findings: tuple[FindingEntry, ...]
    notes: tuple[str, ...]
    overview: tuple[Table, ...] = ()
    numbers: tuple[Table, ...] = ()
    breaking: Table | None = None
    nothing: str = "Nothing failed. The overview has the nearest misses."
    """What stands in place of findings if there are none."""

    @property
    def folded(self) -> tuple[FindingEntry, ...]:
        """Return the findings that are only counted until the reader unfolds them."""
        return tuple(finding for finding in self.findings if finding.folded)

    @property
    def folded_text(self) -> str:
        """Return how many findings are folded, by judgement, such as `11 that no driver can be expected to avoid`."""
        counts = Counter(finding.judgement_word for finding in self.folded if finding.triage is None)
        kinds = [f"{counts[whose.value]} {whose.counted}" for whose in FOLDED if counts[whose.value]]
        triaged = counted_decisions(finding.triage for finding in self.folded if finding.triage is not None)
        return ", ".join([*kinds, *filter(None, [triaged])])

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"headline": self.headline, "notes": self.notes, "findings": self.findings}


def contents_of(folders: Sequence[Path], reader: Reader) -> Contents:
    """Return the contents of a report on finished campaigns.

    Raises:
        ForeseeError: a folder does not hold a campaign.
    """
    campaigns = [read_campaign_folder(folder) for folder in folders]
    sources = [
        ReportedCampaign(campaign, standing_of_written(campaign), name)
        for campaign, name in zip(campaigns, _names(campaigns), strict=True)
    ]
    listed_cases: set[tuple[str, int, str]] = set()
    findings = tuple(finding for source in sources for finding in _findings(source, reader, listed_cases))
    breaking = _breaking(campaigns)
    return Contents(
        title=", ".join(dict.fromkeys(c.driver for c in campaigns)),
        headline=_headline(campaigns, findings, breaking),
        subtitle=_subtitle(campaigns),
        findings=findings,
        notes=(
            *(note for source in sources for note in _notes(source)),
            *_counts(campaigns),
            *(note for campaign in campaigns for note in _not_run(campaign)),
        ),
        overview=tuple(overview(sources, findings)),
        numbers=tuple(numbers(sources)),
        breaking=breaking_children(sources),
        nothing=f"Nothing failed, but {breaking}: the overview lists them." if breaking else Contents.nothing,
    )


def _names(campaigns: Sequence[WrittenCampaign]) -> list[tuple[str, ...]]:
    """Return what tells each campaign from the others: its driver, and as far as needed ranker, preset and folder."""
    if len(campaigns) == 1:
        return [()]
    names: list[tuple[str, ...]] = [(campaign.driver,) for campaign in campaigns]
    for others in ([c.ranker for c in campaigns], [c.preset for c in campaigns], [c.folder.name for c in campaigns]):
        often = Counter(names)
        if len(set(others)) > 1:
            names = [(*name, other) if often[name] > 1 else name for name, other in zip(names, others, strict=True)]
    return names


def _breaking(campaigns: Sequence[WrittenCampaign]) -> str:
    """Return, in words, how many runs break an expectation without another failure; "" if there are none."""
    cases = sum(ended(case) == EXPECTATION for _, case in case_runs(campaigns))
    runs = cases + len([child for c in campaigns for child in breaking_only((), c.mutants)])
    return f"{counted(runs, 'run')} {'breaks' if runs == 1 else 'break'} an expectation" if runs else ""


def _headline(campaigns: Sequence[WrittenCampaign], findings: Sequence[FindingEntry], breaking: str) -> str:
    runs = failing_runs(findings)
    children = sum(c.children for c in campaigns)
    clips = sum(c.clips for c in campaigns)
    cases = len({case.id for c in campaigns for case in c.test_cases})
    finding = f"{counted(len(findings), 'finding')} in {counted(runs, 'failing run')}" if findings else "No failures"
    if breaking:
        finding = f"{finding}, and {breaking} without another failure" if findings else f"{finding}, but {breaking}"
    return (
        f"{finding}, among {counted(children, 'child', 'children')} of {counted(clips, 'clip')} "
        f"from {counted(cases, 'test case')}"
    )


def _subtitle(campaigns: Sequence[WrittenCampaign]) -> str:
    first = campaigns[0]
    settings = first.settings
    length = settings.before_s + settings.after_s
    drivers = ", ".join(dict.fromkeys(c.driver for c in campaigns))
    rankers = ", ".join(dict.fromkeys(c.ranker for c in campaigns))
    return (
        f"driver {drivers} · ranker {rankers} · preset {first.preset} · clips of at most {length:g} s · "
        f"{counted(settings.risky_points, 'risky point')} × {counted(settings.children, 'child', 'children')} · "
        f"seed {settings.seed}"
    )


def _notes(source: ReportedCampaign) -> Iterator[str]:
    campaign = source.campaign
    if campaign.interrupted:
        yield f"The campaign in {source.campaign.folder} was interrupted: what was finished is shown."
    if campaign.findings is None:
        yield (
            f"{source.campaign.folder}/campaign.json was written by an earlier version: each failure stands alone. "
            "Run the campaign again, and equal stories become one finding."
        )
    if campaign.deterministic is False:
        yield f"{not_deterministic(campaign.driver, [record.rate or '' for record in campaign.findings or ()])}."
    if (goal := campaign.goal) is not None:
        others = f"; {counted(goal.others, 'other failure')} keep it" if goal.others else ""
        yield (
            f"The campaign searched the expectation `{goal.name}`: {counted(goal.children, 'child', 'children')} and "
            f"{counted(goal.findings, 'finding')} break it{others}."
        )
    of = f"{', '.join(source.name)}: " if source.name else ""
    yield from (f"{of}{line}." for line in unused_clips(campaign.clip_runs, campaign.settings))
    yield from source.standing.notes


def _counts(campaigns: Sequence[WrittenCampaign]) -> Iterator[str]:
    """Yield how many test cases, with each driver, and how many children of all campaigns need a note."""
    runs = case_runs(campaigns)
    drivers = list(dict.fromkeys(driver for driver, _ in runs))
    for driver in drivers:
        cases = [case for of, case in runs if of == driver]
        broke = Counter(map(ended, cases))
        counts = [
            f"{broke[v.value]} ended with {v.value}" for v in Verdict if broke[v.value] and v not in _WITHOUT_NOTE
        ]
        counts += [f"{broke[EXPECTATION]} broke an expectation"] if broke[EXPECTATION] else []
        if counts:
            of = f"{counted(len(cases), 'test case')}{f' with {driver}' if len(drivers) > 1 else ''}"
            yield f"Of {of}, {', '.join(counts)}: see the overview."
    if children := sum(len(breaking_only((), campaign.mutants)) for campaign in campaigns):
        of = counted(sum(c.children for c in campaigns), "child", "children")
        yield f"Of {of}, {children} broke an expectation without another failure: see the list below."


def _not_run(campaign: WrittenCampaign) -> Iterator[str]:
    if campaign.broken:
        yield f"{counted(len(campaign.broken), 'step')} could not be run at all: {'; '.join(campaign.broken[:5])}"


# ---- findings -------------------------------------------------------------------------------------------------------


def _findings(
    source: ReportedCampaign, reader: Reader, listed_cases: set[tuple[str, int, str]]
) -> Iterator[FindingEntry]:
    """Yield the findings of a campaign and add their runs of test cases to `listed_cases`.

    Left out are findings of which all runs are in it, because a campaign with another ranker has the same ones.
    """
    failures = _failures(source)
    for record in source.campaign.findings or _each_alone(source):
        names = [name for name in (record.name, *record.siblings) if name in failures]
        cases = {key for name in names if (key := failures[name].unmutated) is not None}
        if not names or (len(names) == len(cases) and cases <= listed_cases):
            continue
        listed_cases |= cases
        most = MOST_RUNS if len(reader.playbacks) < MOST_PLAYBACKS else 1
        outcomes = [failures[name] for name in names[:most]]
        if (small := _minimised(source, record, outcomes[0])) is not None:
            outcomes.insert(0, small)
        runs = tuple(map(reader.read, outcomes))
        # Earlier versions wrote the sentence of the run before minimising into the finding, so it is not used for the
        # minimised run.
        reduced = small.minimised if small is not None else None
        sentence = (reduced and reduced.sentence) or record.sentence
        answer = record.preventability or Preventable.UNKNOWN
        yield FindingEntry(
            replace(record, class_=record.class_ or runs[0].class_, preventability=answer),
            key="-".join((*source.name, record.name)),
            title=sentence,
            label=runs[0].label,
            driver=source.campaign.driver,
            runs=runs,
            more=tuple(names[most:]),
            diagnosis=diagnosis_of(source.campaign.folder, record.name, runs[0].outcome.record.reason),
            sure=sureness_of(source.campaign.folder, record.name, runs[0].outcome.record.reason),
            since=source.standing.of(record.story),
            triage=source.standing.decisions.get(record.story),
        )


def _minimised(source: ReportedCampaign, record: WrittenFinding, outcome: FailingRun) -> FailingRun | None:
    """Return the run of a finding's minimised mutant; None if there is none, it does not fail, or its file is gone."""
    small = record.minimised
    file = source.campaign.folder / small.file if small is not None else None
    if small is None or file is None or not small.sentence or not file.is_file():
        return None
    return replace(
        outcome,
        address=file.as_posix(),
        record=replace(outcome.record, reason=small.reason, judgements=record.judgements, references=small.references),
        trace=file.with_suffix(".npz"),
        beside=_beside(file, small.references),
        minimised=small,
        unreduced=Path(outcome.address),
    )


def _beside(file: Path, references: Sequence[ReferenceRun]) -> tuple[tuple[str, Path], ...]:
    """Return the stored runs of reference drivers of the failure in a file, by driver; older campaigns have none."""
    files = ((run.driver, Path(reference_trace(file.as_posix(), run.driver))) for run in references)
    return tuple((driver, trace) for driver, trace in files if trace.is_file())


def _failures(source: ReportedCampaign) -> dict[str, FailingRun]:
    """Return the failing runs of a campaign by name."""
    folder, campaign = source.campaign.folder, source.campaign
    seed = campaign.settings.seed
    traces: dict[str, Path] = {}
    outcomes: dict[str, FailingRun] = {}
    for case in campaign.test_cases:
        if case.trace:
            traces[case.id] = folder / case.trace
        name = _case_name(case)
        outcomes[name] = FailingRun(
            name=name,
            address=case.id,
            record=case,
            driver=campaign.driver,
            seed=seed,
            trace=traces.get(case.id),
            beside=_beside(traces[case.id], case.references) if case.trace else (),
        )
    for clip, child in _failing_children(campaign):
        outcomes[child.name] = _child(source, clip, child, traces.get(clip.seed), seed)
    return outcomes


def _child(
    source: ReportedCampaign, clip: ClipOutcome, child: ChildOutcome, parent: Path | None, seed: int
) -> FailingRun:
    # The file of a repeated mutation, such as `case_p1_s3_m2`.
    again = child.name.rpartition("_m")[0].rpartition("_s")
    if again[0] == clip.name and again[2].isdigit():
        seed = int(again[2])
    return FailingRun(
        name=child.name,
        address=(source.campaign.folder / child.file).as_posix(),
        record=child,
        driver=source.campaign.driver,
        seed=seed,
        trace=source.campaign.folder / "traces" / f"{child.name}.npz",
        parent_trace=parent,
        operators=child.operators,
        why_made=child.why,
    )


def _case_name(case: CaseRunOutcome) -> str:
    """Return the name with which the files of a test case begin: the name of its trace, if it has a trace."""
    return Path(case.trace).stem if case.trace else case_file_name(case.id, Path(case.id).stem)


def _failing_children(campaign: WrittenCampaign) -> Iterator[tuple[ClipOutcome, ChildOutcome]]:
    for clip in campaign.clip_runs:
        for child in clip.children:
            if child.verdict.is_failure:
                yield clip, child


def _each_alone(source: ReportedCampaign) -> tuple[WrittenFinding, ...]:
    """Return each failure as a finding of its own, for an older `campaign.json` without findings."""
    families = {case.id: case.family for case in source.campaign.test_cases}
    failures: list[tuple[str, CaseRunOutcome | ChildOutcome, str, str]] = [
        (_case_name(case), case, case.id, case.id) for case in source.campaign.test_cases if case.verdict.is_failure
    ]
    failures += [(child.name, child, clip.seed, child.file) for clip, child in _failing_children(source.campaign)]
    return tuple(
        WrittenFinding(
            name=name, sentence=run.reason, class_="", verdict=run.verdict, test_case=test_case, file=file, count=1,
            siblings=(), sibling_files=(), family=families.get(test_case, ""), preventability=run.preventable, why=None,
            anticipation=run.anticipation.answer if run.anticipation else None,
        )
        for name, run, test_case, file in failures
    )  # fmt: skip
