"""What was changed on the disk under a store is found, counts as not there, and is said."""

from __future__ import annotations

import json
import random
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.storage.store import Store, StoredResult, StoreError
from foresee_dsl.cli.options.campaign_options import notes_on
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.command import foresee
from tests.support.small_campaign import SETTINGS, Heard, published, write_project

KEYS = [f"{k:064x}" for k in range(300)]


def filled(folder: Path) -> Path:
    """A store of many rows, some with traces, so that its database has several pages."""
    made = StoredResult(key="", kind="child", name="", record=b"x" * 300)
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
        assert (
            "1 result had been changed on the disk: run_0. The campaign ran the missing results again"
            in notes_on(store)[-1]
        )
        store.add(row, b"trace 0")
    with Store(tmp_path) as store:
        assert store.get(KEYS[0]) is not None and not store.damaged


@pytest.mark.parametrize("column", ["record", "verdict", "wall_s", "reason"])
def test_a_changed_row_counts_as_not_there(tmp_path: Path, column: str) -> None:
    new = {"record": b"y" * 300, "verdict": "pass", "wall_s": 9.0, "reason": b"no text: \xff"}[column]
    value = "CAST(? AS TEXT)" if column == "reason" else "?"
    with closing(sqlite3.connect(filled(tmp_path) / "runs.sqlite")) as database, database:
        database.execute(f"UPDATE runs SET {column} = {value} WHERE key = ?", (new, KEYS[5]))
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
        assert f"{len(there)} results could be read from its database, at least" in notes_on(store)[-1]
        assert list(tmp_path.glob("runs.damaged-*.sqlite"))


@pytest.mark.parametrize("share", [0.67, 0.33, 0.05, 0.01])
def test_a_truncated_database_is_replaced_by_what_is_left_of_it(tmp_path: Path, share: float) -> None:
    """Of 0.01 not even a page is left, which SQLite refuses to open; the traces are whole, and stay."""
    file = filled(tmp_path) / "runs.sqlite"
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(StoreError, match=r"is damaged .*rescues the results that can be read"), \
            Store(tmp_path, write=False) as reader:  # fmt: skip
        list(reader.rows())
    with Store(tmp_path) as store:
        left = len(list(store.rows()))
        assert left == store.rescued and left > len(KEYS) * (share - 0.1)
        assert f"{left} results could be read from its database" in notes_on(store)[-1]
        store.add(StoredResult(key="new", kind="child", name="new", record=b"new"), b"trace 0")
        assert len([name for name, _ in store.blobs.files()]) == len(KEYS) / 10
    assert [old.stat().st_size for old in tmp_path.glob("runs.damaged-*.sqlite")] == [int(len(data) * share)]


def test_a_database_of_which_nothing_is_left_is_replaced_where_there_are_traces(tmp_path: Path) -> None:
    file = filled(tmp_path / "store") / "runs.sqlite"
    file.write_bytes(b"\xff" * 200)
    with Store(tmp_path / "store") as store:
        assert store.rescued == 0 and not list(store.rows())
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "runs.sqlite").write_bytes(b"\xff" * 200)
    with pytest.raises(StoreError, match="damaged"):
        Store(tmp_path / "other")
    assert (tmp_path / "other" / "runs.sqlite").read_bytes() == b"\xff" * 200


_FIRST_PAGE = (0, 15, 18, 19, 21, 31, 47, 55, 59, 60, 63, 68, 103, 108, 3699, 3913)
"""Bytes of a database's first page: what it says of itself, and the text of its tables."""


def test_any_flipped_byte_of_the_database_is_harmless(tmp_path: Path) -> None:
    """Every row that is still given is the one that was written, nearly all are, and the next one can be written."""
    file = filled(tmp_path) / "runs.sqlite"
    with Store(tmp_path) as store:
        written = {row.key: row for row in store.rows()}
    data, random_ = file.read_bytes(), random.Random(1)
    for at in (*_FIRST_PAGE, *(random_.randrange(len(data)) for _ in range(24))):
        file.write_bytes(data)
        changed(file, at)
        with Store(tmp_path) as store:
            rows = list(store.rows())
            assert all(row == written.get(row.key) for row in rows)
            assert len(rows) > len(written) / 2 if at >= _PAGE else len(rows) == len(written)
            store.add(StoredResult(key="new", kind="child", name="new", record=b"new"))
        for rest in tmp_path.glob("runs.*sqlite-*"):
            rest.unlink()


_PAGE = 4096


_SETTINGS = replace(SETTINGS, children=2, against=())


def driven(folder: Path, out: Path, heard: Heard) -> tuple[CampaignResult, str]:
    """Run a campaign of one test case, of which one child fails; return what is said of the store, too."""
    case, *_ = load_test_cases([folder / "project" / "crosser.foresee"])
    with Store(out / "store") as store:
        result = run_campaign([case], _SETTINGS, out=out, store=store, listeners=[heard])
        return result, " ".join(notes_on(store))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign, `out`, beside its `project`."""
    folder = tmp_path_factory.mktemp("whole")
    write_project(folder / "project")
    driven(folder, folder / "out", Heard())
    return folder


class Flips(Heard):
    """Changes a byte of the first trace of each kind of step as soon as it is stored, and of one child's row."""

    def __init__(self, store: Path) -> None:
        super().__init__()
        self.store, self.flipped = store, set[str]()

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        super().done(row, new=new)
        if row.trace and row.kind not in self.flipped:
            self.flipped.add(row.kind)
            changed(self.store / "blobs" / row.trace[:2] / f"{row.trace}.npz", 60)
        elif row.kind == "child" and "row" not in self.flipped:
            self.flipped.add("row")
            with closing(sqlite3.connect(self.store / "runs.sqlite", timeout=10)) as database, database:
                database.execute("UPDATE runs SET reason = 'something else' WHERE key = ?", (row.key,))


def test_what_is_changed_during_a_campaign_is_run_again(whole: Path) -> None:
    heard = Flips(whole / "during" / "store")
    result, said = driven(whole, whole / "during", heard)
    assert "had been changed on the disk" in said
    assert heard.flipped >= {"seed", "clip", "child", "row"} and not result.broken and not result.interrupted
    assert without_times(published(whole / "during")) == without_times(published(whole / "out"))


@pytest.mark.parametrize("where", ["trace", "record", "first page", "index"])
def test_what_was_changed_before_a_campaign_is_run_again(whole: Path, where: str) -> None:
    out = whole / where.replace(" ", "_")
    shutil.copytree(whole / "out", out)
    file = out / "store" / "runs.sqlite"
    with Store(out / "store", write=False) as store:
        row = next(row for row in store.rows() if row.kind == "child" and row.trace)
    data, key = file.read_bytes(), row.key.encode()
    at = {"trace": 50, "record": data.index(row.record) + 9, "first page": 3, "index": data.index(key, 2 * _PAGE)}
    changed(store.blobs.path(row.trace) if where == "trace" else file, at[where])
    heard = Heard()
    result, said = driven(whole, out, heard)
    assert not result.broken and set(heard.names) <= {row.name}
    assert (where == "first page") == (not heard.names) or where == "index"
    assert "was damaged" in said
    assert without_times(published(out)) == without_times(published(whole / "out"))


def without_times(found: object) -> object:
    """What a campaign's folder holds, without how long runs took."""
    if isinstance(found, dict):
        return {key: without_times(value) for key, value in found.items() if key != "wall_s"}
    return [without_times(value) for value in found] if isinstance(found, list) else found


def test_a_store_without_checksums_is_read_and_gets_them(tmp_path: Path) -> None:
    with closing(sqlite3.connect(filled(tmp_path) / "runs.sqlite")) as database, database:
        database.execute("ALTER TABLE runs DROP COLUMN sum")
    with Store(tmp_path, write=False) as store:
        assert store.get(KEYS[1]) is None, "its record is no compressed one"
    with Store(tmp_path) as store:
        store.add(StoredResult(key="new", kind="child", name="new", record=b"new"))
        assert store.get("new") is not None


def test_merging_says_what_it_leaves_out(tmp_path: Path) -> None:
    source = filled(tmp_path / "a")
    with Store(source) as store:
        rows = [store.get(KEYS[k]) for k in (0, 10)]
        files = [store.blobs.path(row.trace) for row in rows if row is not None]
    changed(files[0], 3)
    files[1].unlink()
    with closing(sqlite3.connect(source / "runs.sqlite")) as database, database:
        database.execute("UPDATE runs SET wall_s = 9.0 WHERE key IN (?, ?)", KEYS[5:7])
    done = foresee("store", "merge", source, "--into", tmp_path / "b")
    assert done.stdout.splitlines() == [
        f"{tmp_path / 'b'}: 296 new results, 0 already there",
        "left out: 3 changed on the disk, 1 without their traces; a campaign runs them again",
    ]
    again = json.loads(foresee("store", "merge", source, "--into", tmp_path / "b", "--json").stdout)
    assert {name: again[name] for name in ("new", "known", "damaged", "without_trace")} == {
        "new": 0, "known": 296, "damaged": 3, "without_trace": 1,
    }  # fmt: skip
