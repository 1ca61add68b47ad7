"""Runs test cases in separate processes, so that every run gets a verdict, whatever its driver does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from foresee_dsl.campaign.driving import DriverSetup, longest_s, sensors_of
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.deadlines import DEADLINES
from foresee_dsl.errors import DriverError
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.printer import quotable
from foresee_dsl.simulate.driver_faults import LONGEST_REASON
from foresee_dsl.simulate.results.verdict import DriverNotes, RunRecord, RunResult, Verdict
from foresee_dsl.simulate.triggers.unfired import unfired

if TYPE_CHECKING:
    from foresee_dsl.campaign.profiling.tasks import Profiler

T = TypeVar("T")
R = TypeVar("R", bound=RunRecord)


@dataclass(frozen=True)
class CaseRun(RunRecord):
    """The run of one test case. `result`: the result, with its trace; None if the process died or was ended."""

    case: TestCase
    result: RunResult | None = None


def run_cases(
    cases: Sequence[TestCase], setup: DriverSetup, *, jobs: int = 1, profiler: Profiler | None = None
) -> Iterator[CaseRun]:
    """Run test cases; yield each run as soon as it ends. `profiler` measures where the time goes.

    Raises:
        DriverError: the driver's address names nothing that can drive.
    """
    # A single run uses no fork server, because starting it would take as long as the run.
    with WorkerPool(min(jobs, len(cases)), deaths=1, once=len(cases) == 1) as pool:
        tasks = {case.id: case for case in cases}
        run, deadlines = partial(or_driver_error, _run_case, setup), setup.deadlines or DEADLINES
        todo = (
            Task(case.id, run, replace(case, document=None), deadlines.for_run_s(longest_s(case))) for case in cases
        )
        if profiler is None:
            pool.add(todo)
            results = pool.results()
        else:
            pool.add(map(profiler.task, todo))
            results = ((task, profiler.taken(outcome)) for task, outcome in profiler.received(pool.results()))
        for task, outcome in results:
            if isinstance(outcome, DriverError):
                raise outcome
            yield case_run(tasks[task.name], outcome)


def run_here(case: TestCase, setup: DriverSetup) -> CaseRun:
    """Run a test case in this process, for a debugger: without deadlines and without capturing printed output."""
    result = replace(setup, deadlines=None).run(case)
    return case_run(case, with_unfired(case, setup.driver, result))


def case_run(case: TestCase, outcome: RunResult | BrokenTask) -> CaseRun:
    """Return the run of a test case from its task's outcome."""
    if isinstance(outcome, RunResult):
        return CaseRun.of(outcome, case=case, result=outcome)
    return broken_run(CaseRun, outcome, case=case)


def or_driver_error(work: Callable[..., T], *arguments: Any, **options: Any) -> T | DriverError:  # noqa: ANN401
    """Return the result of `work`, or the error that the driver's address names nothing that can drive.

    That is an error of the command, which raises it; all other errors of a driver are a result of its run.
    """
    try:
        return work(*arguments, **options)
    except DriverError as err:
        return err


def broken_verdict(broken: BrokenTask) -> tuple[Verdict, str]:
    """Return the verdict of a run without a result, and the reason in one line."""
    verdict = Verdict.TIMEOUT if broken.how == "timeout" else Verdict.CRASH
    begins = {"raised": "the run raised ", "crash": "", "timeout": "timeout: the run "}.get(broken.how, "the run ")
    return verdict, quotable(begins + broken.reason, LONGEST_REASON)


def broken_run(kind: type[R], broken: BrokenTask, **more: Any) -> R:  # noqa: ANN401 - fields of any type
    """Return the record, of this class, of a run without a result. `more`: the fields that the class adds."""
    verdict, reason = broken_verdict(broken)
    return kind(verdict=verdict, reason=reason, notes=DriverNotes(output=broken.output), **more)


def _run_case(setup: DriverSetup, case: TestCase) -> RunResult:
    result = setup.run(case)
    _ = result.near_misses  # computed here, because this process has imported the kernels already
    return with_unfired(case, setup.driver, result)


def with_unfired(case: TestCase, driver: str, result: RunResult) -> RunResult:
    """Return a result with the triggers that never fired and how near they came to firing, computed from its trace."""
    unfired_triggers = unfired(case.scenario, lambda: compile_test_case(case), result.trace, sensors_of(driver))
    return replace(result, unfired=unfired_triggers) if unfired_triggers else result
