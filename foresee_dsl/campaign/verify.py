"""The day after: run recorded failures again and say which are reproduced, fixed, changed or stale."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.execution.pool import Broken, Task, WorkerPool
from foresee_dsl.drivers.registry import recorded_address
from foresee_dsl.errors import DriverError, InputError
from foresee_dsl.language.model import Mutant, Origin
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict


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


def verify_files(
    files: Sequence[Path], *, driver: str = "", run_programs: bool = False, jobs: int = 1
) -> tuple[Recheck, ...]:
    """Run recorded failures again, in new processes.

    Args:
        files: mutants' files.
        driver: drive with this one; by default with the one that each file records.
        run_programs: start the programs that files record as their drivers (`external:python3 my_driver.py`). A file
            that somebody sends must not run a command by being checked.
        jobs: worker processes.

    Raises:
        DriverError: files record programs, which was not allowed; nothing was run.
    """
    if not driver and not run_programs:
        _refuse_programs(files)
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
    recorded = _recorded(origin)
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


def _recorded(origin: Origin | None) -> str:
    return recorded_address((origin.driver if origin else None) or "pdm")


def _refuse_programs(files: Sequence[Path]) -> None:
    programs = sorted({address for file in files if ":" in (address := _address_in(file))})
    if programs:
        raise DriverError(
            f"recorded with programs as drivers: {'; '.join(programs)}. --run-programs starts what the files say, "
            "--driver names another driver"
        )


def _address_in(file: Path) -> str:
    """Return the driver that a mutant's file records; of a file with mistakes (it is reported as stale), nothing."""
    try:
        model = parse(file.read_text(encoding="utf-8"), str(file)).model
    except (InputError, OSError, UnicodeDecodeError):
        return ""
    return _recorded(model.origin) if isinstance(model, Mutant) else ""


def _same(was: str, now: str) -> bool:
    """The same kind of failure with the same party; the time may differ on another machine."""
    return was.rpartition(" at ")[0] == now.rpartition(" at ")[0]
