"""Cache on disk for values that take long to compute, each under a hash of everything it depends on.

A damaged or unreadable entry only costs the time to compute its value again. The hash includes the versions of the
code, of Python and of the libraries, so no other version ever reads an entry.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from foresee_dsl.files import cache_folder, data_folder, replacing

_SUM_BYTES = 32
MOST = 2000
"""Maximum number of values in a folder. Ours: a day's edits of a large project; 40 MB in all, up to 60 kB each."""


def entry(folder: str, depends_on: Iterable[str | bytes]) -> Path | None:
    """Return the path of a value's entry in the cache folder `folder`; None if the folder cannot be used.

    `depends_on` lists everything that the value depends on, except this package's code and Python.
    """
    digest = hashlib.sha256(_code())
    for part in depends_on:
        # A file name may contain bytes that are not UTF-8; Python represents them as surrogates.
        data = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        digest.update(b"%d:" % len(data))  # so that ("ab", "c") and ("a", "bc") differ
        digest.update(data)
    try:
        return cache_folder(folder) / digest.hexdigest()[:32]
    except OSError:
        return None


def load(file: Path | None) -> Any:  # noqa: ANN401 - any value that was stored
    """Return the value stored in an entry; None if there is no sound entry."""
    if file is None:
        return None
    try:
        content = file.read_bytes()
    except OSError:
        return None
    if content[:_SUM_BYTES] != hashlib.sha256(content[_SUM_BYTES:]).digest():
        return None
    return pickle.loads(content[_SUM_BYTES:])  # noqa: S301 - our own, whole, and in the user's own folder


def store(file: Path | None, value: object) -> None:
    """Store a value (not None) in an entry, replacing one that another process stored."""
    if file is None:
        return
    data = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    with suppress(OSError):
        with replacing(file) as temporary:
            temporary.write_bytes(hashlib.sha256(data).digest() + data)
        _tidy(file.parent)


def _tidy(folder: Path) -> None:
    """Delete the older half of a folder that has too many values; a deleted value is computed again when needed."""
    with os.scandir(folder) as entries:
        paths = [entry.path for entry in entries]
    if len(paths) <= MOST:
        return
    written = {path: os.stat(path).st_mtime_ns for path in paths if os.path.exists(path)}  # noqa: PTH110, PTH116
    for path in sorted(written, key=lambda path: written[path])[: len(written) // 2]:
        with suppress(OSError):
            Path(path).unlink()


@cache
def _code() -> bytes:
    """Return a digest of Python's version and of the names, sizes and modification times of the package's files."""
    digest = hashlib.sha256(sys.version.encode())
    for top in (Path(__file__).parent, data_folder("grammars")):
        for folder, inner, names in os.walk(top):
            inner[:] = sorted(name for name in inner if name not in ("__pycache__", "_data"))
            for name in sorted(names):
                status = os.stat(os.path.join(folder, name))  # noqa: PTH116, PTH118 - every millisecond of a check counts
                digest.update(f"{name} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.digest()
