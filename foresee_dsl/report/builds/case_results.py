"""Results of test cases and children as records that build servers, code hosts and pytest can show."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foresee_dsl.errors import Diagnostic, InputError, Span
from foresee_dsl.files import read_outside_text
from foresee_dsl.language.codes import Code
from foresee_dsl.language.model import Case, Item, Mutant
from foresee_dsl.language.parser import load, parse
from foresee_dsl.language.project.addresses import kind_of
from foresee_dsl.report.verdicts import changed_lines, rule_lines
from foresee_dsl.simulate.results.verdict import EXPECTATION, RunRecord, Verdict

if TYPE_CHECKING:
    from foresee_dsl.campaign.assessment import DriverRun
    from foresee_dsl.campaign.conformance.records import Conformance
    from foresee_dsl.campaign.execution.runs import CaseRun
    from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome
    from foresee_dsl.campaign.regression.verify import Recheck
    from foresee_dsl.campaign.results import CampaignResult
    from foresee_dsl.language.document import Document


_CONFORMANCE = "conformance"
"""The rule of a check of `foresee conform`."""


class BuildOutcome(StrEnum):
    """How a test result counts. `failed`: the software under test failed; `error`: it could not be tested."""

    PASSED = "passed"
    FAILED = "failed"
    ERROR = "error"


@dataclass(frozen=True)
class ReportPlace:
    """The line of a file at which a result is shown; `span` is None if the result is shown for the whole file, and
    `path` is "" if it belongs to no file."""

    path: str
    span: Span | None = None
    source_line: str = ""


@dataclass(frozen=True)
class CaseResult:
    """How one test case or child ended.

    Attributes:
        suite: the file that it belongs to. name: its name, unique in its suite.
        rule: one word for the result: a verdict (`F4`), or a status of `verify` (`changed`).
        message: how it ended, in a sentence. details: further lines for people.
        reproduce: the command that repeats it. attachments: files to keep, such as the trace.
        time_s: simulated time, s.
        sibling_of: the finding with the same story, which is annotated instead of this result; "" if there is none.
    """

    suite: str
    name: str
    outcome: BuildOutcome
    rule: str
    message: str
    place: ReportPlace
    details: tuple[str, ...] = ()
    reproduce: str = ""
    attachments: tuple[str, ...] = ()
    time_s: float = 0.0
    sibling_of: str = ""

    @property
    def text(self) -> str:
        """Return the whole result as text of several lines: message, details, place and the command that repeats it."""
        place = self.place.path if self.place.span is None else f"{self.place.path}:{self.place.span.line}"
        where = f"{place}: {self.place.source_line.strip()}" if self.place.source_line else place
        again = (f"reproduce: {self.reproduce}",) if self.reproduce else ()
        return "\n".join((self.message, *self.details, *([where] if where else ()), *again))


def outcome_of(verdict: Verdict) -> BuildOutcome:
    """Return how a verdict counts."""
    if verdict is Verdict.PASS:
        return BuildOutcome.PASSED
    return BuildOutcome.ERROR if verdict in (Verdict.CRASH, Verdict.INVALID) else BuildOutcome.FAILED


def _name_in(address: str) -> str:
    """Return the name of a test case in the suite of its file."""
    suite, _, name = address.partition("::")
    return name or Path(suite).stem


def of_record(
    run: RunRecord, address: str, driver: str, seed: int, *, suite: str = "", name: str = "", text: str | None = None,
    details: tuple[str, ...] = (), **more: Any,  # noqa: ANN401
) -> CaseResult:  # fmt: skip
    """Return the result of a run of a test case or child.

    Broken expectations fail a run whose verdict is `pass`, and its reason states them.

    `suite`, `name`: by default the file and the name of its case. `text`: the file's content; None to read the file.
    """
    outcome, rule = outcome_of(run.verdict), run.verdict.value
    if run.verdict is Verdict.PASS and run.broken_expectations:
        outcome, rule = BuildOutcome.FAILED, EXPECTATION
    else:
        details = (*run.broken_expectations, *details)
    return CaseResult(
        (suite or address).partition("::")[0], name or _name_in(address), outcome, rule,
        run.reason or run.verdict.label, place_of(address, text), details, reproduce(address, driver, seed),
        time_s=run.duration_s, **more,
    )  # fmt: skip


def of_case_run(run: CaseRun, driver: str, seed: int, trace: Path | None = None) -> CaseResult:
    """Return the result of a run in its own process, which may have died, with the driver's output and traceback."""
    attachments = (str(trace),) if trace and run.result is not None else ()
    return of_record(run, run.case.id, driver, seed, details=_noted(run), attachments=attachments)


def _noted(run: RunRecord) -> tuple[str, ...]:
    """Return lines with the broken rules, and with what the driver raised, changed and printed."""
    notes = run.notes
    printed = ("the driver printed:", *notes.output.rstrip().splitlines()) if notes.output.strip() else ()
    return (*rule_lines(run.infractions), *notes.traceback.splitlines(), *changed_lines([notes]), *printed)


def of_assessment(runs: Iterable[DriverRun], seed: int) -> tuple[CaseResult, ...]:
    """Return a result for each run of `foresee assess`."""
    listed = tuple(runs)
    several = len({run.driver for run in listed}) > 1
    return tuple(
        of_record(
            run,
            run.case,
            run.driver,
            seed,
            name=_name_in(run.case) + (f" [{run.driver}]" if several else ""),
            details=_noted(run),
        )
        for run in listed
    )


def of_conformance(conformance: Conformance) -> tuple[CaseResult, ...]:
    """Return a result for each check of a driver that could be made, and for each of the ten test cases.

    Their place is the driver's file, if the driver's address names one.
    """
    from foresee_dsl.campaign.conformance.records import CheckStatus
    from foresee_dsl.campaign.conformance.suite import conformance_cases
    from foresee_dsl.drivers.registry import files_in

    driver, seed, addresses = conformance.driver, conformance.seed, conformance_cases()
    place = ReportPlace(next(map(str, files_in(driver)), ""))
    again = shlex.join(("foresee", "conform", driver, *(("--seed", str(seed)) if seed else ())))
    checks = (
        CaseResult(
            suite="conform/checks",
            name=check.name,
            outcome=BuildOutcome.FAILED if check.status is CheckStatus.FAIL else BuildOutcome.PASSED,
            rule=_CONFORMANCE,
            message=check.detail,
            place=place,
            details=(check.advice,) if check.advice else (),
            reproduce=again,
        )
        for check in conformance.checks
        if check.status is not CheckStatus.SKIPPED
    )
    cases = (
        replace(
            of_record(
                case.run,
                addresses[case.name].id,
                driver,
                seed,
                suite="conform/cases",
                name=case.name,
                details=(case.about, *_noted(case.run)),
            ),
            place=place,
        )
        for case in conformance.cases
    )
    return (*checks, *cases)


def of_child(child: ChildOutcome, file: str, driver: str, seed: int, *, suite: str, sibling_of: str = "") -> CaseResult:
    """Return the result of a mutant, whose text is or will be in `file`; its place is its first change line."""
    return of_record(child, file, driver, seed, suite=suite, name=child.name, text=child.text, sibling_of=sibling_of,
                     details=_details(child))  # fmt: skip


def of_campaign(result: CampaignResult, out: Path) -> tuple[CaseResult, ...]:
    """Return a result for each test case and each child; a child's place is its first change line.

    Findings come before their siblings, because code hosts show only ten annotations of a step.
    """
    ranks = {finding.name: rank for rank, finding in enumerate(result.findings)}
    siblings = {name: finding.name for finding in result.findings for name in finding.siblings}
    driver, seed = result.settings.driver, result.settings.seed
    seeds = [
        of_record(run, run.id, driver, seed, name=run.id.partition("::")[2] or run.scenario, details=_details(run),
                  attachments=(str(out / run.trace),) if run.trace else ())
        for run in result.seeds
    ]  # fmt: skip
    children = [
        of_child(child, str(out / child.file), driver, seed, suite=clip.seed, sibling_of=siblings.get(child.name, ""))
        for clip in result.clips
        for child in clip.children
    ]
    children.sort(key=lambda run: (ranks.get(run.name, len(ranks)), run.name))
    return (*seeds, *children, *map(_could_not_run, result.broken))


def of_rechecks(rechecks: Iterable[Recheck], driver: str = "") -> tuple[CaseResult, ...]:
    """Return a result for each test that `foresee verify` ran; a test that ends otherwise than expected has failed."""
    from foresee_dsl.campaign.regression.expectations import Status

    broke = dict.fromkeys((Status.CRASHED, Status.TIMED_OUT, Status.STALE), BuildOutcome.ERROR)
    outcomes = {Status.AS_EXPECTED: BuildOutcome.PASSED, **broke}
    return tuple(
        CaseResult(
            suite=recheck.path.parent.as_posix(),
            name=recheck.path.stem + (f"::{recheck.case}" if recheck.case else ""),
            outcome=outcomes.get(recheck.status, BuildOutcome.FAILED),
            rule=recheck.status.value,
            message=f"{recheck.status.label}: {recheck.now or recheck.status.meaning}",
            place=_at_line(place_of(recheck.file), recheck.line),
            details=tuple(filter(None, (f"expected {recheck.was or 'not known'}", f"now {recheck.now}", recheck.note))),
            reproduce=shlex.join(("foresee", "verify", str(recheck.path), *(("--driver", driver) if driver else ()))),
            time_s=recheck.run.duration_s if recheck.run is not None else 0.0,
        )
        for recheck in rechecks
    )


def reproduce(address: str, driver: str, seed: int) -> str:
    """Return the command that runs one test case again."""
    return shlex.join(("foresee", "run", address, "--driver", driver, *(("--seed", str(seed)) if seed else ())))


def place_of(address: str, text: str | None = None) -> ReportPlace:
    """Return the place of a result: a mutant's first change, the line of the case, or else the line of the definition.

    `text`: the file's content; None to read the file. For a file that cannot be read the place has no line.
    """
    path, _, case = address.partition("::")
    try:
        document = parse(text, path) if text is not None else _loaded(path)
    except (InputError, OSError):
        return ReportPlace(path)
    model = document.written or document.model
    items: list[Item] = [item for item in getattr(model, "body", ()) if isinstance(item, Case) and item.name == case]
    if isinstance(model, Mutant):
        items = list(model.changes)
    item = items[0] if items else model
    span = document.span(item)
    if span is None:
        return ReportPlace(path)
    lines = document.text.split("\n")
    source_line = lines[span.line - 1] if span.line <= len(lines) else ""
    if span.end_line != span.line:  # a span over several lines is shown at its first line
        span = Span(span.line, span.column, span.line, len(source_line) + 1)
    return ReportPlace(path, span, source_line)


def _at_line(place: ReportPlace, line: int | None) -> ReportPlace:
    """Return the place of a mutant unchanged; for another file, return the line that states the expected result."""
    if line is None or kind_of(Path(place.path)) == "mutant":
        return place
    text = read_outside_text(Path(place.path)).splitlines()[line - 1]
    return ReportPlace(place.path, Span(line, len(text) - len(text.lstrip()) + 1, line, len(text) + 1), text)


def as_diagnostics(results: Iterable[CaseResult]) -> Iterator[Diagnostic]:
    """Yield a diagnostic for each result that did not pass, except siblings of a finding; for SARIF and GitHub."""
    for result in results:
        if result.outcome is not BuildOutcome.PASSED and not result.sibling_of:
            more = [*result.details, *((f"reproduce: {result.reproduce}",) if result.reproduce else ())]
            yield Diagnostic(
                code=result.rule,
                message=f"{result.name}: {result.message}",
                help="\n".join(more),
                path=result.place.path,
                span=result.place.span,
                source_line=result.place.source_line,
            )


@cache
def rules() -> Mapping[str, Code]:
    """Return the explanation of each rule: verdicts, statuses of `verify`, broken expectations, missing results."""
    from foresee_dsl.campaign.regression.expectations import Status

    codes = {
        verdict.value: Code(verdict.value, verdict.label, f"The run ended as {verdict}: {verdict.label}.")
        for verdict in Verdict
    }
    codes |= {
        status.value: Code(
            status.value, f"verified: {status.label}", f"`foresee verify` says {status.label}: {status.meaning}."
        )
        for status in Status
    }
    codes[EXPECTATION] = Code(
        EXPECTATION, "an expectation does not hold", "The run passed, but an `expect` line of its scenario is broken."
    )
    codes[_CONFORMANCE] = Code(
        _CONFORMANCE, "a rule of the driver protocol is broken", "`foresee conform` says which one, and what to do."
    )
    codes["not-run"] = Code("not-run", "could not be run", "There is no result: the message says why.")
    return codes


@cache
def _loaded(path: str) -> Document:
    return load(Path(path))


def _could_not_run(what: str) -> CaseResult:
    address, _, reason = what.partition(": ")
    suite, _, name = address.partition("::")
    return CaseResult(suite, name or address, BuildOutcome.ERROR, "not-run", reason or what, ReportPlace(suite))


def _details(run: CaseRunOutcome | ChildOutcome) -> tuple[str, ...]:
    """Return lines about a failure: its story, the judgements of the careful drivers, and the drivers that avoid it."""
    sentence = (run.story.sentence,) if run.story is not None and run.story.sentence else ()
    judged = (f"{judgement.name}: {judgement.answer}: {judgement.why}" for judgement in run.judgements)
    avoided = (f"avoided: {other.sentence}" for other in run.avoided)
    return (*sentence, *rule_lines(run.infractions), *judged, *avoided)
