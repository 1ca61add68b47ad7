"""Measures the readers on recordings of others: `python -m evaluation.readers FOLDER...`.

For each file: whether it comes in, the error of each position against the file's own numbers (`expected.py`), which
share of the vehicles is on a lane of the network, and what is left out. FCD in degrees also needs the package pyproj.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import FloatArray, Recording
from rich.console import Console
from rich.table import Table

from evaluation.expected import EXPECTED
from evaluation.roads import network_of, vehicles_on_lanes
from foresee_dsl.errors import ForeseeError

SUFFIXES = (".xml", ".csv", ".parquet", ".osi", ".mcap", ".gz", ".xz")
AIM_M = 0.10


@dataclass
class Row:
    """The result for one file; `errors_m` has an entry for each position of the file that the recording has."""

    file: Path
    format: str = ""
    problem: str = ""
    actors: int = 0
    samples: int = 0
    errors_m: FloatArray = field(default_factory=lambda: np.empty(0))
    expected: int = 0
    on_lanes: str = ""
    left_out: str = ""


def measure(file: Path, *, with_roads: bool) -> Row:
    """Read a recording and compare it with its file."""
    try:
        recording = read(Request(file))
    except ForeseeError as err:
        return Row(file, problem=str(err))
    row = Row(
        file, recording.format, actors=len(recording.tracks), samples=sum(len(t.time_s) for t in recording.tracks)
    )
    if recording.format in EXPECTED:
        row.errors_m, row.expected = _errors(recording, file)
    row.left_out = "; ".join(f"{count} {what}" for what, count in recording.left_out.items())
    if with_roads and recording.roads is not None:
        try:
            share, routes = vehicles_on_lanes(recording.tracks, recording.roads, network_of(recording.roads))
            row.on_lanes = f"{share:.1%}, routes {routes:.0%}"
        except ForeseeError as err:
            row.on_lanes = str(err)
    return row


def _errors(recording: Recording, file: Path) -> tuple[FloatArray, int]:
    """Return the distance of each position of the file to the recording's, m, and the number of the file's positions.

    A static obstacle has one position in its file; positions without a sample at their time have no distance.
    """
    states = {
        (track.id.partition("_part")[0], round(float(time_s), 3)): state[:2]
        for track in recording.tracks
        for time_s, state in zip(track.time_s, track.states, strict=True)
    }
    errors, count = [], 0
    for actor, time_s, x, y in EXPECTED[recording.format](file):
        count += 1
        if (at := states.get((actor, round(time_s, 3)))) is not None:
            errors.append(float(np.hypot(*(at - (x, y)))))
    return np.array(errors), count


def files_in(folders: list[Path]) -> Iterator[Path]:
    """Yield the files that may be recordings."""
    for folder in folders:
        files = sorted(folder.rglob("*")) if folder.is_dir() else [folder]
        yield from (file for file in files if file.suffix in SUFFIXES and "Meta" not in file.name)


def show(rows: list[Row], console: Console) -> None:
    """Print the table and its sums."""
    table = Table("file", "format", "actors", "samples", "of the file's", "median m", "95 % m", "on lanes", "left out")
    for row in rows:
        if row.problem:
            table.add_row(row.file.name, "-", "", "", "", "", "", "", row.problem)
            continue
        figures = [f"{np.percentile(row.errors_m, q):.3f}" for q in (50, 95)] if len(row.errors_m) else ["", ""]
        share = f"{len(row.errors_m) / row.expected:.1%}" if row.expected else ""
        counts = str(row.actors), str(row.samples), share
        table.add_row(row.file.name, row.format, *counts, *figures, row.on_lanes, row.left_out)
    console.print(table)
    errors = np.concatenate([row.errors_m for row in rows]) if rows else np.empty(0)
    came_in = [row for row in rows if not row.problem]
    console.print(f"{len(came_in)} of {len(rows)} files come in, {sum(row.samples for row in came_in):,} samples")
    if len(errors):
        within = (errors <= AIM_M).mean()
        median, most = np.percentile(errors, (50, 95))
        figures = f"median {median:.4f} m, 95 % {most:.4f} m, {within:.2%} within {AIM_M} m"
        console.print(f"error of {len(errors):,} positions: {figures}")


def main() -> None:
    """Measure all recordings in folders."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path, nargs="+", help="folders, or single files")
    parser.add_argument("--roads", action="store_true", help="also measure the networks")
    options = parser.parse_args()
    show([measure(file, with_roads=options.roads) for file in files_in(options.folder)], Console(width=200))


if __name__ == "__main__":
    main()
