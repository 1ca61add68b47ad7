"""Measures and ends a process together with its descendants (Linux only).

Processes that a worker starts (an external driver and its helpers) count as the worker's, because a limit on one
process alone does not limit a driver that can start others.
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
"""Maximum number of descendants of a worker. Ours: a driver starts a handful; one that starts processes without end is
ended before it fills the machine. In the tenth of a second between two checks, two cores start about a hundred."""
_END_S = 5.0
"""Time in which all processes to be ended must end, s. Ours: 1,000 take 0.1 s."""
_SHARE = re.compile(rb"^Pss:\s+(\d+) kB", re.MULTILINE)


def adopt_orphans() -> None:
    """Make this process adopt orphaned descendants, so that they are counted and ended with it."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_ADOPT, 1, 0, 0, 0)


def started_by(pid: int) -> tuple[int, ...]:
    """Return the descendants of a process, the nearest first."""
    descendants: list[int] = []
    ahead = [pid]
    while ahead and len(descendants) < 10 * MOST:  # processes that multiply without end must not hold the campaign up
        children = _children(ahead.pop(0))
        descendants += children
        ahead += children
    return tuple(descendants)


def memory_mb(pid: int, limit_mb: float) -> float:
    """Return the memory of a process and its descendants, in MB; 0 on systems other than Linux.

    The value is exact only above `limit_mb`: the sum of their resident memory counts shared memory more than once; so
    if it exceeds `limit_mb`, each process is counted with its proportional share, which the kernel takes longer to
    compute.
    """
    everybody = (pid, *started_by(pid))
    seen_mb = sum(map(_resident_mb, everybody))
    return seen_mb if len(everybody) == 1 or seen_mb <= limit_mb else sum(map(_share_mb, everybody))


def end_started(pid: int, spared: Collection[int] = ()) -> int:
    """End the descendants of a process, even outside its process group; return their number.

    They are stopped first and killed when no new one appears, so that endless starts cannot outrun this.

    Args:
        spared: processes that stay, with their descendants.
    """
    until_s = time.monotonic() + _END_S
    stopped: dict[int, None] = {}
    while time.monotonic() < until_s:
        kept = {below for process in spared for below in (process, *started_by(process))}
        new = [child for child in started_by(pid) if child not in stopped and child not in kept and not _is_dead(child)]
        if not new:
            break
        _signal(new, signal.SIGSTOP)
        stopped.update(dict.fromkeys(new))
    _signal(reversed(stopped), signal.SIGKILL)
    return len(stopped)


def end_below_this(spared: Collection[int] = ()) -> int:
    """End the descendants of this process except `spared` ones, without zombies; return how many ended."""
    ended, until_s = 0, time.monotonic() + _END_S
    while time.monotonic() < until_s:
        ended += end_started(os.getpid(), spared)
        left = [child for child in _children(os.getpid()) if child not in spared]
        if not left:
            break
        for child in left:
            with contextlib.suppress(ChildProcessError):  # a thread of the driver has already waited for it
                os.waitpid(child, os.WNOHANG)
        time.sleep(0.001)
    return ended


def end_session(leader: int) -> None:
    """End the remaining processes of a session whose leader has ended; its id is not reused while one of them runs."""
    _end_all(lambda: [pid for pid in _everyone() if _status(pid)[3:4] == [str(leader)]])


def end_orphans(parent: int, spared: Collection[int]) -> None:
    """End the children of a process and their descendants, except those `spared`; if `parent` is 0, do nothing."""
    _end_all(lambda: [pid for child in _children(parent) if child not in spared for pid in (child, *started_by(child))])


def parent_of(pid: int) -> int:
    """Return the id of a process's parent, 0 if it is unknown."""
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
    """Return the ids of all processes; empty on systems other than Linux."""
    if sys.platform != "linux":
        return []
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]  # noqa: PTH208 - as in `_children`


def _is_dead(pid: int) -> bool:
    fields = _status(pid)
    return not fields or fields[0] == "Z"


def _status(pid: int) -> list[str]:
    """Return the fields of /proc/PID/stat from the state on; [] if the process has ended."""
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
    children: list[int] = []
    try:
        for thread in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208 - ten times a second
            with open(f"/proc/{pid}/task/{thread}/children", "rb") as file:  # noqa: PTH123 - as above
                children += map(int, file.read().split())
    except OSError:
        pass  # the process has ended, or this is not Linux
    return children


def _resident_mb(pid: int) -> float:
    try:
        pages = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]
    except (OSError, IndexError):
        return 0.0
    return int(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6


def _share_mb(pid: int) -> float:
    try:
        match = _SHARE.search(Path(f"/proc/{pid}/smaps_rollup").read_bytes())
    except OSError:
        return 0.0
    return int(match.group(1)) * 1024 / 1e6 if match else 0.0
