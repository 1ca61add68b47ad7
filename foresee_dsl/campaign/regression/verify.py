"""Runs test cases with expected results again, and says how they compare: as expected, fixed, came back, changed, new
or stale.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

from foresee_dsl import __version__
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.execution.runs import broken_run
from foresee_dsl.campaign.regression.edits import line_of, with_expected
from foresee_dsl.campaign.regression.expectations import (
    Status,
    expected_in,
    expected_of,
    in_words,
    judge,
    name_to_record,
    names_of,
)
from foresee_dsl.campaign.regression.suite import (
    SuiteTest,
    role_of,
    stated_in,
    suite_folder,
    suite_of,
    tests_in,
    write_index,
)
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.drivers.registry import find_driver, recorded_address, recorded_driver
from foresee_dsl.errors import InputError
from foresee_dsl.files import absolute, read_outside, write_whole
from foresee_dsl.language.model import Clip, Mutant
from foresee_dsl.language.parser import load
from foresee_dsl.language.project.addresses import display_path, is_folder, kind_of, mistake, scenario_files
from foresee_dsl.language.project.loading import Project
from foresee_dsl.language.repinning.repin import DerivedFile, PinState, plan
from foresee_dsl.simulate.results.verdict import Hang, RunRecord, Verdict

LONGEST_S = 300.0
"""Longest simulated time of a run, s; the deadline of its process follows from this. Ours: no test case of the library
is longer. Each run also ends after the length of its test case.
"""
HARMLESS_EDIT = (
    "its parent was edited, but the edit does not change this test: `foresee repin --write` records the parent's new "
    "state"
)
"""Note on a test whose parent was edited in a way that does not reach it."""


@dataclass(frozen=True)
class Recheck:
    """The repeated run of one test case.

    Attributes:
        file: its address. case: name of the case, for a scenario with cases.
        was: the expected result in words: `fails F2 with walker`. now: how it ended, or why it is stale.
        driver: name and version of the driver. name: the driver's name in an `expected` line.
        run: how it ended; None if it was not run. line: line of the expectation in its file. note: further remarks.
    """

    file: str
    status: Status
    was: str
    now: str
    driver: str = ""
    name: str = ""
    run: RunRecord | None = None
    line: int | None = None
    note: str = ""
    case: str | None = None

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "file": self.file,
            "status": self.status,
            "driver": self.driver,
            "expected": self.was,
            "verdict": self.run and self.run.verdict,
            "with": self.run and self.run.with_,
            "now": self.now,
            "line": self.line,
            "note": self.note,
        }

    @property
    def path(self) -> Path:
        """Return the file of the test case."""
        return Path(self.file.removesuffix(f"::{self.case}") if self.case else self.file)


def verify_files(
    paths: Iterable[str | Path],
    *,
    driver: str = "",
    run_programs: bool = False,
    jobs: int = 1,
    deadlines: Deadlines = DEADLINES,
) -> tuple[Recheck, ...]:
    """Run the tests of a suite (`suite_of(paths)`) again, in new processes, and compare with the expected results.

    A child whose parent was edited is still run if the edit does not reach it, which is determined from the parent's
    old version in git.

    Args:
        driver: replaces the one that each file records.
        run_programs: start the programs that files record as their drivers (`external:python3 my_driver.py`). Checking
            a file that came from elsewhere must not run a command.
        deadlines: wall times of the driver.

    Raises:
        InputError: a path does not exist, a named file contains no test, or a named folder has scenarios and no test.
        DriverError: there is no such driver, or files record programs, which is not allowed; no run was started.
    """
    named = tuple(map(Path, paths))
    tests = suite_of(named)
    for folder in filter(is_folder, named):
        _refuse_scenarios_alone(folder, tests)
    if driver:
        find_driver(driver)
    else:
        refuse_programs(
            ((test.driver, test.file) for test in tests),
            "--run-programs starts the programs that the files name; --driver chooses another driver",
            unless=run_programs,
        )
    pool = _Pool(driver, jobs, deadlines)
    results = dict(zip(tests, pool.run(tests), strict=True))
    stale = [test for test, seen in results.items() if seen.status is Status.STALE and test.case is None]
    notes = reached([test.file for test in stale])
    harmless = [test for test in stale if notes.get(test.file) == ""]
    for test, seen in zip(harmless, pool.run(harmless, check_pin=False), strict=True):
        results[test] = replace(seen, note=HARMLESS_EDIT)
    for test in stale:
        if why := notes.get(test.file):
            results[test] = replace(results[test], note=why)
    return tuple(results.values())


def _refuse_scenarios_alone(folder: Path, tests: Sequence[SuiteTest]) -> None:
    """Raise if a folder has scenarios and no test: a wrong folder. A suite may be empty, as in a new project."""
    if any(absolute(test.file).is_relative_to(absolute(folder)) for test in tests):
        return
    if any(kind_of(file) == "scenario" and role_of(file) != "parent" for file in scenario_files([folder])):
        message = "the scenarios in this folder have no expected results"
        help = "name the folder that `foresee keep` writes, or write lines such as `expected pdm passes`"
        raise mistake("FS132", message, help, display_path(folder))


@dataclass(frozen=True)
class _Pool:
    """Options of the runs: the driver ("": each test's own), number of processes, deadlines."""

    driver: str
    jobs: int
    deadlines: Deadlines

    def run(self, tests: Sequence[SuiteTest], *, check_pin: bool = True) -> tuple[Recheck, ...]:
        """Run tests; return their results in the same order."""
        longest_s = self.deadlines.for_run_s(LONGEST_S)
        with WorkerPool(min(self.jobs, max(len(tests), 1))) as pool:
            outcomes = pool.outcomes(
                Task(test.address, partial(_recheck_in_worker, test, part=k // _TOGETHER, check_pin=check_pin,
                             deadlines=self.deadlines),
                     self.driver or test.driver, longest_s, shares=(str(test.file.parent),))
                for k, test in enumerate(tests)
            )  # fmt: skip
        return tuple(
            _broken(test, outcome, self.driver, longest_s) if isinstance(outcome, BrokenTask) else outcome
            for test, outcome in zip(tests, outcomes, strict=True)
        )


def _broken(test: SuiteTest, broken: BrokenTask, driver: str, limit_s: float) -> Recheck:
    """Return the result of a test whose run broke; `limit_s`: the wall time that it was given, s."""
    run = broken_run(RunRecord, broken)
    if run.verdict is Verdict.TIMEOUT:
        run = replace(run, notes=replace(run.notes, hang=Hang("run", limit_s)))
    expected = expected_in(test.stated, test.case, names_of(driver or test.driver, ""), test.origin)
    return Recheck(
        file=test.address,
        status=judge(expected, run),
        was=in_words(expected),
        now=run.reason,
        driver=driver or test.driver,
        run=run,
        case=test.case,
    )


_TOGETHER = 64
"""Number of tests of a folder for which a process keeps the files that it has read, 0.3 MB each. Ours: a clip has four
mutants in a suite, so with more tests a process would share few further files."""


@lru_cache(maxsize=2)
def _project_of(folder: Path, part: int, *, check_pin: bool) -> Project:  # noqa: ARG001  they key the cache
    """Return a worker's project for tests of a folder, which share parents and networks; a worker lives for one call of
    `verify_files`, so the files do not change meanwhile."""
    return Project(check_pin=check_pin)


def _recheck_in_worker(test: SuiteTest, driver: str, *, part: int, check_pin: bool, deadlines: Deadlines) -> Recheck:
    project = _project_of(test.file.parent, part, check_pin=check_pin)
    return recheck(test, driver, project=project, deadlines=deadlines)


def recheck(
    test: SuiteTest, driver: str, *, project: Project | None = None, deadlines: Deadlines = DEADLINES
) -> Recheck:
    """Run one test again and compare; `project` has read the files of earlier tests."""
    try:
        case = (project or Project()).test_case(test.address)
        result = run_test_case(case, driver, test.seed, deadlines=deadlines)
    except InputError as err:  # also if the network has no place for one of the actors
        return Recheck(test.address, Status.STALE, "", err.diagnostics[0].message, driver=driver, case=test.case)
    run = RunRecord.of(result)
    version = str(result.trace.meta.get("driver_version", ""))
    stated = stated_in(case.document) if case.document is not None else test.stated
    expected = expected_in(stated, test.case, names_of(driver, version), test.origin)
    return Recheck(
        file=test.address,
        status=judge(expected, run),
        was=in_words(expected),
        now=result.reason or result.verdict.label,
        driver=recorded_driver(driver, version),
        name=expected.driver if expected is not None else name_to_record(driver, version),
        run=run,
        line=line_of(case.document, expected) if case.document is not None and expected in stated else None,
        note=other_version(test, driver, version),
        case=test.case,
    )


def other_version(test: SuiteTest, driver: str, version: str) -> str:
    """Return a note that the recorded run had another version of the driver or of this tool, or ""."""
    origin = test.origin
    if origin is None:
        return ""
    differ = []
    if origin.driver and recorded_address(origin.driver) == driver:
        differ.append((origin.driver, recorded_driver(driver, version)))
    if origin.tool:
        differ.append((f"foresee-dsl {origin.tool}", f"foresee-dsl {__version__}"))
    differences = [f"with {then}, and is now run with {now}" for then, now in differ if then != now]
    return f"it was recorded {'; '.join(differences)}" if differences else ""


def reached(files: Sequence[Path]) -> dict[Path, str]:
    """Return for each stale child why it cannot be run; "" if it can be, because the edit of its parent does not reach
    it.

    A child that no longer fits its parent is left out, because its own message says why.
    """
    if not files:
        return {}
    family = dict.fromkeys(absolute(file) for file in files)
    for file in files:
        family |= dict.fromkeys(_ancestors(file))
    try:
        derived_files = {absolute(derived.file): derived for derived in plan(family)}
    except InputError:  # errors in one file must not affect the others
        return {} if len(files) == 1 else {file: why for each in files for file, why in reached([each]).items()}
    return {file: why for file in files if (why := _why_stale(derived_files.get(absolute(file)))) is not None}


def _why_stale(derived: DerivedFile | None) -> str | None:
    """Return why a clip or mutant cannot be run under its edited parent; "" if it can, None if that is unknown."""
    if derived is None:
        return None
    if derived.state in (PinState.CONFLICT, PinState.BLOCKED):
        messages = [mistake.message for mistake in derived.mistakes if mistake.code != "FS135"]
        return f"it no longer fits its parent: {messages[0]}" if messages else None
    if not derived.has_old_parent or derived.old is None or derived.new is None:
        return "git has no version of the parent with this pin, so that the edit is unknown"
    return "the edit reaches it: " + "; ".join(map(str, derived.reaching)) if derived.reaching else ""


def _ancestors(file: Path) -> Iterable[Path]:
    """Yield the clips and mutants that a file is derived from."""
    try:
        model = load(file).model
        while isinstance(model, Mutant | Clip):
            parent = absolute(file.parent / model.parent)
            model = load(parent).model
            if isinstance(model, Mutant | Clip):
                yield parent
            file = parent
    except InputError:
        return


def update(rechecks: Iterable[Recheck]) -> tuple[Path, ...]:
    """Record the results as the expected ones where they differ; files are otherwise unchanged.

    The index of a suite is updated. Crashes, timeouts and stale children are not recorded.

    Returns:
        The files that were written.
    """
    written: dict[Path, None] = {}
    for check in rechecks:
        new = expected_of(check.run, check.name, check.case) if check.run and check.status.can_be_recorded else None
        if new is not None:
            text = read_outside(check.path).decode("utf-8")
            write_whole(check.path, with_expected(text, new))
            written[check.path] = None
    for suite in dict.fromkeys(folder for file in written if (folder := suite_folder(file)) is not None):
        write_index(suite, tests_in(suite))
    return tuple(written)
