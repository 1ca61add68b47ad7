"""The conformance suite: runs ten test cases of rising difficulty, some of them again in other circumstances.

Its checks turn what was measured in these runs into results, with advice for those that fail.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from foresee_dsl.campaign.conformance.records import Check, CheckStatus, Conformance, ConformanceCase, StepTimes
from foresee_dsl.campaign.conformance.runs import LIMITS, ExaminedDriver, Handover, ObservedRun, OneProcess
from foresee_dsl.campaign.driving import REMEMBERS, longest_s
from foresee_dsl.campaign.execution.runs import broken_run, broken_verdict
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.drivers.parts import DriverPart, ideal_parts, with_ideal
from foresee_dsl.drivers.protocol import OwnDeadline
from foresee_dsl.drivers.registry import find_driver, load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Doc
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.trace import STEP_S

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
FASTEST_SHARE = 1.25
"""Largest allowed quotient of the ego's speed and the limit. Ours: a driver may overshoot, but one that takes m/s for
km/h drives 3.6 times as fast."""
SLOWEST_SHARE = 1 / 3
"""The same quotient on an empty road below which the driver is asked whether it takes the limit for km/h. Ours."""
OFFSET_M = 0.7
"""Largest allowed mean distance to the middle of the lane on a straight road, m. Ours: a car of 1.8 m in a lane of
3.3 m crosses the marking from 0.75 m on."""
MOVED_M = 1.0
"""Distance that the ego must move on an empty road, m. Ours."""
_SEVERAL = 3


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
    start = check_start(first)
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
        repeated = [check_repetition(together, elsewhere), check_reset(together)]
    else:
        repeated = [skipped(name, _why(together)) for name in ("deterministic", "reset")]
    times = step_times(every)
    handover = results[_HANDOVER]
    if not isinstance(handover, Handover):
        handover = Handover(math.nan, why=_why(handover))
    listed: tuple[Check, ...] = (
        start,
        check_answers(every),
        check_steering(runs[BENDS]),
        check_speed(first),
        check_place(first),
        *repeated,
        check_process(every),
        check_files(_changed(files, dict(_files(folder))), str(folder)),
        check_times(times, _step_limit_s(driver, deadlines)),
        check_handover(handover),
        check_parts({part: _run(results[part]) for part in ideal if part in results}),
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


# ---- the checks ------------------------------------------------------------------------------------------------------


def _passed(name: str, detail: str) -> Check:
    return Check(name, CheckStatus.PASS, detail)


def _failed(name: str, detail: str, advice: str) -> Check:
    return Check(name, CheckStatus.FAIL, detail, advice)


def skipped(name: str, why: str) -> Check:
    """Return a check that could not be made."""
    return Check(name, CheckStatus.SKIPPED, why)


def check_start(run: ObservedRun) -> Check:
    """Check that the driver is created, is reset, and answers."""
    if run.record.steps and not run.ended_by_driver:
        return _passed("starts", f"version {run.version or 'none'}; reset in {run.reset_ms:.0f} ms")
    if run.hangs:
        advice = "load weights once in the process (`keep`), or allow more with FORESEE_RESET_DEADLINE_S"
    else:
        advice = "`foresee run CASE --driver DRIVER` shows the traceback and what the driver prints"
    return _failed("starts", run.reason, advice)


def check_answers(runs: Iterable[ObservedRun]) -> Check:
    """Check that all answers are finite numbers in the allowed ranges."""
    listed = list(runs)
    broken = next((run for run in listed if run.ended_by_driver), None)
    if broken is not None:
        return _failed("answers", broken.reason, "answer every step with finite numbers, in time")
    records = [run.record for run in listed if run.record.lowest]
    if not records:
        return skipped("answers", "the driver answers with trajectories, which have no range")
    span = {
        part: (min(record.lowest[part] for record in records), max(record.highest[part] for record in records))
        for part in LIMITS
    }
    texts = {part: f"{part} {low:z.2f} to {high:z.2f}" for part, (low, high) in span.items()}
    wrong = {part: sum(record.outside.get(part, 0) for record in records) for part in LIMITS}
    if not any(wrong.values()):
        return _passed("answers", ", ".join(texts.values()))
    steps = sum(record.steps for record in records)
    detail = "; ".join(
        f"{texts[part]} in {count} of {steps} steps outside {LIMITS[part][0]:g} to {LIMITS[part][1]:g}"
        for part, count in wrong.items()
        if count
    )
    advice = (
        "steer is a share of the largest angle (not rad or degrees), the pedals are shares from 0 to 1; limit "
        "them, as foresee replaces other values by the nearest allowed one"
    )
    return _failed("answers", detail, advice)


def check_steering(run: ObservedRun) -> Check:
    """Check that the driver steers to the side where the route goes on."""
    record = run.record
    if not record.turning or not record.lowest:
        why = "the ego never came to a bend" if record.lowest else "the driver answers with trajectories"
        return skipped("steering", why)
    detail = f"to the side of the route in {record.right_side} of {record.turning} steps in bends"
    if record.right_side * 2 >= record.turning:
        return _passed("steering", detail)
    advice = "positive steer is left; y points north and headings turn counter-clockwise from east, in rad"
    return _failed("steering", f"only {detail}", advice)


def check_speed(run: ObservedRun) -> Check:
    """Check on an empty road that the driver moves, and that it takes speeds for m/s."""
    record = run.record
    share = f"at most {record.fastest_share:.2f} times the speed limit"
    if record.moved_m < MOVED_M:
        pedals = ", ".join(f"{part} at most {record.highest[part]:.2f}" for part in ("throttle", "brake"))
        moved = f"the ego moved {record.moved_m:.1f} m on an empty road" + (f"; {pedals}" if record.highest else "")
        return _failed("speed", moved, "answer with throttle above 0 and brake 0 to move off; they may be exchanged")
    if record.fastest_share > FASTEST_SHARE:
        return _failed(
            "speed", share, "it drives faster than allowed; speed_limit_mps and speed_mps are in m/s, not in km/h"
        )
    if record.fastest_share < SLOWEST_SHARE and run.verdict.is_failure:
        return _failed("speed", share, "speed_limit_mps and speed_mps are in m/s: is the limit divided by 3.6?")
    return _passed("speed", share)


def check_place(run: ObservedRun) -> Check:
    """Check on a straight road that the driver keeps to the middle of its lane."""
    offset_m = run.record.offset_m
    side = "left" if offset_m > 0 else "right"
    detail = f"{abs(offset_m):.2f} m {side} of the lane's middle on a straight road"
    if abs(offset_m) <= OFFSET_M:
        return _passed("place", detail)
    advice = "x and y are the middle of the ego's footprint; centreline has the points to follow"
    return _failed("place", detail, advice)


def check_repetition(runs: OneProcess, elsewhere: ObservedRun) -> Check:
    """Check that equal runs give equal traces, in one process and in another one."""
    if any(run.ended_by_driver for run in (runs.first, runs.second, elsewhere)):
        return skipped("deterministic", "the driver broke or hung in these runs")
    advice = (
        "the same observations after the same reset must give the same answers: no clock, no threads that decide by "
        "time, no random numbers except from the seed of reset, no order of a set or of hash()"
    )
    if runs.first.digest != runs.second.digest and REMEMBERS not in runs.second.notes.changed:
        return _failed("deterministic", "a second run in the same process differs", advice)
    if runs.first.digest != elsewhere.digest:
        return _failed("deterministic", "a run in another process differs", advice)
    return _passed("deterministic", "one digest in three runs and two processes")


def check_reset(runs: OneProcess) -> Check:
    """Check that a run does not depend on an earlier run of the process, or of the driver object."""
    every = [runs.first, runs.second, runs.other, runs.after, *([runs.reused] if runs.reused is not None else [])]
    advice = "reset must forget everything of the last run; keep nothing in the class, in modules, or in files"
    if any(REMEMBERS in run.notes.changed for run in every):
        return _failed("reset", f"the driver {REMEMBERS}", advice)
    if any(run.ended_by_driver for run in every):
        reason = next(run.reason for run in every if run.ended_by_driver)
        return skipped("reset", f"the driver broke or hung: {reason}")
    if runs.after.digest != runs.first.digest:
        return _failed("reset", "a run after a run of another test case differs from the same run alone", advice)
    if runs.reused is not None and runs.reused.digest != runs.first.digest:
        return _failed("reset", "a driver object that is reset for a second run drives it differently", advice)
    objects = "" if runs.reused is None else ", also with the same driver object"
    return _passed("reset", f"a run after another one is as the run alone{objects}")


def check_process(runs: Iterable[ObservedRun]) -> Check:
    """Check that the driver leaves its process as it was, and can be closed."""
    runs = list(runs)
    if why := next((run.notes.not_closed for run in runs if run.notes.not_closed), ""):
        return _failed("process", why, "release the driver's resources in `close`, without waiting")
    changes = sorted({change for run in runs for change in run.notes.changed if change != REMEMBERS})
    if not changes:
        return _passed("process", "no environment, folder, function or process is left changed")
    detail = "; ".join(f"the driver {change}" for change in changes)
    return _failed(
        "process", detail, "undo it in `close`: foresee does, but each time in a new worker, which costs 1 s"
    )


def check_files(changed: Sequence[str] | None, folder: str) -> Check:
    """Check that the driver wrote no files into the working folder; None: the folder is too large to be compared."""
    if changed is None:
        return skipped("files", f"{folder} has too many files to be compared")
    if not changed:
        return _passed("files", "none written in the working folder")
    named = ", ".join(changed[:_SEVERAL]) + (", ..." if len(changed) > _SEVERAL else "")
    advice = "a campaign runs several drivers in this folder at once: write to a temporary folder, and delete it"
    return _failed("files", f"{len(changed)} written in {folder}: {named}", advice)


def step_times(runs: Iterable[ObservedRun]) -> StepTimes | None:
    """Return the wall times of all runs; None if no step was driven."""
    listed = list(runs)
    times = np.array([ms for run in listed for ms in run.step_ms])
    if not len(times):
        return None
    slowest_reset = max(run.reset_ms for run in listed)
    return StepTimes(
        slowest_reset, float(times.mean()), float(np.percentile(times, 99)), float(times.max()), len(times)
    )


def check_times(times: StepTimes | None, limit_s: float) -> Check:
    """Check that no step came near its deadline, `limit_s` of wall time."""
    if times is None:
        return skipped("time a step", "no step was driven")
    mean, most, slowest = (
        f"{ms:.{0 if ms >= 10 else 2}f} ms" for ms in (times.mean_ms, times.p99_ms, times.slowest_ms)
    )
    detail = f"mean {mean}, 99 % under {most}, slowest {slowest}"
    if times.slowest_ms > limit_s * 1e3 / 2:
        advice = (
            f"the deadline is {limit_s:g} s: on a busy machine it would end runs as timeout. Load in reset, or allow "
            "more with --step-deadline"
        )
        return _failed("time a step", detail, advice)
    slow = f"; slower than real time ({STEP_S * 1e3:.0f} ms)" if times.mean_ms > STEP_S * 1e3 else ""
    return _passed("time a step", detail + slow)


def check_handover(handover: Handover) -> Check:
    """Check that the driver drives a clip as it drove the same seconds of the whole run."""
    if math.isnan(handover.ego_m):
        return skipped("handover", handover.why)
    limit_m = CampaignSettings.fidelity_limit_m
    watches = f", which watches {handover.handover_s:g} s first" if handover.handover_s else ""
    detail = f"the ego of a clip deviates by at most {handover.ego_m:.2f} m{watches}"
    if handover.ego_m <= limit_m:
        return _passed("handover", detail)
    advice = (
        f"over {limit_m:g} m a campaign does not mutate the clip: decide from the observation, not from memory, or "
        "give the driver an attribute handover_s"
    )
    return _failed("handover", detail, advice)


def check_parts(runs: Mapping[str, ObservedRun]) -> Check:
    """Check that the driver can be driven with each of its parts replaced by an ideal one."""
    broken = {part: run for part, run in runs.items() if run.ended_by_driver}
    if not broken:
        return _passed("ideal parts", ", ".join(runs))
    detail = "; ".join(f"{part}: {run.reason}" for part, run in broken.items())
    return _failed("ideal parts", detail, "take the truth for this part in `idealise`, or do not declare it in `parts`")
