"""The terminal report of `foresee verify`: the results of a suite's tests by status, then the counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from foresee_dsl.campaign.regression.expectations import Status, in_words
from foresee_dsl.campaign.regression.verify import Recheck

_ORDER = {status: rank for rank, status in enumerate(Status)}
_WIDTH = max(len(status.label) for status in Status) + 2


def print_verification(console: Console, rechecks: Sequence[Recheck], written: Sequence[Path] | None = None) -> None:
    """Print each test that is not as expected, then the counts.

    `written`: the files whose expected results were updated; None without `--update`.
    """
    if not rechecks:
        console.print("no tests there: `foresee keep` writes mutants with expected results", soft_wrap=True)
        return
    for recheck in sorted(rechecks, key=lambda recheck: (_ORDER[recheck.status], recheck.file)):
        line = Text.assemble((f"{recheck.status.label:<{_WIDTH}}", recheck.status.style), recheck.file)
        if recheck.status is not Status.AS_EXPECTED:
            line.append("".join(f"\n{'':{_WIDTH}}{text}" for text in (*_was(recheck), f"now       {recheck.now}")))
        if recheck.note:
            line.append(f"\n{'':{_WIDTH}}{recheck.note}", style="dim")
        console.print(line, soft_wrap=True)
    counts = Counter(recheck.status for recheck in rechecks)
    parts = (f"{counts[status]} {status.label}" for status in Status if counts[status])
    console.print(Text(", ".join(parts), style="bold"), soft_wrap=True)
    _print_next(console, counts, written)


def _was(recheck: Recheck) -> tuple[str, ...]:
    """Return the line about the expected result; none for a stale test, which was not compared."""
    if recheck.status is Status.STALE:
        return ()
    if recheck.was == in_words(None):
        return (f"expected  nothing is recorded for {recheck.driver}",)
    return (f"expected  {recheck.was} ({recheck.driver})",)


def _print_next(console: Console, counts: Counter[Status], written: Sequence[Path] | None) -> None:
    """Print how to record the results, or the files in which they were recorded."""
    if written is None:
        if any(counts[status] for status in Status if status.can_be_recorded):
            console.print("`--update` writes these results as what is expected from now on", soft_wrap=True)
        return
    for file in written:
        console.print(Text(f"written   {file}"), soft_wrap=True)
    if counts[Status.CRASHED] or counts[Status.TIMED_OUT] or counts[Status.STALE]:
        console.print("crashes, timeouts and stale tests are never written: nothing is known of them", soft_wrap=True)
