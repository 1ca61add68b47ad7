"""Two versions of a driver compared: for the terminal, and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.text import Text

from foresee_dsl.campaign.regression.comparison import MEASURES, Change, Comparison, Nearer, Pair, Row
from foresee_dsl.files import rendered
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.tables import plain_table

SHOWN = 20
"""How many test cases of each kind the terminal lists (ours); Markdown and JSON list more."""
SHOWN_IN_MARKDOWN = 100
"""Ours: four such lists are under the 65,536 characters that a comment on GitHub may have."""
_TITLES = ((Change.NEW_FAILURE, "New failures", "bold red"), (Change.FIXED, "Fixed", "bold green"),
           (Change.STILL_FAILING, "Still failing", "bold yellow"))  # fmt: skip


def print_comparison(console: Console, found: Comparison) -> None:
    """Print what changed, then the figures, then the result in a sentence."""
    for name, side in (("base", found.base), ("new ", found.new)):
        console.print(Text(f"{name}  {safe(side.label)}"), soft_wrap=True)
    console.print(Text(paired(found)), soft_wrap=True)
    for line in (*found.base.broken, *found.new.broken):
        console.print(Text(f"could not be run: {safe(line)}", "bold red"), soft_wrap=True)
    for change, title, style in _TITLES:
        _print_pairs(console, found.of(change), title, style)
    if found.nearer:
        console.print(Text(f"\nNear misses that came nearer ({len(found.nearer)})", "bold"))
        for pair in found.nearer[:SHOWN]:
            console.print(Text(f"  {safe(pair.new.name)}\n    {nearer(pair.nearer)}"), soft_wrap=True)
        _print_more(console, len(found.nearer))
    console.print()
    head = ("", "pairs", "base fails", "new fails", "new failures", "fixed", "p")
    console.print(plain_table(head, map(_figures, found.rows), align="<>>>>>>"))
    console.print(Text(f"\n{found.sentence}", "bold"), soft_wrap=True)


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


def to_markdown(found: Comparison) -> str:
    """Return the comparison as a comment on a pull request."""
    parts = [(title, [(pair.new.name, endings(pair)) for pair in found.of(change)]) for change, title, _ in _TITLES]
    parts.append(("Near misses that came nearer", [(pair.new.name, (nearer(pair.nearer),)) for pair in found.nearer]))
    return rendered(
        "report/comparison.md",
        found=found,
        paired=paired(found),
        parts=[(title, cases[:SHOWN_IN_MARKDOWN], len(cases)) for title, cases in parts if cases],
        rows=[_figures(row) for row in found.rows],
    )


def paired(found: Comparison) -> str:
    """Return how many test cases both sides have, and what became of the others."""
    parts = [f"{len(found.pairs)} test cases on both sides"]
    counts = (
        (found.only_base, "only in base"),
        (found.only_new, "only in new"),
        (found.edited, "with another meaning there"),
    )
    parts += [f"{len(names)} {words}" for names, words in counts if names]
    return ", ".join(parts)


def endings(pair: Pair) -> tuple[str, ...]:
    """Return how a test case ended: on the new side, and on the base's where that says more."""
    now, was = safe(pair.new.reason or pair.new.verdict.label), safe(pair.base.reason or pair.base.verdict.label)
    return (f"now {now}", f"was {was}") if was != now else (f"as before: {now}",)


def nearer(found: Nearer | None) -> str:
    """Return `time to collision 2.10 s => 0.60 s, with walker`."""
    if found is None:
        return ""
    measure = MEASURES[found.measure]
    was = "none" if found.was is None else f"{found.was:.2f} {measure.unit}"
    who = f", with {safe(found.actor)}" if found.actor else ""
    return f"{measure.title} {was} => {found.now:.2f} {measure.unit}{who}"


def _figures(row: Row) -> tuple[str, ...]:
    return tuple(_cells(row))


def _cells(row: Row) -> Iterator[str]:
    yield row.label
    yield from map(str, (row.pairs, row.base_failed, row.new_failed, row.new_failures, row.fixed))
    yield f"{row.p:.2g}"
