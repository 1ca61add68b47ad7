"""Children under their old parent and under the new one, driven: does an edit of the parent change the verdict?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.execution.pool import Broken, Task, WorkerPool
from foresee_dsl.drivers.registry import recorded_address
from foresee_dsl.errors import DriverError
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.repinning.repin import Child


@dataclass(frozen=True)
class RunTask:
    """One test case, and what drives it."""

    case: TestCase
    driver: str
    seed: int


def before_and_after(children: Sequence[Child], *, jobs: int = 1) -> dict[Path, tuple[str, str]]:
    """Drive each child twice, in new processes, with the driver and seed that it records (`pdm` and 0 otherwise).

    Raises:
        DriverError: files record programs as drivers, which are not started for a look; nothing was run.

    Returns:
        For each file what the run under the old parent ended with ("" where that parent is unknown), and the new run.
    """
    pool = WorkerPool(jobs)
    cases = {(str(child.file), when): case for child in children for when, case in _cases(child)}
    programs = sorted({driver for case in cases.values() if ":" in (driver := _task(case).driver)})
    if programs:
        message = f"recorded with programs as drivers: {'; '.join(programs)}. `foresee verify --run-programs` runs them"
        raise DriverError(message)
    tasks = {f"{file} {when}": (file, when) for file, when in cases}
    pool.add(Task(name, drive, _task(cases[key])) for name, key in tasks.items())
    ended: dict[tuple[str, str], str] = {}
    try:
        for task, outcome in pool.results():
            ended[tasks[task.name]] = outcome.reason if isinstance(outcome, Broken) else outcome
    finally:
        pool.close()
    return {child.file: (ended.get((str(child.file), "old"), ""), ended[str(child.file), "new"])
            for child in children if child.new is not None}  # fmt: skip


def drive(task: RunTask) -> str:
    """Run one test case; return what it ended with, in a sentence."""
    result = run_test_case(task.case, task.driver, task.seed)
    return result.reason or result.verdict.value


def _cases(child: Child) -> list[tuple[str, TestCase]]:
    """Return the child's two test cases; without the old one where its foreign network is only in git's history."""
    found = [("old", child.old), ("new", child.new)]
    there = [(when, case) for when, case in found if case is not None]
    return [(when, case) for when, case in there if not isinstance(case.network, Path) or case.network.is_file()]


def _task(case: TestCase) -> RunTask:
    origin = case.mutant.origin if case.mutant is not None else None
    driver = recorded_address((origin.driver if origin else None) or "pdm")
    return RunTask(case, driver, int(origin.seed.value) if origin and origin.seed else 0)
