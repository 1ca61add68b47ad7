"""Processes that end with the one that started them, whatever ends that one.

The starter keeps the writing end of a pipe that nothing is ever written to. When it ends, also by SIGKILL, the kernel
closes that end, and the other process is killed. A thread that waits for the end of the pipe would not do where a
library spins without giving Python a chance to run; on Linux the kernel itself sends the signal.
"""

from __future__ import annotations

import fcntl
import os
import select
import signal
import threading


def end_with(descriptor: int) -> None:
    """Kill this process as soon as the other end of a pipe is closed.

    Args:
        descriptor: the reading end, of a pipe that is this process's own.
    """
    set_signal = getattr(fcntl, "F_SETSIG", None)
    if set_signal is None:  # not Linux: as good as a thread can do it
        threading.Thread(target=_wait_and_exit, args=(descriptor,), daemon=True).start()
        return
    fcntl.fcntl(descriptor, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(descriptor, set_signal, signal.SIGKILL)
    fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([descriptor], [], [], 0)[0]:  # closed before the kernel was asked to tell
        os.kill(os.getpid(), signal.SIGKILL)


def _wait_and_exit(descriptor: int) -> None:
    select.select([descriptor], [], [])
    os._exit(1)
