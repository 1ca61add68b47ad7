"""Shows the effect of a parent's edit: each derived file is run with its old and with its new parent."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from foresee_dsl.campaign.driving import recorded_setup
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.repinning.repin import DerivedFile


def before_and_after(derived_files: Sequence[DerivedFile]) -> dict[Path, tuple[str, str]]:
    """Run each derived file under its old parent and under the edited one, in new processes.

    Driver and seed are those that the derived file records (otherwise `pdm` and 0).

    Raises:
        DriverError: files record programs as drivers, which this command does not start; no run was started.

    Returns:
        For each file, how the run under the old parent ended ("" if that parent is unknown), and how the run under the
        new parent ended.
    """
    runs = [(derived.file, when, case) for derived in derived_files for when, case in _cases_of(derived)]
    refuse_programs(
        ((recorded_setup(derived.new or derived.old).driver, derived.file) for derived in derived_files),
        "`foresee verify --run-programs` runs them",
    )
    with WorkerPool(1) as pool:
        outcomes = pool.outcomes(Task(str(file), _ending, case) for file, _, case in runs)
    ended = {
        (file, when): outcome.reason if isinstance(outcome, BrokenTask) else outcome
        for (file, when, _), outcome in zip(runs, outcomes, strict=True)
    }
    return {derived.file: (ended.get((derived.file, "old"), ""), ended[derived.file, "new"])
            for derived in derived_files if derived.new is not None}  # fmt: skip


def _ending(case: TestCase) -> str:
    """Run one test case as its file records; return how it ended, in one sentence."""
    result = recorded_setup(case).run(case)
    return result.reason or result.verdict.value


def _cases_of(derived: DerivedFile) -> list[tuple[str, TestCase]]:
    """Return the test cases of a derived file, without those whose network file exists only in git."""
    return [
        (when, case)
        for when, case in (("old", derived.old), ("new", derived.new))
        if case is not None and (not isinstance(case.network, Path) or case.network.is_file())
    ]
