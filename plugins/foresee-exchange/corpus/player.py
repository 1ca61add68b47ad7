"""The reference player: runs esmini without a window, and reads the positions of all entities at some times."""

from __future__ import annotations

import csv
import math
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_PLAYER_S = 30.0
_STEP_S = 0.05
_EXIT_LINES = 3
_LOOKS_S = 0.02
_TAIL_BYTES = 100_000


@dataclass(frozen=True)
class Played:
    """Positions of entities by time (s): x, y, m, of their reference points. `error`: reason why there are none."""

    at: dict[float, dict[str, tuple[float, float]]]
    error: str = ""


def play(player: Path, file: Path, times_s: Sequence[float]) -> Played:
    """Play a scenario up to the last of some times."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "states.csv"
        command = [
            player,
            "--headless",
            "--osc",
            file.resolve(),
            "--fixed_timestep",
            str(_STEP_S),
            "--csv_logger",
            table,
        ]
        silent = [*map(str, command), "--disable_stdout"]
        with subprocess.Popen(silent, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            ends = time.monotonic() + _PLAYER_S
            while process.poll() is None and time.monotonic() < ends and not _is_past(table, max(times_s)):
                time.sleep(_LOOKS_S)
            process.kill()  # what it wrote up to then counts
        log = Path(folder) / "log.txt"
        text = log.read_text(errors="replace") if log.exists() else ""
        lines = [line for line in text.splitlines() if line.strip()]
        errors = [line for line in lines if "error" in line.lower()] or lines[-_EXIT_LINES:]
        positions = {time_s: _at(table, time_s) for time_s in times_s} if table.exists() else {}
    return Played(positions, "" if any(positions.values()) else " / ".join(errors)[-300:] or "it wrote nothing")


def _is_past(table: Path, time_s: float) -> bool:
    """Return whether the last but one complete line is later than a time."""
    if not table.exists():
        return False
    with table.open("rb") as stream:
        stream.seek(max(0, table.stat().st_size - _TAIL_BYTES))
        lines = stream.read().decode(errors="replace").splitlines()
    cells = lines[-2].split(",") if len(lines) > _EXIT_LINES else []
    try:
        return float(cells[1]) > time_s + 1.0
    except (IndexError, ValueError):
        return False


def _at(table: Path, time_s: float) -> dict[str, tuple[float, float]]:
    """Return the positions of the line nearest to a time; empty if the run ended before it."""
    rows = list(csv.reader(table.open(encoding="utf-8", errors="replace")))
    head = next((k for k, row in enumerate(rows) if any("TimeStamp" in cell for cell in row)), None)
    if head is None:
        return {}
    names = [cell.strip() for cell in rows[head]]
    clock = next(k for k, name in enumerate(names) if "TimeStamp" in name)
    best, gap = None, math.inf
    for row in rows[head + 1 :]:
        try:
            off = abs(float(row[clock]) - time_s)
        except (ValueError, IndexError):
            continue
        if off < gap:
            best, gap = row, off
    return {} if best is None or gap > _STEP_S else _entities(names, best)


def _entities(names: list[str], row: list[str]) -> dict[str, tuple[float, float]]:
    positions: dict[str, tuple[float, float]] = {}
    for k, name in enumerate(names):
        if "Entity_Name" not in name or k >= len(row):
            continue
        prefix = name.split("Entity_Name")[0]
        columns = {
            axis: next(
                (j for j, other in enumerate(names) if other.startswith(prefix) and f"Position_{axis}" in other), None
            )
            for axis in ("X", "Y")
        }
        x, y = columns["X"], columns["Y"]
        if x is not None and y is not None and row[k].strip():
            positions[row[k].strip()] = float(row[x]), float(row[y])
    return positions
