"""Collects a driver's output in a file: the standard output and error of Python and C code in this process.

Worker processes use it (`campaign.workers.isolation`), so that a driver's output cannot get into a report or into
JSON. Other processes do not redirect output.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import os
import sys
from dataclasses import dataclass

SHOWN = 4_000
"""Maximum number of characters kept from the beginning of a run's output, and as many from its end. Ours: two screens
each."""
LONGEST = 4_000_000
"""Size of the file above which its middle is dropped, bytes. Ours: so that a driver that prints in a loop does not fill
the disk."""


@dataclass
class PrintedOutput:
    """The files to which the output of this process goes.

    Attributes:
        output: descriptor of the file, opened to append, that gets standard output and error.
        stacks: descriptor of the file that gets the stack of a process that crashes.
        head: the beginning of the output, kept when the file is emptied.
    """

    output: int
    stacks: int
    head: str = ""

    def begin(self) -> None:
        """Delete the output so far, at the beginning of a run."""
        _flush()
        self.head = ""
        os.ftruncate(self.output, 0)

    def text(self) -> str:
        """Return the output of the run, without its middle if it is long."""
        _flush()
        return self.head + shortened(read_all(self.output))

    def trim(self) -> None:
        """Empty the file when it has become too long, and keep its beginning in `head`."""
        if os.fstat(self.output).st_size > LONGEST:
            self.head = self.head or os.pread(self.output, SHOWN, 0).decode("utf-8", "replace") + "\n...\n"
            os.ftruncate(self.output, 0)

    def end_after(self, seconds: float) -> None:
        """End this process after this time (s). No other way stops a call of library code that never returns."""
        faulthandler.dump_traceback_later(seconds, exit=True, file=self.stacks)


_here: list[PrintedOutput] = []


def keep_prints(output: int, stacks: int) -> None:
    """Redirect this process's standard output and error to one file, and the stack of a crash to another."""
    _flush()
    for stream in (1, 2):
        os.dup2(output, stream)
    for text in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError):  # a replaced stream may have no descriptor
            text.reconfigure(line_buffering=True, errors="backslashreplace")  # type: ignore[union-attr]
    faulthandler.enable(file=stacks)
    _here[:] = [PrintedOutput(output, stacks)]


def printed_here() -> PrintedOutput | None:
    """Return the output files of this process; None if its output is not redirected."""
    return _here[0] if _here else None


def read_all(descriptor: int) -> bytes:
    """Return the content of a file; if the file is long, return only its beginning and its end."""
    size = os.fstat(descriptor).st_size
    if size <= 8 * SHOWN:
        return os.pread(descriptor, 8 * SHOWN, 0)
    return os.pread(descriptor, 4 * SHOWN, 0) + os.pread(descriptor, 4 * SHOWN, size - 4 * SHOWN)


def shortened(data: bytes) -> str:
    """Return output as text; if it is long, return only its beginning and its end."""
    text = data.decode("utf-8", "replace")
    if len(text) <= 2 * SHOWN:
        return text
    return f"{text[:SHOWN]}\n... ({len(text) - 2 * SHOWN} characters or more are left out) ...\n{text[-SHOWN:]}"


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):  # the driver may have closed or replaced the stream
            stream.flush()
    with contextlib.suppress(Exception):  # the C library of this platform may not have the function
        ctypes.CDLL(None).fflush(None)
