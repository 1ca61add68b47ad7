"""Files of recordings: opened as they are read, piece by piece, with their names and hashes."""

from __future__ import annotations

import hashlib
import io
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from foresee_dsl.compile.nets.safe_xml import open_packed
from foresee_dsl.files import open_outside
from foresee_recordings.recording import RecordingError

_PIECE_BYTES = 1 << 20
"""Bytes that are hashed at once. Ours."""


@contextmanager
def opened(path: Path, limit: str | None = None) -> Iterator[BinaryIO]:
    """Open a file for reading bytes, unpacked if it is a gzip file; every file of a recording is opened here.

    Args:
        limit: a name of `limits.LIMITS`, in MB; None if the caller reads it piece by piece in bounded memory.

    Raises:
        RecordingError: it cannot be read, is not an ordinary file, or is damaged (also while it is read).
    """
    try:
        with open_packed(path, RecordingError, limit) as file:
            yield file
    except (EOFError, zlib.error) as err:
        raise RecordingError(f"{path}: the gzip file is damaged ({err})") from err
    except UnicodeDecodeError as err:
        raise RecordingError(f"{path}: it is not a text in UTF-8 ({err.reason})") from err
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err


def head_of(path: Path, count: int) -> bytes:
    """Return the first bytes of a file, unpacked if it is a gzip file.

    Raises:
        RecordingError: as `opened`.
    """
    with opened(path) as file:
        return file.read(count)


def digest(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, hexadecimal; of packed bytes if it is packed.

    Raises:
        RecordingError: as `opened`.
    """
    hasher = hashlib.sha256()
    try:
        with open_outside(path, None) as file:
            while piece := file.read(_PIECE_BYTES):
                hasher.update(piece)
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err
    return hasher.hexdigest()


def name_of(path: Path) -> str:
    """Return a name for files and scenarios from a file's name: `USA_US101-1.xml` gives `usa_us101_1`."""
    stem = path.name.partition(".")[0] or path.name
    name = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_")
    return name if name[:1].isalpha() else f"recording_{name}".rstrip("_")


def as_text(file: BinaryIO) -> io.TextIOWrapper:
    """Return a text stream in UTF-8 (a byte order mark is skipped) over a byte stream."""
    return io.TextIOWrapper(file, encoding="utf-8-sig", newline="")
