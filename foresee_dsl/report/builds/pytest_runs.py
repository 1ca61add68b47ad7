"""Tests of the pytest plugin: which there are in a file, and one of them driven, judged and told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.campaign.driving import case_name, run_test_case
from foresee_dsl.campaign.regression.expectations import Ending, Status, expected_in, in_words, judge, names_of
from foresee_dsl.campaign.regression.layout import role_of
from foresee_dsl.campaign.regression.suite import SuiteTest, suite_of
from foresee_dsl.campaign.regression.verify import reached
from foresee_dsl.drivers.consent import allow, refuse_programs
from foresee_dsl.errors import InputError
from foresee_dsl.language.project.addresses import kind_of
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.report.builds.case_results import CaseResult, Outcome, of_run
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.story import tell

Sections = tuple[tuple[str, str], ...]
"""Titles and texts that a test's report gets."""


@dataclass(frozen=True)
class Wanted:
    """What the plugin's options ask for.

    Attributes:
        driver: "" for the one that each file records. traces: where traces are written. keep_all: of passed tests too.
        run_programs: start the programs that files record as their drivers.
    """

    driver: str
    seed: int
    traces: Path
    keep_all: bool = False
    allow_outside: bool = False
    run_programs: bool = False


def tests_in(file: str, *, allow_outside: bool = False) -> Iterator[tuple[str, SuiteTest]]:
    """Yield name and test of each case of a scenario, of a mutant, and of a clip of which something is expected.

    Of a suite that `foresee keep` wrote they are those that `foresee verify` runs: none in its `parents/`.

    Raises:
        InputError: the file has mistakes (a mutant's are found when it is run).
    """
    kind = kind_of(Path(file))
    if kind not in ("scenario", "clip", "mutant") or role_of(Path(file)) == "parent":
        return
    try:
        stated = {test.address: test for test in suite_of([file])}
    except InputError:  # nothing is expected of it
        stated = {}
    if kind != "scenario":
        yield from ((Path(file).stem, test) for test in stated.values())
        return
    for case in load_test_cases([file], allow_outside=allow_outside):
        name = case.id.partition("::")[2]
        yield name or case_name(case), stated.get(case.id, SuiteTest(Path(file), name or None, verified=False))


def drive(test: SuiteTest, wanted: Wanted) -> tuple[CaseResult, Sections]:
    """Drive once and judge: by what the file expects of the driver, and where it says nothing, it has to pass.

    Raises:
        InputError: the file has mistakes, or an edit of its parent reaches it.
        DriverError: there is no such driver, or it is a program that was not allowed.
    """
    case, note = _loaded(test, allow_outside=wanted.allow_outside)
    if wanted.driver:
        allow(wanted.driver)
    else:
        refuse_programs(
            [(test.driver, test.file)],
            "--foresee-run-programs starts what the files say, --foresee-driver names another driver",
            unless=wanted.run_programs,
        )
    driver = wanted.driver or test.driver
    seed = wanted.seed or test.seed
    result = run_test_case(case, driver, seed)
    found = _judged(test, of_run(case.id, driver, seed, result), result, driver)
    failed = found.outcome is not Outcome.PASSED
    story = tell(result.trace, case) if failed else None
    sections: list[tuple[str, str]] = []
    if story is not None and story.sentence not in ("", result.reason):
        found = replace(found, details=(story.sentence, *found.details))
        sections.append(("what happened", "\n".join(f"{m.time_s:6.2f} s  {m.text}" for m in story.moments)))
    if failed or wanted.keep_all:
        file = wanted.traces / f"{case_name(case)}.npz"
        file.parent.mkdir(parents=True, exist_ok=True)
        result.trace.save(file)
        found = replace(found, attachments=(str(file),))
        sections.append(("trace", str(file)))
    if note:
        sections.append(("note", note))
    return found, tuple(sections)


def _loaded(test: SuiteTest, *, allow_outside: bool) -> tuple[TestCase, str]:
    """Return the test case; of a child whose parent's edit does not reach it too, with a note."""
    try:
        return load_test_case(test.address, allow_outside=allow_outside), ""
    except InputError:
        if test.case is not None or reached([test.file]).get(test.file) != "":
            raise
        note = "its parent was edited, and the edit does not reach it: `foresee repin --write` writes the new pins"
        return load_test_case(test.address, allow_outside=allow_outside, check_pin=False), note


def _judged(test: SuiteTest, found: CaseResult, result: RunResult, driver: str) -> CaseResult:
    """Return the result as `foresee verify` counts it, where that runs the test too."""
    version = str(result.trace.meta.get("driver_version", ""))
    expected = expected_in(test.stated, test.case, names_of(driver, version), test.origin)
    if expected is None and not test.verified:
        return found
    status = judge(expected, Ending.of(result))
    if status is Status.AS_EXPECTED:
        return replace(found, outcome=Outcome.PASSED, rule=status.value, details=())
    was = f"{driver} {in_words(expected)}" if expected is not None else f"nothing is recorded for {driver}"
    return replace(
        found,
        outcome=Outcome.ERROR if status is Status.CRASHED else Outcome.FAILED,
        rule=status.value,
        message=f"{status.label}: {found.message}",
        details=(f"expected: {was}", *found.details),
    )
