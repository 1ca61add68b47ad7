"""The store: what was finished stays, whoever ends, and a store that cannot be used says what to do."""

from __future__ import annotations

import csv
import multiprocessing
import os
import resource
import signal
import sqlite3
from pathlib import Path

import pytest

from foresee_dsl.campaign.storage import store as store_module
from foresee_dsl.campaign.storage.maintenance import MergeCounts, export, merge, statistics, sweep
from foresee_dsl.campaign.storage.store import SCHEMA, Store, StoredResult, StoreError
from foresee_dsl.campaign.storage.traces import name_of


def row(key: str, kind: str = "child", **more: object) -> StoredResult:
    return StoredResult(key=key, kind=kind, name=f"name of {key}", record=b"record", **more)


def test_a_row_and_its_trace_come_back(tmp_path: Path) -> None:
    with Store(tmp_path / "s") as store:
        added = store.add(row("k", verdict="F4", wall_s=0.1 + 0.2, broken=True), b"a trace")
        assert store.get("k") == added
        assert added.wall_s == 0.1 + 0.2
        assert store.blobs.get(added.trace) == b"a trace"
        assert store.blobs.path(added.trace).parent.name == added.trace[:2]
        assert store.get("other") is None
    with Store(tmp_path / "s", write=False) as again:
        assert again.get("k") == added


def test_the_first_result_of_a_key_stays(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        store.add(row("k", verdict="F1"))
        store.add(row("k", verdict="F2"))
        found = store.get("k")
        assert found is not None and found.verdict == "F1"


def test_a_row_without_its_trace_counts_as_not_there(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        lost = store.add(row("k"), b"a trace")
        store.blobs.path(lost.trace).unlink()
        assert store.get("k") is None and not store.has("k")
        store.add(row("k", verdict="pass"), b"a trace")
        assert store.has("k")


def test_a_damaged_trace_is_none(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        added = store.add(row("k"), b"a trace")
        store.blobs.path(added.trace).write_bytes(b"a tracE")
        assert store.blobs.get(added.trace) is None
        swept = sweep(store)
        assert (swept.rows, swept.files) == (0, 0)  # without --damaged, traces are not read
        swept = sweep(store, damaged=True)
        assert (swept.rows, swept.files) == (1, 1)


def test_two_at_once_are_refused_and_told_who_has_it(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        store.add(row("k"))
        with pytest.raises(StoreError, match=rf"process {os.getpid()} .*since .*\) is writing.*--store"):
            Store(tmp_path)
        with Store(tmp_path, write=False) as reader:  # reading is for any number
            assert reader.has("k")
    Store(tmp_path).close()


def _write_until_killed(folder: Path, said: object) -> None:
    store = Store(folder)
    for k in range(100_000):
        store.add(row(f"k{k}"), b"%d" % k)
        said.send(k)  # type: ignore[attr-defined]


def test_what_was_added_outlives_a_kill_and_the_lock_does_not(tmp_path: Path) -> None:
    context = multiprocessing.get_context("forkserver")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_write_until_killed, args=(tmp_path, theirs))
    process.start()
    theirs.close()
    for _ in range(40):
        ours.recv()
    os.kill(process.pid or 0, signal.SIGKILL)
    process.join()
    last = 39
    while True:
        try:
            last = ours.recv()
        except EOFError:
            break
    ours.close()
    with Store(tmp_path) as store:
        assert all(store.has(f"k{k}") for k in range(last + 1))
        assert len(list(store.rows())) in (last + 1, last + 2)


@pytest.mark.parametrize(("schema", "said"), [(SCHEMA + 1, "newer version"), (0, "older version")])
def test_another_schema_is_refused_and_left_alone(tmp_path: Path, schema: int, said: str) -> None:
    with Store(tmp_path) as store:
        store.add(row("k"))
    with sqlite3.connect(tmp_path / "runs.sqlite") as database:
        database.execute(f"PRAGMA user_version = {schema}")
        database.execute("PRAGMA application_id = 0")  # else the number was changed on the disk
    database.close()
    for write in (True, False):
        with pytest.raises(StoreError, match=rf"schema {schema}.*{said}.*--store"):
            Store(tmp_path, write=write)
    with sqlite3.connect(tmp_path / "runs.sqlite") as database:
        assert database.execute("SELECT key FROM runs").fetchall() == [("k",)]
    database.close()


def test_what_is_no_store_is_said(tmp_path: Path) -> None:
    (tmp_path / "runs.sqlite").write_bytes(b"something else entirely, and long enough to be read" * 40)
    with pytest.raises(StoreError, match="damaged"):
        Store(tmp_path)
    with pytest.raises(StoreError, match="no store in"):
        Store(tmp_path / "nowhere", write=False)


def _fill(folder: Path, said: object) -> None:
    """Write with a limit on files' sizes, which is as near to a full disk as a test comes without being root."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    store = Store(folder)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
    kept = 0
    try:
        for k in range(1000):
            store.add(row(f"k{k}"), os.urandom(1000 * k))
            kept = k + 1
        said.send(("never full", kept))  # type: ignore[attr-defined]
    except StoreError as err:
        said.send((str(err), kept))  # type: ignore[attr-defined]


def test_a_full_disk_is_said_and_nothing_is_lost(tmp_path: Path) -> None:
    context = multiprocessing.get_context("forkserver")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_fill, args=(tmp_path, theirs))
    process.start()
    theirs.close()
    message, kept = ours.recv()
    process.join()
    ours.close()
    assert "cannot be written" in message and "finished results are kept" in message
    assert kept > 20
    with Store(tmp_path) as store:
        assert all(store.has(f"k{k}") for k in range(kept))
        assert not store.has(f"k{kept}")
        assert all(name for name, _ in store.blobs.files())  # no half-written file is left


def test_results_before_one_that_cannot_be_written_are_stored(tmp_path: Path) -> None:
    with Store(tmp_path / "store") as store:
        refused = b"a trace whose folder is a file"
        store.blobs.folder.mkdir()
        store.blobs.path(name_of(refused)).parent.write_text("in the way")
        with pytest.raises(StoreError, match="cannot be written"):
            store.add_all([(row("a"), b"a trace"), (row("b"), None), (row("c"), refused), (row("d"), None)])
    with Store(tmp_path / "store") as store:
        assert [store.get(key) is not None for key in "abcd"] == [True, True, False, False]


def test_gc_leaves_what_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Store(tmp_path) as store:
        needed = store.add(row("k"), b"needed")
        store.add(row("old", tool="0.0.1"), b"old")
        orphan = store.blobs.put(b"an orphan")
        assert sweep(store).files == 1
        assert not store.blobs.has(orphan) and store.blobs.has(needed.trace) and store.has("old")
        swept = sweep(store, older=True)
        assert (swept.rows, swept.files) == (1, 1)
        assert store.has("k") and not store.has("old")


def test_merging_joins_and_keeps_the_sources(tmp_path: Path) -> None:
    for name, keys in (("a", ("k1", "k2")), ("b", ("k2", "k3"))):
        with Store(tmp_path / name) as store:
            for key in keys:
                store.add(row(key), key.encode())
    assert merge([tmp_path / "a", tmp_path / "b"], tmp_path / "c") == MergeCounts(3, 1, 0, 0)
    assert merge([tmp_path / "a", tmp_path / "b"], tmp_path / "c") == MergeCounts(0, 4, 0, 0)
    with Store(tmp_path / "c") as joined, Store(tmp_path / "a") as source:
        assert [r.key for r in joined.rows()] == ["k1", "k2", "k3"]
        found = joined.get("k3")
        assert found is not None and joined.blobs.get(found.trace) == b"k3"
        assert [r.key for r in source.rows()] == ["k1", "k2"]


def test_statistics_and_tables(tmp_path: Path) -> None:
    with Store(tmp_path / "s") as store:
        store.add(row("k1", "seed", verdict="pass", simulated_s=2.5), b"trace")
        store.add(row("k2", verdict="F4"))
        store.add(row("k3", verdict="crash", broken=True))
        found = statistics(store, ("seed", "child"))
        assert found.kinds == {"seed": {"pass": 1}, "child": {"F4": 1, "crash": 1}}
        assert list(found.kinds) == ["seed", "child"] == list(reversed(statistics(store, ("child",)).kinds))
        assert (found.broken, found.traces, found.trace_bytes, found.simulated_s) == (1, 1, 5, 2.5)
        assert export(store, tmp_path / "t.csv") == 3
        with (tmp_path / "t.csv").open(newline="") as stream:
            assert [r["verdict"] for r in csv.DictReader(stream)] == ["pass", "F4", "crash"]
        parquet = pytest.importorskip("pyarrow.parquet", reason="the extra `parquet` is not installed")
        assert export(store, tmp_path / "t.parquet") == 3
        assert parquet.read_table(tmp_path / "t.parquet")["key"].to_pylist() == ["k1", "k2", "k3"]
        with pytest.raises(StoreError, match=r"\.parquet or \.csv"):
            export(store, tmp_path / "t.xlsx")


def test_a_file_that_is_in_the_way_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        Store(tmp_path / "file" / "store")
    assert store_module.COLUMNS[0] == "key"


def test_mean_times_are_of_whole_runs_of_the_driver_and_of_steps_without_one(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        for key, driver, wall_s, broken in (
            ("a", "pdm", 1.0, False), ("b", "pdm", 3.0, False), ("c", "pdm", 500.0, True), ("d", "idm", 9.0, False),
        ):  # fmt: skip
            store.add(row(key, driver=driver, wall_s=wall_s, broken=broken))
        store.add(row("e", kind="mutants", driver="", wall_s=0.5))
        assert store.mean_wall_s("pdm") == {"child": 2.0, "mutants": 0.5}
