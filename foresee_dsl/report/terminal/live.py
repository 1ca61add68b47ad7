"""Shows the progress of a running campaign: bars on a terminal, a line every few seconds elsewhere, and a log of all
events; with an estimate of the time left, including runs that are not planned yet.
"""

from __future__ import annotations

import json
import time
from collections import Counter, defaultdict
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
from foresee_dsl.campaign.records import FAILED, CaseRunOutcome, ChildOutcome, decode
from foresee_dsl.campaign.results import is_problem
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import STEPS
from foresee_dsl.campaign.steps.step import AnyStep
from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.documents import plain
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.steps import EVERY_S
from foresee_dsl.report.terminal.tables import duration
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict

_STEPS = {step.kind: step for step in STEPS}


def _run_above(step: type[AnyStep]) -> str:
    above = step.follows
    while above and not _STEPS[above].drives:
        above = _STEPS[above].follows
    return above


RUNS = tuple(step for step in STEPS if step.drives)
"""The steps that run test cases, clips or mutants, in an order in which each comes after the step that it depends
on."""
_ABOVE = {step.kind: _run_above(step) for step in RUNS}
"""For each kind of run, the kind on which it depends; "" for the first."""
USUAL_SHARE = {"clip": 0.69, "child": 0.92}
"""Share of the maximum number of runs of a kind (per run of the kind on which it depends) that usually takes place; it
replaces the step's own `share`. Ours: measured with the bundled library and `pdm`, which gave 120 test cases, 332 clips
and 1220 children."""
_WEIGHT = 12
"""Number of measured runs that have as much weight as the usual values. Ours: the first few runs change the estimate
little, and after fifty the measured runs nearly determine it."""
_FAILING = 0.1
"""Share of children that are assumed to fail until runs have shown it; a step's `share` refers to it. Ours, measured as
above."""
_ALIKE_FROM, _ALIKE_POWER = 64, 0.36
"""From the first number of failures on, the number of findings is assumed to grow as the number of failures to the
power of the second value, because most failures repeat a story. Ours: measured with the bundled library and `pdm`,
where 64 failures had 24 findings to be minimised, and 1,985 failures had 82."""
_SHOWN_FROM = 0.02
"""An estimate is shown when this share of the work is done. Ours."""
_SMOOTH = 0.1
"""Weight of the newest estimate of the campaign's duration in the running average of these estimates, which is updated
every `_EVERY_S`. Ours."""
_EVERY_S = 0.5
"""Wall time between two updates of that average, s. Ours."""
_NEARLY = 0.9
"""From this share of the work on, the time left is at least the time that the remaining work takes at the average rate.
Ours."""


class TimeLeft(Listener):
    """Counts a campaign's runs, and estimates the time left, so that the estimate changes little from one moment to the
    next.
    """

    def __init__(self, settings: CampaignSettings, clock: Callable[[], float] = time.monotonic) -> None:
        """Start the clock; `clock` returns the current time, s."""
        self._clock, self._began_s = clock, clock()
        self.total: Counter[str] = Counter()
        """Number of planned runs by kind."""
        self.finished: Counter[str] = Counter()
        self.run_here: Counter[str] = Counter()
        """The finished runs that were not in the store, counted by kind."""
        at_most = {step.kind: step.at_most(settings) for step in RUNS}
        at_most["child"] *= settings.repeat
        self._usual = {step.kind: at_most[step.kind] * USUAL_SHARE.get(step.kind, step.share) for step in RUNS}
        self._in_rounds = settings.in_rounds
        self._children = 0
        """Total number of children in all rounds; 0 until a later round states it, or if there are no rounds."""
        self._failed: Counter[str] = Counter()
        self._wall_s: defaultdict[str, float] = defaultdict(float)
        self._whole_s = 0.0
        self.shown_share = 0.0
        """Share of the whole time that had passed at the last call of `left_s`; it never decreases."""
        self._looked_s = self._began_s

    def planned(self, kind: str, count: int) -> None:
        """Count further planned runs of a kind."""
        self.total[kind] += count

    def round(self, begun: Round) -> None:
        """Take the total number of children from a round that begins."""
        self._children = max(self._children, begun.total)

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        """Count a finished run; `new`: whether it was run now, not taken from the store."""
        self.finished[row.kind] += 1
        self._failed[row.kind] += row.verdict in FAILED
        if new:
            self.run_here[row.kind] += 1
            self._wall_s[row.kind] += row.wall_s

    @property
    def share(self) -> float:
        """Return the share of the work that is done, 0 to 1."""
        done, whole = 0.0, 0.0
        of_kind: dict[str, float] = {}
        for step in RUNS:
            kind, above = step.kind, _ABOVE[step.kind]
            expected = of_kind.get(above, 0.0)
            if above:
                seen = self.finished[above]
                # What follows from a run is planned after it has ended, so until some is, one more run may lead to it.
                ahead = max(expected - seen, 0.0 if self.total[kind] else min(expected, 1.0))
                each = (self.total[kind] + self._usual[kind] * _WEIGHT) / (seen + _WEIGHT)
                if kind == "child" and self._in_rounds:
                    # A round is planned only when the round before has ended; until then the usual number of children
                    # is assumed.
                    expected = max(self.total[kind], self._children or expected * self._usual[kind])
                elif not step.after_all:
                    expected = self.total[kind] + ahead * each
                elif self.total[kind]:
                    expected = float(self.total[kind])
                else:  # this step comes after all runs above it, and only for those that failed
                    failing = (self._failed[above] + _FAILING * _WEIGHT) / (seen + _WEIGHT)
                    alike = max(1.0, expected * failing / _ALIKE_FROM) ** (_ALIKE_POWER - 1)
                    expected *= failing * self._usual[kind] / _FAILING * alike
            else:
                expected = float(self.total[kind])
            each_s = (self._wall_s[kind] + step.usual_s * _WEIGHT) / (self.run_here[kind] + _WEIGHT)
            done += self.run_here[kind] * each_s
            whole += max(0.0, expected - (self.finished[kind] - self.run_here[kind])) * each_s
            of_kind[kind] = expected
        return min(1.0, done / whole) if whole else 0.0

    @property
    def left_s(self) -> float | None:
        """Return the estimated wall time until the end, s; None while less than `_SHOWN_FROM` of the work is done."""
        now_s, share = self._clock(), self.share
        if share < _SHOWN_FROM:
            return None
        took_s = now_s - self._began_s
        if not self._whole_s:
            self._whole_s = took_s / share
        elif (looks := (now_s - self._looked_s) / _EVERY_S) >= 1:
            self._whole_s += (1 - (1 - _SMOOTH) ** looks) * (took_s / share - self._whole_s)
            self._looked_s = now_s
        # Near the end, the remaining work says more than the average over the whole campaign.
        left_s = max(took_s * (1 - share) / share if share > _NEARLY else 0.0, self._whole_s - took_s, 0.0)
        self.shown_share = max(self.shown_share, took_s / (took_s + left_s) if took_s else 0.0)
        return left_s


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

    def done(self, row: StoredResult, *, new: bool = True) -> None:
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

    def done(self, row: StoredResult, *, new: bool = True) -> None:  # noqa: ARG002 - as a listener is called
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

    def done(self, row: StoredResult, *, new: bool = True) -> None:
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

    def done(self, row: StoredResult, *, new: bool = True) -> None:
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

    def done(self, row: StoredResult, *, new: bool = True) -> None:
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


def _problem(row: StoredResult) -> str:
    if row.kind == "seed" and row.verdict != Verdict.PASS:
        return f"not usable: {row.name}: {safe(row.reason, 1000)}"
    return f"broke: {row.name}: {safe(row.reason, 1000)}" if row.broken else ""
