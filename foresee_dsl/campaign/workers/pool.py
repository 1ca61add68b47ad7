"""The pool of worker processes that runs a campaign's tasks.

A task that dies, hangs or needs too much memory gets an outcome too.
"""

from __future__ import annotations

import heapq
import math
import multiprocessing.connection
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count
from typing import Any, Literal, Self

from foresee_dsl.campaign.settings import CampaignLimits, Shard
from foresee_dsl.campaign.workers.isolation import ProcessEnding, Task, Worker
from foresee_dsl.campaign.workers.processes import MOST, memory_mb, started_by

Priority = tuple[int, ...]
Shares = tuple[str, ...]
"""Inputs of a task, from those that many tasks share to those that few share: a network, a test case, a clip."""


class TaskQueue:
    """The waiting tasks, by number and priority."""

    def __init__(self) -> None:
        self._waiting: dict[int, tuple[Priority, int, Shares]] = {}
        self._heaps: dict[Shares, list[tuple[Priority, int, int]]] = {}
        """Priority, turn and number of tasks by shared inputs (`()`: all tasks); may contain tasks already removed."""
        self._sharing: Counter[Shares] = Counter()
        """Number of waiting tasks by shared inputs."""
        self._turns = count()

    def __len__(self) -> int:
        return len(self._waiting)

    def push(self, number: int, priority: Priority, shares: Shares = ()) -> None:
        """Queue a task, after those of the same priority."""
        turn = next(self._turns)
        self._waiting[number] = priority, turn, shares
        for length in range(len(shares) + 1):
            heapq.heappush(self._heaps.setdefault(shares[:length], []), (priority, turn, number))
            self._sharing[shares[:length]] += 1

    @property
    def first(self) -> int:
        """Return the number of the most urgent task, which stays in the queue; `IndexError` if there is none."""
        return self._head()[1]

    def take(self, most: int = 1, warm: Sequence[Shares] = ()) -> list[int]:
        """Remove and return one of the most urgent tasks, together with others that are as urgent and share its inputs:
        up to `most` tasks in all.

        `warm`: inputs that a process has used, the latest first; tasks that share most with one of them are preferred.

        Raises:
            IndexError: there is none.
        """
        priority, number = self._head()
        urgency = priority[:-1]
        number = self._warm(warm, urgency, number)
        shares = self._waiting[number][2]
        numbers: list[int] = []
        while True:
            numbers.append(number)
            self._remove(number)
            top = self._top(shares)
            if len(numbers) == most or top is None or top[0][:-1] != urgency or self._waiting[top[1]][2] != shares:
                return numbers
            number = top[1]

    def clear(self) -> None:
        """Remove all tasks."""
        self._waiting.clear()
        self._heaps.clear()
        self._sharing.clear()

    def _head(self) -> tuple[Priority, int]:
        head = self._top(())
        if head is None:
            raise IndexError("no task is waiting")
        return head

    def _warm(self, warm: Sequence[Shares], urgency: Priority, otherwise: int) -> int:
        for length in range(max(map(len, warm), default=0), 0, -1):
            for shares in warm:
                top = self._top(shares[:length]) if len(shares) >= length else None
                if top is not None and top[0][:-1] == urgency:
                    return top[1]
        return otherwise

    def _remove(self, number: int) -> None:
        _, _, shares = self._waiting.pop(number)
        for length in range(len(shares) + 1):
            self._sharing[shares[:length]] -= 1
            if not self._sharing[shares[:length]]:
                del self._sharing[shares[:length]], self._heaps[shares[:length]]

    def _top(self, shares: Shares) -> tuple[Priority, int] | None:
        """Return priority and number of the most urgent task with these shared inputs; None if there is none."""
        heap = self._heaps.get(shares)
        while heap:
            priority, turn, number = heap[0]
            entry = self._waiting.get(number)
            if entry is not None and entry[1] == turn:
                return priority, number
            heapq.heappop(heap)
        return None


__all__ = [
    "BATCH",
    "DEATHS",
    "BrokenTask",
    "Executor",
    "RunOptions",
    "Task",
    "TaskPart",
    "Update",
    "WorkerPool",
    "local",
]

DEATHS = 3
"""Number of times that a task's process must die before the task counts as the cause. Ours: a `kill` from outside, or
by the kernel when memory is short, sometimes hits an innocent task, whereas a crash inside a library recurs every time.
"""
BATCH = 8
"""Maximum number of tasks sent to a process at once. Ours: sending takes 0.2 ms, which is little compared with eight
tasks; if more were sent, other workers would be idle at the end.
"""
_TICK_S = 0.1
"""Interval at which deadlines and memory are checked, s. Ours: a process can allocate about 200 MB in that time."""
_OUTSIDE = ": sent from outside, as by `kill`, or by the system when memory runs out, so it does not count as a crash"
_STARTS = 5
"""Number of processes in a row that may die before they begin a task. Ours: one process may be hit by a kill; if five
die, no process can start.
"""


@dataclass(frozen=True)
class BrokenTask:
    """A task without an outcome: its process died (`crash`), it took too long (`timeout`) or too much memory
    (`memory`), or it raised; or its process was ended from outside each time (`killed`), which says nothing about the
    task."""

    task: Task
    reason: str
    how: Literal["crash", "timeout", "memory", "raised", "killed"] = "crash"
    output: str = ""
    """The output of its process."""


@dataclass(frozen=True)
class TaskPart:
    """One part of the outcome of a task that reports its outcome in parts."""

    value: Any


@dataclass(frozen=True)
class Update:
    """A message about a task: a `TaskPart`, a `BrokenTask`, or its outcome (None after the last part)."""

    task: Task
    value: Any

    @property
    def final(self) -> bool:
        """Return whether the task has ended."""
        return not isinstance(self.value, TaskPart)


class Executor(ABC):
    """Runs tasks isolated from each other, by priority (smaller first), then in the order of their addition.

    Among tasks whose priorities differ only in their last number, a process gets those that share most inputs with the
    tasks that it has run (`Task.shares`). No result depends on which process runs a task, or when.
    """

    def __init__(self) -> None:
        self._tasks: dict[int, Task] = {}
        self._queue = TaskQueue()
        self._numbers = count(1)

    def add(self, tasks: Iterable[Task], priority: Priority = ()) -> None:
        """Queue more tasks."""
        for number, task in zip(self._numbers, tasks):  # noqa: B905 - numbers have no end
            self._tasks[number] = task
            self._queue.push(number, priority, task.shares)

    @abstractmethod
    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        """Yield the updates of the tasks until none is left, or `stop` (called several times a second) returns true:
        each time all that have arrived since the last time, in the order of each process.

        Raises:
            RuntimeError: processes die as soon as they start, so no task can run.
            ClusterError: the scheduler of a cluster does not answer.
        """

    @abstractmethod
    def close(self) -> None:
        """End the workers now; their present tasks are lost."""


class WorkerPool(Executor):
    """Runs tasks in `jobs` processes; tasks may be added while others run.

    A process runs tasks one after the other, in batches. If it dies at a task, the task is repeated alone in a new
    process, until that has happened `DEATHS` times; the rest of its batch goes to other processes.
    """

    def __init__(
        self,
        jobs: int,
        *,
        memory_mb: float = CampaignLimits.memory_mb,
        deaths: int = DEATHS,
        once: bool = False,
        fresh: bool = False,
    ) -> None:
        """Store the settings; processes start later.

        Args:
            memory_mb: memory limit of each process and its descendants together. deaths: number of deaths after which a
                task is the cause.
            once: there is a single task, for which no fork server is started if that is safe.
            fresh: processes are new interpreters, which take a second to start, instead of forks of one.
        """
        super().__init__()
        self._jobs = max(1, jobs)
        self._memory_mb = memory_mb
        self._most_deaths, self._once, self._fresh = deaths, once, fresh
        self._deaths: Counter[int] = Counter()
        self._kills: Counter[int] = Counter()
        """Number of times that the process of each task was ended from outside."""
        self._spoilt: set[int] = set()
        """Tasks that raised an exception in a process that a driver had changed; each is repeated once."""
        self._workers: list[Worker] = []
        self._failed_starts = 0
        self._checked_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def results(self) -> Iterator[tuple[Task, Any | BrokenTask]]:
        """Yield each task with its outcome until none is left."""
        for update in chain.from_iterable(self.updates()):
            if update.final:
                yield update.task, update.value

    def outcomes(self, tasks: Iterable[Task], on_end: Callable[[Any], None] = lambda _: None) -> list[Any]:
        """Run tasks, and return the outcome of each, or its `BrokenTask`, in the order of the tasks.

        `on_end`: called with each outcome as soon as its task ends.
        """
        numbered = [replace(task, key=str(k)) for k, task in enumerate(tasks)]
        self.add(numbered)
        outcomes: dict[str, Any] = {}
        for task, outcome in self.results():
            outcomes[task.key] = outcome
            on_end(outcome)
        return [outcomes[task.key] for task in numbered]

    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        """See `Executor`; `stop` is called ten times a second."""
        while self._tasks and not stop():
            self._hand_out()
            arrived: list[Update] = []
            busy = {id(handle): worker for worker in self._workers if not worker.idle for handle in worker.watched}
            watched = [handle for worker in self._workers if not worker.idle for handle in worker.watched]
            for ready in multiprocessing.connection.wait(watched, timeout=_TICK_S):
                worker = busy[id(ready)]
                if worker not in self._workers:
                    continue  # both watched objects were ready, and the worker was handled with the first one
                arrived += self._receive(worker)
                # A process gets its next task before the caller handles the last result, so that it is not idle.
                self._hand_out()
            if time.monotonic() - self._checked_s >= _TICK_S:
                self._checked_s = time.monotonic()
                for worker in tuple(self._workers):
                    arrived += self._check_limits(worker)
            if arrived:
                yield arrived

    def close(self) -> None:
        """See `Executor`."""
        self._queue.clear()
        self._tasks.clear()
        for worker in self._workers:
            worker.kill()
        self._workers.clear()

    @property
    def pids(self) -> tuple[int, ...]:
        """Return the ids of the processes."""
        return tuple(worker.pid for worker in self._workers)

    def _hand_out(self) -> None:
        while self._queue:
            worker = next((w for w in self._workers if w.idle), None)
            if worker is not None and worker.finished and self._suspect(self._queue.first):
                self._drop(worker)  # a task that may have been the cause runs in a fresh process
                worker = None
            if worker is None:
                if len(self._workers) == self._jobs:
                    return
                worker = self._started()
                self._workers.append(worker)
            batch = self._batch(worker)
            try:
                worker.give(batch)
            except OSError:  # the process died while it had no task
                self._requeue(number for number, _ in batch)
                self._drop(worker)

    def _started(self) -> Worker:
        """Return a new worker; if the fork server is killed at that moment, try again with a new one."""
        while True:
            try:
                return Worker(once=self._once, fresh=self._fresh)
            except (OSError, EOFError) as err:
                self._note_failed_start(f"{type(err).__name__} {err}")
                time.sleep(_TICK_S)  # until the system has registered the end of the old process

    def _note_failed_start(self, how: str) -> None:
        self._failed_starts += 1
        if self._failed_starts >= _STARTS:
            raise RuntimeError(f"worker processes die as soon as they start: {how}")

    def _batch(self, worker: Worker) -> list[tuple[int, Task]]:
        """Return the next tasks from the queue: fewer than `BATCH` when few are left. A task at which a process ended
        forms a batch of its own.
        """
        size = max(1, min(BATCH, math.ceil(len(self._queue) / (2 * self._jobs))))
        most = 1 if self._suspect(self._queue.first) else size
        return [(number, self._tasks[number]) for number in self._queue.take(most, worker.warm)]

    def _requeue(self, numbers: Iterable[int]) -> None:
        for number in numbers:
            # Requeued tasks come before all others. Among them, those that may have ended the process come last, so
            # that the rest of their batch need not wait for them.
            self._queue.push(number, (-1, self._suspect(number), 0), self._tasks[number].shares)

    def _receive(self, worker: Worker) -> Iterator[Update]:
        try:
            for what, number, value in worker.messages():
                self._failed_starts = 0
                if what == "part":
                    yield Update(self._tasks[number], TaskPart(value))
                elif what == "done":
                    yield self._ended(number, value)
                elif what == "raised":
                    yield from self._raised(number, value, worker)
        except EOFError:
            yield from self._died(worker)
        else:
            if worker.changed and worker.current is None:
                self._drop(worker)

    def _raised(self, number: int, error: str, worker: Worker) -> Iterator[Update]:
        """Handle a task that raised an error; if a driver had changed the process, run the task once more."""
        if worker.changed and number not in self._spoilt:
            self._spoilt.add(number)
            self._requeue([number])
            return
        if worker.changed:
            error += f" (before that, the driver {'; it '.join(worker.changed)})"
        yield self._ended(number, BrokenTask(self._tasks[number], error, "raised"))

    def _ended(self, number: int, value: object) -> Update:
        self._deaths.pop(number, None)
        self._kills.pop(number, None)
        self._spoilt.discard(number)
        return Update(self._tasks.pop(number), value)

    def _died(self, worker: Worker) -> Iterator[Update]:
        culprit = worker.current
        ending = self._drop(worker, gone=True)
        if culprit is None:
            if not worker.finished:
                self._note_failed_start(ending.text)
            return
        number, task = culprit
        left = worker.left_behind()
        at = f", at {left.place}" if left.place else ""
        if left.hung:
            reason = f"did not return from a library's code in time{at}; --step-deadline allows more (with --retry)"
            yield self._ended(number, BrokenTask(task, reason, "timeout", left.output))
            return
        counted, most = (self._kills, DEATHS) if ending.outside else (self._deaths, self._most_deaths)
        counted[number] += 1
        times = f", {most} times" if most > 1 else ""
        if counted[number] < most:
            self._requeue([number])
        elif ending.outside:
            yield self._ended(number, BrokenTask(task, f"{ending.text}{times}{_OUTSIDE}", "killed", left.output))
        else:
            yield self._ended(number, BrokenTask(task, f"{ending.text}{at}{times}", output=left.output))

    def _suspect(self, number: int) -> int:
        """Return how many processes ended at a task; if any did, the task runs alone in a new process."""
        return self._deaths[number] + self._kills[number]

    def _drop(self, worker: Worker, *, gone: bool = False) -> ProcessEnding:
        """End a worker and requeue its waiting tasks; return how it ended."""
        self._workers.remove(worker)
        self._requeue(number for number, _ in worker.waiting)
        return worker.kill(gone=gone)

    def _check_limits(self, worker: Worker) -> Iterator[Update]:
        if worker.connection.poll():
            return  # the process has sent messages that were not read yet
        if worker.current is None:
            # Between two batches, a process that has grown is replaced, before it ends a task that did not cause it.
            if worker.idle and memory_mb(worker.pid, self._memory_mb / 2) > self._memory_mb / 2:
                self._drop(worker)
            return
        number, task = worker.current
        if worker.overdue():
            self._drop(worker)
            reason = f"took longer than {task.deadline_s:g} s of wall time and was ended; --deadline allows more"
            yield self._ended(number, BrokenTask(task, reason, "timeout", worker.left_behind().output))
        elif len(started_by(worker.pid)) > MOST:
            self._drop(worker)
            reason = f"started more than {MOST:,} processes and was ended"
            yield self._ended(number, BrokenTask(task, reason, "memory", worker.left_behind().output))
        elif memory_mb(worker.pid, self._memory_mb) > self._memory_mb:
            alone = not worker.finished
            self._drop(worker)
            if alone:
                reason = f"took more than {self._memory_mb:g} MB of memory and was ended; --memory allows more"
                yield self._ended(number, BrokenTask(task, reason, "memory", worker.left_behind().output))
            else:  # earlier tasks may have used the memory
                self._deaths[number] += 1
                self._requeue([number])


def local(options: RunOptions) -> Executor:
    """Return an executor that runs tasks in processes here."""
    return WorkerPool(options.jobs, memory_mb=options.limits.memory_mb)


@dataclass(frozen=True)
class RunOptions:
    """How a campaign is executed; no option changes a result.

    Attributes:
        jobs: number of worker processes. limits: limits of each run. shard: the part of the campaign that is run.
        retry: repeat runs that broke in an earlier campaign (died, hung, raised).
        executor: factory of the executor. stop: called ten times a second; true stops the campaign.
    """

    jobs: int = 1
    limits: CampaignLimits = field(default_factory=CampaignLimits)
    shard: Shard = field(default_factory=Shard)
    retry: bool = False
    executor: Callable[[RunOptions], Executor] = local
    stop: Callable[[], bool] = lambda: False
