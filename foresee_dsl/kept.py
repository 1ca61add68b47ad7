"""Keeps values that cost time to make, by what they were made from, in the user's cache folder.

A kept value that is damaged, or cannot be read or written, only costs the time to make it again. It is never taken by
another version of the code, of Python or of a library, as all of these go into its name.
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

from foresee_dsl.resources import cache_folder, data_folder

_SUM_BYTES = 32
MOST = 2000
"""How many values a folder keeps. Ours: a day's edits of a large project; a few kB to 60 kB each, 40 MB in all."""


def place_of(folder: str, made_of: Iterable[str | bytes]) -> Path | None:
    """Return where in the cache folder `folder` the value that is made of these parts is kept; None without a cache.

    Args:
        folder: a name such as "documents".
        made_of: everything that the value depends on, apart from this package's code and Python.
    """
    digest = hashlib.sha256(_code())
    for part in made_of:
        data = part.encode() if isinstance(part, str) else part
        digest.update(b"%d:" % len(data))  # so that ("ab", "c") and ("a", "bc") differ
        digest.update(data)
    try:
        return cache_folder(folder) / digest.hexdigest()[:32]
    except OSError:
        return None


def take(place: Path | None) -> Any:  # noqa: ANN401 - whatever was put there
    """Return what was put at a place, or None."""
    if place is None:
        return None
    try:
        content = place.read_bytes()
    except OSError:
        return None
    if content[:_SUM_BYTES] != hashlib.sha256(content[_SUM_BYTES:]).digest():
        return None
    return pickle.loads(content[_SUM_BYTES:])  # noqa: S301 - our own, whole, and in the user's own folder


def put(place: Path | None, value: object) -> None:
    """Keep a value (not None) at a place, whole or not at all, past what other processes put there."""
    if place is None:
        return
    data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
    fresh = place.with_name(f".{place.name}.{os.getpid()}")
    with suppress(OSError):
        fresh.write_bytes(hashlib.sha256(data).digest() + data)
        fresh.replace(place)
        _tidy(place.parent)


def _tidy(folder: Path) -> None:
    """Throw the older half away where a folder holds too much; what is missed is made again."""
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
    """Return what stands for the code that made a value: Python, and the package's files with sizes and times."""
    digest = hashlib.sha256(sys.version.encode())
    for top in (Path(__file__).parent, data_folder("grammars")):
        for folder, inner, names in os.walk(top):
            inner[:] = sorted(name for name in inner if name not in ("__pycache__", "_data"))
            for name in sorted(names):
                found = os.stat(os.path.join(folder, name))  # noqa: PTH116, PTH118 - every millisecond of a check counts
                digest.update(f"{name} {found.st_size} {found.st_mtime_ns}\n".encode())
    return digest.digest()
