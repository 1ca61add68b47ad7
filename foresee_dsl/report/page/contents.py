"""What a report of finished campaigns says: their findings with every run of them, and the raw numbers."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.campaign.findings import case_file_name
from foresee_dsl.derive.preventability import Preventable
from foresee_dsl.report.page.recorded import Campaign, CaseRun, Child, ClipRun, Finding, read_campaign_folder
from foresee_dsl.report.page.runs import Outcome, Reader, Run
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict

FAMILY_TITLES = {
    "3": "crossing actor",
    "4": "obstacle after a turn",
    "7": "red-light runner",
    "8": "unprotected left",
    "9": "right turn into traffic",
}
"""The paper's five scenarios in a few words (table of scenarios)."""

MOST_RUNS = 25
"""Runs of one finding that a report shows; the others are named. Ours: nobody looks at more that tell one story."""
MOST_PLAYBACKS = 400
"""From so many playbacks on, further findings show their representative only. Ours: of 15 kB and 0.05 s each, they
are 6 MB and 20 s."""

_NO_ANCHOR = re.compile(r"[^\w.-]+", re.ASCII)
_LONGEST_ANCHOR = 120


@dataclass(frozen=True)
class Source:
    """A campaign's folder and what it recorded."""

    folder: Path
    campaign: Campaign


@dataclass(frozen=True)
class Found:
    """A finding with its runs; the first is its representative.

    `key`: what tells it from all others of the report.
    """

    key: str
    title: str
    class_: str
    verdict: str
    label: str
    family: str
    driver: str
    preventability: str
    test_case: str
    runs: tuple[Run, ...]
    more: tuple[str, ...] = ()
    """Names of further runs, which are only named."""

    @property
    def count(self) -> int:
        """How many failing runs tell it; one that was made smaller is not counted again."""
        return sum(run.outcome.minimised is None for run in self.runs) + len(self.more)

    @property
    def anchor(self) -> str:
        """The key, as addresses and file names can hold it."""
        plain = _NO_ANCHOR.sub("_", self.key)
        if plain == self.key and len(plain) <= _LONGEST_ANCHOR:
            return plain
        return f"{plain[:_LONGEST_ANCHOR]}-{hashlib.sha256(self.key.encode()).hexdigest()[:8]}"

    @property
    def name(self) -> str:
        """The representative's."""
        return self.runs[0].outcome.name

    @property
    def others(self) -> tuple[str, ...]:
        """The names of the other runs that are shown."""
        return tuple(run.outcome.name for run in self.runs if run.outcome.name != self.name)

    @property
    def mutated(self) -> bool:
        """Whether its runs are mutants' (or those of a test case as it is)."""
        return bool(self.runs[0].outcome.operators) or self.runs[0].outcome.parent_trace is not None


@dataclass(frozen=True)
class Table:
    """A table of plain values; the first column is text, `total` the last row."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    total: tuple[str, ...] = ()
    texts: int = 1
    """How many of the first columns hold text, not numbers."""


@dataclass(frozen=True)
class Contents:
    """All that a report says.

    Attributes:
        notes: what a reader should know first (interrupted, what could not be run, an older version's file).
        overview, numbers: tables.
    """

    title: str
    headline: str
    subtitle: str
    findings: tuple[Found, ...]
    notes: tuple[str, ...]
    overview: tuple[Table, ...] = ()
    numbers: tuple[Table, ...] = ()


def contents_of(folders: Sequence[Path], reader: Reader) -> Contents:
    """Read finished campaigns.

    Raises:
        ForeseeError: a folder holds none.
    """
    sources = [Source(folder, read_campaign_folder(folder)) for folder in folders]
    several = len(sources) > 1
    findings = tuple(found for source in sources for found in _findings(source, reader, several=several))
    campaigns = [source.campaign for source in sources]
    return Contents(
        title=", ".join(dict.fromkeys(c.driver for c in campaigns)),
        headline=_headline(campaigns, findings),
        subtitle=_subtitle(campaigns),
        findings=findings,
        notes=tuple(note for source in sources for note in _notes(source)),
        overview=tuple(_overview(sources, findings)),
        numbers=tuple(_numbers(sources)),
    )


def _headline(campaigns: Sequence[Campaign], findings: Sequence[Found]) -> str:
    runs = sum(found.count for found in findings)
    children = sum(c.children for c in campaigns)
    clips = sum(c.clips for c in campaigns)
    cases = sum(len(c.test_cases) for c in campaigns)
    found = f"{_counted(len(findings), 'finding')} in {_counted(runs, 'failing run')}" if findings else "No failures"
    return (
        f"{found}, among {_counted(children, 'child', 'children')} of {_counted(clips, 'clip')} "
        f"from {_counted(cases, 'test case')}"
    )


def _subtitle(campaigns: Sequence[Campaign]) -> str:
    first = campaigns[0]
    settings = first.settings
    length = float(settings.get("before_s", 0.0)) + float(settings.get("after_s", 0.0))
    drivers = ", ".join(dict.fromkeys(c.driver for c in campaigns))
    rankers = ", ".join(dict.fromkeys(c.ranker for c in campaigns))
    return (
        f"driver {drivers} · ranker {rankers} · preset {first.preset} · clips of {length:g} s · "
        f"{settings.get('risky_points', '?')} risky points × {settings.get('children', '?')} children · "
        f"seed {settings.get('seed', 0)}"
    )


def _notes(source: Source) -> Iterator[str]:
    campaign = source.campaign
    if campaign.interrupted:
        yield f"The campaign in {source.folder} was interrupted: what was finished is shown."
    if campaign.findings is None:
        yield (
            f"{source.folder}/campaign.json was written by an earlier version: each failure stands alone. "
            "Run the campaign again, and equal stories become one finding."
        )
    if campaign.broken:
        yield f"{_counted(len(campaign.broken), 'step')} could not be run at all: {'; '.join(campaign.broken[:5])}"


# ---- findings -------------------------------------------------------------------------------------------------------


def _findings(source: Source, reader: Reader, *, several: bool) -> Iterator[Found]:
    failures = _failures(source)
    for record in source.campaign.findings or _each_alone(source):
        names = [name for name in (record.name, *record.siblings) if name in failures]
        if not names:
            continue
        most = MOST_RUNS if len(reader.playbacks) < MOST_PLAYBACKS else 1
        outcomes = [failures[name] for name in names[:most]]
        if (small := _made_smaller(source, record, outcomes[0])) is not None:
            outcomes.insert(0, small)
        runs = tuple(map(reader.read, outcomes))
        answer = record.preventability or Preventable.UNKNOWN.value
        yield Found(
            key=f"{source.campaign.driver}-{record.name}" if several else record.name,
            title=record.sentence,
            class_=record.class_ or runs[0].class_,
            verdict=record.verdict,
            label=runs[0].label,
            family=record.family,
            driver=source.campaign.driver,
            preventability=answer,
            test_case=record.test_case,
            runs=runs,
            more=tuple(names[most:]),
        )


def _made_smaller(source: Source, record: Finding, found: Outcome) -> Outcome | None:
    """Return the run of a finding's minimised mutant, None where there is none (any more)."""
    small = record.minimised
    file = source.folder / small.file if small is not None else None
    if small is None or file is None or not file.is_file():
        return None
    return replace(
        found,
        address=file.as_posix(),
        reason=small.reason,
        trace=file.with_suffix(".npz"),
        minimised=small,
        unreduced=Path(found.address),
    )


def _failures(source: Source) -> dict[str, Outcome]:
    """Return the failing runs of a campaign by name."""
    folder, campaign = source.folder, source.campaign
    seed = int(campaign.settings.get("seed", 0))
    traces: dict[str, Path] = {}
    found: dict[str, Outcome] = {}
    for case in campaign.test_cases:
        if case.trace:
            traces[case.test_case] = folder / case.trace
        name = _case_name(case)
        found[name] = Outcome(
            name=name,
            address=case.test_case,
            verdict=case.verdict,
            reason=case.reason,
            driver=campaign.driver,
            seed=seed,
            trace=traces.get(case.test_case),
            preventability=case.preventability,
        )
    for clip, child in _failing_children(campaign):
        found[child.mutant] = _child(source, clip, child, traces.get(clip.test_case), seed)
    return found


def _child(source: Source, clip: ClipRun, child: Child, parent: Path | None, seed: int) -> Outcome:
    again = child.mutant.rpartition("_m")[0].rpartition("_s")  # a repeated mutation: `case_p1_s3_m2`
    if again[0] == clip.clip and again[2].isdigit():
        seed = int(again[2])
    return Outcome(
        name=child.mutant,
        address=(source.folder / (child.file or "")).as_posix(),
        verdict=child.verdict,
        reason=child.reason,
        driver=source.campaign.driver,
        seed=seed,
        trace=source.folder / "traces" / f"{child.mutant}.npz",
        parent_trace=parent,
        operators=child.operators,
        preventability=child.preventability,
    )


def _case_name(case: CaseRun) -> str:
    """Return the name that a test case's files begin with; its trace has it."""
    return Path(case.trace).stem if case.trace else case_file_name(case.test_case, Path(case.test_case).stem)


def _failing_children(campaign: Campaign) -> Iterator[tuple[ClipRun, Child]]:
    for clip in campaign.clip_runs:
        for child in clip.children:
            if child.file is not None:
                yield clip, child


def _each_alone(source: Source) -> tuple[Finding, ...]:
    """Return every failure as a finding of its own, for a file without findings."""
    campaign = source.campaign
    families = {case.test_case: case.family for case in campaign.test_cases}
    found = [
        Finding.model_validate(
            {
                "name": _case_name(case), "sentence": case.reason, "class": "", "verdict": case.verdict,
                "test_case": case.test_case, "family": case.family, "file": case.test_case,
                "preventability": case.preventability.verdict if case.preventability else None,
            }
        )
        for case in campaign.test_cases
        if case.verdict in {v.value for v in FAILURES}
    ]  # fmt: skip
    for clip, child in _failing_children(campaign):
        found.append(
            Finding.model_validate(
                {
                    "name": child.mutant, "sentence": child.reason, "class": "", "verdict": child.verdict,
                    "test_case": clip.test_case, "family": families.get(clip.test_case, ""), "file": child.file,
                    "preventability": child.preventability.verdict if child.preventability else None,
                }
            )
        )  # fmt: skip
    return tuple(found)


# ---- tables ---------------------------------------------------------------------------------------------------------


def _overview(sources: Sequence[Source], findings: Sequence[Found]) -> Iterator[Table]:
    several = len(sources) > 1
    yield _by("family", findings, lambda f: family_title(f.family))
    yield _by("kind", findings, lambda f: f"{f.verdict} {f.label}")
    yield _by("class", findings, lambda f: f.class_ or "not told")
    if several:
        yield _by("driver", findings, lambda f: f.driver)
    failed = [
        (
            *((source.campaign.driver,) if several else ()),
            case.test_case,
            case.verdict,
            case.reason,
            case.preventability.verdict if case.preventability else "",
        )
        for source in sources
        for case in source.campaign.test_cases
        if case.verdict != Verdict.PASS.value
    ]
    if failed:
        headings = (*(("driver",) if several else ()), "test case", "verdict", "how it ended", "preventable?")
        yield Table("Test cases that fail without mutation", headings, tuple(failed), texts=len(headings))


def _by(what: str, findings: Sequence[Found], key: Callable[[Found], str]) -> Table:
    """Return findings and failing runs by something, and what a careful driver would have avoided."""
    names = list(dict.fromkeys(map(key, findings)))
    rows = [_row(name, [f for f in findings if key(f) == name]) for name in sorted(names)]
    headings = (what, "findings", "runs", *(answer.value for answer in Preventable))
    return Table(f"By {what}", headings, tuple(rows), _row("all", findings) if len(rows) > 1 else ())


def _row(name: str, findings: Sequence[Found]) -> tuple[str, ...]:
    answers = Counter(f.preventability for f in findings)
    counts = (len(findings), sum(f.count for f in findings), *(answers[answer.value] for answer in Preventable))
    return (name, *map(str, counts))


def family_title(family: str) -> str:
    """Return a family's number and what it is about."""
    return f"{family} {FAMILY_TITLES.get(family, '')}".strip() or "(no family)"


def _numbers(sources: Sequence[Source]) -> Iterator[Table]:
    for source in sources:
        campaign, driver = source.campaign, source.campaign.driver if len(sources) > 1 else ""
        yield Table(f"The campaign {driver}".strip(), ("", "value"), tuple(_figures(campaign)))
        yield _family_table(campaign, driver)
        yield _operator_table(campaign, driver)
        yield Table(
            f"Test cases {driver}".strip(),
            ("test case", "verdict", "how it ended", "points", "nearest m", "TTC s", "PET s", "braking m/s²"),
            tuple(_case_row(case) for case in campaign.test_cases),
            texts=3,
        )


def _figures(campaign: Campaign) -> Iterator[tuple[str, str]]:
    others = campaign.fidelity.get("others", {})
    yield "test cases", str(len(campaign.test_cases))
    yield "risky points", str(campaign.risky_points)
    yield "clips", str(campaign.clips)
    yield "children", str(campaign.children)
    yield "failing children", str(sum(campaign.failures.values()))
    for answer, count in campaign.preventability.items():
        yield f"  {answer}", str(count)
    yield "simulated", _duration(campaign.simulated_s)
    yield "time it took", _duration(campaign.wall_s)
    if isinstance(others, dict) and others.get("within_0.1_m") is not None:
        yield "other actors of clips within 0.1 m of their parent", f"{float(others['within_0.1_m']):.1%}"


def _family_table(campaign: Campaign, driver: str) -> Table:
    kinds = [verdict.value for verdict in FAILURES]
    headings = ("family", "cases", "not passed", "points", "clips", "children", *kinds, "failing children")
    families = {case.test_case: case.family for case in campaign.test_cases}
    rows = [
        _family_row(campaign, families, {family}, family_title(family)) for family in sorted(set(families.values()))
    ]
    total = _family_row(campaign, families, set(families.values()), "all")
    return Table(f"By family {driver}".strip(), headings, tuple(rows), total)


def _family_row(campaign: Campaign, families: dict[str, str], which: set[str], name: str) -> tuple[str, ...]:
    cases = [case for case in campaign.test_cases if case.family in which]
    clips = [clip for clip in campaign.clip_runs if families.get(clip.test_case, "") in which]
    verdicts = Counter(child.verdict for clip in clips for child in clip.children)
    kinds = [verdicts[verdict.value] for verdict in FAILURES]
    counts = (
        len(cases),
        sum(case.verdict != Verdict.PASS.value for case in cases),
        sum(case.risky_points for case in cases),
        len(clips),
        sum(len(clip.children) for clip in clips),
        *kinds,
        sum(kinds),
    )
    return (name, *map(str, counts))


def _operator_table(campaign: Campaign, driver: str) -> Table:
    ran: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    for clip in campaign.clip_runs:
        for child in clip.children:
            names = " + ".join(child.operators) or "none"
            ran[names] += 1
            failed[names] += child.file is not None
    rows = [(name, str(ran[name]), str(failed[name]), f"{failed[name] / ran[name]:.1%}") for name in sorted(ran)]
    return Table(f"By operator {driver}".strip(), ("operators", "children", "failing", "share"), tuple(rows))


def _case_row(case: CaseRun) -> tuple[str, ...]:
    near = case.near_misses or {}
    values = (near.get(name) for name in ("distance_m", "ttc_s", "pet_s", "drac_mps2"))
    shown = ("" if v is None or v.value is None else f"{v.value:.2f}" for v in values)
    return (case.test_case, case.verdict, case.reason, str(case.risky_points), *shown)


def _counted(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d} h" if hours else f"{minutes}:{rest:02d} min"


def options_of(findings: Iterable[Found], key: Callable[[Found], str]) -> tuple[str, ...]:
    """Return the values that a filter offers."""
    return tuple(sorted({key(found) for found in findings} - {""}))
