"""One worker process: it gets batches of tasks over a pipe and reports when each task begins and ends.

So the starter always knows which task the process runs. If the process dies, hangs or takes too much memory, that task
is the cause, and no other task has to be repeated to find the cause.
"""

from __future__ import annotations

import contextlib
import fcntl
import multiprocessing
import multiprocessing.connection
import os
import pickle
import select
import signal
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from inspect import isgenerator
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd
from pathlib import Path
from typing import Any, NamedTuple, Self

from foresee_dsl.campaign.workers.processes import (
    adopt_orphans,
    end_orphans,
    end_session,
    end_started,
    parent_of,
)
from foresee_dsl.drivers.consent import allowed, allowing
from foresee_dsl.drivers.process_state import changes_here
from foresee_dsl.simulate.driver_faults import place_in_dump
from foresee_dsl.simulate.printed import keep_prints, read_all, shortened

PRELOAD = ("foresee_dsl.campaign.workers.fork_server", "foresee_dsl.campaign.execution.preloading")
"""Modules that the fork server imports once, so that new workers start quickly."""
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that limit the threads of libraries to one: there is a worker per core already."""

_WARM = 4
"""Number of clips for which a process counts as warm. Ours: while a clip runs, the mutants of the previous clip are
made; the caches hold sixteen clips.
"""
_GRACE_S = 10.0
"""Time beyond a deadline before a process is ended, s. Ours: a run checks its deadline once a second and reports where
the driver was; the work before and after a run takes less than a second. The grace is never longer than the deadline
itself.
"""
_REPORTED_S = 2.0
"""Time for the fork server to report how a process ended, s. Ours: a hundred times the usual time."""


@dataclass(frozen=True)
class Task:
    """A function of an installed package and its argument.

    Attributes:
        name: its name for people. function: returns the outcome, or yields its parts.
        deadline_s: wall time for the outcome, or for each part; None: no limit.
        key: identity of the task for its sender.
        shares: its inputs, from those that many tasks share to those that few share (a network, a test case, a clip);
            a process that has used the same inputs is warm for it.
        programs: the external drivers that it may start (`drivers.consent`).
    """

    name: str
    function: Callable[[Any], Any]
    argument: object
    deadline_s: float | None = None
    key: str = ""
    shares: tuple[str, ...] = ()
    programs: frozenset[str] = field(default_factory=allowed)


Message = tuple[str, int, Any]
"""A worker's report on the task with this number: `started`, `part` (with a value), `changed` (with a driver's changes
to the process, as phrases), `done` (with a value), `raised` (with the exception as text)."""


class Worker:
    """A worker process, as the process that started it sees it."""

    def __init__(self, *, once: bool = False, fresh: bool = False) -> None:
        """Start a process; `once`: as a fork of this one, if that is safe; `fresh`: as a new interpreter.

        Raises:
            OSError, EOFError: the fork server was killed at this moment; another try starts a new one.
        """
        forked = once and "libsumo" not in sys.modules and threading.active_count() == 1
        context = multiprocessing.get_context("fork") if forked else interpreter() if fresh else forkserver()
        self.connection, theirs = context.Pipe()
        """The connection, for `multiprocessing.connection.wait`: ready when there is a message, or when the process has
        ended."""
        line, self._lifeline = context.Pipe(duplex=False)
        self._output, self._stacks = SharedFile.new(), SharedFile.new()
        files = self._output, self._stacks
        ours = (self.connection, self._lifeline) if forked else ()
        self._process: BaseProcess = context.Process(target=_serve, args=(theirs, line, *files, *ours), daemon=True)
        try:
            self._process.start()
        except BaseException:
            self.connection.close()
            self._lifeline.close()
            raise
        finally:
            theirs.close()
            line.close()
        self.waiting: list[tuple[int, Task]] = []
        """The tasks that the process has received but not begun."""
        self.current: tuple[int, Task] | None = None
        self.since_s = 0.0
        """Time on the monotonic clock at which the process began its present task or, if it has finished a part of it,
        finished the last part, s.
        """
        self.finished = 0
        """Number of tasks that the process has finished."""
        self.changed: tuple[str, ...] = ()
        """The changes that a driver made to the process, which therefore ends after that task."""
        self._server = 0 if forked or fresh else parent_of(self.pid)
        _running.add(self.pid)
        self.warm: list[tuple[str, ...]] = []
        """The `shares` of the last tasks that the process received, the latest first."""

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self._process.pid or 0

    @property
    def watched(self) -> tuple[Connection | int, ...]:
        """Return the handles to wait for; one becomes ready when the process sends a message or ends.

        The connection alone does not show the end if a process that a driver started still has it open.
        """
        return self.connection, self._process.sentinel

    @property
    def idle(self) -> bool:
        """Return whether the process has no task."""
        return self.current is None and not self.waiting

    def give(self, batch: Sequence[tuple[int, Task]]) -> None:
        """Send it numbered tasks, which it runs in order.

        Raises:
            OSError: the process has ended.
        """
        self.connection.send([(number, pickle.dumps(task)) for number, task in batch])
        self.waiting.extend(batch)
        for shares in dict.fromkeys(task.shares for _, task in batch):
            self.warm = [shares, *(other for other in self.warm if other != shares)][:_WARM]

    def messages(self) -> Iterator[Message]:
        """Yield its messages since the last call.

        Raises:
            EOFError: the process has ended (after all its messages).
        """
        while self.connection.poll():
            try:
                message: Message = self.connection.recv()
            except (OSError, pickle.UnpicklingError) as err:  # the process was killed in the middle of a message
                raise EOFError from err
            self.since_s = time.monotonic()
            if message[0] == "started":
                self.current = self.waiting.pop(0)
            elif message[0] in ("done", "raised"):
                self.current = None
                self.finished += 1
            elif message[0] == "changed":
                self.changed = message[2]
            yield message
        if not self.connection.poll() and multiprocessing.connection.wait([self._process.sentinel], 0):
            raise EOFError

    def overdue(self) -> bool:
        """Return whether its present task exceeds its deadline by more than the grace in which it should end itself."""
        limit_s = self.current[1].deadline_s if self.current else None
        return limit_s is not None and time.monotonic() - self.since_s > limit_s + min(limit_s, _GRACE_S)

    def left_behind(self) -> LeftBehind:
        """Return what a broken process left: its printed output, and whether and where it hung or crashed."""
        stack = read_all(self._stacks.descriptor).decode("utf-8", "replace")
        printed = shortened(read_all(self._output.descriptor))
        return LeftBehind(printed, stack.startswith("Timeout "), place_in_dump(stack), stack)

    def kill(self, *, gone: bool = False) -> ProcessEnding:
        """End the process and its descendants now, or only the descendants if it is already `gone`.

        Return how it ended.
        """
        if gone:
            self._process.join(_REPORTED_S)
        else:
            end_started(self.pid)
        code = self._process.exitcode
        # If its fork server was killed too, it is unknown whether and how a process ended.
        if code is None or code == 255:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)
        self._lifeline.close()
        self.connection.close()
        self._process.join(5)
        _running.discard(self.pid)
        end_session(self.pid)
        end_orphans(self._server, _running)
        return ProcessEnding.of(code)


_running: set[int] = set()
"""Ids of all worker processes that this process has started and not ended."""


class ProcessEnding(NamedTuple):
    """How a process ended.

    `outside`: whether it was ended by a signal that a process does not send to itself.
    """

    text: str
    outside: bool = False

    @classmethod
    def of(cls, code: int | None) -> ProcessEnding:
        """Return the meaning of an exit code."""
        if code is None:
            return cls("its process closed the connection")
        if code >= 0:
            return cls(f"its process died with exit code {code}")
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        meaning = {"SIGSEGV": " (a crash inside a library)", "SIGABRT": " (a library ended the process)"}.get(name, "")
        outside = name in _FROM_OUTSIDE
        return cls(f"its process {'was ended by' if outside else 'died of'} {name}{meaning}", outside)


_FROM_OUTSIDE = ("SIGKILL", "SIGTERM", "SIGHUP")
"""Signals of `kill`, a closing terminal, a batch system and the kernel (the last when memory is short)."""


class LeftBehind(NamedTuple):
    """The information that a process which crashed or hung has left for the report.

    Attributes:
        output: its prints. hung: whether it was ended because it did not return. place: the place in a driver's code,
            or "".
        stack: where it stood, in the format of `faulthandler`.
    """

    output: str
    hung: bool
    place: str
    stack: str


class SharedFile:
    """A file without a name, written by a worker and read by its starter; it disappears with both."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self._close = weakref.finalize(self, os.close, descriptor)

    @classmethod
    def new(cls) -> Self:
        """Create one in append mode."""
        with tempfile.TemporaryFile(buffering=0) as file:
            descriptor = os.dup(file.fileno())
        fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_APPEND)
        return cls(descriptor)

    def __reduce__(self) -> tuple[object, ...]:
        """Pass the descriptor to another process, as `multiprocessing` passes its pipes."""
        return _received, (DupFd(self.descriptor),)


def _received(sent: Any) -> SharedFile:  # noqa: ANN401 - a type that multiprocessing keeps to itself
    return SharedFile(sent.detach())


def forkserver() -> ForkServerContext:
    """Return the context in which workers start: a fork server, because libsumo must not be forked while it runs."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOAD))
    for variable in _ONE_THREAD:
        os.environ.setdefault(variable, "1")
    return context


def interpreter() -> SpawnContext:
    """Return the context of workers that share nothing with others, not even the seed of the hashes of strings."""
    for variable in _ONE_THREAD:
        os.environ.setdefault(variable, "1")
    return multiprocessing.get_context("spawn")


class _Reports:
    """The worker's end of its pipe, to which only the worker itself writes."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._pid = pipe, os.getpid()

    def send(self, message: Message) -> None:
        """Send a message. In a process that a driver has forked off, end that process instead, so that only the worker
        reports.
        """
        if os.getpid() != self._pid:
            os._exit(0)
        self._pipe.send(message)


def _serve(pipe: Connection, lifeline: Connection, output: SharedFile, stacks: SharedFile, *others: Connection) -> None:
    """Work until the starter has no more tasks or has ended; `others` are the starter's ends, which a fork inherits."""
    for other in others:
        other.close()
    with contextlib.suppress(PermissionError):  # the process already leads a session
        os.setsid()  # signals that a driver sends to its process group then reach the worker, not the campaign
    end_with(lifeline.fileno())
    adopt_orphans()
    keep_prints(output.descriptor, stacks.descriptor)
    # Ctrl-C reaches the whole group, but only the starter decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with contextlib.suppress(OSError):  # if memory runs out, the kernel then kills a worker, not the starter
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    reports = _Reports(pipe)
    while True:
        try:
            batch: list[tuple[int, bytes]] = pipe.recv()
        except (EOFError, OSError):
            return
        for number, packed in batch:
            if _run_task(reports, number, packed):
                return  # the starter gives the remaining tasks to another process


def _run_task(reports: _Reports, number: int, packed: bytes) -> bool:
    """Run a task and report it; return whether a driver has changed this process, so that no other task may use it."""
    reports.send(("started", number, None))
    result: Message
    try:
        task: Task = pickle.loads(packed)  # noqa: S301 - from the process that started this one
        with allowing(task.programs):
            outcome = task.function(task.argument)
            if isgenerator(outcome):
                for part in outcome:
                    reports.send(("part", number, part))
                outcome = None
        result = "done", number, outcome
    except (Exception, SystemExit) as err:  # an exception is the outcome of the task, and must not end the process
        result = "raised", number, f"{type(err).__name__}: {err}"
    if changed := changes_here():
        reports.send(("changed", number, changed))
    reports.send(result)
    return bool(changed)


def end_with(descriptor: int) -> None:
    """Make this process end (by SIGKILL) when the process that started it ends, in whatever way.

    The starter holds the writing end of a pipe that stays empty; when it ends, even by SIGKILL, the kernel closes that
    end. On Linux the kernel then signals the whole process group, which this process leads; a thread that waits for the
    end of the pipe could not run while a library holds Python's lock.
    `descriptor` is the reading end, owned by this process.
    """
    set_signal = getattr(fcntl, "F_SETSIG", None)
    if set_signal is None:  # without Linux, a thread is the best substitute
        threading.Thread(target=_wait_and_exit, args=(descriptor,), daemon=True).start()
        return
    fcntl.fcntl(descriptor, fcntl.F_SETOWN, -os.getpid())
    fcntl.fcntl(descriptor, set_signal, signal.SIGKILL)
    fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([descriptor], [], [], 0)[0]:  # the pipe was closed before the signal was requested
        os.killpg(os.getpid(), signal.SIGKILL)


def _wait_and_exit(descriptor: int) -> None:
    select.select([descriptor], [], [])
    os._exit(1)
