"""What was changed on the disk under a store is found, counts as not there, and is said."""

from __future__ import annotations

import random
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.storage.store import Row, Store, StoreError
from foresee_dsl.cli.options.campaign_options import notes_on

KEYS = [f"{k:064x}" for k in range(300)]


def filled(folder: Path) -> Path:
    """A store of many rows, some with traces, so that its database has several pages."""
    made = Row(key="", kind="child", name="", record=b"x" * 300)
    with Store(folder) as store:
        for k, key in enumerate(KEYS):
            store.add(
                replace(made, key=key, name=f"run_{k}", reason="r" * 40), b"trace %d" % k if k % 10 == 0 else None
            )
    return folder


def changed(file: Path, at: int) -> None:
    data = bytearray(file.read_bytes())
    data[at] ^= 1
    file.write_bytes(data)


def test_a_flipped_byte_of_a_trace_is_found_and_the_trace_is_written_again(tmp_path: Path) -> None:
    with Store(filled(tmp_path)) as store:
        row = store.get(KEYS[0])
        assert row is not None
        file = store.blobs.path(row.trace)
    changed(file, 3)
    with Store(tmp_path) as store:
        assert store.get(KEYS[0]) is None and store.damaged == {KEYS[0]: "run_0"}
        assert "1 result had been changed on the disk: run_0. What was missing was run again" in notes_on(store)[-1]
        store.add(row, b"trace 0")
    with Store(tmp_path) as store:
        assert store.get(KEYS[0]) is not None and not store.damaged


@pytest.mark.parametrize("column", ["record", "verdict", "wall_s"])
def test_a_changed_row_counts_as_not_there(tmp_path: Path, column: str) -> None:
    new = {"record": b"y" * 300, "verdict": "pass", "wall_s": 9.0}[column]
    with closing(sqlite3.connect(filled(tmp_path) / "runs.sqlite")) as database, database:
        database.execute(f"UPDATE runs SET {column} = ? WHERE key = ?", (new, KEYS[5]))
    with Store(tmp_path) as store:
        assert store.get(KEYS[5]) is None and store.get(KEYS[6]) is not None
        assert store.damaged == {KEYS[5]: "run_5"}


def test_a_database_that_sqlite_cannot_read_is_replaced_by_what_can_be_rescued(tmp_path: Path) -> None:
    file = filled(tmp_path) / "runs.sqlite"
    data = bytearray(file.read_bytes())
    data[5 * 4096 : 5 * 4096 + 8] = b"\xff" * 8  # the head of one page
    file.write_bytes(data)
    with Store(tmp_path) as store:
        there = [key for key in KEYS if store.get(key) is not None]
        assert 100 < len(there) < len(KEYS) and store.lost == len(KEYS) - len(there)
        assert "could not be read from its database, which is kept" in notes_on(store)[-1]
        assert list(tmp_path.glob("runs.damaged-*.sqlite"))


def test_any_flipped_byte_of_the_database_is_harmless(tmp_path: Path) -> None:
    """Every row that is still given is the one that was written; a store that cannot be opened says so."""
    file = filled(tmp_path) / "runs.sqlite"
    with Store(tmp_path) as store:
        written = {row.key: row for row in store.rows()}
    data, random_ = file.read_bytes(), random.Random(1)
    for _ in range(40):
        file.write_bytes(data)
        changed(file, random_.randrange(len(data)))
        try:
            with Store(tmp_path) as store:
                assert all(row == written.get(row.key) for row in store.rows())
        except StoreError as err:
            assert "damaged" in str(err) or "schema" in str(err)
        for rest in tmp_path.glob("runs.damaged-*"):
            rest.unlink()


def test_a_store_without_checksums_is_read_and_gets_them(tmp_path: Path) -> None:
    with closing(sqlite3.connect(filled(tmp_path) / "runs.sqlite")) as database, database:
        database.execute("ALTER TABLE runs DROP COLUMN sum")
    with Store(tmp_path, write=False) as store:
        assert store.get(KEYS[1]) is None, "its record is no compressed one"
    with Store(tmp_path) as store:
        store.add(Row(key="new", kind="child", name="new", record=b"new"))
        assert store.get("new") is not None
