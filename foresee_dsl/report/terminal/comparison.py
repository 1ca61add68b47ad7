"""Prints the comparison of two versions of a driver, and the results of kept tests, for the terminal and for pull
requests.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from foresee_dsl.campaign.regression.comparison import MEASURES, CampaignComparison, Nearer, OutcomeChange, Pair, Row
from foresee_dsl.campaign.regression.expectations import Status, in_words
from foresee_dsl.campaign.regression.verify import Recheck
from foresee_dsl.files import rendered
from foresee_dsl.report.safe_text import counted, safe
from foresee_dsl.report.terminal.tables import plain_table

_ORDER = {status: rank for rank, status in enumerate(Status)}
_WIDTH = max(len(status.label) for status in Status) + 2


def print_verification(console: Console, rechecks: Sequence[Recheck], written: Sequence[Path] | None = None) -> None:
    """Print each test that did not end as expected, then the counts.

    `written`: the files whose expected results were updated; None without `--update`.
    """
    if not rechecks:
        console.print("there are no tests: `foresee keep` writes mutants with expected results", soft_wrap=True)
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
        return (f"expected  no result is recorded for {recheck.driver}",)
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
        console.print(
            "results of crashes, timeouts and stale tests are never written, because they do not say how the test ends",
            soft_wrap=True,
        )


SHOWN = 20
"""Maximum number of test cases of each kind on the terminal; Markdown and JSON list more. Ours."""
SHOWN_IN_MARKDOWN = 100
"""Maximum number of test cases of each kind in Markdown. Ours: four such lists have fewer than the 65,536 characters
that GitHub allows in a comment."""
_TITLES = ((OutcomeChange.NEW_FAILURE, "New failures", "bold red"), (OutcomeChange.FIXED, "Fixed", "bold green"),
           (OutcomeChange.STILL_FAILING, "Still failing", "bold yellow"))  # fmt: skip


def print_comparison(console: Console, comparison: CampaignComparison) -> None:
    """Print the test cases that changed, then the figures, then the result in a sentence."""
    for name, side in (("base", comparison.base), ("new ", comparison.new)):
        console.print(Text(f"{name}  {safe(side.label)}"), soft_wrap=True)
    console.print(Text(paired(comparison)), soft_wrap=True)
    for line in (*comparison.base.broken, *comparison.new.broken):
        console.print(Text(f"could not be run: {safe(line)}", "bold red"), soft_wrap=True)
    for title, style, cases in _parts(comparison):
        console.print(Text(f"\n{title} ({len(cases)})", style))
        for name, lines in cases[:SHOWN]:
            console.print(Text("\n    ".join((f"  {safe(name)}", *lines))), soft_wrap=True)
        if len(cases) > SHOWN:
            console.print(Text(f"  and {len(cases) - SHOWN} more (`--format json` lists all)", "dim"))
    console.print()
    head = ("", "pairs", "base fails", "new fails", "new failures", "fixed", "p")
    console.print(plain_table(head, map(_figures, comparison.rows), align="<>>>>>>"))
    console.print(Text(f"\n{comparison.sentence}", "bold"), soft_wrap=True)


def to_markdown(comparison: CampaignComparison) -> str:
    """Return the comparison as a comment on a pull request."""
    return rendered(
        "report/comparison.md",
        comparison=comparison,
        paired=paired(comparison),
        parts=[(title, cases[:SHOWN_IN_MARKDOWN], len(cases)) for title, _, cases in _parts(comparison)],
        rows=[_figures(row) for row in comparison.rows],
    )


def _parts(comparison: CampaignComparison) -> Iterator[tuple[str, str, Sequence[tuple[str, Sequence[str]]]]]:
    """Yield the kinds of changes that occur: title, style, and each test case with the lines about it."""
    for change, title, style in _TITLES:
        if pairs := comparison.of(change):
            yield title, style, [(pair.new.name, endings(pair)) for pair in pairs]
    if comparison.nearer:
        near_misses = [(pair.new.name, [nearer(pair.nearer)]) for pair in comparison.nearer]
        yield "Near misses that came nearer", "bold", near_misses


def paired(comparison: CampaignComparison) -> str:
    """Return in words how many test cases both sides have, and how many are on one side only or were edited."""
    parts = [f"{counted(len(comparison.pairs), 'test case')} on both sides"]
    counts = (
        (comparison.only_base, "only in base"),
        (comparison.only_new, "only in new"),
        (comparison.edited, "with another meaning there"),
    )
    parts += [f"{len(names)} {words}" for names, words in counts if names]
    return ", ".join(parts)


def endings(pair: Pair) -> tuple[str, ...]:
    """Return how a test case ended with the new version and, if that differs, with the base version."""
    now, was = safe(pair.new.reason or pair.new.verdict.label), safe(pair.base.reason or pair.base.verdict.label)
    return (f"now {now}", f"was {was}") if was != now else (f"as before: {now}",)


def nearer(near_miss: Nearer | None) -> str:
    """Return, in words, a near miss that came nearer: `time to collision 2.10 s => 0.60 s, with walker`."""
    if near_miss is None:
        return ""
    measure = MEASURES[near_miss.measure]
    was = "none" if near_miss.was is None else f"{near_miss.was:.2f} {measure.unit}"
    actor = f", with {safe(near_miss.actor)}" if near_miss.actor else ""
    return f"{measure.title} {was} => {near_miss.now:.2f} {measure.unit}{actor}"


def _figures(row: Row) -> tuple[str, ...]:
    counts = row.pairs, row.base_failed, row.new_failed, row.new_failures, row.fixed
    return (row.label, *map(str, counts), f"{row.p:.2g}")
