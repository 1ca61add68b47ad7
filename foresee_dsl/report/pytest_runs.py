"""One test of the pytest plugin: a test case or a recorded failure is driven, judged and told."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.campaign.driving import case_name, run_test_case
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.case_results import CaseResult, Outcome, of_run
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.story import tell

Sections = tuple[tuple[str, str], ...]
"""Titles and texts that a test's report gets."""


def drive(
    address: str, *, driver: str, seed: int, traces: Path, keep_all: bool, allow_outside: bool = False
) -> tuple[CaseResult, Sections]:
    """Drive once.

    Args:
        driver: "" for the one that the file records. traces: where the trace is written. keep_all: of passed tests too.

    Raises:
        InputError: the file has mistakes, or is stale. DriverError: there is no such driver.
    """
    case = load_test_case(address, allow_outside=allow_outside)
    driver = driver or _recorded(case)
    result = run_test_case(case, driver, seed)
    judged = of_run(case.id, driver, seed, result)
    failed = judged.outcome is not Outcome.PASSED
    kept = _kept(case, result, traces) if failed or keep_all else ""
    story = tell(result.trace, case) if failed else None
    sections: list[tuple[str, str]] = []
    details = judged.details
    if story is not None and story.sentence:
        details = (story.sentence, *details)
        sections.append(("what happened", "\n".join(f"{m.time_s:6.2f} s  {m.text}" for m in story.moments)))
    if kept:
        sections.append(("trace", kept))
    attachments = (kept,) if kept else ()
    found = CaseResult(**{**vars(judged), "details": details, "attachments": attachments})
    return found, tuple((title, text) for title, text in sections if text)


def _kept(case: TestCase, result: RunResult, folder: Path) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{case_name(case)}.npz"
    result.trace.save(file)
    return str(file)


def _recorded(case: TestCase) -> str:
    from foresee_dsl.drivers.registry import recorded_address

    origin = case.mutant.origin if case.mutant else None
    return recorded_address((origin.driver if origin else None) or "pdm")
