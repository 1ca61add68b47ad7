"""Runs a campaign's tasks in this process, one after the other, up to a limit of simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from foresee_dsl.campaign.execution.pool import BrokenTask, Executor, TaskPart, Update
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.steps.step import StepResult, Work, run_steps

REFERENCES = frozenset({"reference", "case_reference"})
"""Steps that judge failures; the time that they simulate does not count."""
SEARCH = frozenset({"seed", "forecast", "clip", "mutants", "child"})
PLAIN = frozenset({"seed"})


class InOrder(Executor):
    """Executes the tasks of a campaign in the order in which it would pass them to its workers.

    Attributes:
        simulated_s: simulated time of the search so far. order: kind, name and simulated time of each run.
    """

    def __init__(self, limit_s: float, kinds: frozenset[str] = SEARCH) -> None:
        """Run steps of these kinds up to `limit_s` of simulated time, and afterwards only steps that judge failures."""
        super().__init__()
        self._limit_s, self._kinds = limit_s, kinds
        self.simulated_s = 0.0
        self.order: list[tuple[str, str, float]] = []

    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        """See `Executor`; tasks that are not run are dropped, so that the campaign counts as stopped."""
        while self._queue and not stop():
            (number,) = self._queue.take()
            task = self._tasks.pop(number)
            work = task.argument
            if not isinstance(work, Work):
                raise TypeError(f"the task {task.name} is not a step of a campaign")
            kind = work.steps[0].kind
            if kind not in REFERENCES and (kind not in self._kinds or self.simulated_s >= self._limit_s):
                continue
            try:
                for step in run_steps(work):
                    self._count(step, task.name)
                    yield [Update(task, TaskPart(step))]
            except Exception as err:  # a step that fails has an outcome of its own
                yield [Update(task, BrokenTask(task, f"{type(err).__name__}: {err}", "raised"))]
            else:
                yield [Update(task, None)]

    def close(self) -> None:
        """Drop the remaining tasks."""
        self._queue.clear()
        self._tasks.clear()

    def _count(self, step: StepResult, task: str) -> None:
        record = step.record
        if not isinstance(record, CaseRunOutcome | ClipOutcome | ChildOutcome):
            return
        duration_s = record.duration_s if math.isfinite(record.duration_s) else 0.0
        self.simulated_s += duration_s
        self.order.append((step.kind, task if step.kind == "seed" else step.name, duration_s))
