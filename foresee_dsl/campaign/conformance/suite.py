"""Runs the conformance suite: ten test cases of rising difficulty, and some of them again in other circumstances."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.conformance import checks
from foresee_dsl.campaign.conformance.records import Check, Conformance, ConformanceCase
from foresee_dsl.campaign.conformance.runs import ExaminedDriver, Handover, ObservedRun, OneProcess
from foresee_dsl.campaign.driving import longest_s
from foresee_dsl.campaign.execution.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.campaign.execution.runs import broken_run, broken_verdict
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.drivers.parts import DriverPart, ideal_parts, with_ideal
from foresee_dsl.drivers.protocol import OwnDeadline
from foresee_dsl.drivers.registry import find_driver, load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.language.model import Doc
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.loading import load_test_cases

CASES = Path(__file__).parent / "cases"
"""Folder of the test cases."""
EMPTY, BENDS, LEADER, WALKER = "straight_road", "two_bends", "leader_stops", "zebra_crossing"
"""Test cases that are used more than once: without others, with bends, with an actor ahead, with a pedestrian."""
MOST_FILES = 20_000
"""Largest number of files in the working folder that is compared. Ours: a second of reading."""
_NOT_COMPARED = frozenset(("__pycache__", "node_modules"))
_ONE_PROCESS, _ELSEWHERE, _HANDOVER = "one process", "another process", "handover"
_RUNS_IN_ONE_PROCESS, _RUNS_OF_PART = 5, 3
"""Largest number of runs of one task."""


def conformance_cases() -> dict[str, TestCase]:
    """Return the ten test cases by name, the easiest first."""
    listed = load_test_cases([str(CASES)], allow_outside=True)
    return {case.scenario.name: case for case in listed}


def conform(
    driver: str,
    *,
    seed: int = 0,
    jobs: int = 1,
    deadlines: Deadlines = DEADLINES,
    on_task: Callable[[int, int], None] = lambda *_: None,
) -> Conformance:
    """Check a driver from outside.

    Args:
        driver: its address; a program needs consent (`drivers.consent`). jobs: number of processes.
        on_task: called after each task with the number of finished and of all tasks.

    Raises:
        DriverError: there is no such driver.
    """
    find_driver(driver)
    cases, examined = conformance_cases(), ExaminedDriver(driver, seed, deadlines)
    folder = Path.cwd()
    files = dict(_files(folder))
    tasks = _Tasks(deadlines, on_task)
    tasks.add(EMPTY, examined.case, cases[EMPTY])
    first = _run(tasks.results(jobs)[EMPTY])
    start = checks.check_start(first)
    if first.ended_by_driver and not first.record.steps:
        return Conformance(driver, first.version, seed, (start,))

    for name, case in cases.items():
        if name != EMPTY:
            tasks.add(name, examined.case, case)
    tasks.add(_ONE_PROCESS, examined.in_one_process, (cases[LEADER], cases[BENDS]), runs=_RUNS_IN_ONE_PROCESS)
    tasks.add(_HANDOVER, examined.handover, cases[WALKER], runs=2)
    ideal = {part: with_ideal(driver, {part}) for part in DriverPart if part in first.record.parts}
    for part, address in ideal.items() if not ideal_parts(driver) else ():
        tasks.add(part, examined.with_ideal_part, (cases[WALKER], address), runs=_RUNS_OF_PART)
    results = {EMPTY: first, **tasks.results(jobs)}
    tasks.add(_ELSEWHERE, examined.case, cases[LEADER])
    results |= tasks.results(1, fresh=True)

    runs = {name: _run(results[name]) for name in cases}
    together, elsewhere = results[_ONE_PROCESS], _run(results[_ELSEWHERE])
    every = [*runs.values(), elsewhere]
    if isinstance(together, OneProcess):
        every += [run for run in vars(together).values() if run is not None]
        repeated = [checks.check_repetition(together, elsewhere), checks.check_reset(together)]
    else:
        repeated = [checks.skipped(name, _why(together)) for name in ("deterministic", "reset")]
    times = checks.step_times(every)
    handover = results[_HANDOVER]
    if not isinstance(handover, Handover):
        handover = Handover(math.nan, why=_why(handover))
    listed: tuple[Check, ...] = (
        start,
        checks.check_answers(every),
        checks.check_steering(runs[BENDS]),
        checks.check_speed(first),
        checks.check_place(first),
        *repeated,
        checks.check_process(every),
        checks.check_files(_changed(files, dict(_files(folder))), str(folder)),
        checks.check_times(times, _step_limit_s(driver, deadlines)),
        checks.check_handover(handover),
        checks.check_parts({part: _run(results[part]) for part in ideal if part in results}),
    )
    return Conformance(
        driver, first.version, seed, listed, tuple(_case(cases[name], run) for name, run in runs.items()), times
    )


class _Tasks:
    """The tasks that wait for their run, and how many have ended."""

    def __init__(self, deadlines: Deadlines, on_task: Callable[[int, int], None]) -> None:
        self._deadlines, self._on_task = deadlines, on_task
        self._waiting: list[Task] = []
        self._total = self._done = 0

    def add(self, name: str, function: Callable[[Any], object], argument: Any, *, runs: int = 1) -> None:  # noqa: ANN401 - of the function
        """Add a task of this number of runs of test cases."""
        case = argument[0] if isinstance(argument, tuple) else argument
        self._waiting.append(Task(name, function, argument, runs * self._deadlines.for_run_s(longest_s(case))))
        self._total += 1

    def results(self, jobs: int, *, fresh: bool = False) -> dict[str, Any]:
        """Run the waiting tasks; return the result of each, or a `BrokenTask`. `fresh`: in a new interpreter."""
        results = {}
        with WorkerPool(min(jobs, len(self._waiting)), deaths=1, fresh=fresh) as pool:
            pool.add(self._waiting)
            for task, outcome in pool.results():
                results[task.name] = outcome
                self._done += 1
                self._on_task(self._done, self._total)
        self._waiting.clear()
        return results


def _run(outcome: ObservedRun | BrokenTask) -> ObservedRun:
    return broken_run(ObservedRun, outcome) if isinstance(outcome, BrokenTask) else outcome


def _why(broken: BrokenTask) -> str:
    return broken_verdict(broken)[1]


def _case(case: TestCase, run: ObservedRun) -> ConformanceCase:
    about = next((item.text for item in case.scenario.body if isinstance(item, Doc)), "")
    return ConformanceCase(case.scenario.name, about, run)


def _step_limit_s(driver: str, deadlines: Deadlines) -> float:
    """Return the wall time that the driver may take for a step, s."""
    if deadlines.step_s is not None:
        return deadlines.step_s
    try:
        loaded = load_driver(driver)
    except DriverError:
        return deadlines.for_step_s
    return loaded.step_deadline_s if isinstance(loaded, OwnDeadline) else deadlines.for_step_s


def _files(folder: Path) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield the files below a folder with time and size, without hidden ones and caches; at most `MOST_FILES`."""
    count = 0
    for root, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name not in _NOT_COMPARED and not name.startswith("."))
        for name in sorted(names):
            count += 1
            if count > MOST_FILES:
                return
            file = Path(root) / name
            try:
                facts = file.lstat()
            except OSError:  # deleted in the meantime
                continue
            yield str(file.relative_to(folder)), (facts.st_mtime_ns, facts.st_size)


def _changed(before: Mapping[str, object], after: Mapping[str, object]) -> list[str] | None:
    """Return the files that are new or changed; None if there are too many to compare."""
    if max(len(before), len(after)) >= MOST_FILES:
        return None
    return [file for file, facts in after.items() if before.get(file) != facts]
