"""Tables (CSV), read row by row in bounded memory."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from foresee_recordings.recording import RecordingError
from foresee_recordings.sources import as_text, opened

LINE_CHARACTERS = 1_000_000
"""Longest line that is read, characters. Ours: a log of esmini with a hundred vehicles has lines of 50,000."""
_SEPARATORS = ",;\t"


@dataclass(frozen=True)
class Table:
    """An open table.

    Attributes:
        path: its file. columns: the names in its first line. rows: its lines as texts, each as long as `columns`.
    """

    path: Path
    columns: tuple[str, ...]
    rows: Iterator[list[str]]

    def index(self, name: str) -> int:
        """Return the index of a column.

        Raises:
            RecordingError: there is no such column; the message lists those that there are.
        """
        if name not in self.columns:
            raise RecordingError(f"{self.path} has no column {name!r}; its columns are {listed(self.columns)}")
        return self.columns.index(name)

    def indices(self, *names: str) -> list[int]:
        """Return the indices of columns; raises as `index`."""
        return [self.index(name) for name in names]

    def error(self, text: str) -> RecordingError:
        """Return an error at the row that was read last."""
        number = getattr(self.rows, "number", 0)
        return RecordingError(f"{self.path}:{number}: {text}")


class _Rows:
    """The rows of a table below its names, with the number of the line that was read last."""

    def __init__(self, path: Path, file: io.TextIOBase, separator: str, width: int, number: int) -> None:
        self._path, self._width, self._first = path, width, number
        self._reader = csv.reader(lines(path, file, number), delimiter=separator)

    @property
    def number(self) -> int:
        return self._first + self._reader.line_num

    def __iter__(self) -> _Rows:
        return self

    def __next__(self) -> list[str]:
        try:
            row = next(self._reader)
            while not row:  # an empty line
                row = next(self._reader)
        except csv.Error as err:
            raise RecordingError(f"{self._path}:{self.number}: not a row of a table ({err})") from err
        if len(row) != self._width:
            raise RecordingError(
                f"{self._path}:{self.number}: the row has {len(row)} values, but there are {self._width} columns"
            )
        return row


def lines(path: Path, file: io.TextIOBase, number: int = 0) -> Iterator[str]:
    """Yield the lines of a text.

    Args:
        number: how many lines were read before.

    Raises:
        RecordingError: a line is too long: it may be a file of another kind.
    """
    while line := file.readline(LINE_CHARACTERS):
        number += 1
        if len(line) >= LINE_CHARACTERS:
            raise RecordingError(f"{path}:{number}: the line has more than {LINE_CHARACTERS:,} characters: not a table")
        if "\0" in line:
            raise RecordingError(f"{path}:{number}: the line has a zero byte: not a text")
        yield line


@contextmanager
def table(path: Path) -> Iterator[Table]:
    """Open a table whose first line has the names of its columns, separated by commas, semicolons or tabs; lines before
    it that begin with `#` are comments.

    Raises:
        RecordingError: the file cannot be read, is empty, or is not a table; also while its rows are read.
    """
    with opened(path) as file, as_text(file) as text:
        count, first = 1, next(lines(path, text), "")
        while first.startswith("#"):
            count, first = count + 1, next(lines(path, text, count), "")
        separator = max(_SEPARATORS, key=first.count)
        columns = tuple(name.strip() for name in next(csv.reader([first], delimiter=separator), []))
        if len(columns) < 2:
            raise RecordingError(f"{path}:{count}: the first line does not have the names of columns")
        yield Table(path, columns, _Rows(path, text, separator, len(columns), count))


def number(text: str) -> float:
    """Return the number in a cell; NaN for an empty one.

    Raises:
        ValueError: it is not a number.
    """
    return float(text) if text.strip() else math.nan


def listed(names: Sequence[str], most: int = 30) -> str:
    """Return names for a message, the first ones of a long list."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
