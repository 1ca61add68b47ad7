"""Stores values that take long to compute in the user's cache folder, under a hash of what they depend on.

An entry that is damaged, or cannot be read or written, only costs the time to compute the value again. Another version
of the code, of Python or of a library never reads it: all of these are part of the hash.
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
"""How many values a folder holds. Ours: a day's edits of a large project; a few kB to 60 kB each, 40 MB in all."""


def entry(folder: str, depends_on: Iterable[str | bytes]) -> Path | None:
    """Return the file in the cache folder `folder` for a value; None where there is no cache.

    `depends_on` is everything that the value depends on, apart from this package's code and Python.
    """
    digest = hashlib.sha256(_code())
    for part in depends_on:
        # The name of a file may hold bytes that are not UTF-8, which Python keeps as surrogates.
        data = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        digest.update(b"%d:" % len(data))  # so that ("ab", "c") and ("a", "bc") differ
        digest.update(data)
    try:
        return cache_folder(folder) / digest.hexdigest()[:32]
    except OSError:
        return None


def load(file: Path | None) -> Any:  # noqa: ANN401 - any value that was stored
    """Return the value that is stored in an entry, or None."""
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
    """Store a value (not None) in an entry; one that another process stored is replaced."""
    if file is None:
        return
    data = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    with suppress(OSError):
        with replacing(file) as temporary:
            temporary.write_bytes(hashlib.sha256(data).digest() + data)
        _tidy(file.parent)


def _tidy(folder: Path) -> None:
    """Delete the older half of a folder that holds too many values; what is missed is computed again."""
    with os.scandir(folder) as entries:
        there = [entry.path for entry in entries]
    if len(there) <= MOST:
        return
    written = {path: os.stat(path).st_mtime_ns for path in there if os.path.exists(path)}  # noqa: PTH110, PTH116
    for path in sorted(written, key=lambda path: written[path])[: len(written) // 2]:
        with suppress(OSError):
            Path(path).unlink()


@cache
def _code() -> bytes:
    """Return a digest of the code that computes values: Python, and the package's files with sizes and times."""
    digest = hashlib.sha256(sys.version.encode())
    for top in (Path(__file__).parent, data_folder("grammars")):
        for folder, inner, names in os.walk(top):
            inner[:] = sorted(name for name in inner if name not in ("__pycache__", "_data"))
            for name in sorted(names):
                found = os.stat(os.path.join(folder, name))  # noqa: PTH116, PTH118 - every millisecond of a check counts
                digest.update(f"{name} {found.st_size} {found.st_mtime_ns}\n".encode())
    return digest.digest()
