"""The tests of the pytest plugin: it lists the tests of a file, and runs and judges one of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.campaign.driving import case_name, run_test_case
from foresee_dsl.campaign.regression.expectations import Status, expected_in, in_words, judge, names_of
from foresee_dsl.campaign.regression.suite import SuiteTest, role_of, suite_of
from foresee_dsl.campaign.regression.verify import HARMLESS_EDIT, reached
from foresee_dsl.drivers.consent import allow, refuse_programs
from foresee_dsl.errors import InputError
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.addresses import kind_of
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.report.builds.case_results import BuildOutcome, CaseResult, of_record
from foresee_dsl.report.verdicts import rule_lines
from foresee_dsl.simulate.results.verdict import RunRecord
from foresee_dsl.story import tell

Sections = tuple[tuple[str, str], ...]
"""Titles and texts of the sections in a test's report."""


@dataclass(frozen=True)
class DriveOptions:
    """The plugin's options.

    Attributes:
        driver: name of the driver; "" for the driver that each file records. traces: folder for traces.
        keep_all: also keep the traces of passed tests.
        run_programs: allow the programs that files record as their drivers.
    """

    driver: str
    seed: int
    traces: Path
    keep_all: bool = False
    allow_outside: bool = False
    run_programs: bool = False


def tests_in(file: str, *, allow_outside: bool = False) -> Iterator[tuple[str, SuiteTest]]:
    """Yield the name and the test of each case of a scenario, of a mutant, and of a clip with an expected result.

    In a suite of `foresee keep`, files in `parents/` have no tests, as for `foresee verify`.

    Raises:
        InputError: the file has errors (those of a mutant appear only when it is run).
    """
    kind = kind_of(Path(file))
    if kind not in ("scenario", "clip", "mutant") or role_of(Path(file)) == "parent":
        return
    try:
        stated = {test.address: test for test in suite_of([file])}
    except InputError:  # the file states no expected result
        stated = {}
    if kind != "scenario":
        yield from ((Path(file).stem, test) for test in stated.values())
        return
    for case in load_test_cases([file], allow_outside=allow_outside):
        name = case.id.partition("::")[2]
        yield name or case_name(case), stated.get(case.id, SuiteTest(Path(file), name or None, verified=False))


def drive(test: SuiteTest, options: DriveOptions) -> tuple[CaseResult, Sections]:
    """Run a test once and return its result: the run must end as the file expects, or pass if the file expects nothing.

    Raises:
        InputError: the file has errors, or an edit of its parent changes the test.
        DriverError: there is no such driver, or it is a program that was not allowed.
    """
    case, note = _loaded(test, allow_outside=options.allow_outside)
    if options.driver:
        allow(options.driver)
    else:
        refuse_programs(
            [(test.driver, test.file)],
            "--foresee-run-programs starts the programs that the files name; --foresee-driver chooses another driver",
            unless=options.run_programs,
        )
    driver = options.driver or test.driver
    seed = options.seed or test.seed
    result = run_test_case(case, driver, seed)
    run, version = RunRecord.of(result), str(result.trace.meta.get("driver_version", ""))
    case_result = of_record(run, case.id, driver, seed, details=rule_lines(run.infractions))
    case_result = _judged(test, case_result, run, driver, version)
    failed = case_result.outcome is not BuildOutcome.PASSED
    story = tell(result.trace, case) if failed else None
    sections: list[tuple[str, str]] = []
    if story is not None and story.sentence not in ("", result.reason):
        case_result = replace(case_result, details=(story.sentence, *case_result.details))
        sections.append(("what happened", "\n".join(f"{m.time_s:6.2f} s  {m.text}" for m in story.moments)))
    if failed or options.keep_all:
        file = options.traces / f"{case_name(case)}.npz"
        file.parent.mkdir(parents=True, exist_ok=True)
        result.trace.save(file)
        case_result = replace(case_result, attachments=(str(file),))
        sections.append(("trace", str(file)))
    if note:
        sections.append(("note", note))
    return case_result, tuple(sections)


def _loaded(test: SuiteTest, *, allow_outside: bool) -> tuple[TestCase, str]:
    """Return the test case of a test, and a note if its parent was edited in a way that does not change it."""
    try:
        return load_test_case(test.address, allow_outside=allow_outside), ""
    except InputError:
        if test.case is not None or reached([test.file]).get(test.file) != "":
            raise
        return load_test_case(test.address, allow_outside=allow_outside, check_pin=False), HARMLESS_EDIT


def _judged(test: SuiteTest, case_result: CaseResult, run: RunRecord, driver: str, version: str) -> CaseResult:
    """Return the result as `foresee verify` counts it, if `verify` would run the test; otherwise return it
    unchanged.
    """
    expected = expected_in(test.stated, test.case, names_of(driver, version), test.origin)
    if expected is None and not test.verified:
        return case_result
    status = judge(expected, run)
    if status is Status.AS_EXPECTED:
        return replace(case_result, outcome=BuildOutcome.PASSED, rule=status.value, details=())
    was = f"{driver} {in_words(expected)}" if expected is not None else f"the file records no result of {driver}"
    return replace(
        case_result,
        outcome=BuildOutcome.ERROR if status is Status.CRASHED else BuildOutcome.FAILED,
        rule=status.value,
        message=f"{status.label}: {case_result.message}",
        details=(f"expected: {was}", *case_result.details),
    )
