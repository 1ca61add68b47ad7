"""What a driver prints, where this process keeps it in a file: Python's and C's standard output and error alike.

Worker processes do (`campaign.execution.isolation`): nothing that a driver prints can then land in a report or in JSON.
Elsewhere nothing is kept, and prints go where they always go.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import os
import sys
from dataclasses import dataclass

SHOWN = 4_000
"""Characters of a run's output that are kept from its beginning, and as many from its end. Ours: two screens each."""
LONGEST = 4_000_000
"""Bytes of a file before its middle is dropped. Ours: a driver that prints in a loop fills no disk."""


@dataclass
class Printed:
    """The files of this process.

    Attributes:
        output: descriptor of the file, opened to append, that standard output and error go into.
        stacks: descriptor of the file in which a process that breaks leaves where it was.
        head: what was dropped from the file's beginning.
    """

    output: int
    stacks: int
    head: str = ""

    def begin(self) -> None:
        """Forget what was printed so far: a run begins."""
        _flush()
        self.head = ""
        os.ftruncate(self.output, 0)

    def text(self) -> str:
        """Return what was printed since then, without its middle where it is long."""
        _flush()
        return self.head + shortened(read_all(self.output))

    def trim(self) -> None:
        """Drop the middle of a file that has become too long."""
        if os.fstat(self.output).st_size > LONGEST:
            self.head = self.head or os.pread(self.output, SHOWN, 0).decode("utf-8", "replace") + "\n...\n"
            os.ftruncate(self.output, 0)

    def end_after(self, seconds: float) -> None:
        """End this process when so much time passes: the way out of code that no signal's handler interrupts."""
        faulthandler.dump_traceback_later(seconds, exit=True, file=self.stacks)


_here: list[Printed] = []


def keep_prints(output: int, stacks: int) -> None:
    """From now on this process's standard output and error go into a file; crashes leave their stack in the other."""
    _flush()
    for stream in (1, 2):
        os.dup2(output, stream)
    for text in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError):  # a driver's process may have others
            text.reconfigure(line_buffering=True, errors="backslashreplace")  # type: ignore[union-attr]
    faulthandler.enable(file=stacks)
    _here[:] = [Printed(output, stacks)]


def printed_here() -> Printed | None:
    """Return the files of this process, None where nothing is kept."""
    return _here[0] if _here else None


def read_all(descriptor: int) -> bytes:
    """Return the two ends of a file as it is now, the middle dropped where it is long."""
    size = os.fstat(descriptor).st_size
    if size <= 8 * SHOWN:
        return os.pread(descriptor, 8 * SHOWN, 0)
    return os.pread(descriptor, 4 * SHOWN, 0) + os.pread(descriptor, 4 * SHOWN, size - 4 * SHOWN)


def shortened(data: bytes) -> str:
    """Return what was printed as text; of a long one the beginning and the end."""
    text = data.decode("utf-8", "replace")
    if len(text) <= 2 * SHOWN:
        return text
    return f"{text[:SHOWN]}\n... ({len(text) - 2 * SHOWN} characters or more are left out) ...\n{text[-SHOWN:]}"


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):  # a driver may have closed or replaced it
            stream.flush()
    with contextlib.suppress(Exception):  # no C library that says so
        ctypes.CDLL(None).fflush(None)
