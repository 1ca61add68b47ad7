"""Tables, durations and the details of a run for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.verdicts import rule_lines, unfired_lines
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import ExpectationResult, Impact, RunResult


def plain_table(
    headings: Sequence[str], rows: Iterable[Sequence[object]], *, align: str = "", title: str = "", gap: int = 2
) -> Table:
    """Return a table without lines, with `gap` spaces between columns.

    `align`: `<` or `>` for each column; by default the first column is left-aligned, the others are right-aligned.
    """
    table = Table(
        title=title or None, title_justify="left", title_style="bold", box=None, pad_edge=False, padding=(0, gap, 0, 0)
    )
    for k, heading in enumerate(headings):
        left = align[k] == "<" if align else k == 0
        table.add_column(heading, justify="left" if left else "right", no_wrap=bool(title))
    for row in rows:
        table.add_row(*map(str, row))
    return table


def duration(seconds: float) -> str:
    """Return a duration as `m:ss`, or `h:mm:ss` from one hour on."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def print_run_details(console: Console, result: RunResult, *, triggers: bool = True) -> None:
    """Print the contact that ended a run, its near misses, the largest deviation from the driver's trajectories, the
    traffic rules that the ego broke, and its expectations; with `triggers` also the triggers that never fired."""
    rules = (f"  {line}" for line in rule_lines(result.infractions))
    tracking = () if result.tracking is None else (f"  tracking  {result.tracking.sentence}",)
    for detail in (*_impact_lines(result.impact), *near_lines(result.near_misses), *tracking, *rules):
        console.print(Text(safe(detail), style="dim"), soft_wrap=True)
    for expectation in result.expectations:
        console.print(_expectation_line(expectation), soft_wrap=True)
    for line in unfired_lines(result.unfired if triggers else (), console.width if console.is_terminal else 0):
        console.print(line, soft_wrap=True)


def _impact_lines(impact: Impact | None) -> list[str]:
    if impact is None:
        return []
    along = f"{abs(impact.ahead_m):.1f} m {'ahead of' if impact.ahead_m >= 0 else 'behind'} the ego's centre"
    across = f"{abs(impact.left_m):.1f} m to the {'left' if impact.left_m >= 0 else 'right'}"
    return [
        f"  impact    {impact.relative_mps:.1f} m/s ({impact.closing_mps:.1f} m/s onto each other), the ego's speed "
        f"{impact.ego_mps:.1f} m/s",
        f"            {impact.struck}; headings {abs(math.degrees(impact.turned_rad)):.0f} deg apart",
        f"            at the ego's {impact.side} ({along}, {across}), the other's {impact.other_side}",
    ]


_NEAR = (
    ("distance_m", "nearest", "{:.2f} m"),
    ("ttc_s", "TTC", "{:.2f} s"),
    ("pet_s", "PET", "{:.2f} s"),
    ("drac_mps2", "braking", "{:.1f} m/s^2 needed"),
)
"""The measures of near misses: field, title, and format of the value."""


def near_lines(near: NearMisses) -> list[str]:
    """Return a line for each measure of how near a run came to a failure."""
    lines = []
    for name, title, form in _NEAR:
        near_miss: NearMiss | None = getattr(near, name)
        if near_miss is None:
            continue
        value = form.format(near_miss.value) if math.isfinite(near_miss.value) else "none would have been enough"
        lines.append(f"  {title:<9} {value} at {near_miss.time_s:.2f} s, {near_miss.actor}")
    return lines


def _expectation_line(expectation: ExpectationResult) -> Text:
    """Return the line of an expectation: its label, whether it held, its margin, and the condition that decided."""
    mark = Text("  held    ", style="green") if expectation.held else Text("  BROKEN  ", style="red")
    mark.append(safe(expectation.text), style="default")
    if expectation.margin is not None:
        margin = f"{expectation.margin:.2f} {expectation.unit}".rstrip()
        # The text of the expectation already contains the condition.
        alone = expectation.text.endswith(f" {expectation.decides}")
        mark.append(f"  (by {margin})" if alone else f"  (by {margin}: {expectation.decides})", style="dim")
    return mark


def print_points(console: Console, points: tuple[RiskyPoint, ...]) -> None:
    """Print a ranked list of risky points."""
    if not points:
        console.print("no risky points: no actor came near the ego")
        return
    rows = ((p.rank, f"{p.time_s:.2f} s", p.frame, p.why) for p in points)
    console.print(plain_table(("rank", "time", "frame", "why"), rows, align=">>><"))
