"""One worker process: it gets batches of tasks over a pipe and reports what it begins and what it has done.

So its starter knows at each moment which task the process is running: when it dies, hangs or takes too much memory,
that task is the cause, and nothing has to be run again to find it.
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
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd
from pathlib import Path
from typing import Any, NamedTuple, Self

from foresee_dsl.campaign.execution.processes import (
    adopt_orphans,
    end_orphans,
    end_session,
    end_started,
    memory_mb,
    parent_of,
    started_by,
)
from foresee_dsl.drivers.consent import allowed, allowing
from foresee_dsl.drivers.process_state import changes_here
from foresee_dsl.simulate.driver_faults import place_in_dump
from foresee_dsl.simulate.printed import keep_prints, read_all, shortened

PRELOAD = ("foresee_dsl.campaign.execution.fork_server", "foresee_dsl.campaign.execution.preloading")
"""Imported once in the fork server, so that a new worker starts warm."""
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Libraries' threads: a worker for each core is there already, so threads inside would only fight."""

_WARM = 4
"""How many clips a process counts as warm for. Ours: while it runs one, the children of the one before are made; caches
of clips hold sixteen."""
_GRACE_S = 10.0
"""A run looks at its deadline itself, and then says where the driver was. Ours: it does so once a second, and what
comes before and after the run takes under a second; of a short deadline as much again."""
_REPORTED_S = 2.0
"""How long the fork server may take to report how a process ended. Ours: a hundred times what it takes."""


@dataclass(frozen=True)
class Task:
    """A function of an installed package and its argument.

    Attributes:
        name: for people. function: returns the outcome, or yields one part of it after the other.
        deadline_s: wall time for the outcome, or for each part; None: as long as it takes.
        key: by which its giver recognises it.
        shares: what it works with, from what many tasks have in common to what few do (a network, a test case, a clip):
            a process that has worked with the same is warm for it.
        programs: the drivers in programs that it may start (`drivers.consent`).
    """

    name: str
    function: Callable[[Any], Any]
    argument: object
    deadline_s: float | None = None
    key: str = ""
    shares: tuple[str, ...] = ()
    programs: frozenset[str] = field(default_factory=allowed)


Message = tuple[str, int, Any]
"""What a worker reports of the task with this number: `started`, `part` (with a value), `changed` (with what a driver
has changed of the process, in phrases), `done` (with a value), `raised` (with the exception in words)."""


class Worker:
    """A worker process, seen from the one that started it."""

    def __init__(self, *, once: bool = False) -> None:
        """Start a process; `once`: as a fork of this one, where that is safe.

        Raises:
            OSError, EOFError: the fork server was killed at this moment; another try starts a new one.
        """
        forked = once and "libsumo" not in sys.modules and threading.active_count() == 1
        context = multiprocessing.get_context("fork") if forked else forkserver()
        self.connection, theirs = context.Pipe()
        """For `multiprocessing.connection.wait`: ready when there is a message, or when the process is gone."""
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
        """What it was given and has not begun."""
        self.current: tuple[int, Task] | None = None
        self.since_s = 0.0
        """When (on the monotonic clock) it began what it does now, or its last part."""
        self.finished = 0
        """How many tasks it has ended so far."""
        self.changed: tuple[str, ...] = ()
        """What a driver has changed of the process, which ends after that task."""
        self._server = 0 if forked else parent_of(self.pid)
        _running.add(self.pid)
        self.warm: list[tuple[str, ...]] = []
        """What the tasks that it was given last share with others, the latest first."""

    @property
    def pid(self) -> int:
        """Its process's number."""
        return self._process.pid or 0

    @property
    def watched(self) -> tuple[Connection | int, ...]:
        """For `multiprocessing.connection.wait`: one is ready when there is a message, or when the process is gone.

        The connection alone does not tell the latter, where a process that a driver started has it open, too.
        """
        return self.connection, self._process.sentinel

    @property
    def idle(self) -> bool:
        """Whether it has nothing to do."""
        return self.current is None and not self.waiting

    def give(self, batch: Sequence[tuple[int, Task]]) -> None:
        """Give it numbered tasks to do, one after the other.

        Raises:
            OSError: the process is gone.
        """
        self.connection.send([(number, pickle.dumps(task)) for number, task in batch])
        self.waiting.extend(batch)
        for shares in dict.fromkeys(task.shares for _, task in batch):
            self.warm = [shares, *(other for other in self.warm if other != shares)][:_WARM]

    def messages(self) -> Iterator[Message]:
        """Yield its messages since the last call.

        Raises:
            EOFError: the process is gone (after all its messages).
        """
        while self.connection.poll():
            try:
                message: Message = self.connection.recv()
            except (OSError, pickle.UnpicklingError) as err:  # killed in the middle of a message
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
        """Whether what it does now has taken longer than it may, by so much that it does not end it itself."""
        limit_s = self.current[1].deadline_s if self.current else None
        return limit_s is not None and time.monotonic() - self.since_s > limit_s + min(limit_s, _GRACE_S)

    def memory_mb(self, limit_mb: float) -> float:
        """Return how much memory the process and what it has started have in use, exactly where that passes `limit_mb`;
        0 where the system does not tell (no Linux)."""
        return memory_mb(self.pid, limit_mb)

    def started(self) -> int:
        """Return how many processes it has started that still run."""
        return len(started_by(self.pid))

    def left_behind(self) -> LeftBehind:
        """Return what a process that broke has left: what was printed, and whether and where it hung or crashed."""
        stack = read_all(self._stacks.descriptor).decode("utf-8", "replace")
        printed = shortened(read_all(self._output.descriptor))
        return LeftBehind(printed, stack.startswith("Timeout "), place_in_dump(stack), stack)

    def kill(self, *, gone: bool = False) -> Ending:
        """End the process now, or one that is `gone`, with all that it has started; return how it had ended."""
        if gone:
            self._process.join(_REPORTED_S)
        else:
            end_started(self.pid)
        code = self._process.exitcode
        # Without its fork server (killed, too) it is not known how a process ended, or whether it did.
        if code is None or code == 255:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)
        self._lifeline.close()
        self.connection.close()
        self._process.join(5)
        _running.discard(self.pid)
        end_session(self.pid)
        end_orphans(self._server, _running)
        return Ending.of(code)


_running: set[int] = set()
"""The numbers of all worker processes that this process has started and not ended."""


class Ending(NamedTuple):
    """How a process ended. `outside`: by a signal that nothing in a process sends by itself."""

    text: str
    outside: bool = False

    @classmethod
    def of(cls, code: int | None) -> Ending:
        """Return what an exit code means."""
        if code is None:
            return cls("its process broke off the connection")
        if code >= 0:
            return cls(f"its process died with exit code {code}")
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        meaning = {"SIGSEGV": " (a crash inside a library)", "SIGABRT": " (a library gave up)"}.get(name, "")
        outside = name in _FROM_OUTSIDE
        return cls(f"its process {'was ended by' if outside else 'died of'} {name}{meaning}", outside)


_FROM_OUTSIDE = ("SIGKILL", "SIGTERM", "SIGHUP")
"""What `kill`, a terminal that closes, a batch system and the kernel send, the last when memory is short."""


class LeftBehind(NamedTuple):
    """What a process that broke has left.

    Attributes:
        output: what was printed. hung: it was ended because it did not come back. place: in a driver's code, or "".
        stack: as `faulthandler` writes it.
    """

    output: str
    hung: bool
    place: str
    stack: str


class SharedFile:
    """A file without a name, which a worker writes and its starter reads; it is gone with both."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self._close = weakref.finalize(self, os.close, descriptor)

    @classmethod
    def new(cls) -> Self:
        """Make one that is always appended to."""
        with tempfile.TemporaryFile(buffering=0) as file:
            descriptor = os.dup(file.fileno())
        fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_APPEND)
        return cls(descriptor)

    def __reduce__(self) -> tuple[object, ...]:
        """Go to another process as `multiprocessing` sends its pipes."""
        return _received, (DupFd(self.descriptor),)


def _received(sent: Any) -> SharedFile:  # noqa: ANN401 - a type that multiprocessing keeps to itself
    return SharedFile(sent.detach())


def forkserver() -> ForkServerContext:
    """Return the context in which workers start. libsumo must never be forked while it runs: hence a fork server."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOAD))
    for variable in _ONE_THREAD:
        os.environ.setdefault(variable, "1")
    return context


class _Reports:
    """The worker's end of its pipe, which only the worker itself writes to."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._pid = pipe, os.getpid()

    def send(self, message: Message) -> None:
        """Send a message; a fork that a driver made, and that came to the end of the run as well, ends here."""
        if os.getpid() != self._pid:
            os._exit(0)
        self._pipe.send(message)


def _serve(pipe: Connection, lifeline: Connection, output: SharedFile, stacks: SharedFile, *others: Connection) -> None:
    """Work until the starter has nothing more, or is gone; `others` are the starter's ends, which a fork has too."""
    for other in others:
        other.close()
    with contextlib.suppress(PermissionError):  # it leads a session already
        os.setsid()  # what a driver sends to its process group reaches the worker, not the campaign
    end_with(lifeline.fileno())
    adopt_orphans()
    keep_prints(output.descriptor, stacks.descriptor)
    # Ctrl-C reaches the whole group; only the starter decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with contextlib.suppress(OSError):  # where memory runs out, a worker goes first, not the starter
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    reports = _Reports(pipe)
    while True:
        try:
            batch: list[tuple[int, bytes]] = pipe.recv()
        except (EOFError, OSError):
            return
        for number, packed in batch:
            if _run_task(reports, number, packed):
                return  # its starter gives the rest to another process


def _run_task(reports: _Reports, number: int, packed: bytes) -> bool:
    """Run a task and report it; return whether a driver has changed this process, in which no other task is to run."""
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
    except (Exception, SystemExit) as err:  # an exception is this task's outcome, not this process's end
        result = "raised", number, f"{type(err).__name__}: {err}"
    if changed := changes_here():
        reports.send(("changed", number, changed))
    reports.send(result)
    return bool(changed)


def end_with(descriptor: int) -> None:
    """End this process (by SIGKILL) with the one that started it, whatever ends that one.

    The starter keeps the writing end of a pipe that nothing is ever written to; when it ends, also by SIGKILL, the
    kernel closes that end. On Linux the kernel then sends the signal, to the whole process group, which this process
    leads: a thread that waits for the end of the pipe would get no turn while a library keeps Python's lock.
    `descriptor` is the reading end, this process's own.
    """
    set_signal = getattr(fcntl, "F_SETSIG", None)
    if set_signal is None:  # not Linux: as good as a thread can do it
        threading.Thread(target=_wait_and_exit, args=(descriptor,), daemon=True).start()
        return
    fcntl.fcntl(descriptor, fcntl.F_SETOWN, -os.getpid())
    fcntl.fcntl(descriptor, set_signal, signal.SIGKILL)
    fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([descriptor], [], [], 0)[0]:  # closed before the kernel was asked to tell
        os.killpg(os.getpid(), signal.SIGKILL)


def _wait_and_exit(descriptor: int) -> None:
    select.select([descriptor], [], [])
    os._exit(1)
