"""Readers of recordings, found by the entry point `foresee_dsl.recordings`, and the choice of one for a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Protocol

from foresee_dsl.plugins import PluginGroup
from foresee_recordings.recording import Recording, RecordingError
from foresee_recordings.sources import head_of

READERS = PluginGroup("foresee_dsl.recordings", "format of recordings", RecordingError)
HEAD_BYTES = 4096
"""Number of bytes at the beginning of a file by which a reader recognises its format. Ours."""


@dataclass(frozen=True)
class Request:
    """What is to be read.

    Attributes:
        path: the file, or the folder of a data set.
        begins_s, ends_s: the seconds to keep; samples outside are skipped while the file is read.
        actors: ids of the actors to keep; empty: all.
        map_file: the roads, if the recording does not hold them.
        columns: for tables: our name of a column (`time_s`, `actor`, `x_m`, ...) to the file's name.
        numbers: further settings of a format, such as the recording's number in a data set.
    """

    path: Path
    begins_s: float = float("-inf")
    ends_s: float = float("inf")
    actors: frozenset[str] = frozenset()
    map_file: Path | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)


class Reader(Protocol):
    """A format of recordings. The class is the entry point; it is made without arguments.

    Attributes:
        what: one line for the list of formats.
        numbers: the names of `Request.numbers` that it uses.
    """

    what: ClassVar[str]
    numbers: ClassVar[tuple[str, ...]]

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file is of this format, by its name and first `HEAD_BYTES` bytes (unpacked if it
        is a gzip file; empty for a folder)."""
        ...

    def read(self, request: Request) -> Recording:
        """Read a recording.

        Raises:
            RecordingError: the file is not of this format, is damaged, or exceeds a limit.
        """
        ...


def read(request: Request, format_: str = "") -> Recording:
    """Read a recording with the reader of this name, or with the one that recognises the file.

    Without a name, a request with `columns` is read as a table.

    Raises:
        RecordingError: no reader recognises the file, or it does not use one of the request's numbers; or as
            `Reader.read` does.
    """
    path = request.path
    if not path.exists():
        raise RecordingError(f"{path}: there is no such file")
    if format_ or request.columns:
        return _read(format_ or "table", request)
    head = b"" if path.is_dir() else head_of(path, HEAD_BYTES)
    for name in READERS.names():
        if _reader(name).recognises(path, head):
            return _read(name, request)
    if path.name.lower().endswith((".csv", ".csv.gz")):
        return _read("table", request)  # its error names the columns that are missing
    raise RecordingError(
        f"{path}: no reader recognises this file; write --reader with one of {', '.join(READERS.names())}"
    )


def _read(name: str, request: Request) -> Recording:
    reader = _reader(name)
    numbers = getattr(reader, "numbers", tuple(request.numbers))  # readers of others may be older than the attribute
    if unknown := sorted(request.numbers.keys() - set(numbers)):
        those = f"it uses {' and '.join(numbers)}" if numbers else "it uses none"
        raise RecordingError(f"{request.path}: the reader {name} does not use --number {', '.join(unknown)}: {those}")
    return reader.read(request)


def _reader(name: str) -> Reader:
    reader: Reader = READERS.load(name)()
    return reader
