"""The terminal: reports of campaigns and of runs."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from foresee_dsl.campaign.results import CampaignResult, FamilyRow
from foresee_dsl.derive.preventability import Preventable
from foresee_dsl.files import write_whole
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.verdicts import verdicts_line
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import COLLISIONS, FAILURES, ExpectationResult, Impact, RunResult, Verdict

FAMILY_TITLES = {
    "3": "crossing actor",
    "4": "obstacle after a turn",
    "7": "red-light runner",
    "8": "unprotected left",
    "9": "right turn into traffic",
}
"""The paper's five scenarios in a few words (table of scenarios)."""


def save_campaign(file: Path, result: CampaignResult, out: Path) -> None:
    """Write the report to a file: an SVG picture, HTML, or plain text, by the file's suffix."""
    console = Console(record=True, width=100, file=io.StringIO(), highlight=False)
    print_campaign(console, result, out)
    texts = {
        ".svg": lambda: console.export_svg(title="foresee campaign"),
        ".html": lambda: console.export_html(inline_styles=True),
    }
    write_whole(file, texts.get(file.suffix, console.export_text)())


def plain_table(
    headings: Sequence[str], rows: Iterable[Sequence[object]], *, align: str = "", title: str = "", gap: int = 2
) -> Table:
    """Return a table without lines, with `gap` spaces between columns.

    `align`: a sign for each column, `<` or `>`; by default the first is left-aligned, the others right-aligned.
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


def print_campaign(console: Console, result: CampaignResult, out: Path, *, raw: bool = False) -> None:  # noqa: ARG001
    """Print the report of a campaign: headline, tables by family, fidelity, and the files to open first.

    It fits 80 columns.
    """
    total = result.row()
    rows = [*(result.row(family) for family in result.families), total]
    kinds = ", ".join(f"{kind.value} {kind.label}" for kind in COLLISIONS)
    seeds = [seed.verdict for seed in result.seeds]
    reasons = [seed.reason for seed in result.seeds if seed.verdict is not Verdict.PASS]
    parts: list[Text | Table] = [
        Text.assemble("\n", verdicts_line(seeds, reasons)),
        _headline(result, total),
        _counts_table(rows),
        _failures_table(rows),
        *([_avoidable_table(result)] if total.failed else []),
        Text(f"{kinds};\nper risky point that was clipped, per simulated hour", style="dim"),
        _fidelity_line(result),
        *_failing_test_cases(result),
        *_open_first(result, out),
    ]
    if result.interrupted:
        parts.append(Text(f"\nInterrupted: what was finished is kept in {out}.", style="yellow"))
    console.print(Group(*parts))


def _headline(result: CampaignResult, total: FamilyRow) -> Text:
    settings = result.settings
    text = Text.assemble((f"\n{total.failed} failures", "bold red" if total.failed else "bold green"))
    text.append(f" in {total.children} children of {total.clips} clips from {total.cases} test cases")
    text.append(f", in {duration(result.wall_s)}")
    if total.failed:
        avoidable = result.avoidable()
        counts = ", ".join(f"{count} {answer.value}" for answer, count in avoidable.items())
        text.append(f"\n{counts}", style="bold red" if avoidable[Preventable.YES] else "bold")
        text.append(" for a careful driver who brakes")
    length = settings.before_s + settings.after_s
    text.append(
        f"\ndriver {settings.driver}, ranker {settings.ranker}, preset {settings.preset}, clips of {length:g} s, "
        f"{settings.risky_points} risky points x {settings.children} children, seed {settings.seed}\n",
        style="dim",
    )
    return text


def _family(row: FamilyRow) -> str:
    if row.family == "all":
        return "all"
    return f"{row.family} {FAMILY_TITLES.get(row.family, '')}".strip() or "(no family)"


def _counts_table(rows: Sequence[FamilyRow]) -> Table:
    table = plain_table(
        ("scenario family", "cases", "failed", "points", "clips", "children", "simulated", "time"),
        ((_family(r), r.cases, r.cases_failed, r.risky_points, r.clips, r.children, duration(r.simulated_s),
          duration(r.wall_s)) for r in rows),
        title="What was run (times in minutes:seconds)",
        gap=1,
    )  # fmt: skip
    table.rows[-1].style = "bold"
    return table


def _failures_table(rows: Sequence[FamilyRow]) -> Table:
    table = plain_table(
        ("scenario family", *(kind.value for kind in FAILURES), "all", "per point", "per hour"),
        ((_family(r), *(_dim_zero(r.failures[kind.value]) for kind in FAILURES), f"[bold]{r.failed}[/bold]",
          f"{r.per_risky_point:.2f}", f"{r.per_simulated_hour:.0f}") for r in rows),
        title="\nFailures of children",
        gap=1,
    )  # fmt: skip
    table.rows[-1].style = "bold"
    return table


def _avoidable_table(result: CampaignResult) -> Table:
    by_kind, everything = [result.avoidable(kind) for kind in FAILURES], result.avoidable()
    return plain_table(
        ("", *(kind.value for kind in FAILURES), "all"),
        ((answer.value, *(_dim_zero(found[answer]) for found in by_kind), f"[bold]{everything[answer]}[/bold]")
         for answer in Preventable),
        title="\nFor a careful driver who brakes",
        gap=1,
    )  # fmt: skip


def _dim_zero(count: int) -> str:
    return str(count) if count else "[dim]0[/dim]"


def _fidelity_line(result: CampaignResult) -> Text:
    clips = result.clips
    if not clips:
        return Text("\nNo clips.")
    found = result.fidelity
    mutated = sum(bool(c.children) for c in clips)
    return Text(
        f"\nFidelity of the {len(clips)} unmutated clips with {result.settings.driver}, largest deviation from the "
        f"parent's run:\n  other actors: {found.others_median_m:.2f} m in the median, {found.others_within:.1%} within "
        f"0.1 m, {found.others_max_m:.2f} m at most\n  the ego: {found.ego_median_m:.2f} m in the median, "
        f"{found.ego_max_m:.2f} m at most\n{mutated} of {len(clips)} clips were mutated.",
    )


def _failing_test_cases(result: CampaignResult) -> list[Text]:
    failed = [s for s in result.seeds if s.verdict is not Verdict.PASS]
    lines = [Text("\nNot usable (the test case already fails without mutation):", style="bold")] if failed else []
    for seed in failed:
        lines.append(Text(f"  {seed.id}: {seed.reason}"))
        if seed.preventability:
            lines.append(Text(f"    {seed.preventability.verdict.value}: {seed.preventability.why}"))
    return lines


def _open_first(result: CampaignResult, out: Path) -> list[Text]:
    children = result.to_open_first()
    lines = [Text("\nOpen these first:", style="bold")] if children else []
    for child in children:
        found = f"\n    {child.reason} ({', '.join(child.operators)})"
        line = Text.assemble("  ", (str(out / child.file), "cyan"), found)
        if child.preventability:
            line.append(f"\n    {child.preventability.verdict.value}: {child.preventability.why}")
        lines.append(line)
    return lines


def duration(seconds: float) -> str:
    """Return minutes and seconds as `m:ss`, with hours in front where there are any."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def print_run_details(console: Console, result: RunResult) -> None:
    """Print the contact that a run ended with, how near it came to others, and which expectations held."""
    for detail in (*_impact_lines(result.impact), *_near_lines(result.near_misses)):
        console.print(Text(safe(detail), style="dim"), soft_wrap=True)
    for expectation in result.expectations:
        console.print(_expectation_line(expectation), soft_wrap=True)


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
"""The measures of near misses: field, what it is called, and how its value is written."""


def _near_lines(near: NearMisses) -> list[str]:
    lines = []
    for name, called, form in _NEAR:
        found: NearMiss | None = getattr(near, name)
        if found is None:
            continue
        value = form.format(found.value) if math.isfinite(found.value) else "none would have been enough"
        lines.append(f"  {called:<9} {value} at {found.time_s:.2f} s, {found.actor}")
    return lines


def _expectation_line(expectation: ExpectationResult) -> Text:
    """Return whether it held, as written (its label is part of that), by how much, and what decided."""
    mark = Text("  held    ", style="green") if expectation.held else Text("  BROKEN  ", style="red")
    mark.append(safe(expectation.text), style="default")
    if expectation.margin is not None:
        margin = f"{expectation.margin:.2f} {expectation.unit}".rstrip()
        alone = expectation.text.endswith(f" {expectation.decides}")  # then it need not be written twice
        mark.append(f"  (by {margin})" if alone else f"  (by {margin}: {expectation.decides})", style="dim")
    return mark


def print_points(console: Console, points: tuple[RiskyPoint, ...]) -> None:
    """Print a ranked list of risky points."""
    if not points:
        console.print("no risky points: no actor came near the ego")
        return
    rows = ((p.rank, f"{p.time_s:.2f} s", p.frame, p.why) for p in points)
    console.print(plain_table(("rank", "time", "frame", "why"), rows, align=">>><"))
