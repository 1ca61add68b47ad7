"""Runs a program in a process group of its own: exchanges lines with deadlines, and makes sure that the program ends.

The leader of the group is a guard: a shell that waits for the end of its input and then kills the group, itself
included. Its input is a pipe that only this process holds, so the program ends with this process even after a SIGKILL.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Sequence
from typing import IO

from foresee_dsl.drivers.kept import values
from foresee_dsl.errors import DriverError, DriverLateError

LONGEST_LINE = 65_536
"""Maximum length of a line from the program, bytes. Ours: an answer needs less than 100."""
FAREWELL_S = 1.0
"""Time that a program gets to end by itself after the line `end`, s. Ours: time to close a log file."""
LAST_WORDS_S = 0.2
"""After the program has closed its output, its exit code and the rest of its stderr are awaited for this time, s. Ours.
"""
LAST_WORDS = 400
"""Maximum number of characters from the end of stderr in a message. Ours: the last line of a traceback and its
place."""
_STDERR_KEPT = 4096
_CHUNK = 65_536
_TICK_S = 0.05
_GUARD = ("/bin/sh", "-c", 'trap "" HUP INT TERM; read -r _; kill -KILL 0')


def kept_programs() -> tuple[int, ...]:
    """Return the process ids of the programs that stay for the next run."""
    return tuple(pid for value in values() if isinstance(value, Program) for pid in value.pids)


class Program:
    """A running program; `exchange` sends a line and returns the line that answers it."""

    def __init__(self, command: Sequence[str]) -> None:
        """Start the program with its arguments in the working folder; no shell is used."""
        self._guard = subprocess.Popen(  # noqa: S603  a constant
            _GUARD, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, process_group=0
        )
        try:
            self._process = subprocess.Popen(  # noqa: S603  the user's own program is what this is for
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                process_group=self._guard.pid,
            )
        except (OSError, ValueError) as err:
            self._end_guard()
            reason = err.strerror if isinstance(err, OSError) else err
            raise DriverError(f"{command[0]} cannot be started: {reason}") from err
        self._in, self._out = _pipe(self._process.stdin), _pipe(self._process.stdout)
        self._err = _pipe(self._process.stderr)
        for stream in (self._in, self._out, self._err):
            os.set_blocking(stream.fileno(), False)
        self._received = bytearray()
        self._words = bytearray()
        self._silent = False  # the program has closed its standard output
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._out, selectors.EVENT_READ)
        self._selector.register(self._err, selectors.EVENT_READ)

    @property
    def pid(self) -> int:
        """The program's process id."""
        return self._process.pid

    @property
    def pids(self) -> tuple[int, int]:
        """The process ids of the guard and of the program."""
        return self._guard.pid, self._process.pid

    def stays(self, farewell: bytes) -> bool:
        """Send the last line of a run; return whether the program is still there and can take another run."""
        with contextlib.suppress(OSError):
            unsent = self._send(memoryview(farewell), time.monotonic() + FAREWELL_S)
            return not unsent and self.waits
        return False

    @property
    def waits(self) -> bool:
        """Whether the program runs and has not written anything since its last answer."""
        self._read(self._out)
        return self._process.poll() is None and not self._silent and not self._received

    def exchange(self, line: bytes, deadline_s: float) -> bytes:
        """Send a line and return the program's answer, without its newline.

        Raises:
            DriverError: the answer is late, too long, or more than one line, or the program has ended. The caller must
                then kill the program.
        """
        self._read(self._out)
        if self._received:
            raise DriverError(f"it wrote a line although no message was waiting for an answer{self._last_words()}")
        until = time.monotonic() + deadline_s
        unsent = self._send(memoryview(line), until)
        while not unsent:
            answer, newline, rest = self._received.partition(b"\n")
            if len(answer) > LONGEST_LINE:
                raise DriverError(f"it wrote a line of more than {LONGEST_LINE} bytes{self._last_words()}")
            if newline:
                if rest:
                    raise DriverError(f"it answered one message with more than one line{self._last_words()}")
                self._received.clear()
                return bytes(answer)
            if self._silent or not self._wait(until):
                break
        if self._silent or self._process.poll() is not None:
            raise DriverError(f"it ended ({self._exit()}) without an answer{self._last_words()}")
        if len(self._received) > LONGEST_LINE:
            raise DriverError(
                f"it wrote {len(self._received)} bytes, and no message was waiting for an answer{self._last_words()}"
            )
        doing = "read its line" if unsent else "answer"
        raise DriverLateError(f"it did not {doing} within {deadline_s:g} s{self._last_words()}", deadline_s)

    def end(self, farewell: bytes) -> None:
        """Send a last line, wait up to `FAREWELL_S` for the program to end, then kill its group. It never raises."""
        until = time.monotonic() + FAREWELL_S
        with contextlib.suppress(OSError):
            self._send(memoryview(farewell), until)
            self._in.close()
        while self._process.poll() is None and (self._open(self._out) or self._open(self._err)) and self._wait(until):
            self._received.clear()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0.0, until - time.monotonic()))
        self.kill()

    def kill(self) -> None:
        """Kill the program and its group, and leave no zombie process. It never raises, and may be called again."""
        self._selector.close()
        self._end_guard()
        if self._process.poll() is None:  # the program has left the group
            self._process.kill()
        self._process.wait()
        for stream in (self._in, self._out, self._err):
            with contextlib.suppress(OSError):
                stream.close()

    def _end_guard(self) -> None:
        if self._guard.returncode is not None:
            return
        # The guard has not been waited for, so its id still belongs to the group even if the guard is dead, and no
        # other process can have it.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._guard.pid, signal.SIGKILL)
        self._guard.wait()
        with contextlib.suppress(OSError):
            _pipe(self._guard.stdin).close()

    def _send(self, data: memoryview, until: float) -> memoryview:
        """Write data, and read at the same time so that two full pipes do not block each other; return the bytes that
        were not sent.
        """
        self._selector.register(self._in, selectors.EVENT_WRITE)
        try:
            while data:
                with contextlib.suppress(BlockingIOError):
                    data = data[os.write(self._in.fileno(), data) :]
                if data and (len(self._received) > LONGEST_LINE or self._silent or not self._wait(until)):
                    break
        except BrokenPipeError:
            self._silent = True
        finally:
            self._selector.unregister(self._in)
        return data

    def _wait(self, until: float) -> bool:
        """Wait at most `_TICK_S` until data can be read or written, and read it; return False if the deadline has
        passed.
        """
        left = until - time.monotonic()
        if left <= 0:
            return False
        for key, _ in self._selector.select(min(left, _TICK_S)):
            if key.fileobj is not self._in:
                self._read(self._err if key.fileobj is self._err else self._out)
        return True

    def _read(self, stream: IO[bytes]) -> None:
        """Read one chunk if data is available."""
        if not self._open(stream):
            return
        try:
            chunk = os.read(stream.fileno(), _CHUNK)
        except BlockingIOError:
            return
        if not chunk:
            self._selector.unregister(stream)
            self._silent |= stream is self._out
        elif stream is self._out:
            self._received += chunk
        else:
            self._words += chunk
            del self._words[:-_STDERR_KEPT]

    def _exit(self) -> str:
        try:
            code = self._process.wait(LAST_WORDS_S)
        except subprocess.TimeoutExpired:
            return "it closed its output"
        return f"exit code {code}" if code >= 0 else f"by signal {-code}"

    def _last_words(self) -> str:
        until = time.monotonic() + LAST_WORDS_S
        while self._process.poll() is not None and self._open(self._err) and self._wait(until):
            self._received.clear()
        self._read(self._err)
        words = " | ".join(w for w in self._words.decode("utf-8", errors="replace").splitlines() if w.strip())
        words = "".join(c if c.isprintable() else " " for c in words)
        return f"; the end of its stderr: {words[-LAST_WORDS:]}" if words else ""

    def _open(self, stream: IO[bytes]) -> bool:
        return stream in (k.fileobj for k in self._selector.get_map().values())


def _pipe(stream: IO[bytes] | None) -> IO[bytes]:
    if stream is None:
        raise DriverError("a pipe is missing")
    return stream
