"""The day after: run recorded failures again and say which are reproduced, fixed, changed or stale."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.pool import Broken, Task, WorkerPool
from foresee_dsl.campaign.steps import run_test_case
from foresee_dsl.errors import InputError
from foresee_dsl.language.project import load_test_case
from foresee_dsl.simulate.verdict import Verdict


class Status(StrEnum):
    """What became of a recorded failure."""

    REPRODUCED = "reproduced"
    FIXED = "fixed"
    CHANGED = "changed"
    STALE = "stale"


@dataclass(frozen=True)
class Recheck:
    """One recorded failure, run again; `was` and `now` are sentences: `F4 lateral collision with runner at 3.15 s`."""

    file: str
    status: Status
    was: str
    now: str


@dataclass(frozen=True)
class VerifyTask:
    """One mutant's file; `driver`: another than the recorded one, or ""."""

    file: Path
    driver: str


def verify_files(files: Sequence[Path], *, driver: str = "", jobs: int = 1) -> tuple[Recheck, ...]:
    """Run recorded failures again, in new processes.

    Args:
        files: mutants' files.
        driver: drive with this one; by default with the one that each file records.
        jobs: worker processes.
    """
    pool = WorkerPool(jobs)
    pool.add(Task(str(file), recheck, VerifyTask(file, driver)) for file in files)
    found: list[Recheck] = []
    try:
        for task, outcome in pool.results():
            if isinstance(outcome, Broken):
                found.append(Recheck(task.name, Status.CHANGED, "", outcome.reason))
            else:
                found.append(outcome)
    finally:
        pool.close()
    return tuple(sorted(found, key=lambda r: r.file))


def recheck(task: VerifyTask) -> Recheck:
    """Run one recorded failure again."""
    try:
        case = load_test_case(task.file)
    except InputError as err:
        return Recheck(str(task.file), Status.STALE, "", err.diagnostics[0].message)
    origin = case.mutant.origin if case.mutant else None
    was = (origin.found if origin else None) or ""
    recorded = ((origin.driver if origin else None) or "pdm").split()[0]
    seed = int(origin.seed.value) if origin and origin.seed else 0
    result = run_test_case(case, task.driver or recorded, seed)
    if not result.verdict.is_failure and result.verdict is not Verdict.CRASH:
        status = Status.FIXED
    elif _same(was, result.reason):
        status = Status.REPRODUCED
    else:
        status = Status.CHANGED
    return Recheck(str(task.file), status, was, result.reason)


def as_dict(rechecks: Sequence[Recheck]) -> dict[str, Any]:
    """Return what `foresee verify --json` prints."""
    counts = Counter(r.status for r in rechecks)
    return {
        "schema": 1,
        **{status.value: counts[status] for status in Status},
        "children": [{"file": r.file, "status": r.status.value, "was": r.was, "now": r.now} for r in rechecks],
    }


def _same(was: str, now: str) -> bool:
    """The same kind of failure with the same party; the time may differ on another machine."""
    return was.rpartition(" at ")[0] == now.rpartition(" at ")[0]
