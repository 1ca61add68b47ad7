"""Shows the progress of a running campaign: bars on a terminal, a line every few seconds elsewhere, and a log of all
events.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable
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

from foresee_dsl.campaign.allocation.rounds import Round
from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, decode
from foresee_dsl.campaign.results import is_problem
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.documents import plain
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.steps import EVERY_S
from foresee_dsl.report.terminal.tables import duration
from foresee_dsl.report.terminal.time_left import RUNS, TimeLeft
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict

TITLES = {step.kind: step.title for step in RUNS}
"""Title of each kind of run; the progress shows only steps that run something."""


LONGEST_LINE = 99
"""Maximum length of a line of progress in a pipe, characters: it stays one line of a build's log. The report and
`campaign.json` have the whole reasons."""


class Figures(TimeLeft):
    """Counts of a campaign's planned and finished runs by kind, and of its children's verdicts."""

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        settings: CampaignSettings = CampaignSettings(),  # noqa: B008
    ) -> None:
        super().__init__(settings, clock)
        self.verdicts: Counter[str] = Counter()
        self.last_round: Round | None = None
        """The last round of children that has begun; None if children are not allocated in rounds."""

    def round(self, begun: Round) -> None:
        """Remember the round of children that begins."""
        super().round(begun)
        self.last_round = begun

    def done(self, row: Row, *, new: bool = True) -> None:
        """Count a finished run."""
        super().done(row, new=new)
        if row.kind == "child":
            self.verdicts[row.verdict] += 1

    @property
    def failures(self) -> dict[str, int]:
        """Return the number of children by kind of failure, in the order of the tables, without kinds that did not
        occur.
        """
        kinds = (*FAILURES, Verdict.GOAL, Verdict.CRASH)
        return {kind.value: self.verdicts[kind.value] for kind in kinds if self.verdicts[kind.value]}

    def line(self) -> str:
        """Return a line with the time left, the failures, and the counts of what is not finished.

        It has at most `LONGEST_LINE` characters: counts of the last stages are left out first.
        """
        took_s = self._clock() - self._began_s
        rate = sum(self.run_here[kind] for kind in TITLES) / took_s if took_s > 0 else 0.0
        failures = ", ".join(f"{count} {kind}" for kind, count in self.failures.items())
        parts = [self.ahead(), f"failures {failures}" if failures else "no failures"]
        parts += [f"round {self.last_round.number}/{self.last_round.of}"] if self.last_round is not None else []
        there = [kind for kind in TITLES if self.total[kind]]
        open_kinds = [kind for kind in there if self.finished[kind] < self.total[kind]] or there
        parts += [f"{TITLES[kind]} {self.finished[kind]}/{self.total[kind]}" for kind in open_kinds]
        line, more = "", f"{rate:.1f} runs/s"
        for part in filter(None, parts):
            longer = f"{line}; {part}" if line else part
            line = longer if len(longer) + len(more) + 2 <= LONGEST_LINE else line
        return f"{line}; {more}"

    def ahead(self) -> str:
        """Return, in words, the share that is done and the time left; "" while they cannot be estimated."""
        left_s = self.left_s
        return f"{self.shown_share:.0%} done, about {duration(left_s)} left" if left_s is not None else ""


class FirstFailure(Listener):
    """Remembers the name of the first run of a campaign that failed."""

    def __init__(self) -> None:
        self.name = ""

    def done(self, row: Row, *, new: bool = True) -> None:  # noqa: ARG002 - as a listener is called
        """Remember the run's name if the run is the first that failed."""
        verdict = next((kind for kind in Verdict if kind.value == row.verdict), Verdict.PASS)
        problem = verdict is not Verdict.PASS if row.kind == "seed" else is_problem(verdict) or row.broken
        if not problem and row.kind in ("seed", "child"):
            run = decode(row.record, CaseRunOutcome if row.kind == "seed" else ChildOutcome)
            problem = isinstance(run, CaseRunOutcome | ChildOutcome) and bool(run.broken_expectations)
        if problem and not self.name:
            self.name = row.name


class PlainProgress(Figures):
    """Prints a line of progress every few seconds, and each problem at once."""

    def __init__(
        self,
        print_line: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        settings: CampaignSettings = CampaignSettings(),  # noqa: B008 - immutable
    ) -> None:
        super().__init__(clock, settings)
        self._print_line = print_line
        self._printed_s = clock()

    def done(self, row: Row, *, new: bool = True) -> None:
        """Print a problem at once, and the progress every `EVERY_S`."""
        super().done(row, new=new)
        if new and (problem := _problem(row)):
            self._print_line(problem)
        if new and self._clock() - self._printed_s >= EVERY_S:
            self._printed_s = self._clock()
            self._print_line(self.line())

    def round(self, begun: Round) -> None:
        """Print to which clips the children of the round go."""
        super().round(begun)
        self._print_line(begun.sentence)

    def broken(self, what: str) -> None:
        """Print a step that could not be run."""
        self._print_line(f"could not be run: {what}")


class RichProgress(Figures):
    """Shows a bar for each kind of run on a terminal."""

    def __init__(self, console: Console, settings: CampaignSettings = CampaignSettings()) -> None:  # noqa: B008
        super().__init__(settings=settings)
        self.bars = bars(console, SpinnerColumn(), TextColumn("{task.description}"), rate=_Rate(), left=False)
        self._all = self.bars.add_task("altogether", total=None, visible=False)
        self._bars = {kind: self.bars.add_task(title, total=None, visible=False) for kind, title in TITLES.items()}

    def planned(self, kind: str, count: int) -> None:
        """Lengthen the bar of this kind of run."""
        super().planned(kind, count)
        if kind in self._bars:
            self.bars.update(self._bars[kind], total=self.total[kind], visible=True)

    def done(self, row: Row, *, new: bool = True) -> None:
        """Advance the bar of this kind of run, and print a problem."""
        super().done(row, new=new)
        if row.kind in self._bars:
            self.bars.update(self._bars[row.kind], completed=self.finished[row.kind])
        if ahead := self.ahead():
            percent = round(self.shown_share * 100)
            self.bars.update(self._all, visible=True, description=ahead, total=100, completed=percent)
        if self.failures and row.kind == "child":
            self._describe_children()
        if new and (problem := _problem(row)):
            self.bars.console.print(f"  {problem}", style="dim", highlight=False, markup=False)

    def round(self, begun: Round) -> None:
        """Show the round beside the children's bar, and print to which clips the children of the round go."""
        super().round(begun)
        self._describe_children()
        self.bars.console.print(f"  {begun.sentence}", style="dim", highlight=False, markup=False)

    def _describe_children(self) -> None:
        counts = [f"{kind} [red]{count}[/red]" for kind, count in self.failures.items()]
        begun = [] if self.last_round is None else [f"round {self.last_round.number} of {self.last_round.of}"]
        self.bars.update(self._bars["child"], description="  ".join((TITLES["child"], *begun, *counts)))

    def broken(self, what: str) -> None:
        """Print a step that could not be run."""
        self.bars.console.print(f"  could not be run: {what}", style="red", highlight=False, markup=False)


class _Rate(ProgressColumn):
    """A column with the number of runs per second in the last seconds."""

    def render(self, task: Bar) -> Text:
        return Text(f"{task.speed:.1f}/s" if task.speed else "", style="dim")


def bars(console: Console, *title: ProgressColumn, rate: ProgressColumn | None = None, left: bool = True) -> Progress:
    """Return progress bars with these columns in front; with `left`, the time left is the last column.

    Nothing is shown if the console is not a terminal.
    """
    rates = () if rate is None else (rate,)
    columns = (BarColumn(bar_width=None), MofNCompleteColumn(), *rates, TimeElapsedColumn())
    lefts = (TextColumn("left"), TimeRemainingColumn()) if left else ()
    return Progress(
        *title, *columns, *lefts, console=console, disable=not console.is_terminal, transient=True,
        expand=True,
    )  # fmt: skip


class JsonLog(Listener):
    """Writes each event as a JSON object on a line of its own, in the order of time, without delay."""

    def __init__(self, file: TextIO, clock: Callable[[], float] = time.time) -> None:
        self._file, self._clock = file, clock

    def write(self, event: str, **fields: object) -> None:
        """Write one event with its fields."""
        self._file.write(json.dumps({"time": round(self._clock(), 3), "event": event, **fields}) + "\n")
        self._file.flush()

    def planned(self, kind: str, count: int) -> None:
        """Write that runs of a kind were planned."""
        self.write("planned", stage=kind, count=count)

    def done(self, row: Row, *, new: bool = True) -> None:
        """Write that a run was finished."""
        run = {"verdict": row.verdict, "reason": row.reason} if row.verdict else {}
        self.write("done" if new else "known", stage=row.kind, name=row.name, key=row.key, **run,
                   wall_s=round(row.wall_s, 4), simulated_s=round(row.simulated_s, 2), broken=row.broken)  # fmt: skip

    def round(self, begun: Round) -> None:
        """Write that a round of children begins."""
        self.write("round", **plain(begun))

    def broken(self, what: str) -> None:
        """Write that a step could not be run."""
        self.write("broken", what=what)


def progress(
    stack: ExitStack,
    console: Console,
    *,
    quiet: bool,
    log: Path | None,
    settings: CampaignSettings = CampaignSettings(),  # noqa: B008 - immutable
) -> tuple[list[Listener], JsonLog | None]:
    """Return the listeners of a campaign and its log; `stack` closes both.

    Progress is shown on the console, which must be standard error: standard output is reserved for the report.

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
        rich = RichProgress(console, settings)
        stack.enter_context(rich.bars)
        listeners.append(rich)
    elif not quiet:

        def say(line: str) -> None:
            line = line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 3]}..."
            console.print(line, highlight=False, markup=False, soft_wrap=True)

        listeners.append(PlainProgress(say, settings=settings))
    return listeners, json_log


def _problem(row: Row) -> str:
    if row.kind == "seed" and row.verdict != Verdict.PASS:
        return f"not usable: {row.name}: {safe(row.reason, 1000)}"
    return f"broke: {row.name}: {safe(row.reason, 1000)}" if row.broken else ""
