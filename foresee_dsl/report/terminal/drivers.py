"""The terminal reports on drivers: `foresee assess`, on plain test cases, and `foresee conform`, in 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby

from rich.console import Console
from rich.progress import TextColumn
from rich.table import Table
from rich.text import Text

from foresee_dsl.campaign.assessment import DriverRow, DriverRun, rows_of
from foresee_dsl.campaign.conformance.records import CheckStatus, Conformance, ConformanceCase
from foresee_dsl.report.safe_text import COLUMNS, safe
from foresee_dsl.report.terminal.live import bars
from foresee_dsl.report.terminal.runs import print_notes
from foresee_dsl.report.terminal.tables import plain_table
from foresee_dsl.report.verdicts import WHOLE, ending, verdicts_line, without_verdict
from foresee_dsl.simulate.results.verdict import COLLISIONS, FAILURES, Verdict


@contextmanager
def runs_progress(console: Console, total: int) -> Iterator[Callable[[DriverRun], None]]:
    """Show a progress bar on a terminal, and nothing elsewhere; yield a function to call with each finished run."""
    with bars(console, TextColumn("runs")) as progress:
        task = progress.add_task("runs", total=total)
        yield lambda _: progress.advance(task)


def print_assessment(console: Console, runs: Sequence[DriverRun], *, failures: bool = False, of: int = 0) -> None:
    """Print how many runs of each driver failed and how, then a table of drivers, and one of drivers by family.

    Args:
        runs: the finished runs. failures: also list each failing run. of: number of runs that were planned; larger
            than the number of `runs` if the first failure ended them.
    """
    for driver, mine in groupby(runs, key=lambda outcome: outcome.driver):
        console.print(Text.assemble((f"{safe(driver)}: ", "bold"), verdicts_line(list(mine))), soft_wrap=True)
    if len(runs) < of:
        left = f"stopped at the first failure (--fail-fast): {of - len(runs)} were not run"
        console.print(Text(left, style="yellow"))
    console.print()
    console.print(_table("Drivers on plain test cases", "driver", [(row.driver, row) for row in rows_of(runs)]))
    by_family = rows_of(runs, families=True)
    if len({row.family for row in by_family}) > 1:
        named = [(f"{row.driver} {row.family}", row) for row in by_family]
        console.print(_table("\nBy scenario family", "driver, family", named))
    console.print(
        Text(
            f"{', '.join(f'{kind.value} {kind.label}' for kind in COLLISIONS)}: share of the cases;\n"
            "brake: brakings over 3 m/s^2 a kilometre; ms: the driver's own time a step",
            style="dim",
        )
    )
    if failures:
        noted = set()
        for run in (run for run in runs if not run.passed):
            how = safe(without_verdict(run.verdict, run.reason), WHOLE)
            text = f"{safe(run.driver)}  {safe(run.case, WHOLE)}\n    {ending(run)}: {how}"
            console.print(Text(text), soft_wrap=True)
            if (run.driver, run.reason) not in noted:  # each place in a driver's code is printed once
                noted.add((run.driver, run.reason))
                print_notes(console, run.notes)


def _table(title: str, first: str, rows: Sequence[tuple[str, DriverRow]]) -> Table:
    columns = {kind.value: (kind,) for kind in COLLISIONS} | {
        "stuck": (Verdict.STUCK,), "rule": (Verdict.RULE,), "late": (Verdict.TIMEOUT,),
        "other": tuple(kind for kind in Verdict if kind not in (*FAILURES, Verdict.PASS, Verdict.TIMEOUT)),
    }  # fmt: skip
    if not any(row.share(Verdict.RULE) for _, row in rows):
        del columns["rule"]
    table = plain_table(
        (first, "cases", "arrive", "fail", *columns, "km/h", "brake", "ms"),
        ((label, row.cases, f"[bold]{row.share(Verdict.PASS):.0%}[/bold]", f"[bold]{row.failed:.0%}[/bold]",
          *(_share(row, *kinds) for kinds in columns.values()), f"{row.mean_mps * 3.6:.0f}",
          f"{row.hard_brakings_per_km:.1f}", f"{row.step_ms:.2f}") for label, row in rows),
        title=title,
        gap=1,
    )  # fmt: skip
    table.columns[0].no_wrap, table.columns[0].overflow = False, "fold"
    return table


def _share(row: DriverRow, *verdicts: Verdict) -> str:
    share = row.share(*verdicts)
    return f"{share:.0%}" if share else "[dim]0[/dim]"


_STYLES = {CheckStatus.PASS: "green", CheckStatus.FAIL: "bold red", CheckStatus.SKIPPED: "yellow"}
_MARK = 8
"""Width of the column of results."""


@contextmanager
def tasks_progress(console: Console) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on a terminal, and nothing elsewhere; yield a function that takes the number of finished and
    of all tasks."""
    with bars(console, TextColumn("checks")) as progress:
        task = progress.add_task("checks", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def print_conformance(console: Console, conformance: Conformance) -> None:
    """Print all checks, then the ten test cases, then a line that sums up."""
    console.print(Text(safe(f"Conformance of {conformance.driver} {conformance.version}".rstrip()), style="bold"))
    console.print()
    name_width = max(len(check.name) for check in conformance.checks) + 2
    for check in conformance.checks:
        mark = "FAIL" if check.status is CheckStatus.FAIL else check.status.value
        _row(console, check.name, name_width, mark, _STYLES[check.status], check.detail)
        if check.advice:
            _row(console, "", name_width, "", "", f"=> {check.advice}", style="cyan")
    if conformance.cases:
        console.print(Text("\nTen cases, the easiest first", style="bold"))
        case_width = max(len(case.name) for case in conformance.cases) + 5
        for number, case in enumerate(conformance.cases, start=1):
            style = _STYLES[CheckStatus.PASS if case.run.passed else CheckStatus.FAIL]
            mark = case.run.verdict.value if case.run.passed or case.run.verdict.value != "pass" else "BROKEN"
            _row(console, f"{number:>2} {case.name}", case_width, mark, style, _ending(case))
    console.print()
    console.print(_summary(conformance), soft_wrap=True)


def _row(console: Console, name: str, width: int, mark: str, mark_style: str, detail: str, *, style: str = "") -> None:
    """Print one row, whose detail goes on below itself."""
    lines = textwrap.wrap(safe(detail, WHOLE), COLUMNS - width - _MARK, break_on_hyphens=False) or [""]
    for k, line in enumerate(lines):
        parts = (name, mark) if k == 0 else ("", "")
        console.print(
            Text.assemble(f"{parts[0]:<{width}}", (f"{parts[1]:<{_MARK}}", mark_style), (line, style)), soft_wrap=True
        )


def _ending(case: ConformanceCase) -> str:
    """Return how a case ended; for one that failed also what it is about."""
    if case.run.passed:
        return case.run.reason
    return f"{without_verdict(case.run.verdict, case.run.reason)}. {case.about}"


def _summary(conformance: Conformance) -> Text:
    judged = [check for check in conformance.checks if check.status is not CheckStatus.SKIPPED]
    passed, arrived = len(judged) - len(conformance.failed), sum(case.run.passed for case in conformance.cases)
    cases = f", {arrived} of {len(conformance.cases)} cases pass" if conformance.cases else ""
    words = "conforms" if conformance.conforms else "does not conform"
    style = "bold green" if conformance.conforms else "bold red"
    return Text.assemble((f"{safe(conformance.driver)} {words}", style), f": {passed} of {len(judged)} checks{cases}")
