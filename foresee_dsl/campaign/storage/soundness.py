"""Finds what was changed in a store's database on the disk, and rescues what can still be read of it."""

from __future__ import annotations

import hashlib
import sqlite3
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)
"""What reading a damaged database raises; the second where the name of a table is damaged, which the message holds."""
_SIDES = ("", "-wal", "-shm")
"""The files of a database in SQLite's write-ahead mode."""


def sum_of(values: Sequence[object]) -> str:
    """Return the checksum of a row's values, as they are stored."""
    digest = hashlib.sha256()
    for value in values:
        plain = float(value) if isinstance(value, bool | int | float) else value
        data = plain if isinstance(plain, bytes) else repr(plain).encode()
        digest.update(b"%d:" % len(data))
        digest.update(data)
    return digest.hexdigest()[:32]


def is_sound(values: Sequence[Any], total: str) -> bool:
    """Return whether a row is as it was written; of one without a checksum only its record (the last value) is checked.

    The record has a checksum of its own, since it is compressed.
    """
    if total:
        return total == sum_of(values)
    record = next((value for value in values if isinstance(value, bytes)), b"")
    try:
        zlib.decompress(record)
    except zlib.error:
        return False
    return True


def has_sums(database: sqlite3.Connection) -> bool:
    """Return whether the rows of a store have checksums."""
    return any(column[1] == "sum" for column in database.execute("PRAGMA table_info(runs)"))


def is_whole(file: Path) -> bool:
    """Return whether SQLite can read all of a database. A file that is no database passes: opening it gives the
    error."""
    try:
        with closing(_opened(file)) as database:
            return bool(database.execute("PRAGMA quick_check(1)").fetchone() == ("ok",))
    except UNREADABLE as err:
        return not isinstance(err, UnicodeDecodeError) and "malformed" not in str(err)


def rescue(file: Path, columns: Sequence[str], insert: str, setup: Sequence[str]) -> int:
    """Replace a damaged database by one with all sound rows that can be read; the old one stays beside it.

    Args:
        columns: of a row, in the order of its checksum. insert: a row with its checksum. setup: makes the tables.

    Returns:
        How many rows are missing, as far as that can be told; at least 1.
    """
    old = file.with_name(f"runs.damaged-{time.time_ns()}.sqlite")
    for side in _SIDES:
        beside = file.with_name(file.name + side)
        if beside.exists():
            beside.rename(old.with_name(old.name + side))
    rows: dict[Any, Sequence[Any]] = {}
    for *values, total in _readable(old, columns):
        if is_sound(values, total):
            rows[values[0]] = (*values, total)
    with closing(sqlite3.connect(file)) as database, database:
        for statement in setup:
            database.execute(statement)
        database.executemany(insert, rows.values())
    return max(1, _claimed(old) - len(rows))


def _readable(file: Path, columns: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a damaged database from its beginning up to the damage, then from its end."""
    for order in ("ASC", "DESC"):
        try:
            with closing(_opened(file)) as database:
                total = "sum" if has_sums(database) else "''"
                database.text_factory = bytes
                asked = f"SELECT {', '.join(columns)}, {total} FROM runs ORDER BY rowid {order}"  # noqa: S608 - our names
                for row in database.execute(asked):
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
