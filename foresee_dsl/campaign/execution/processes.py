"""A process and all that it has started: how much memory they have in use, and their end (Linux only).

What a worker starts (an external driver, and that one's own helpers) counts as the worker's: a limit that looks at one
process is no limit for who may start others.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import signal
import sys
from pathlib import Path

_ADOPT = 36
"""`PR_SET_CHILD_SUBREAPER` of Linux' <sys/prctl.h>."""
_MOST = 10_000
"""Processes that are looked at. Ours: far more than a driver starts; a fork bomb must not hold the campaign up."""
_SHARE = re.compile(rb"^Pss:\s+(\d+) kB", re.MULTILINE)


def adopt_orphans() -> None:
    """Let what this process's children leave behind become its own children, so that it is seen and ended with it."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_ADOPT, 1, 0, 0, 0)


def started_by(pid: int) -> tuple[int, ...]:
    """Return the processes that a process has started, and these in turn, those nearest to it first."""
    found: list[int] = []
    ahead = [pid]
    while ahead and len(found) < _MOST:
        children = _children(ahead.pop(0))
        found += children
        ahead += children
    return tuple(found)


def memory_mb(pid: int, limit_mb: float) -> float:
    """Return how much memory a process and all that it has started have in use, in MB.

    The sum of what each sees counts shared memory more than once; so where it passes `limit_mb`, each is counted with
    its share, which takes the kernel longer to find out.
    """
    everybody = (pid, *started_by(pid))
    seen_mb = sum(map(_resident_mb, everybody))
    return seen_mb if len(everybody) == 1 or seen_mb <= limit_mb else sum(map(_share_mb, everybody))


def end_started(pid: int) -> None:
    """End all that a process has started, also what has left its process group."""
    for child in reversed(started_by(pid)):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(child, signal.SIGKILL)


def _children(pid: int) -> list[int]:
    found: list[int] = []
    try:
        for thread in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208 - ten times a second
            with open(f"/proc/{pid}/task/{thread}/children", "rb") as file:  # noqa: PTH123 - as above
                found += map(int, file.read().split())
    except OSError:
        pass  # it has ended, or this is no Linux
    return found


def _resident_mb(pid: int) -> float:
    try:
        pages = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]
    except (OSError, IndexError):
        return 0.0
    return int(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6


def _share_mb(pid: int) -> float:
    try:
        found = _SHARE.search(Path(f"/proc/{pid}/smaps_rollup").read_bytes())
    except OSError:
        return 0.0
    return int(found.group(1)) * 1024 / 1e6 if found else 0.0
