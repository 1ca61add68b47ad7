"""A campaign while it runs: bars on a terminal, a line every few seconds elsewhere, and a log of every event."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
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

from foresee_dsl.campaign.execution.events import Listener
from foresee_dsl.campaign.results import FAILURES
from foresee_dsl.campaign.storage.records import RUNS, Kind
from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.report.terminal import duration
from foresee_dsl.simulate.results.verdict import Verdict

TITLES = {"seed": "test cases", "clip": "clips", "child": "children"}
EVERY_S = 5.0
"""Between two lines where there is no terminal. Ours: twelve a minute can be read in a CI log."""


class Figures:
    """How many runs of each kind there are and were done, and what children ended with."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = clock()
        self.planned: Counter[str] = Counter()
        self.done: Counter[str] = Counter()
        self.fresh: Counter[str] = Counter()
        """Of `done`, those that this campaign ran itself."""
        self.verdicts: Counter[str] = Counter()

    def plan(self, kind: Kind, count: int) -> None:
        """So many more are known of."""
        self.planned[kind] += count

    def take(self, row: Row, *, fresh: bool) -> None:
        """One is done."""
        self.done[row.kind] += 1
        self.fresh[row.kind] += fresh
        if row.kind == "child":
            self.verdicts[row.verdict] += 1

    @property
    def failures(self) -> dict[str, int]:
        """How many children ended in which failure, in the order of the tables; kinds that occurred only."""
        shown = (*FAILURES, Verdict.CRASH)
        return {kind.value: self.verdicts[kind.value] for kind in shown if self.verdicts[kind.value]}

    @property
    def rate(self) -> float:
        """Runs a second, of those that this campaign ran itself."""
        took_s = self._clock() - self._began
        return sum(self.fresh[kind] for kind in RUNS) / took_s if took_s > 0 else 0.0

    @property
    def left_s(self) -> float | None:
        """How long the runs that are known of will take; None before any is done."""
        left = sum(self.planned[kind] - self.done[kind] for kind in RUNS)
        return left / self.rate if self.rate else None

    def line(self) -> str:
        """Return all of it in a line."""
        parts = [f"{TITLES[kind]} {self.done[kind]}/{self.planned[kind]}" for kind in RUNS if self.planned[kind]]
        failures = ", ".join(f"{count} {kind}" for kind, count in self.failures.items())
        parts.append(f"failures {failures}" if failures else "no failures")
        parts.append(f"{self.rate:.1f} runs/s")
        if self.left_s is not None:
            parts.append(f"about {duration(self.left_s)} left of what is known")
        return "; ".join(parts)


class PlainProgress:
    """A line every few seconds, on standard error."""

    def __init__(self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._say, self._clock = say, clock
        self._figures = Figures(clock)
        self._said_s = clock()

    def planned(self, kind: Kind, count: int) -> None:
        """So many more steps of a kind are known of."""
        self._figures.plan(kind, count)

    def known(self, row: Row) -> None:
        """One of them was in the store."""
        self._figures.take(row, fresh=False)

    def finished(self, row: Row) -> None:
        """One of them was done."""
        self._figures.take(row, fresh=True)
        if (told := _set_aside(row)) is not None:
            self._say(told)
        if self._clock() - self._said_s >= EVERY_S:
            self._said_s = self._clock()
            self._say(self._figures.line())

    def broken(self, what: str) -> None:
        """One of them cannot be done."""
        self._say(f"could not be done: {what}")


class RichProgress:
    """Bars by kind of run, on a terminal."""

    def __init__(self, console: Console) -> None:
        self._figures = Figures()
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
        self._bars = {kind: self._progress.add_task(TITLES[kind], total=None, visible=False) for kind in RUNS}

    def __enter__(self) -> RichProgress:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def planned(self, kind: Kind, count: int) -> None:
        """So many more steps of a kind are known of."""
        self._figures.plan(kind, count)
        if kind in self._bars:
            self._progress.update(self._bars[kind], total=self._figures.planned[kind], visible=True)

    def known(self, row: Row) -> None:
        """One of them was in the store."""
        self._take(row, fresh=False)

    def finished(self, row: Row) -> None:
        """One of them was done."""
        self._take(row, fresh=True)
        if (told := _set_aside(row)) is not None:
            self._progress.console.print(f"  {told}", style="dim", highlight=False, markup=False)

    def broken(self, what: str) -> None:
        """One of them cannot be done."""
        self._progress.console.print(f"  could not be done: {what}", style="red", highlight=False, markup=False)

    def _take(self, row: Row, *, fresh: bool) -> None:
        self._figures.take(row, fresh=fresh)
        for kind, bar in self._bars.items():
            if kind == row.kind:
                self._progress.update(bar, completed=self._figures.done[kind])
        if self._figures.failures and row.kind == "child":
            counts = "  ".join(f"{kind} [red]{count}[/red]" for kind, count in self._figures.failures.items())
            self._progress.update(self._bars["child"], description=f"{TITLES['child']}  {counts}")


class _Rate(ProgressColumn):
    """Runs a second, as of late."""

    def render(self, task: Bar) -> Text:
        """Return the column's text."""
        return Text(f"{task.speed:.1f}/s" if task.speed else "", style="dim")


class JsonLog:
    """One JSON object a line for each event, in the order in which they happened; written through at once."""

    def __init__(self, file: TextIO, clock: Callable[[], float] = time.time) -> None:
        self._file, self._clock = file, clock

    def begin(self, **what: object) -> None:
        """The campaign begins."""
        self._write("begin", **what)

    def end(self, **what: object) -> None:
        """The campaign has ended."""
        self._write("end", **what)

    def planned(self, kind: Kind, count: int) -> None:
        """So many more steps of a kind are known of."""
        self._write("planned", stage=kind, count=count)

    def known(self, row: Row) -> None:
        """One of them was in the store."""
        self._step(row, "known")

    def finished(self, row: Row) -> None:
        """One of them was done."""
        self._step(row, "done")

    def broken(self, what: str) -> None:
        """One of them cannot be done."""
        self._write("broken", what=what)

    def _step(self, row: Row, event: str) -> None:
        run = {"verdict": row.verdict, "reason": row.reason} if row.verdict else {}
        self._write(event, stage=row.kind, name=row.name, key=row.key, **run, wall_s=round(row.wall_s, 4),
                    simulated_s=round(row.simulated_s, 2), broken=row.broken)  # fmt: skip

    def _write(self, event: str, **fields: object) -> None:
        self._file.write(json.dumps({"time": round(self._clock(), 3), "event": event, **fields}) + "\n")
        self._file.flush()


class Several:
    """Tells several listeners."""

    def __init__(self, listeners: Sequence[Listener]) -> None:
        self._listeners = tuple(listeners)

    def planned(self, kind: Kind, count: int) -> None:
        """So many more steps of a kind are known of."""
        for listener in self._listeners:
            listener.planned(kind, count)

    def known(self, row: Row) -> None:
        """One of them was in the store."""
        for listener in self._listeners:
            listener.known(row)

    def finished(self, row: Row) -> None:
        """One of them was done."""
        for listener in self._listeners:
            listener.finished(row)

    def broken(self, what: str) -> None:
        """One of them cannot be done."""
        for listener in self._listeners:
            listener.broken(what)


def progress(stack: ExitStack, console: Console, *, quiet: bool, log: Path | None) -> tuple[Several, JsonLog | None]:
    """Return who is told of a campaign, and the log; what has to be closed is put on the stack.

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


def _set_aside(row: Row) -> str | None:
    if row.kind == "seed" and row.verdict != Verdict.PASS:
        return f"set aside: {row.name}: {row.reason}"
    return f"broke: {row.name}: {row.reason}" if row.broken else None
