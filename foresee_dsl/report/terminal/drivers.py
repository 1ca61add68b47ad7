"""The terminal report of `foresee assess`: how drivers do on plain test cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby

from rich.console import Console
from rich.progress import TextColumn
from rich.table import Table
from rich.text import Text

from foresee_dsl.campaign.assessment import DriverRow, DriverRun, rows_of
from foresee_dsl.report.safe_text import safe
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
        listed = list(mine)
        failed = [outcome for outcome in listed if not outcome.passed]
        breaking = sum(outcome.verdict is Verdict.PASS for outcome in failed)
        verdicts, reasons = [outcome.verdict for outcome in listed], [outcome.reason for outcome in failed]
        line = verdicts_line(verdicts, reasons, breaking=breaking)
        console.print(Text.assemble((f"{safe(driver)}: ", "bold"), line), soft_wrap=True)
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
            ended = ending(run.verdict, run.broken_expectations)
            text = f"{safe(run.driver)}  {safe(run.case, WHOLE)}\n    {ended}: {how}"
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
