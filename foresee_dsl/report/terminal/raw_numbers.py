"""The terminal report with all numbers of a campaign, by family and kind of failure (`--raw`)."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from foresee_dsl.avoidance.judge import R157
from foresee_dsl.avoidance.r157.assessing import Preventable
from foresee_dsl.campaign.results import CampaignResult, FamilyRow
from foresee_dsl.report.safe_text import counted
from foresee_dsl.report.terminal.tables import duration, plain_table
from foresee_dsl.simulate.results.verdict import COLLISIONS, Verdict

FAMILY_TITLES = {
    "3": "crossing actor",
    "4": "obstacle after a turn",
    "7": "red-light runner",
    "8": "unprotected left",
    "9": "right turn into traffic",
}
"""The paper's five scenarios in a few words (table of scenarios)."""


def raw_numbers(result: CampaignResult) -> list[Text | Table]:
    """Return tables of 80 columns: runs, failures, preventable failures, and how well clips reproduce their parents."""
    total = result.row()
    rows = [*(result.row(family) for family in result.families), total]
    kinds = ", ".join(f"{kind.value} {kind.label}" for kind in COLLISIONS)
    return [
        _counts_table(rows),
        _failures_table(rows, result.kinds),
        *([_avoidable_table(result)] if total.failed else []),
        Text(f"{kinds};\nper risky point that was clipped, per simulated hour", style="dim"),
        _fidelity_line(result),
    ]


def family_title(family: str) -> str:
    """Return the number and the title of a scenario family."""
    return f"{family} {FAMILY_TITLES.get(family, '')}".strip() or "(no family)"


def _family(row: FamilyRow) -> str:
    return "all" if row.family == "all" else family_title(row.family)


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


def _failures_table(rows: Sequence[FamilyRow], kinds: Sequence[Verdict]) -> Table:
    table = plain_table(
        ("scenario family", *(kind.value for kind in kinds), "all", "per point", "per hour"),
        ((_family(r), *(_dim_zero(r.failures[kind.value]) for kind in kinds), f"[bold]{r.failed}[/bold]",
          f"{r.per_risky_point:.2f}", f"{r.per_simulated_hour:.0f}") for r in rows),
        title="\nFailures of children",
        gap=1,
    )  # fmt: skip
    table.rows[-1].style = "bold"
    return table


def _avoidable_table(result: CampaignResult) -> Table:
    by_kind, everything = [result.avoidable(kind) for kind in result.kinds], result.avoidable()
    return plain_table(
        ("", *(kind.value for kind in result.kinds), "all"),
        ((answer.value, *(_dim_zero(counts[answer]) for counts in by_kind), f"[bold]{everything[answer]}[/bold]")
         for answer in Preventable),
        title=f"\nFor {R157}",
        gap=1,
    )  # fmt: skip


def _dim_zero(count: int) -> str:
    return str(count) if count else "[dim]0[/dim]"


def _fidelity_line(result: CampaignResult) -> Text:
    clips, fidelity = result.clips, result.fidelity
    if not fidelity.clips:
        return Text(f"\n{counted(len(clips), 'clip')} mutated; none failed." if clips else "\nNo clips.")
    mutated = sum(bool(c.children) for c in clips)
    return Text(
        f"\nFidelity of the {fidelity.clips} unmutated clips with {result.settings.driver}, largest deviation from the "
        f"parent's run:\n  other actors: {fidelity.others_median_m:.2f} m in the median, "
        f"{fidelity.others_within:.1%} within 0.1 m, {fidelity.others_max_m:.2f} m at most\n"
        f"  the ego: {fidelity.ego_median_m:.2f} m in the median, "
        f"{fidelity.ego_max_m:.2f} m at most\n{mutated} of {len(clips)} clips were mutated.",
    )
