"""Maintenance of stores: statistics, deletion of unneeded data, merging, and tables for other tools."""

from __future__ import annotations

import csv
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from foresee_dsl import __version__
from foresee_dsl.campaign.storage.store import Store, StoreError

TABLE = (
    "key", "kind", "name", "driver", "tool", "verdict", "reason", "broken", "simulated_s", "wall_s", "trace", "made_s"
)  # fmt: skip
"""Columns of an exported table: those of a row, without its record."""
_STALE_S = 3600.0
"""A half-written blob older than this does not belong to a running process, s. Ours: writing one takes milliseconds."""


@dataclass(frozen=True)
class Statistics:
    """Contents of a store, in numbers.

    Attributes:
        kinds: number of results by kind of step and verdict ("" if the step is not a run). tools: number of results by
            tool version.
        broken: runs that crashed, hung, or exceeded a limit. simulated_s, wall_s: sums over all runs.
    """

    kinds: dict[str, dict[str, int]]
    tools: dict[str, int]
    broken: int
    traces: int
    trace_bytes: int
    database_bytes: int
    simulated_s: float
    wall_s: float


def statistics(store: Store, order: Sequence[str]) -> Statistics:
    """Return counts of a store's contents. `order`: the kinds of steps in their order; any other kind comes last."""
    kinds: dict[str, dict[str, int]] = {}
    counts = store.execute("SELECT kind, verdict, count(*) FROM runs GROUP BY kind, verdict ORDER BY verdict")
    for kind, verdict, count in sorted(counts, key=lambda row: order.index(row[0]) if row[0] in order else len(order)):
        kinds.setdefault(kind, {})[verdict] = count
    sizes = [file.stat().st_size for name, file in store.blobs.files() if name]
    ((broken, simulated_s, wall_s),) = store.execute(
        "SELECT coalesce(sum(broken), 0), coalesce(sum(simulated_s), 0), coalesce(sum(wall_s), 0) FROM runs"
    )
    return Statistics(
        kinds=kinds,
        tools=dict(store.execute("SELECT tool, count(*) FROM runs GROUP BY tool ORDER BY tool")),
        broken=broken,
        traces=len(sizes),
        trace_bytes=sum(sizes),
        database_bytes=sum(file.stat().st_size for file in store.folder.glob("runs.sqlite*")),
        simulated_s=simulated_s,
        wall_s=wall_s,
    )


@dataclass(frozen=True)
class Swept:
    """Deleted data: number of rows and files, and the files' bytes."""

    rows: int
    files: int
    size: int


def sweep(store: Store, *, older: bool = False, damaged: bool = False) -> Swept:
    """Delete data without references: traces without a row, rows without their trace, half-written files.

    `older`: also rows of other tool versions, which no campaign of this version uses. `damaged`: also read every trace,
    and delete those whose content has changed.
    """
    rows = _deleted(store, "DELETE FROM runs WHERE tool != ?", (__version__,)) if older else 0
    needed = {name for (name,) in store.execute("SELECT DISTINCT trace FROM runs WHERE trace != ''")}
    files, size, there = 0, 0, set()
    for name, file in list(store.blobs.files()):
        status = file.stat()
        if name in needed and not (damaged and store.blobs.get(name) is None):
            there.add(name)
        elif name or time.time() - status.st_mtime > _STALE_S:
            file.unlink(missing_ok=True)
            files, size = files + 1, size + status.st_size
    for name in needed - there:
        rows += _deleted(store, "DELETE FROM runs WHERE trace = ?", (name,))
    store.vacuum()
    return Swept(rows, files, size)


@dataclass(frozen=True)
class MergeCounts:
    """Result of `merge`, in numbers of results.

    Attributes:
        new, known: results that the joined store did not have, and those that it had.
        damaged: left out, because they or their traces were changed on the disk.
        without_trace: left out, because their traces no longer exist.
    """

    new: int
    known: int
    damaged: int
    without_trace: int


def merge(sources: Sequence[Path], into: Path) -> MergeCounts:
    """Copy the results of several stores into an existing or new one; the sources are not changed.

    Raises:
        StoreError: one of them is not a store that this version reads, or cannot be written.
    """
    new = already_there = damaged = without_trace = 0
    with Store(into) as target:
        for folder in sources:
            if folder.resolve() == into.resolve():
                continue
            with Store(folder, write=False) as source:
                for row in source.rows():
                    trace = source.blobs.get(row.trace) if row.trace else None
                    if row.trace and trace is None:  # a result without its trace cannot be used
                        if source.blobs.has(row.trace):
                            damaged += 1
                        else:
                            without_trace += 1
                    elif target.has(row.key):
                        already_there += 1
                    else:
                        target.add(row, trace)
                        new += 1
                damaged += len(source.damaged)
    return MergeCounts(new, already_there, damaged, without_trace)


def export(store: Store, file: Path) -> int:
    """Write the results as a table, a row each: `.parquet` (for DuckDB, polars, pandas) or `.csv`, by the file's name.

    Returns:
        How many rows.

    Raises:
        StoreError: another suffix, or `pyarrow` is not installed.
        OSError: the file cannot be written.
    """
    if file.suffix not in (".csv", ".parquet"):
        raise StoreError(f"{file} must end in .parquet or .csv")
    rows = [[getattr(row, column) for column in TABLE] for row in store.rows(records=False)]
    if file.suffix == ".csv":
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerows((TABLE, *rows))
        return len(rows)
    try:
        arrow: Any = import_module("pyarrow")
        parquet: Any = import_module("pyarrow.parquet")
    except ImportError as err:
        raise StoreError("Parquet needs pyarrow: pip install 'foresee-dsl[parquet]'; or export to a .csv file") from err
    table = arrow.table({column: [row[k] for row in rows] for k, column in enumerate(TABLE)})
    file.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table, file, compression="zstd")
    return len(rows)


def _deleted(store: Store, statement: str, values: tuple[object, ...]) -> int:
    store.execute(statement, values)
    return int(store.execute("SELECT changes()")[0][0])
