"""The terminal report of `foresee conform`, which fits 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import TextColumn
from rich.text import Text

from foresee_dsl.campaign.conformance.records import CheckStatus, Conformance, ConformanceCase
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.live import bars
from foresee_dsl.report.verdicts import WHOLE, without_verdict

WIDTH = 80
"""Width of the report, in columns. Ours: the usual width of a terminal."""
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
    lines = textwrap.wrap(safe(detail, WHOLE), WIDTH - width - _MARK, break_on_hyphens=False) or [""]
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
