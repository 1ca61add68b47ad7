"""Test cases and children as results that build servers, code hosts and pytest show: one record for all of them."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foresee_dsl.errors import Diagnostic, InputError, Span
from foresee_dsl.files import read_outside_text
from foresee_dsl.language.codes.code import Code
from foresee_dsl.language.model import Case, Item, Mutant
from foresee_dsl.language.parser import load, parse
from foresee_dsl.language.project.addresses import kind_of
from foresee_dsl.report.verdicts import changed_lines
from foresee_dsl.simulate.results.verdict import EXPECTATION, DriverNotes, RunResult, Verdict

if TYPE_CHECKING:
    from foresee_dsl.campaign.assessment import DriverRun
    from foresee_dsl.campaign.execution.runs import CaseRun
    from foresee_dsl.campaign.records import ChildOutcome, SeedOutcome
    from foresee_dsl.campaign.regression.verify import Recheck
    from foresee_dsl.campaign.results import CampaignResult
    from foresee_dsl.language.project.document import Document


class Outcome(StrEnum):
    """How a test result counts: `failed` is the software under test, `error` is that it could not be tested."""

    PASSED = "passed"
    FAILED = "failed"
    ERROR = "error"


@dataclass(frozen=True)
class Place:
    """A line that a result is shown at; `span` is None where the whole file is meant."""

    path: str
    span: Span | None = None
    source_line: str = ""


@dataclass(frozen=True)
class CaseResult:
    """One test case or child and how it ended.

    Attributes:
        suite: the file that it belongs to. name: unique in its suite.
        rule: what happened, in a word: a verdict (`F4`), or a status of `verify` (`changed`).
        message: how it ended, in a sentence. details: further lines for people.
        reproduce: the command that shows it again. attachments: files to keep, such as the trace.
        time_s: simulated seconds. sibling_of: the finding that tells the same story; it is annotated, this is not.
    """

    suite: str
    name: str
    outcome: Outcome
    rule: str
    message: str
    place: Place
    details: tuple[str, ...] = ()
    reproduce: str = ""
    attachments: tuple[str, ...] = ()
    time_s: float = 0.0
    sibling_of: str = ""

    @property
    def text(self) -> str:
        """Everything that a person needs of a failure, over several lines."""
        place = self.place.path if self.place.span is None else f"{self.place.path}:{self.place.span.line}"
        shown = f"{place}: {self.place.source_line.strip()}" if self.place.source_line else place
        again = (f"reproduce: {self.reproduce}",) if self.reproduce else ()
        return "\n".join((self.message, *self.details, shown, *again))


def outcome_of(verdict: Verdict) -> Outcome:
    """Return how a verdict counts."""
    if verdict is Verdict.PASS:
        return Outcome.PASSED
    return Outcome.ERROR if verdict in (Verdict.CRASH, Verdict.INVALID) else Outcome.FAILED


def _of(
    address: str,
    name: str,
    verdict: Verdict,
    reason: str,
    place: Place,
    broken: Sequence[str] = (),
    **more: Any,  # noqa: ANN401
) -> CaseResult:
    """Return the result of a run of a test case or child; an expectation that does not hold fails it.

    `broken`: those expectations, a sentence each; of a run that passed otherwise they are its reason already.
    """
    suite, reason = address.partition("::")[0], reason or verdict.label
    if verdict is Verdict.PASS and broken:
        return CaseResult(suite, name, Outcome.FAILED, EXPECTATION, reason, place, **more)
    more["details"] = (*broken, *more.get("details", ()))
    return CaseResult(suite, name, outcome_of(verdict), verdict.value, reason, place, **more)


def _name_in(address: str) -> str:
    """Return what a test case is called in its file's suite."""
    suite, _, name = address.partition("::")
    return name or Path(suite).stem


def of_run(address: str, driver: str, seed: int, result: RunResult, attachments: Sequence[str] = ()) -> CaseResult:
    """Return the result of one run."""
    return _of(
        address, _name_in(address), result.verdict, result.reason, place_of(address), result.broken_expectations,
        reproduce=reproduce(address, driver, seed), attachments=tuple(attachments), time_s=result.duration_s,
    )  # fmt: skip


def of_case_run(one: CaseRun, driver: str, seed: int, trace: Path | None = None) -> CaseResult:
    """Return the result of a run in a process of its own, which may have died; with what the driver raised, printed."""
    address, noted = one.case.id, _notes(one.notes)
    if one.result is not None:
        found = of_run(address, driver, seed, one.result, (str(trace),) if trace else ())
        return replace(found, details=(*found.details, *noted))
    return _of(address, _name_in(address), one.verdict, one.reason, place_of(address), details=noted,
               reproduce=reproduce(address, driver, seed))  # fmt: skip


def _notes(notes: DriverNotes) -> tuple[str, ...]:
    printed = ("the driver printed:", *notes.output.rstrip().splitlines()) if notes.output.strip() else ()
    return (*notes.traceback.splitlines(), *changed_lines([notes]), *printed)


def of_assessment(runs: Iterable[DriverRun], seed: int) -> tuple[CaseResult, ...]:
    """Return a result for each run of `foresee assess`."""
    listed = tuple(runs)
    several = len({one.driver for one in listed}) > 1
    return tuple(
        _of(one.case, _name_in(one.case) + (f" [{one.driver}]" if several else ""), one.verdict, one.reason,
            place_of(one.case), one.broken_expectations, details=_notes(one.notes),
            reproduce=reproduce(one.case, one.driver, seed), time_s=one.duration_s)
        for one in listed
    )  # fmt: skip


def of_campaign(result: CampaignResult, out: Path) -> tuple[CaseResult, ...]:
    """Return a result for each test case and each child; a child's place is its first change line.

    Findings come before their siblings: code hosts show ten annotations of a step.
    """
    ranks = {finding.name: rank for rank, finding in enumerate(result.findings)}
    siblings = {name: finding.name for finding in result.findings for name in finding.siblings}
    driver, seed = result.settings.driver, result.settings.seed
    seeds = [
        _of(one.id, one.id.partition("::")[2] or one.scenario, one.verdict, one.reason, place_of(one.id),
            one.broken_expectations, details=_told(one), reproduce=reproduce(one.id, driver, seed),
            attachments=(str(out / one.trace),) if one.trace else (), time_s=one.duration_s)
        for one in result.seeds
    ]  # fmt: skip
    children = [
        _of(clip.seed, child.name, child.verdict, child.reason, place_of(str(out / child.file), child.text),
            child.broken_expectations, details=_told(child), sibling_of=siblings.get(child.name, ""),
            reproduce=reproduce(str(out / child.file), driver, seed), time_s=child.duration_s)
        for clip in result.clips
        for child in clip.children
    ]  # fmt: skip
    children.sort(key=lambda one: (ranks.get(one.name, len(ranks)), one.name))
    return (*seeds, *children, *map(_could_not_run, result.broken))


def of_rechecks(rechecks: Iterable[Recheck], driver: str = "") -> tuple[CaseResult, ...]:
    """Return a result for each test that `foresee verify` ran; what is not as expected failed."""
    from foresee_dsl.campaign.regression.expectations import Status

    broke = dict.fromkeys((Status.CRASHED, Status.TIMED_OUT, Status.STALE), Outcome.ERROR)
    outcomes = {Status.AS_EXPECTED: Outcome.PASSED, **broke}
    return tuple(
        CaseResult(
            suite=one.path.parent.as_posix(),
            name=one.path.stem + (f"::{one.case}" if one.case else ""),
            outcome=outcomes.get(one.status, Outcome.FAILED),
            rule=one.status.value,
            message=f"{one.status.label}: {one.now or one.status.meaning}",
            place=_at_line(place_of(one.file), one.line),
            details=tuple(filter(None, (f"expected {one.was or 'not known'}", f"now {one.now}", one.note))),
            reproduce=shlex.join(("foresee", "verify", str(one.path), *(("--driver", driver) if driver else ()))),
        )
        for one in rechecks
    )


def reproduce(address: str, driver: str, seed: int) -> str:
    """Return the command that runs one test case again."""
    return shlex.join(("foresee", "run", address, "--driver", driver, *(("--seed", str(seed)) if seed else ())))


def place_of(address: str, text: str | None = None) -> Place:
    """Return where a result is shown: a mutant's first change, a case's own line, or else the definition's.

    `text`: what the file holds, where it is known. A file that cannot be read has no line.
    """
    path, _, case = address.partition("::")
    try:
        document = parse(text, path) if text is not None else _loaded(path)
    except (InputError, OSError):
        return Place(path)
    model = document.written or document.model
    items: list[Item] = [item for item in getattr(model, "body", ()) if isinstance(item, Case) and item.name == case]
    if isinstance(model, Mutant):
        items = list(model.changes)
    item = items[0] if items else model
    span = document.span(item)
    if span is None:
        return Place(path)
    lines = document.text.split("\n")
    source_line = lines[span.line - 1] if span.line <= len(lines) else ""
    if span.end_line != span.line:  # a block: its first line says what it is
        span = Span(span.line, span.column, span.line, len(source_line) + 1)
    return Place(path, span, source_line)


def _at_line(place: Place, line: int | None) -> Place:
    """Return the place of a mutant's change as it is; of another file, the line that says what is expected."""
    if line is None or kind_of(Path(place.path)) == "mutant":
        return place
    text = read_outside_text(Path(place.path)).splitlines()[line - 1]
    return Place(place.path, Span(line, len(text) - len(text.lstrip()) + 1, line, len(text) + 1), text)


def as_diagnostics(results: Iterable[CaseResult]) -> Iterator[Diagnostic]:
    """Give what did not pass, siblings apart, in the form that SARIF and GitHub's annotations are made of."""
    for one in results:
        if one.outcome is not Outcome.PASSED and not one.sibling_of:
            more = [*one.details, *((f"reproduce: {one.reproduce}",) if one.reproduce else ())]
            yield Diagnostic(
                code=one.rule,
                message=f"{one.name}: {one.message}",
                help="\n".join(more),
                path=one.place.path,
                span=one.place.span,
                source_line=one.place.source_line,
            )


@cache
def rules() -> Mapping[str, Code]:
    """Return what each rule means: the verdicts, the statuses of `verify`, and what else can be wrong."""
    from foresee_dsl.campaign.regression.expectations import Status

    found = {one.value: Code(one.value, one.label, f"The run ended as {one}: {one.label}.") for one in Verdict}
    found |= {
        one.value: Code(one.value, f"verified: {one.label}", f"`foresee verify` says {one.label}: {one.meaning}.")
        for one in Status
    }
    found[EXPECTATION] = Code(
        EXPECTATION, "an expectation does not hold", "The run passed, but an `expect` line of its scenario is broken."
    )
    found["not-run"] = Code("not-run", "could not be run", "There is no result: the message says why.")
    return found


@cache
def _loaded(path: str) -> Document:
    return load(Path(path))


def _could_not_run(what: str) -> CaseResult:
    address, _, reason = what.partition(": ")
    suite, _, name = address.partition("::")
    return CaseResult(suite, name or address, Outcome.ERROR, "not-run", reason or what, Place(suite))


def _told(run: SeedOutcome | ChildOutcome) -> tuple[str, ...]:
    """What happened, whether the careful drivers would have avoided it, and which other drivers do; of a failure."""
    told = (run.story.sentence,) if run.story is not None and run.story.sentence else ()
    judged = (f"{found.name}: {found.answer}: {found.why}" for found in run.judgements)
    return (*told, *judged, *(f"avoided: {other.told}" for other in run.avoided))
