"""What became of a suite's tests, for the terminal: first what cannot be told, then what is not as expected."""

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

    `written`: the files whose expected results were written anew; None where that was not asked for.
    """
    if not rechecks:
        console.print("no tests there: `foresee keep` writes mutants with what is expected of them", soft_wrap=True)
        return
    for one in sorted(rechecks, key=lambda one: (_ORDER[one.status], one.file)):
        line = Text.assemble((f"{one.status.label:<{_WIDTH}}", one.status.style), one.file)
        if one.status is not Status.AS_EXPECTED:
            line.append("".join(f"\n{'':{_WIDTH}}{text}" for text in (*_was(one), f"now       {one.now}")))
        if one.note:
            line.append(f"\n{'':{_WIDTH}}{one.note}", style="dim")
        console.print(line, soft_wrap=True)
    counts = Counter(one.status for one in rechecks)
    told = (f"{counts[status]} {status.label}" for status in Status if counts[status])
    console.print(Text(", ".join(told), style="bold"), soft_wrap=True)
    _print_next(console, counts, written)


def _was(one: Recheck) -> tuple[str, ...]:
    """The line about what is expected; none of a stale test, of which nothing was compared."""
    if one.status is Status.STALE:
        return ()
    if one.was == in_words(None):
        return (f"expected  nothing is recorded for {one.driver}",)
    return (f"expected  {one.was} ({one.driver})",)


def _print_next(console: Console, counts: Counter[Status], written: Sequence[Path] | None) -> None:
    """Say what to do now."""
    if written is None:
        if any(counts[status] for status in Status if status.can_be_recorded):
            console.print("`--update` writes these results as what is expected from now on", soft_wrap=True)
        return
    for file in written:
        console.print(Text(f"written   {file}"), soft_wrap=True)
    if counts[Status.CRASHED] or counts[Status.TIMED_OUT] or counts[Status.STALE]:
        console.print("crashes, timeouts and stale tests are never written: nothing is known of them", soft_wrap=True)
