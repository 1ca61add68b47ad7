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
import time
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

_ADOPT = 36
"""`PR_SET_CHILD_SUBREAPER` of Linux' <sys/prctl.h>."""
MOST = 1000
"""Processes that a worker may start. Ours: a driver starts a handful; one that starts others without end is ended
before it fills the machine. In the tenth of a second between two looks two cores make some hundred."""
_END_S = 5.0
"""How long to look for processes that are to end. Ours: 1,000 take 0.1 s."""
_SHARE = re.compile(rb"^Pss:\s+(\d+) kB", re.MULTILINE)


def adopt_orphans() -> None:
    """Let what this process's children leave behind become its own children, so that it is seen and ended with it."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_ADOPT, 1, 0, 0, 0)


def started_by(pid: int) -> tuple[int, ...]:
    """Return the processes that a process has started, and these in turn, those nearest to it first."""
    found: list[int] = []
    ahead = [pid]
    while ahead and len(found) < 10 * MOST:  # a fork bomb must not hold the campaign up
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


def end_started(pid: int, spared: Collection[int] = ()) -> int:
    """End all that a process has started, also what has left its process group; return how many that were.

    They are stopped first and ended when no new one appears: what starts others without end could else stay ahead.

    Args:
        spared: processes that stay, with all that these have started.
    """
    until_s = time.monotonic() + _END_S
    stopped: dict[int, None] = {}
    while time.monotonic() < until_s:
        kept = {below for one in spared for below in (one, *started_by(one))}
        new = [child for child in started_by(pid) if child not in stopped and child not in kept and not _is_dead(child)]
        if not new:
            break
        _signal(new, signal.SIGSTOP)
        stopped.update(dict.fromkeys(new))
    _signal(reversed(stopped), signal.SIGKILL)
    return len(stopped)


def end_below_this(spared: Collection[int] = ()) -> int:
    """End all that this process has started, but for those `spared`, and leave no zombie; return how many that were."""
    ended, until_s = 0, time.monotonic() + _END_S
    while time.monotonic() < until_s:
        ended += end_started(os.getpid(), spared)
        left = [child for child in _children(os.getpid()) if child not in spared]
        if not left:
            break
        for child in left:
            with contextlib.suppress(ChildProcessError):  # a thread of the driver's waited for it
                os.waitpid(child, os.WNOHANG)
        time.sleep(0.001)
    return ended


def end_session(leader: int) -> None:
    """End what is left of a session whose leader has ended; no other session gets its number while one runs."""
    _end_all(lambda: [pid for pid in _everyone() if _status(pid)[3:4] == [str(leader)]])


def end_orphans(parent: int, spared: Collection[int]) -> None:
    """End the children of a process, with all below them, but for those `spared`; of process 0 there are none."""
    _end_all(lambda: [pid for child in _children(parent) if child not in spared for pid in (child, *started_by(child))])


def parent_of(pid: int) -> int:
    """Return the number of a process's parent, 0 where it is not known."""
    fields = _status(pid)
    return int(fields[1]) if fields else 0


def _end_all(listed: Callable[[], list[int]]) -> None:
    """End processes until none of them runs."""
    until_s = time.monotonic() + _END_S
    while time.monotonic() < until_s:
        left = [pid for pid in listed() if not _is_dead(pid)]
        if not left:
            break
        _signal(left, signal.SIGKILL)
        time.sleep(0.001)


def _everyone() -> list[int]:
    """Return the numbers of all processes; on another system than Linux, none."""
    if sys.platform != "linux":
        return []
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]  # noqa: PTH208 - as in `_children`


def _is_dead(pid: int) -> bool:
    fields = _status(pid)
    return not fields or fields[0] == "Z"


def _status(pid: int) -> list[str]:
    """Return the fields of /proc/PID/stat from the state on; [] of a process that is gone."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    return text.rpartition(")")[2].split()


def _signal(pids: Iterable[int], number: signal.Signals) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, number)


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
