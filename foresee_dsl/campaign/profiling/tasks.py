"""Measures tasks in their own processes, and sums the measurements."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from inspect import isgenerator
from pathlib import Path
from typing import Any, TypeVar

from foresee_dsl import measuring
from foresee_dsl.campaign.profiling.clock import Clock, Measurement
from foresee_dsl.campaign.profiling.profile import Profile
from foresee_dsl.campaign.workers.pool import Executor, RunOptions, Task, TaskPart, Update
from foresee_dsl.measuring import Part

T = TypeVar("T")


class Profiler:
    """Measures a command: this process, and its tasks in other processes."""

    def __init__(self) -> None:
        """Begin; the time so far counts as start-up."""
        self._own = self._tasks = Measurement()
        self._worked_s = 0.0
        self._clock = Clock(Part.REST)
        self._clock.add(Part.START, cpu_ns=time.process_time_ns(), wall_ns=_age_ns())

    @contextmanager
    def command(self) -> Iterator[None]:
        """Measure this process inside this context; the time until `ready` is called counts as start-up."""
        self._clock.enter(Part.START)
        measuring.start(self._clock)
        try:
            yield
        finally:
            measuring.start(None)

    def ready(self) -> None:
        """Mark the end of start-up."""
        self._clock.enter(Part.REST)

    def task(self, task: Task) -> Task:
        """Return a task that measures itself."""
        return replace(task, function=_Measured(task.function))

    def taken(self, outcome: object) -> Any:  # noqa: ANN401 - what the task gave
        """Return the result of a measured task, and add its measurement."""
        if isinstance(outcome, _WithMeasurement):
            self.add(outcome.measurement)
            return outcome.value
        return outcome

    def add(self, measurement: Measurement) -> None:
        """Add the measurement of a task."""
        self._tasks += measurement

    def received(self, updates: Iterable[T]) -> Iterator[T]:
        """Yield the workers' updates; the time between them counts as distributing tasks."""
        began_s, ahead = time.monotonic(), iter(updates)
        try:
            while True:
                before = self._clock.enter(Part.HANDING)
                try:
                    update = next(ahead)
                except StopIteration:
                    return
                finally:
                    self._clock.enter(before)
                yield update
        finally:
            self._worked_s += time.monotonic() - began_s

    def executor(self, make: Callable[[RunOptions], Executor]) -> Callable[[RunOptions], Executor]:
        """Return a factory of executors whose tasks are measured."""
        return lambda options: _MeasuringExecutor(self, make(options))

    def profile(self, drivers: Iterable[str], *, workers: int = 1, not_measured: int = 0) -> Profile:
        """Return where the time went so far; arguments as in `Profile`."""
        self._own += self._clock.take()
        return Profile.of(
            tuple(dict.fromkeys(drivers)),
            self._own,
            self._tasks,
            workers=workers,
            worked_s=self._worked_s,
            not_measured=not_measured,
        )


class _MeasuringExecutor(Executor):
    """An executor that measures its tasks and delegates to another executor."""

    def __init__(self, profiler: Profiler, inner: Executor) -> None:
        super().__init__()
        self._profiler, self._inner = profiler, inner

    def add(self, tasks: Iterable[Task], priority: tuple[int, ...] = ()) -> None:
        self._inner.add(map(self._profiler.task, tasks), priority)

    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        for updates in self._profiler.received(self._inner.updates(stop)):
            results = []
            for update in updates:
                if isinstance(update.value, TaskPart) and isinstance(update.value.value, Measurement):
                    self._profiler.add(update.value.value)
                else:
                    results.append(update)
            if results:
                yield results

    def close(self) -> None:
        self._inner.close()


@dataclass(frozen=True)
class _WithMeasurement:
    """The outcome of a task, with its measurement."""

    value: Any
    measurement: Measurement


@dataclass(frozen=True)
class _Measured:
    """A task's function that measures itself. A function that yields parts yields a `Measurement` last; the result of
    any other is wrapped in a `_WithMeasurement`."""

    function: Callable[[Any], Any]

    def __call__(self, argument: object) -> Any:  # noqa: ANN401 - what the function gives
        clock = _clock_here()
        before = clock.enter(Part.REST)
        try:
            outcome = self.function(argument)
        finally:
            clock.enter(before)
        return _parts(outcome, clock) if isgenerator(outcome) else _WithMeasurement(outcome, clock.take())


def _parts(parts: Iterator[Any], clock: Clock) -> Iterator[Any]:
    while True:
        before = clock.enter(Part.REST)
        try:
            part = next(parts)
        except StopIteration:
            break
        finally:
            clock.enter(before)
        # Until the next part is requested, this one is packed and sent.
        before = clock.enter(Part.STORE)
        yield part
        clock.enter(before)
    yield clock.take()


_CLOCKS: dict[int, Clock] = {}
"""Clock of this process by its id, as a forked process needs a clock of its own."""


def _clock_here() -> Clock:
    """Return this process's clock; at the first call, the time so far counts as start-up."""
    clock = _CLOCKS.get(os.getpid())
    if clock is None:
        cpu_ns = time.process_time_ns()
        age_ns = max(_age_ns(), cpu_ns)
        clock = _CLOCKS[os.getpid()] = Clock(Part.START)
        clock.add(Part.START, cpu_ns=cpu_ns, wall_ns=age_ns)
        measuring.start(clock)
        clock.enter(Part.IDLE)
    return clock


def _age_ns() -> int:
    """Return the age of this process, ns, to 10 ms; its CPU time if the system does not report the age."""
    try:
        fields = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        began_s = int(fields[19]) / os.sysconf("SC_CLK_TCK")
        return max(round((time.clock_gettime(time.CLOCK_BOOTTIME) - began_s) * 1e9), 0)
    except (OSError, IndexError, ValueError, AttributeError):
        return time.process_time_ns()
