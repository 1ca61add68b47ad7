"""The store: results of runs by key. Each result is a row in SQLite; its trace is a file (a blob), written before the
row.

One process writes at a time (a lock contains its description); any number may read. Committed results survive the end
of every process. A row whose trace is lost counts as missing, and so does a row or trace that was changed on the disk:
every row has a checksum, and a trace's file is named by its checksum.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from foresee_dsl import __version__
from foresee_dsl.campaign.storage.lock import Lock, LockedError
from foresee_dsl.campaign.storage.soundness import UNREADABLE, has_sums, is_sound, is_whole, rescue, sound_rows, sum_of
from foresee_dsl.campaign.storage.traces import Blobs
from foresee_dsl.errors import ForeseeError
from foresee_dsl.limits import most
from foresee_dsl.measuring import Part

SCHEMA = 1
"""`user_version` of the database; increased when a table changes."""
_MARK = 0x46530000 + SCHEMA
"""`application_id` of the database ("FS" and the schema): distinguishes a damaged `user_version` from another
schema."""
_MARKED = slice(68, 72)
"""Bytes of a database that contain its `application_id` (SQLite's file format, 1.3)."""
_TABLES = """
CREATE TABLE runs (
  key TEXT PRIMARY KEY, kind TEXT NOT NULL, name TEXT NOT NULL, driver TEXT NOT NULL, tool TEXT NOT NULL,
  verdict TEXT NOT NULL, reason TEXT NOT NULL, broken INTEGER NOT NULL, simulated_s REAL NOT NULL, wall_s REAL NOT NULL,
  trace TEXT NOT NULL, made_s REAL NOT NULL, record BLOB NOT NULL, sum TEXT NOT NULL DEFAULT ''
)
"""
_WITH_SUM = "ALTER TABLE runs ADD COLUMN sum TEXT NOT NULL DEFAULT ''"
"""Stores of the first versions lack this column; the sums of their rows are empty, and only their records are
checked."""
_SETUP = (_TABLES, f"PRAGMA user_version = {SCHEMA}", f"PRAGMA application_id = {_MARK}")
_BUSY_MS = 10_000
"""Time that a statement waits while another process reads the database, ms. Ours: `foresee store stat` reads a large
store in a second."""


class StoreError(ForeseeError):
    """The store cannot be read or written, or another process uses it; the message says what to do."""


@dataclass(frozen=True)
class StoredResult:
    """One result.

    Attributes:
        key: see `keys`. kind: kind of step. name: its name for people. driver: address of the driver ("" if the step is
            not a run). verdict: verdict of a run, otherwise "". broken: whether the run gave no result, because its
            process died, hung or raised an exception.
        simulated_s, wall_s: times of the run; for a run ended by its deadline, that deadline.
        trace: the blob's name, or "".
        record: the result, in the form of `records.encode`.
    """

    key: str
    kind: str
    name: str
    record: bytes
    driver: str = ""
    verdict: str = ""
    reason: str = ""
    broken: bool = False
    simulated_s: float = 0.0
    wall_s: float = 0.0
    trace: str = ""
    tool: str = __version__
    made_s: float = 0.0


COLUMNS = tuple(field.name for field in fields(StoredResult))
_BROKEN = COLUMNS.index("broken")
_SELECT = f"SELECT {', '.join(COLUMNS)}"
_INSERT = f"INSERT OR IGNORE INTO runs ({', '.join(COLUMNS)}, sum) VALUES ({', '.join('?' * len(COLUMNS))}, ?)"  # noqa: S608 - names of our own fields


class Store:
    """A store's folder: `runs.sqlite`, `blobs/`, and `lock` while a process writes."""

    @Part.STORE.measured
    def __init__(self, folder: Path, *, write: bool = True) -> None:
        """Open a store; for writing, create it if there is none.

        Raises:
            StoreError: it is another version's, damaged, missing, or another process writes to it.
            OSError: the folder cannot be created or written to.
        """
        self.folder = folder
        self.blobs = Blobs(folder.absolute() / "blobs")  # absolute, because a driver may change the working folder
        self.damaged: dict[str, str] = {}
        """Names, by key, of results that were changed on the disk and count as missing."""
        self.rescued: int | None = None
        """Number of results rescued from a damaged database, which was replaced and stays beside the new one; None if
        it was not damaged."""
        self.lost = 0
        """Number of results known to be lost with a damaged database."""
        self._sound: set[str] = set()
        """Traces that were read and are sound."""
        self._checked: set[str] = set()
        """Keys of the rows that were read and are sound."""
        self._sum = "sum"
        self._lock: Lock | None = None
        self._database: sqlite3.Connection | None = None
        if write:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(folder)
        elif not (folder / "runs.sqlite").is_file():
            raise StoreError(f"there is no store in {folder}: `foresee campaign` creates one")
        try:
            with self._errors():
                self._database = self._open(write)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @Part.STORE.measured
    def get(self, key: str) -> StoredResult | None:
        """Return the row of a key, or None; also None if its trace is missing, or row or trace were changed."""
        columns = self._stored_row(key)
        if columns is None:
            return None
        row = self._row(columns[:-1], columns[-1], checked=key in self._checked)
        return row if row is not None and self._has_trace(row) else None

    def _stored_row(self, key: str) -> tuple[Any, ...] | None:
        """Return the columns of a key's row and its checksum, or None if there is none."""
        database = self._db
        query = f"{_SELECT}, {self._sum} FROM runs WHERE key = ?"
        columns: tuple[Any, ...] | None
        try:
            # SQLite's module decodes texts in half the time of our function, but raises an exception for a damaged one.
            database.text_factory = str
            try:
                columns = database.execute(query, (key,)).fetchone()
            except sqlite3.OperationalError:
                database.text_factory = _text
                columns = database.execute(query, (key,)).fetchone()
            finally:
                database.text_factory = _text
        except (*UNREADABLE, OSError) as err:  # not `_errors`, because that costs as much as the query itself
            raise StoreError(_explained(self.folder, err, reads=self._lock is None)) from err
        return columns

    def _row(self, columns: Sequence[Any], total: str, *, checked: bool = False) -> StoredResult | None:
        """Return a row from the values of its columns; None if they were changed on the disk."""
        if not checked:
            if not is_sound(columns, total):
                self.damaged[str(columns[0])] = str(columns[2])
                return None
            self._checked.add(columns[0])
        return StoredResult(*(*columns[:_BROKEN], bool(columns[_BROKEN]), *columns[_BROKEN + 1 :]))

    def _has_trace(self, row: StoredResult) -> bool:
        """Return whether a row has a sound trace, or needs none; each trace is read once."""
        if not row.trace or row.trace in self._sound:
            return True
        if self.blobs.get(row.trace) is not None:
            self._sound.add(row.trace)
            return True
        if self.blobs.has(row.trace):
            self.damaged[row.key] = row.name
        return False

    def read_again(self) -> None:
        """Check each row and trace again on its next use, in case it was changed meanwhile."""
        self._sound.clear()
        self._checked.clear()

    @Part.STORE.measured
    def has(self, key: str) -> bool:
        """Return whether `get` would return a row, without reading its record."""
        with self._errors():
            trace_row = self._db.execute("SELECT trace FROM runs WHERE key = ?", (key,)).fetchone()
        return trace_row is not None and (not trace_row[0] or self.blobs.has(trace_row[0]))

    @Part.STORE.measured
    def add(self, row: StoredResult, trace: bytes | None = None) -> StoredResult:
        """Store one result; see `add_all`."""
        return self.add_all([(row, trace)])[0]

    @Part.STORE.measured
    def add_all(self, results: Iterable[tuple[StoredResult, bytes | None]]) -> list[StoredResult]:
        """Store results with their traces in one transaction; return the rows with the names of their traces.

        They survive the end of any process. An existing row of the same key is kept, unless its trace was lost.

        Raises:
            StoreError: one cannot be written (a full disk); those before it are stored.
        """
        rows = []
        with self._errors():
            try:
                for row, trace in results:
                    name = self.blobs.put(trace) if trace is not None else ""
                    rows.append(replace(row, trace=name, made_s=row.made_s or time.time()))
                    self._insert(rows[-1])
            finally:
                self._db.commit()
        return rows

    def _insert(self, row: StoredResult) -> None:
        values = tuple(getattr(row, column) for column in COLUMNS)
        columns = (*values, sum_of(values))
        if not self._db.execute(_INSERT, columns).rowcount and self.get(row.key) is None:
            self._db.execute("DELETE FROM runs WHERE key = ?", (row.key,))
            self._db.execute(_INSERT, columns)

    @Part.STORE.measured
    def drop(self, key: str) -> None:
        """Delete the result of a key, so that it can be replaced; its trace remains until `store gc`."""
        self.execute("DELETE FROM runs WHERE key = ?", (key,))

    def of_other_versions(self) -> int:
        """Return the number of results of other tool versions, which no campaign of this version uses."""
        return int(self.execute("SELECT count(*) FROM runs WHERE tool != ?", (__version__,))[0][0])

    def rows(self, where: str = "", values: tuple[object, ...] = (), *, records: bool = True) -> Iterator[StoredResult]:
        """Yield sound rows in the order of their keys. `records=False` omits the records, which make rows large; then
        damage cannot be detected.
        """
        columns = ", ".join(column if records or column != "record" else "x''" for column in COLUMNS)
        with self._errors():
            for *values_of_row, total in self._db.execute(
                f"SELECT {columns}, {self._sum} FROM runs {where} ORDER BY key",  # noqa: S608 - our own names
                values,
            ):
                row = self._row(values_of_row, total, checked=not records)
                if row is not None:
                    yield row

    def mean_wall_s(self, driver: str) -> dict[str, float]:
        """Return the mean wall time of each kind of step, over runs with this driver and steps without a driver, s."""
        query = "SELECT kind, avg(wall_s) FROM runs WHERE NOT broken AND driver IN (?, '') GROUP BY kind"
        with self._errors():
            return dict(self._db.execute(query, (driver,)).fetchall())

    def execute(self, statement: str, values: tuple[object, ...] = ()) -> list[Any]:
        """Run one statement (of this package) as a separate transaction and return its rows."""
        with self._errors(), self._db:
            return self._db.execute(statement, values).fetchall()

    def vacuum(self) -> None:
        """Return the space of deleted rows to the disk."""
        with self._errors():
            self._db.execute("VACUUM")
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    @Part.STORE.measured
    def close(self) -> None:
        """Close the database and release the lock."""
        if self._database is not None:
            with contextlib.suppress(sqlite3.Error):
                self._database.close()
            self._database = None
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    @property
    def _db(self) -> sqlite3.Connection:
        if self._database is None:
            raise StoreError(f"the store {self.folder} is closed")
        return self._database

    def _open(self, write: bool) -> sqlite3.Connection:
        file = self.folder / "runs.sqlite"
        # Readers of a write-ahead log write files beside it; a read-only folder has no writer, so it is opened as
        # immutable.
        how = "?mode=ro" if os.access(self.folder, os.W_OK) else "?mode=ro&immutable=1"
        address = file.resolve().as_uri() + ("" if write else how)
        if write and file.exists() and not is_whole(file):
            self._rescue(file)
        database = sqlite3.connect(address, uri=True, timeout=_BUSY_MS / 1000)
        database.text_factory = _text
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, round(most("file") * 1e6))
        try:
            (schema,) = database.execute("PRAGMA user_version").fetchone()
            (mark,) = database.execute("PRAGMA application_id").fetchone()
            (tables,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
            _check_has_only_data(database, self.folder)
            if (tables or not write) and mark != _MARK:
                _check_schema(schema, self.folder)
            if write:
                # NORMAL: a commit survives the end of any process; a power cut may undo the last ones but not damage
                # the file. FULL would wait for the disk at each run.
                database.execute("PRAGMA journal_mode = WAL")
                database.execute("PRAGMA synchronous = NORMAL")
                with database:
                    if not tables:
                        database.execute(_TABLES)
                    elif not has_sums(database):
                        database.execute(_WITH_SUM)
                    if (schema, mark) != (SCHEMA, _MARK):
                        for statement in _SETUP[1:]:
                            database.execute(statement)
            self._sum = "sum" if has_sums(database) else "''"
        except BaseException:
            database.close()
            raise
        return database

    def _rescue(self, file: Path) -> None:
        """Replace a database that SQLite cannot read by its readable rows; leave databases of other tools alone."""
        rows = sound_rows(file, COLUMNS, _SETUP)
        if rows or _is_ours(file) or any(name for name, _ in self.blobs.files()):
            self.lost, self.rescued = rescue(file, rows, _INSERT, _SETUP), len(rows)

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (*UNREADABLE, OSError) as err:
            raise StoreError(_explained(self.folder, err, reads=self._lock is None)) from err


def _is_ours(file: Path) -> bool:
    """Return whether a damaged database can be recognised as a store's, by its mark or by its table."""
    with file.open("rb") as stream:
        if stream.read(_MARKED.stop)[_MARKED] == _MARK.to_bytes(4, "big"):
            return True
    try:
        with contextlib.closing(sqlite3.connect(file)) as database:
            return bool(database.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'").fetchone())
    except UNREADABLE:
        return False


def _check_has_only_data(database: sqlite3.Connection, folder: Path) -> None:
    """Raise for a database that computes its rows, as a view may give endless rows."""
    kinds = [kind for (kind,) in database.execute("SELECT type FROM sqlite_master")]
    if not set(kinds) <= {"table", "index"}:
        odd = next(kind for kind in kinds if kind not in ("table", "index"))
        raise StoreError(
            f"the database of the store {folder} contains a {odd}, which stores of foresee-dsl do not have: "
            "it is not read"
        )


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")  # only damaged rows have invalid bytes, and their checksums do not fit


def _check_schema(schema: int, folder: Path) -> None:
    if schema == SCHEMA:
        return
    newer, older = (
        "a newer version of foresee-dsl",
        "an older version of foresee-dsl, whose results this version would not use",
    )
    what = (
        f"{newer} wrote it: use that version"
        if schema > SCHEMA
        else f"{older}, or another program, wrote it: move it away"
    )
    raise StoreError(
        f"the store {folder} has schema {schema}, this version ({__version__}) reads {SCHEMA}: {what}, or choose "
        "another folder with --store; nothing was changed"
    )


def _explained(folder: Path, err: Exception, *, reads: bool) -> str:
    cause = str(getattr(err, "strerror", None) or err)
    rest = "finished results are kept, and the same command continues from there"
    if isinstance(err, UnicodeDecodeError) or "not a database" in cause or "malformed" in cause:
        rescue_it = "`foresee store gc` or the next campaign rescues the results that can be read; or " if reads else ""
        return (
            f"the store {folder} is damaged ({cause}): {rescue_it}move the folder away, or choose another with --store"
        )
    if "readonly" in cause or "read-only" in cause.lower() or "unable to open" in cause:
        return f"the store {folder} cannot be written ({cause}): choose another folder with --store; {rest}"
    return f"the store {folder} cannot be written ({cause}): {rest} once there is space on the disk"


def _locked(folder: Path) -> Lock:
    """Return the lock of a store."""
    try:
        return Lock(folder / "lock")
    except LockedError as err:
        if err.holder:
            raise StoreError(
                f"another campaign ({err.holder}) is writing to the store {folder}: wait for it, or use another folder "
                "with --store (and join the two afterwards with `foresee store merge`)"
            ) from None
        raise StoreError(f"the store {folder} cannot be locked ({err.cause}): is it on a network drive without locks? "
                         "Name another folder with --store") from err  # fmt: skip
