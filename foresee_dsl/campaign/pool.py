"""Worker processes: tasks in, outcomes out, in whatever order; a task that kills its process is found and named."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

PRELOAD = ("foresee_dsl.campaign.tasks",)
"""Imported once in the fork server, so that a new worker starts warm."""


@dataclass(frozen=True)
class Task:
    """A function of this package and its argument; `name` is for people."""

    name: str
    function: Callable[[Any], Any]
    argument: object


@dataclass(frozen=True)
class Broken:
    """A task that ended its process (a segmentation fault, out of memory) or raised."""

    task: Task
    reason: str


class WorkerPool:
    """Runs tasks in `jobs` processes; new ones may be added while others run.

    Python's own executor gives up as a whole when one process dies. The tasks that were under way are then run again
    one by one in a process of their own, so that the culprit is known and the others are kept.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = max(1, jobs)
        self._waiting: list[Task] = []
        self._running: dict[Future[Any], Task] = {}
        self._executor: ProcessPoolExecutor | None = None

    def add(self, tasks: Iterable[Task]) -> None:
        """Queue more tasks."""
        self._waiting.extend(tasks)

    def results(self) -> Iterator[tuple[Task, Any | Broken]]:
        """Yield each task with its outcome until none is left."""
        while self._waiting or self._running:
            self._fill()
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
            suspects: list[Task] = []
            for future in sorted(done, key=lambda f: self._running[f].name):
                task = self._running.pop(future)
                try:
                    yield task, future.result()
                except BrokenProcessPool:
                    suspects.append(task)
                except Exception as err:
                    yield task, Broken(task, f"{type(err).__name__}: {err}")
            if suspects:
                suspects.extend(self._running.values())
                self._running.clear()
                self._drop()
                for task in suspects:
                    yield task, _alone(task)

    def close(self) -> None:
        """End the workers now; what they were doing is lost."""
        self._waiting.clear()
        self._running.clear()
        self._drop()

    def _fill(self) -> None:
        if self._executor is None:
            self._executor = _executor(self._jobs)
        # No more than the workers can hold: what waits here can still be thrown away.
        while self._waiting and len(self._running) < self._jobs + 1:
            task = self._waiting.pop(0)
            self._running[self._executor.submit(task.function, task.argument)] = task

    def _drop(self) -> None:
        if self._executor is None:
            return
        processes = list((self._executor._processes or {}).values())  # the executor has no public way to end them
        self._executor.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        for process in processes:
            process.join(5)
        self._executor = None


def _alone(task: Task) -> Any:  # noqa: ANN401 - whatever the task returns
    with contextlib.ExitStack() as stack:
        executor = stack.enter_context(_executor(1))
        try:
            return executor.submit(task.function, task.argument).result()
        except BrokenProcessPool:
            return Broken(task, "its process died (a crash inside a library, or out of memory)")
        except Exception as err:
            return Broken(task, f"{type(err).__name__}: {err}")


def _executor(jobs: int) -> ProcessPoolExecutor:
    # libsumo allows one simulation a process and must never be forked while it runs: hence the fork server.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOAD))
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # two workers on two cores: threads inside would only fight
    return ProcessPoolExecutor(max_workers=jobs, mp_context=context, initializer=_ignore_interrupt)


def _ignore_interrupt() -> None:
    """Ctrl-C reaches the whole group; only the parent decides what it means."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
