"""The result of one file, and the table, summary and CSV of all results."""

from __future__ import annotations

import csv
import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from rich.console import Console
from rich.table import Table


class Outcome(StrEnum):
    """The outcome of a file."""

    imported = "imported"
    partial = "partial"
    good_reason = "refused for a good reason"
    ours = "refused for ours"
    broken = "broken"
    """A traceback, or over a limit."""


@dataclass(frozen=True)
class Row:
    """The result of one file.

    Attributes:
        file, outcome, seconds: its name, outcome and time.
        reason: why it was refused, or the lost parts.
        arrives: whether a first drive arrived (maps only).
        compared, near: number of actors that the player has too, and of those that are within 3 m of it at every
            comparison.
        worst_m, worst: largest distance, m; the actor and the time.
        player_error: the message of the player if it could not play the file.
    """

    file: str
    outcome: Outcome
    reason: str = ""
    compared: int = 0
    near: int = 0
    worst_m: float = 0.0
    worst: str = ""
    player_error: str = ""
    arrives: bool | None = None
    seconds: float = 0.0


def write_csv(rows: Sequence[Row], path: Path) -> None:
    """Write one line for each file."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [field.name for field in dataclasses.fields(Row)])
        writer.writeheader()
        writer.writerows(dataclasses.asdict(row) for row in rows)


def show(rows: Sequence[Row], console: Console) -> None:
    """Print the table and the summary."""
    table = Table("file", "outcome", "actors near", "worst", "why")
    for row in rows:
        near = f"{row.near}/{row.compared}" if row.compared else ""
        worst = f"{row.worst_m:.1f} m {row.worst}" if row.compared else row.player_error[:40]
        table.add_row(row.file, row.outcome, near, worst, row.reason[:160])
    console.print(table)
    counts = Counter(row.outcome for row in rows)
    for outcome in Outcome:
        console.print(f"{counts[outcome]:4d} {outcome}")
    taken = counts[Outcome.imported] + counts[Outcome.partial]
    console.print(f"{taken} of {len(rows)} imported ({_percent(taken, len(rows))})")
    meant = len(rows) - counts[Outcome.good_reason]
    console.print(f"{taken} of {meant} without those refused for a good reason ({_percent(taken, meant)})")
    driven = [row for row in rows if row.arrives is not None]
    if driven:
        arrived = sum(bool(row.arrives) for row in driven)
        console.print(f"{arrived} of {len(driven)} first drives arrive ({_percent(arrived, len(driven))})")
    compared, close = sum(row.compared for row in rows), sum(row.near for row in rows)
    if compared:
        share = _percent(close, compared)
        console.print(f"{close} of {compared} actors within 3 m of the player at each look ({share})")
        whole = [row for row in rows if row.outcome is Outcome.imported]
        played = [row for row in whole if row.compared]
        good = sum(row.near == row.compared for row in played)
        share = _percent(good, len(played))
        console.print(f"{good} of {len(played)} files of which nothing is lost have all actors near ({share})")
        compared, close = sum(row.compared for row in whole), sum(row.near for row in whole)
        console.print(f"{close} of {compared} of them in files of which nothing is lost ({_percent(close, compared)})")


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "none"
