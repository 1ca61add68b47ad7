"""Shows the effect of a parent's edit: each derived file is run with its old and with its new parent."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from foresee_dsl.campaign.driving import recorded_run, run_test_case
from foresee_dsl.campaign.execution.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.repinning.repin import DerivedFile


def before_and_after(derived_files: Sequence[DerivedFile], *, jobs: int = 1) -> dict[Path, tuple[str, str]]:
    """Run each derived file under its old parent and under the edited one, in new processes.

    Driver and seed are those that the derived file records (otherwise `pdm` and 0).

    Raises:
        DriverError: files record programs as drivers, which this command does not start; no run was started.

    Returns:
        For each file, how the run under the old parent ended ("" if that parent is unknown), and how the run under the
        new parent ended.
    """
    runs = {f"{derived.file} {when}": run for derived in derived_files for when, run in _runs_of(derived)}
    refuse_programs(
        ((_driver_and_seed(derived.new or derived.old)[0], derived.file) for derived in derived_files),
        "`foresee verify --run-programs` runs them",
    )
    with WorkerPool(jobs) as pool:
        pool.add(Task(name, partial(drive, case, driver), seed) for name, (case, driver, seed) in runs.items())
        ended = {
            task.name: outcome.reason if isinstance(outcome, BrokenTask) else outcome
            for task, outcome in pool.results()
        }
    return {derived.file: (ended.get(f"{derived.file} old", ""), ended[f"{derived.file} new"])
            for derived in derived_files if derived.new is not None}  # fmt: skip


def drive(case: TestCase, driver: str, seed: int) -> str:
    """Run one test case; return how it ended, in one sentence."""
    result = run_test_case(case, driver, seed)
    return result.reason or result.verdict.value


def _runs_of(derived: DerivedFile) -> list[tuple[str, tuple[TestCase, str, int]]]:
    """Return the runs of a derived file with driver and seed.

    A run whose network file exists only in git is left out.
    """
    return [
        (when, (case, *_driver_and_seed(case)))
        for when, case in (("old", derived.old), ("new", derived.new))
        if case is not None and (not isinstance(case.network, Path) or case.network.is_file())
    ]


def _driver_and_seed(case: TestCase | None) -> tuple[str, int]:
    """Return the driver and seed that a mutant's file records; by default `pdm` and 0."""
    return recorded_run(case.mutant.origin if case is not None and case.mutant else None)
