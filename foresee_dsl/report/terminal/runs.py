"""The terminal report on runs of test cases, with the driver's output and traceback."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from foresee_dsl.campaign.execution.runs import CaseRun
from foresee_dsl.report.safe_text import counted, safe
from foresee_dsl.report.terminal.tables import plain_table, print_run_details
from foresee_dsl.report.verdicts import (
    WHOLE,
    changed_lines,
    ending,
    unfired_lines,
    verdicts_line,
    without_verdict,
)
from foresee_dsl.simulate.results.verdict import DriverNotes

_LINES = 30
"""Maximum number of lines of a driver's output that are printed. Ours: the verdict above them stays on the screen."""


def print_case_run(console: Console, run: CaseRun, trace: Path | None) -> None:
    """Print how one run ended: verdict and reason, what happened in it, and what the driver raised and printed."""
    text = Text.assemble(f"{safe(run.case.id, WHOLE)}: ", ending(run))
    text.append(f", {safe(without_verdict(run.verdict, run.reason), WHOLE)}")
    if run.result is not None:
        text.append(f" ({run.result.duration_s:.2f} s, {run.result.steps} steps)")
    console.print(text, soft_wrap=True)
    if run.result is not None:
        # Most triggers have no time to fire within a clip, so one that did not fire there means nothing.
        print_run_details(console, run.result, triggers=run.case.clip is None)
    print_notes(console, run.notes)
    if trace is not None:
        console.print(Text(f"  trace {safe(trace, WHOLE)}", style="dim"), soft_wrap=True)


def print_notes(console: Console, notes: DriverNotes) -> None:
    """Print a driver's traceback, its changes to the process, and its output."""
    for line in notes.traceback.splitlines():
        console.print(Text(f"  {safe(line, WHOLE)}", style="red" if line[:1].strip() else "default"), soft_wrap=True)
    for line in changed_lines([notes]):
        console.print(Text(f"  {line}", style="yellow"), soft_wrap=True)
    if notes.output.strip():
        console.print(Text("  the driver printed:", style="dim"))
        lines = notes.output.rstrip().splitlines()
        cut = len(lines) - _LINES
        if cut > 0:
            more = f"... ({counted(cut, 'line')} more; --json has them)"
            lines = [*lines[: _LINES // 2], more, *lines[-_LINES // 2 :]]
        for line in lines:
            console.print(Text(f"  | {safe(line, WHOLE)}"), soft_wrap=True)


def print_case_runs(console: Console, runs: Sequence[CaseRun], of: int, traces: Mapping[str, Path]) -> None:
    """Print several runs: how many failed and how, the failed runs in detail, and a table of all runs."""
    failed = [run for run in runs if not run.passed]
    console.print(verdicts_line(runs), soft_wrap=True)
    for run in failed:
        console.print()
        print_case_run(console, run, traces.get(run.case.id))
    console.print()
    rows = [
        (safe(run.case.id, WHOLE), ending(run).plain,
         f"{run.result.time_s:.2f} s" if run.result else "", _held(run),
         "yes" if run.notes.output.strip() else "")
        for run in runs
    ]  # fmt: skip
    headings = ("test case", "verdict", "at", "expectations", "printed")
    table = plain_table(headings, rows, align="<<>><")
    table.columns[0].overflow = "fold"
    console.print(table)
    _print_never_fired(console, runs)
    if len(runs) < of:
        console.print(
            Text(f"stopped at the first failure (--fail-fast): {of - len(runs)} were not run", style="yellow")
        )


def _print_never_fired(console: Console, runs: Sequence[CaseRun]) -> None:
    """Print the triggers and steps that fired in none of the cases of a file, if the file has several."""
    complete = [run for run in runs if run.result is not None and run.case.clip is None]
    by_file = {
        str(run.case.source): [other for other in complete if other.case.source == run.case.source] for run in complete
    }
    for of_file in by_file.values():
        unfired = [{(u.index, u.where): u for u in run.result.unfired} for run in of_file if run.result is not None]
        always = [key for key in unfired[0] if len(unfired) > 1 and all(key in other for other in unfired)]
        if always:
            console.print(Text(f"in none of {len(of_file)} cases of {safe(of_file[0].case.source.name, WHOLE)}:"))
            width = console.width if console.is_terminal else 0
            for line in unfired_lines([unfired[0][key] for key in always], width):
                console.print(line, soft_wrap=True)


def _held(run: CaseRun) -> str:
    expectations = run.result.expectations if run.result is not None else ()
    broken = sum(not expectation.held for expectation in expectations)
    return f"{broken} BROKEN" if broken else f"{len(expectations)} held" if expectations else ""
