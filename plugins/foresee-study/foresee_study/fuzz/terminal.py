"""Prints the progress of a fuzzing run, and its results at the end."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.progress import TextColumn
from rich.text import Text

from foresee_dsl.campaign.execution.engine import Listener
from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.report.safe_text import counted, safe, shortened
from foresee_dsl.report.terminal.live import bars
from foresee_dsl.report.terminal.steps import EVERY_S
from foresee_dsl.report.terminal.tables import duration, plain_table
from foresee_dsl.report.verdicts import without_verdict
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict

if TYPE_CHECKING:
    from rich.console import Console

    from foresee_study.fuzz.records import FuzzedCase, FuzzResult


_CALLED = {Verdict.PASS: "passed", Verdict.INVALID: "impossible", Verdict.CRASH: "broke the driver"}
"""Names in the headline of outcomes that are not failures."""


class FuzzProgress(Listener):
    """Shows a bar on a terminal, a line every `EVERY_S` seconds elsewhere, and each failure at once."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bars = bars(console, TextColumn("{task.description}"), left=False)
        self._task = self._bars.add_task("runs")
        self._done = self._failed = 0
        self._told_s = time.monotonic()

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, err: BaseException | None, at: TracebackType | None) -> None:
        self._bars.stop()

    def planned(self, kind: str, count: int) -> None:  # noqa: ARG002 - as a listener is called
        """Set the maximum number of runs; a failure ends its test case earlier."""
        self._bars.update(self._task, total=count)

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        """Count a run, and print its failure."""
        self._done += 1
        self._bars.update(self._task, completed=self._done)
        if row.verdict in [verdict.value for verdict in FAILURES]:
            self._failed += 1
            self._bars.update(self._task, description=f"runs, {counted(self._failed, 'failure')}")
            if new:
                self._bars.console.print(f"  {row.name}: {row.reason}", style="dim", highlight=False, markup=False)
        if new and not self._console.is_terminal and time.monotonic() - self._told_s >= EVERY_S:
            self._told_s = time.monotonic()
            self._console.print(f"{counted(self._done, 'run')}, {counted(self._failed, 'failure')}")

    def broken(self, what: str) -> None:
        """Print an error of a run."""
        self._bars.console.print(f"  could not be run: {what}", style="red", highlight=False, markup=False)


def print_fuzz(console: Console, result: FuzzResult, out: Path) -> None:
    """Print the failures, the lowest scores by cycle, and the paths of the files."""
    usable = [case for case in result.seeds if case.usable]
    every = [run for case in result.seeds for run in case.every]
    counts = Counter(run.outcome.verdict for run in every)
    summary = ", ".join(f"{counts[kind]} {_CALLED.get(kind, kind.value)}" for kind in Verdict if counts[kind])
    style = "bold red" if result.failures else "bold green"
    line = f"{counted(len(every), 'mutation')}: {summary}" if every else "no mutation was run"
    console.print(Text.assemble((f"{safe(result.settings.driver)}: ", "bold"), (line, style)), soft_wrap=True)
    for case in result.seeds:
        _print_case(console, case, out)
    if result.by_cycle:
        rows = [(cycle.cycle, cycle.seeds, cycle.failures, f"{cycle.mean_best:.2f}") for cycle in result.by_cycle]
        console.print()
        console.print(plain_table(("cycle", "test cases", "failures", "mean lowest score"), rows))
    waiting = sum(case.plain is None for case in result.seeds)
    failing = len(result.seeds) - len(usable) - waiting
    left_out = f", {counted(failing, 'fails', 'fail')} unmutated" if failing else ""
    left_out += f", {counted(waiting, 'has', 'have')} not been run yet" if waiting else ""
    console.print(
        f"\n{result.failures} of {len(usable)} test cases fail after {len(every)} mutations{left_out}; "
        f"{duration(result.simulated_s)} simulated in {duration(result.wall_s)}",
        soft_wrap=True,
    )
    console.print(f"{out / 'fuzz.json'}", soft_wrap=True, markup=False)


def _print_case(console: Console, case: FuzzedCase, out: Path) -> None:
    name = safe(case.test_case)
    run = case.failed
    if run is not None:
        verdict, reason = run.outcome.verdict, f" {safe(without_verdict(run.outcome.verdict, run.outcome.reason))}"
        console.print(Text.assemble((f"{name}  ", "bold"), (verdict.value, verdict.style), reason),
                      soft_wrap=True)  # fmt: skip
        _print_line(console, f"  cycle {run.cycle}, mutation {run.number}: {run.outcome.what}")
        console.print(f"  {out / run.file}", soft_wrap=True, markup=False)
    elif case.plain is None:
        console.print(Text.assemble((f"{name}  ", "bold"), ("not run yet", "dim")), soft_wrap=True)
    elif not case.usable:
        console.print(
            Text.assemble((f"{name}  ", "bold"), (f"not mutated: {safe(case.reason)}", "dim")), soft_wrap=True
        )
    else:
        scores = " ".join(f"{cycle.best:.1f}" for cycle in case.cycles) or "none yet"
        console.print(Text.assemble((f"{name}  ", "bold"), f"passes; lowest scores {scores}"), soft_wrap=True)


def _print_line(console: Console, text: str) -> None:
    console.print(Text(shortened(text, max(console.width, 40))), soft_wrap=True)
