"""The comparison of two versions of a driver, for the terminal and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.text import Text

from foresee_dsl.campaign.regression.comparison import MEASURES, Change, Comparison, Nearer, Pair, Row
from foresee_dsl.files import rendered
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.tables import plain_table

SHOWN = 20
"""Maximum number of test cases of each kind on the terminal (ours); Markdown and JSON list more."""
SHOWN_IN_MARKDOWN = 100
"""Maximum number of test cases of each kind in Markdown. Ours: four such lists have fewer than the 65,536 characters
that GitHub allows in a comment."""
_TITLES = ((Change.NEW_FAILURE, "New failures", "bold red"), (Change.FIXED, "Fixed", "bold green"),
           (Change.STILL_FAILING, "Still failing", "bold yellow"))  # fmt: skip


def print_comparison(console: Console, comparison: Comparison) -> None:
    """Print the test cases that changed, then the figures, then the result in a sentence."""
    for name, side in (("base", comparison.base), ("new ", comparison.new)):
        console.print(Text(f"{name}  {safe(side.label)}"), soft_wrap=True)
    console.print(Text(paired(comparison)), soft_wrap=True)
    for line in (*comparison.base.broken, *comparison.new.broken):
        console.print(Text(f"could not be run: {safe(line)}", "bold red"), soft_wrap=True)
    for change, title, style in _TITLES:
        _print_pairs(console, comparison.of(change), title, style)
    if comparison.nearer:
        console.print(Text(f"\nNear misses that came nearer ({len(comparison.nearer)})", "bold"))
        for pair in comparison.nearer[:SHOWN]:
            console.print(Text(f"  {safe(pair.new.name)}\n    {nearer(pair.nearer)}"), soft_wrap=True)
        _print_more(console, len(comparison.nearer))
    console.print()
    head = ("", "pairs", "base fails", "new fails", "new failures", "fixed", "p")
    console.print(plain_table(head, map(_figures, comparison.rows), align="<>>>>>>"))
    console.print(Text(f"\n{comparison.sentence}", "bold"), soft_wrap=True)


def _print_pairs(console: Console, pairs: tuple[Pair, ...], title: str, style: str) -> None:
    if not pairs:
        return
    console.print(Text(f"\n{title} ({len(pairs)})", style))
    for pair in pairs[:SHOWN]:
        lines = "\n    ".join(endings(pair))
        console.print(Text(f"  {safe(pair.new.name)}\n    {lines}"), soft_wrap=True)
    _print_more(console, len(pairs))


def _print_more(console: Console, number: int) -> None:
    if number > SHOWN:
        console.print(Text(f"  and {number - SHOWN} more (`--format json` lists all)", "dim"))


def to_markdown(comparison: Comparison) -> str:
    """Return the comparison as a comment on a pull request."""
    parts = [
        (title, [(pair.new.name, endings(pair)) for pair in comparison.of(change)]) for change, title, _ in _TITLES
    ]
    parts.append(
        ("Near misses that came nearer", [(pair.new.name, (nearer(pair.nearer),)) for pair in comparison.nearer])
    )
    return rendered(
        "report/comparison.md",
        comparison=comparison,
        paired=paired(comparison),
        parts=[(title, cases[:SHOWN_IN_MARKDOWN], len(cases)) for title, cases in parts if cases],
        rows=[_figures(row) for row in comparison.rows],
    )


def paired(comparison: Comparison) -> str:
    """Return in words how many test cases both sides have, and how many are on one side only or were edited."""
    parts = [f"{len(comparison.pairs)} test cases on both sides"]
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
    """Return a near miss that came nearer in words: `time to collision 2.10 s => 0.60 s, with walker`."""
    if near_miss is None:
        return ""
    measure = MEASURES[near_miss.measure]
    was = "none" if near_miss.was is None else f"{near_miss.was:.2f} {measure.unit}"
    actor = f", with {safe(near_miss.actor)}" if near_miss.actor else ""
    return f"{measure.title} {was} => {near_miss.now:.2f} {measure.unit}{actor}"


def _figures(row: Row) -> tuple[str, ...]:
    return tuple(_cells(row))


def _cells(row: Row) -> Iterator[str]:
    yield row.label
    yield from map(str, (row.pairs, row.base_failed, row.new_failed, row.new_failures, row.fixed))
    yield f"{row.p:.2g}"
