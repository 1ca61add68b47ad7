"""Effect of a parent's edit on its children: each is run under the old parent and under the new one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from foresee_dsl.campaign.driving import recorded_run, run_test_case
from foresee_dsl.campaign.execution.pool import Broken, Task, WorkerPool
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.repinning.repin import Child


def before_and_after(children: Sequence[Child], *, jobs: int = 1) -> dict[Path, tuple[str, str]]:
    """Run each child under its old parent and under the edited one, in new processes.

    Driver and seed are those that the child records (otherwise `pdm` and 0).

    Raises:
        DriverError: files record programs as drivers, which this command does not start; no run was started.

    Returns:
        For each file how the run under the old parent ended ("" if that parent is unknown), and how the new one did.
    """
    runs = {f"{child.file} {when}": run for child in children for when, run in _runs_of(child)}
    refuse_programs(
        ((_driver_and_seed(child.new or child.old)[0], child.file) for child in children),
        "`foresee verify --run-programs` runs them",
    )
    with WorkerPool(jobs) as pool:
        pool.add(Task(name, partial(drive, case, driver), seed) for name, (case, driver, seed) in runs.items())
        ended = {
            task.name: outcome.reason if isinstance(outcome, Broken) else outcome for task, outcome in pool.results()
        }
    return {child.file: (ended.get(f"{child.file} old", ""), ended[f"{child.file} new"])
            for child in children if child.new is not None}  # fmt: skip


def drive(case: TestCase, driver: str, seed: int) -> str:
    """Run one test case; return how it ended, in one sentence."""
    result = run_test_case(case, driver, seed)
    return result.reason or result.verdict.value


def _runs_of(child: Child) -> list[tuple[str, tuple[TestCase, str, int]]]:
    """Return the child's runs with driver and seed; without a run whose foreign network exists only in git."""
    return [
        (when, (case, *_driver_and_seed(case)))
        for when, case in (("old", child.old), ("new", child.new))
        if case is not None and (not isinstance(case.network, Path) or case.network.is_file())
    ]


def _driver_and_seed(case: TestCase | None) -> tuple[str, int]:
    """Return the driver and seed that a mutant's file records; by default `pdm` and 0."""
    return recorded_run(case.mutant.origin if case is not None and case.mutant else None)
