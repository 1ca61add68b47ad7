"""Makes sure that only one process writes to a folder: a lock, which the system releases when its holder ends in any
way.
"""

from __future__ import annotations

import contextlib
import fcntl
import getpass
import os
import socket
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from foresee_dsl.errors import ForeseeError

_LONGEST = 300
"""Number of bytes read from a lock's file. Ours: process id, user, host and time take 60."""
_NAME = ".lock"


class LockedError(ForeseeError):
    """A folder cannot be locked.

    Attributes:
        holder: the process that has the lock, in words; "" if the file system has no locks.
        cause: the system's message.
    """

    def __init__(self, file: Path, holder: str, cause: str) -> None:
        super().__init__(f"{file} cannot be locked: {holder or cause}")
        self.holder, self.cause = holder, cause


class Lock:
    """A lock on a file, held by this process.

    `flock` is used, not the file's existence, because a killed holder leaves a file but no lock. On NFS, Linux turns it
    into a byte-range lock, which the server keeps for all hosts. The file is never deleted: a process that waits for a
    deleted file would lock another file than the next process does.
    """

    def __init__(self, file: Path) -> None:
        """Take the lock.

        Raises:
            LockedError: another process has it, or the file system has no locks.
            OSError: the file cannot be created.
        """
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, _LONGEST).decode(errors="replace").strip()
            os.close(descriptor)
            raise LockedError(file, holder or "a process that has just started", "") from None
        except OSError as err:
            os.close(descriptor)
            raise LockedError(file, "", err.strerror or str(err)) from err
        self._descriptor: int | None = descriptor
        with contextlib.suppress(OSError):  # on a full disk the text cannot be written, but the lock is still valid
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{_this_process()}\n".encode(), 0)

    def release(self) -> None:
        """Release the lock; may be called again."""
        if self._descriptor is None:
            return
        with contextlib.suppress(OSError):
            os.ftruncate(self._descriptor, 0)
            # A forked process has the descriptor too, and would keep the lock.
            fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        os.close(self._descriptor)
        self._descriptor = None


_LOCKS: dict[Path, Lock] = {}
"""The locks of this process, by folder."""
_REQUESTS: Counter[Path] = Counter()
"""Number of nested requests of each folder's lock."""


@contextlib.contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Let no other process write results into a folder inside this context; nested use in this process is allowed.

    The folder, which the commands' option `--out` names, is created if missing.

    Raises:
        ForeseeError: another process writes to it (the message says which, and since when), or it cannot be locked.
        OSError: the folder cannot be created or written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    whole = folder.resolve()
    if not _REQUESTS[whole]:
        try:
            _LOCKS[whole] = Lock(whole / _NAME)
        except LockedError as err:
            if err.holder:
                raise ForeseeError(
                    f"another campaign ({err.holder}) writes its results into {folder}: wait for it, or choose another "
                    "folder with --out"
                ) from None
            raise ForeseeError(
                f"the folder {folder} cannot be locked ({err.cause}): is it on a network drive without locks? Name "
                "another folder with --out"
            ) from err
    _REQUESTS[whole] += 1
    try:
        yield
    finally:
        _REQUESTS[whole] -= 1
        if not _REQUESTS[whole]:
            _LOCKS.pop(whole).release()


def _this_process() -> str:
    """Return a description of this process: `process 4711 of anna on build-3, since 2026-03-01 14:05:09`."""
    try:
        user = f" of {getpass.getuser()}"
    except (OSError, KeyError, ImportError):  # in a container, the user may have no name
        user = ""
    return f"process {os.getpid()}{user} on {socket.gethostname()}, since {time.strftime('%Y-%m-%d %H:%M:%S')}"
