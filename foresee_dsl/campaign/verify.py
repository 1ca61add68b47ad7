"""Recorded failures, run again: reproduced, fixed, changed or stale; and what a parent's edit does to them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.execution.pool import Broken, Task, WorkerPool
from foresee_dsl.drivers.registry import recorded_address
from foresee_dsl.errors import DriverError, InputError
from foresee_dsl.language.model import Mutant, Origin
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.language.repinning.repin import Child
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


def verify_files(
    files: Sequence[Path], *, driver: str = "", run_programs: bool = False, jobs: int = 1
) -> tuple[Recheck, ...]:
    """Run recorded failures again, in new processes.

    Args:
        driver: by default the one that each file records.
        run_programs: start the programs that files record as their drivers (`external:python3 my_driver.py`). Checking
            a file that came from elsewhere must not run a command.

    Raises:
        DriverError: files record programs, which was not allowed; nothing was run.
    """
    if not driver and not run_programs:
        _refuse_programs(
            map(_address_in, files), "--run-programs starts what the files say, --driver names another driver"
        )
    with WorkerPool(jobs) as pool:
        pool.add(Task(str(file), partial(recheck, file), driver) for file in files)
        found = (
            Recheck(task.name, Status.CHANGED, "", outcome.reason) if isinstance(outcome, Broken) else outcome
            for task, outcome in pool.results()
        )
        return tuple(sorted(found, key=lambda r: r.file))


def recheck(file: Path, driver: str) -> Recheck:
    """Run one recorded failure again, with another driver than the recorded one unless `driver` is ""."""
    try:
        case = load_test_case(file)
    except InputError as err:
        return Recheck(str(file), Status.STALE, "", err.diagnostics[0].message)
    origin = case.mutant.origin if case.mutant else None
    was = (origin.found if origin else None) or ""
    recorded, seed = _driver_and_seed(origin)
    result = run_test_case(case, driver or recorded, seed)
    if not result.verdict.is_failure and result.verdict is not Verdict.CRASH:
        status = Status.FIXED
    # The same kind of failure with the same actor; the time may differ on another machine.
    elif was.rpartition(" at ")[0] == result.reason.rpartition(" at ")[0]:
        status = Status.REPRODUCED
    else:
        status = Status.CHANGED
    return Recheck(str(file), status, was, result.reason)


def as_dict(rechecks: Sequence[Recheck]) -> dict[str, Any]:
    """Return what `foresee verify --json` prints."""
    counts = Counter(r.status for r in rechecks)
    return {
        "schema": 1,
        **{status.value: counts[status] for status in Status},
        "children": [{"file": r.file, "status": r.status.value, "was": r.was, "now": r.now} for r in rechecks],
    }


def before_and_after(children: Sequence[Child], *, jobs: int = 1) -> dict[Path, tuple[str, str]]:
    """Drive each child under its old parent and under the edited one, in new processes.

    The driver and the seed are those that the child records (`pdm` and 0 otherwise).

    Raises:
        DriverError: files record programs as drivers, which are not started for a look; nothing was run.

    Returns:
        For each file how the run under the old parent ended ("" where that parent is unknown), and the new run.
    """
    runs = {f"{child.file} {when}": run for child in children for when, run in _runs_of(child)}
    _refuse_programs((driver for _, driver, _ in runs.values()), "`foresee verify --run-programs` runs them")
    with WorkerPool(jobs) as pool:
        pool.add(Task(name, partial(drive, case, driver), seed) for name, (case, driver, seed) in runs.items())
        ended = {task.name: found.reason if isinstance(found, Broken) else found for task, found in pool.results()}
    return {child.file: (ended.get(f"{child.file} old", ""), ended[f"{child.file} new"])
            for child in children if child.new is not None}  # fmt: skip


def drive(case: TestCase, driver: str, seed: int) -> str:
    """Run one test case; return how it ended, in a sentence."""
    result = run_test_case(case, driver, seed)
    return result.reason or result.verdict.value


def _runs_of(child: Child) -> list[tuple[str, tuple[TestCase, str, int]]]:
    """Return the child's two runs, each with driver and seed; without one whose foreign network is only in git."""
    return [
        (when, (case, *_driver_and_seed(case.mutant.origin if case.mutant else None)))
        for when, case in (("old", child.old), ("new", child.new))
        if case is not None and (not isinstance(case.network, Path) or case.network.is_file())
    ]


def _driver_and_seed(origin: Origin | None) -> tuple[str, int]:
    """Return what a mutant's file records of its run; by default `pdm` and 0."""
    driver = recorded_address((origin.driver if origin else None) or "pdm")
    return driver, int(origin.seed.value) if origin and origin.seed else 0


def _refuse_programs(drivers: Iterable[str], instead: str) -> None:
    programs = sorted({address for address in drivers if ":" in address})
    if programs:
        raise DriverError(f"recorded with programs as drivers: {'; '.join(programs)}. {instead}")


def _address_in(file: Path) -> str:
    """Return the driver that a mutant's file records; of a file with errors (it is reported as stale), nothing."""
    try:
        model = parse(file.read_text(encoding="utf-8"), str(file)).model
    except (InputError, OSError, UnicodeDecodeError):
        return ""
    return _driver_and_seed(model.origin)[0] if isinstance(model, Mutant) else ""
