"""Reads the two sides of a comparison: finished campaigns, or runs of a suite with two drivers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.execution.runs import broken_run
from foresee_dsl.campaign.records import JudgedRun
from foresee_dsl.campaign.regression.comparison import ComparedRun, Side
from foresee_dsl.campaign.regression.suite import SuiteTest, suite_of
from foresee_dsl.campaign.regression.verify import LONGEST_S
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.campaign.written import JSON, WrittenCampaign, read_campaign_file
from foresee_dsl.documents import plain, read_record
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.drivers.registry import find_driver, recorded_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.addresses import is_folder, parse_address
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.simulate.results.near_misses import NearMisses


def side_of_campaign(folder: Path) -> Side:
    """Return the runs in a campaign's `campaign.json`: its test cases and their mutants.

    Raises:
        ForeseeError: there is no campaign, or an older version wrote it.
    """
    file = folder / JSON if folder.is_dir() else folder
    campaign = read_campaign_file(file)
    if campaign is None:
        raise ForeseeError(f"there is no finished campaign in {folder}: `foresee campaign` writes {JSON}")
    runs = tuple(_runs_in(campaign))
    if not all(run.key for run in runs):
        message = f"{file} does not state the meaning of its test cases: run the campaign again with this version"
        raise ForeseeError(message)
    return Side(f"{folder} ({campaign.driver})", runs, campaign.broken)


def _runs_in(campaign: WrittenCampaign) -> Iterator[ComparedRun]:
    families = {case.id: case.family for case in campaign.test_cases}
    for case in campaign.test_cases:
        yield _compared(case, case.id, case.family)
    for clip in campaign.clip_runs:
        for child in clip.children:
            yield _compared(child, child.name, families.get(clip.seed, ""))


def _compared(run: JudgedRun, name: str, family: str) -> ComparedRun:
    return ComparedRun(run.meaning, name, family, verdict=run.verdict, reason=run.reason, near=run.near,
                       broken_expectations=run.broken_expectations)  # fmt: skip


def tests_under(paths: Sequence[str]) -> tuple[SuiteTest, ...]:
    """Return the tests for a comparison of two drivers: those of suites, and the test cases of scenarios.

    A folder gives its tests (mutants and files with expectations), or if it has none, the test cases of its scenarios.
    """
    collected: dict[str, SuiteTest] = {}
    for path in paths:
        file, case = parse_address(path)
        tests = suite_of([path]) if is_folder(file) else ()
        if not tests and case is None and not is_folder(file):
            tests = _named_test(path)
        if not tests:
            tests = tuple(
                SuiteTest(Path(case_.id.partition("::")[0]), case_.id.partition("::")[2] or None)
                for case_ in load_test_cases([path])
            )
        collected |= {test.address: test for test in tests}
    return tuple(collected.values())


def _named_test(path: str) -> tuple[SuiteTest, ...]:
    try:
        return suite_of([path])
    except ForeseeError:  # the file is a scenario without expectations, or is missing, which loading reports
        return ()


def side_of_driver(tests: Sequence[SuiteTest], driver: str, *, jobs: int, deadlines: Deadlines = DEADLINES) -> Side:
    """Run tests with a driver, in new processes, and return the side of the comparison.

    Raises:
        DriverError: there is no such driver; no run was started.
    """
    find_driver(driver)
    runs: list[ComparedRun] = []
    broken: list[str] = []
    label, longest_s = driver, deadlines.for_run_s(LONGEST_S)
    setups = [DriverSetup(driver, test.seed, deadlines) for test in tests]
    with WorkerPool(min(jobs, max(len(tests), 1))) as pool:
        outcomes = pool.outcomes(
            Task(test.address, partial(_run, test), setup, longest_s) for test, setup in zip(tests, setups, strict=True)
        )
    for test, outcome in zip(tests, outcomes, strict=True):
        if not isinstance(outcome, BrokenTask):
            run, label = outcome
            runs.append(run)
        elif outcome.how == "raised":
            broken.append(f"{test.address}: {outcome.reason}")
        else:
            runs.append(broken_run(ComparedRun, outcome, key=test.address, name=test.address, family=""))
    return Side(label, tuple(runs), tuple(sorted(broken)))


def _run(test: SuiteTest, setup: DriverSetup) -> tuple[ComparedRun, str]:
    case = load_test_case(test.address)
    result = setup.run(case)
    label = recorded_driver(setup.driver, str(result.trace.meta.get("driver_version", "")))
    run = ComparedRun.of(
        result,
        key=test.address,
        name=test.address,
        family=case.family,
        reason=result.reason or result.verdict.label,
        near=read_record(NearMisses, plain(result.near_misses)),  # rounded, as those of a campaign are
    )
    return run, label
