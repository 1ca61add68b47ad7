"""Detection of changes to a store's database on disk, and rescue of its readable rows."""

from __future__ import annotations

import hashlib
import shutil
import sqlite3
import tempfile
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from foresee_dsl.files import unpacked_within
from foresee_dsl.limits import most

UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)
"""Errors of reading a damaged database; the second occurs if the message contains a damaged table name."""
_SIDES = ("", "-wal", "-shm")
"""Suffixes of the files of a database in SQLite's write-ahead mode."""
_MOST_PACKED = 1032
"""Maximum number of bytes that one byte expands to (zlib's Technical Details: "Maximum Compression Factor")."""
_DAMAGE = ("malformed", "not a database", "unsupported file format")
"""Parts of SQLite's messages about a changed file."""
_MODES = slice(18, 20)
"""The bytes of a database that state how it is written and read (SQLite's file format, section 1.3)."""
_WRITE_AHEAD = b"\x02\x02"
"""Value of these bytes in write-ahead mode."""


def sum_of(values: Sequence[bytes | str | float]) -> str:
    """Return the checksum of a row's values in their stored form."""
    parts: list[bytes] = []
    for value in values:
        # A database does not distinguish `True`, `1` and `1.0`.
        data = value if isinstance(value, bytes) else repr(value if isinstance(value, str) else float(value)).encode()
        parts += (b"%d:" % len(data), data)
    return hashlib.sha256(b"".join(parts)).hexdigest()[:32]


def is_sound(values: Sequence[Any], total: str) -> bool:
    """Return whether a row is unchanged, and its record within the limit `record`; for a row without a checksum only
    the record (the last value) is checked.

    A record has its own checksum, because it is compressed.
    """
    if total and total != sum_of(values):
        return False
    record = next((value for value in values if isinstance(value, bytes)), b"")
    if total and len(record) * _MOST_PACKED < most("record") * 1e6:
        return True
    try:
        unpacked_within("record", record)
    except (zlib.error, ValueError):
        return False
    return True


def has_sums(database: sqlite3.Connection) -> bool:
    """Return whether the rows of a store have checksums."""
    return any(column[1] == "sum" for column in database.execute("PRAGMA table_info(runs)"))


def is_whole(file: Path) -> bool:
    """Return whether SQLite can read and write all of a database, as far as this can be determined; one that cannot be
    opened at all (a lock, missing permissions) counts as whole."""
    try:
        with closing(_opened(file)) as database:
            whole = database.execute("PRAGMA integrity_check(1)").fetchone() == ("ok",)
        with file.open("rb") as stream:
            return whole and stream.read(_MODES.stop)[_MODES] in (
                b"",
                b"\x01\x01",
                _WRITE_AHEAD,
            )
    except UnicodeDecodeError:
        return False
    except sqlite3.DatabaseError as err:
        return not any(part in str(err) for part in _DAMAGE)


def sound_rows(file: Path, columns: Sequence[str], setup: Sequence[str]) -> dict[Any, Sequence[Any]]:
    """Return the unchanged rows of a damaged database that can still be read, by their first value.

    The database is read as it is, and also with the first page of a new one, because without a valid first page no row
    is readable.

    Args:
        columns: the columns of a row, in the order in which its checksum covers them. setup: statements that create the
            tables.
    """
    rows: dict[Any, Sequence[Any]] = {}
    with tempfile.TemporaryDirectory(prefix="foresee-store-") as folder:
        mended = _with_new_start(file, Path(folder) / "runs.sqlite", setup)
        for *values, total in (*_readable(file, columns), *_readable(mended, columns)):
            if is_sound(values, total):
                rows[values[0]] = (*values, total)
    return rows


def rescue(file: Path, rows: dict[Any, Sequence[Any]], insert: str, setup: Sequence[str]) -> int:
    """Replace a damaged database by a new one with the readable rows; the old one stays beside it.

    Args:
        rows: see `sound_rows`. insert: statement for a row with its checksum. setup: statements that create the tables.

    Returns:
        The number of missing rows, as far as it can be determined.
    """
    old = file.with_name(f"runs.damaged-{time.time_ns()}.sqlite")
    for side in _SIDES:
        beside = file.with_name(file.name + side)
        if beside.exists():
            beside.rename(old.with_name(old.name + side))
    with closing(sqlite3.connect(file)) as database, database:
        for statement in setup:
            database.execute(statement)
        database.executemany(insert, rows.values())
    return max(0, _claimed(old) - len(rows))


def _with_new_start(file: Path, copy: Path, setup: Sequence[str]) -> Path:
    """Copy a database and replace its first page, which locates its tables, by that of a new one with the right number
    of pages; return the copy."""
    for side in _SIDES:
        if (beside := file.with_name(file.name + side)).exists():
            shutil.copyfile(beside, copy.with_name(copy.name + side))
    with closing(sqlite3.connect(":memory:")) as database:
        for statement in setup:
            database.execute(statement)
        database.commit()
        ((size,),) = database.execute("PRAGMA page_size").fetchall()
        page = bytearray(database.serialize()[:size])
    data = copy.read_bytes()
    page[_MODES] = _WRITE_AHEAD
    page[28:32] = (len(data) // size).to_bytes(4, "big")
    page[92:96] = page[24:28]  # SQLite uses the number of pages only if these two numbers agree
    copy.write_bytes(page + data[size:])
    return copy


def _readable(file: Path, columns: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a damaged database from its beginning up to the damage, then from its end."""
    for order in ("ASC", "DESC"):
        try:
            with closing(_opened(file)) as database:
                total = "sum" if has_sums(database) else "''"
                database.text_factory = bytes
                query = f"SELECT {', '.join(columns)}, {total} FROM runs ORDER BY rowid {order}"  # noqa: S608 - our names
                for row in database.execute(query):
                    yield tuple(_read(value, name) for value, name in zip(row, [*columns, "sum"], strict=True))
        except UNREADABLE:
            continue


def _read(value: object, name: str) -> object:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) and name != "record" else value


def _claimed(file: Path) -> int:
    try:
        with closing(_opened(file)) as database:
            return int(database.execute("SELECT count(*) FROM runs").fetchone()[0])
    except UNREADABLE:
        return 0


def _opened(file: Path) -> sqlite3.Connection:
    database = sqlite3.connect(file.resolve().as_uri() + "?mode=rw", uri=True, timeout=1.0)
    database.text_factory = lambda data: data.decode("utf-8", "replace")
    return database
