"""The terminal report of a profile: the time of a command by part of the tool, and the share of it that the driver
takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

from rich.console import Console
from rich.text import Text

from foresee_dsl.campaign.profiling.profile import PartTime, Profile
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.tables import plain_table

_LEAST = 0.0005
"""Parts with less than this share of their group's time are joined in one row. Ours: each would read 0.0 %."""
_COLUMNS = 80
"""Width of the sentence, columns: the width of the table below it, also in a pipe."""


def print_profile(console: Console, profile: Profile) -> None:
    """Print a profile: a sentence about the driver, a table of the parts, and notes on what was not measured."""
    console.print()
    console.print(Text(fill(driver_sentence(profile), _COLUMNS), style="bold"))
    of_runs = [part for part in profile.parts if part.share_of_runs is not None]
    around = [part for part in profile.parts if part.share_of_runs is None]
    rows = [*_rows("in runs", of_runs), *_rows("around them", around), _row("together", profile.parts)]
    console.print(plain_table(("part", "CPU s", "wall s", "ms/sim. s", "of runs", "of all"), rows))
    for line in _notes(profile):
        console.print(Text(line, style="dim"))


def driver_sentence(profile: Profile) -> str:
    """Return a sentence on the driver's share of a run's time."""
    if profile.driver_share is None or profile.decision_ms is None:
        return "No decision of a driver was measured."
    name = safe(", ".join(profile.drivers), 60)
    text = (
        f"Your driver ({name}) takes {profile.driver_share:.0%} of a run's time: {_ms(profile.decision_ms)} ms a "
        f"decision"
    )
    if profile.begin_s >= 0.1 * _simulating_s(profile) / profile.runs:
        text += f", and {_ms(profile.begin_s * 1000)} ms for its reset, first step and close"
    return f"{text}."


def _simulating_s(profile: Profile) -> float:
    return sum(part.wall_s for part in profile.parts if part.part.simulates)


def _notes(profile: Profile) -> list[str]:
    s = "" if profile.runs == 1 else "s"
    lines = [f"{profile.runs} run{s}, {profile.simulated_s:.0f} s simulated, {profile.wall_s:.1f} s of wall time"]
    if profile.workers > 1:
        share = profile.waited_s / (profile.waited_s + sum(part.wall_s for part in profile.parts))
        lines[0] += f"; {profile.workers} workers waited {profile.waited_s:.1f} s ({share:.0%})"
    if profile.not_measured:
        lines.append(f"{profile.not_measured} results were in the store already, so nothing was run or measured")
    return lines


def _rows(title: str, parts: Sequence[PartTime]) -> list[tuple[str, ...]]:
    """Return a row for each part, the largest time first, one row for all small parts, and the row of the sum."""
    most = sorted(parts, key=lambda part: -part.wall_s)
    least_s = _LEAST * sum(part.wall_s for part in parts)
    rows = [_row(part.title, [part]) for part in most if part.wall_s >= least_s]
    if rest := [part for part in most if part.wall_s < least_s]:
        rows.append(_row(f"{len(rest)} more", rest))
    return [*rows, _row(title, parts)] if parts else []


def _row(title: str, parts: Sequence[PartTime]) -> tuple[str, ...]:
    per_s = [part.ms_per_simulated_s for part in parts if part.ms_per_simulated_s is not None]
    of_runs = [part.share_of_runs for part in parts if part.share_of_runs is not None]
    return (
        title,
        f"{sum(part.cpu_s for part in parts):.3f}",
        f"{sum(part.wall_s for part in parts):.3f}",
        f"{sum(per_s):.2f}" if per_s else "",
        f"{sum(of_runs):.1%}" if of_runs else "",
        f"{sum(part.share for part in parts):.1%}",
    )


def _ms(value: float) -> str:
    """Return milliseconds with at least two significant digits."""
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2g}"
