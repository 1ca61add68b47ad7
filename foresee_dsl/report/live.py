"""A campaign while it runs: bars on a terminal, a line every few seconds elsewhere, and a log of every event."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Task as Bar
from rich.text import Text

from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.stages import STEPS
from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.report.terminal import duration
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict

TITLES = {step.kind: step.title for step in STEPS if step.drives}
"""Of the kinds of run, which are what is shown."""
EVERY_S = 5.0
"""Between two lines where there is no terminal. Ours: twelve a minute can be read in a CI log."""


class Figures(Listener):
    """How many runs of each kind there are and were done, and what children ended with."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = clock()
        self.total: Counter[str] = Counter()
        self.done: Counter[str] = Counter()
        self.run_here: Counter[str] = Counter()
        """Of `done`, those that were not in the store."""
        self.verdicts: Counter[str] = Counter()

    def planned(self, kind: str, count: int) -> None:
        """Count them."""
        self.total[kind] += count

    def known(self, row: Row) -> None:
        """Count it."""
        self.done[row.kind] += 1
        if row.kind == "child":
            self.verdicts[row.verdict] += 1

    def finished(self, row: Row) -> None:
        """Count it."""
        self.known(row)
        self.run_here[row.kind] += 1

    @property
    def failures(self) -> dict[str, int]:
        """How many children ended in which failure, in the order of the tables; kinds that occurred only."""
        shown = (*FAILURES, Verdict.CRASH)
        return {kind.value: self.verdicts[kind.value] for kind in shown if self.verdicts[kind.value]}

    def line(self) -> str:
        """Return all of it in a line."""
        parts = [f"{title} {self.done[kind]}/{self.total[kind]}" for kind, title in TITLES.items() if self.total[kind]]
        failures = ", ".join(f"{count} {kind}" for kind, count in self.failures.items())
        parts.append(f"failures {failures}" if failures else "no failures")
        took_s = self._clock() - self._began
        rate = sum(self.run_here[kind] for kind in TITLES) / took_s if took_s > 0 else 0.0
        parts.append(f"{rate:.1f} runs/s")
        if rate:
            left = sum(self.total[kind] - self.done[kind] for kind in TITLES)
            parts.append(f"about {duration(left / rate)} left of what is known")
        return "; ".join(parts)


class PlainProgress(Figures):
    """A line every few seconds, on standard error."""

    def __init__(self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(clock)
        self._say = say
        self._said_s = clock()

    def finished(self, row: Row) -> None:
        """Say at once what did not go well, and now and then how far it is."""
        super().finished(row)
        if (told := _what_went_wrong(row)) is not None:
            self._say(told)
        if self._clock() - self._said_s >= EVERY_S:
            self._said_s = self._clock()
            self._say(self.line())

    def broken(self, what: str) -> None:
        """Say it."""
        self._say(f"could not be done: {what}")


class RichProgress(Figures):
    """Bars by kind of run, on a terminal."""

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            _Rate(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            expand=True,
        )
        self._bars = {k: self._progress.add_task(title, total=None, visible=False) for k, title in TITLES.items()}

    def __enter__(self) -> RichProgress:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def planned(self, kind: str, count: int) -> None:
        """Lengthen its bar."""
        super().planned(kind, count)
        if kind in self._bars:
            self._progress.update(self._bars[kind], total=self.total[kind], visible=True)

    def known(self, row: Row) -> None:
        """Advance its bar."""
        super().known(row)
        if row.kind in self._bars:
            self._progress.update(self._bars[row.kind], completed=self.done[row.kind])
        if self.failures and row.kind == "child":
            counts = "  ".join(f"{kind} [red]{count}[/red]" for kind, count in self.failures.items())
            self._progress.update(self._bars["child"], description=f"{TITLES['child']}  {counts}")

    def finished(self, row: Row) -> None:
        """Advance its bar, and say what did not go well."""
        super().finished(row)
        if (told := _what_went_wrong(row)) is not None:
            self._progress.console.print(f"  {told}", style="dim", highlight=False, markup=False)

    def broken(self, what: str) -> None:
        """Say it."""
        self._progress.console.print(f"  could not be done: {what}", style="red", highlight=False, markup=False)


class _Rate(ProgressColumn):
    """Runs a second, as of late."""

    def render(self, task: Bar) -> Text:
        """Return the column's text."""
        return Text(f"{task.speed:.1f}/s" if task.speed else "", style="dim")


class JsonLog(Listener):
    """One JSON object a line for each event, in the order in which they happened; written through at once."""

    def __init__(self, file: TextIO, clock: Callable[[], float] = time.time) -> None:
        self._file, self._clock = file, clock

    def write(self, event: str, **fields: object) -> None:
        """Write one event."""
        self._file.write(json.dumps({"time": round(self._clock(), 3), "event": event, **fields}) + "\n")
        self._file.flush()

    def planned(self, kind: str, count: int) -> None:
        """Write it."""
        self.write("planned", stage=kind, count=count)

    def known(self, row: Row) -> None:
        """Write it."""
        self._step(row, "known")

    def finished(self, row: Row) -> None:
        """Write it."""
        self._step(row, "done")

    def broken(self, what: str) -> None:
        """Write it."""
        self.write("broken", what=what)

    def _step(self, row: Row, event: str) -> None:
        run = {"verdict": row.verdict, "reason": row.reason} if row.verdict else {}
        self.write(event, stage=row.kind, name=row.name, key=row.key, **run, wall_s=round(row.wall_s, 4),
                   simulated_s=round(row.simulated_s, 2), broken=row.broken)  # fmt: skip


class Several(Listener):
    """Tells several listeners."""

    def __init__(self, listeners: Sequence[Listener]) -> None:
        self._listeners = tuple(listeners)

    def planned(self, kind: str, count: int) -> None:
        """Tell them."""
        for listener in self._listeners:
            listener.planned(kind, count)

    def known(self, row: Row) -> None:
        """Tell them."""
        for listener in self._listeners:
            listener.known(row)

    def finished(self, row: Row) -> None:
        """Tell them."""
        for listener in self._listeners:
            listener.finished(row)

    def broken(self, what: str) -> None:
        """Tell them."""
        for listener in self._listeners:
            listener.broken(what)


def progress(stack: ExitStack, console: Console, *, quiet: bool, log: Path | None) -> tuple[Listener, JsonLog | None]:
    """Return the listener of a campaign, and the log; what has to be closed is put on the stack.

    Args:
        console: where progress is shown (on standard error, so that standard output is the report's alone).
        quiet: show none. log: also write a log to this file.

    Raises:
        OSError: the log's file cannot be written.
    """
    listeners: list[Listener] = []
    json_log = None
    if log is not None:
        log.parent.mkdir(parents=True, exist_ok=True)
        json_log = JsonLog(stack.enter_context(log.open("w", encoding="utf-8", newline="\n")))
        listeners.append(json_log)
    if not quiet and console.is_terminal:
        listeners.append(stack.enter_context(RichProgress(console)))
    elif not quiet:
        listeners.append(PlainProgress(lambda line: console.print(line, highlight=False, markup=False, soft_wrap=True)))
    return Several(listeners), json_log


def _what_went_wrong(row: Row) -> str | None:
    if row.kind == "seed" and row.verdict != Verdict.PASS:
        return f"not usable: {row.name}: {row.reason}"
    return f"broke: {row.name}: {row.reason}" if row.broken else None
