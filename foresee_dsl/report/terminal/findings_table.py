"""The table of findings on a terminal: one line a finding, under the judgement on it. No text is cut.

A line that is too long for the terminal goes on in the next one.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from rich.text import Text

from foresee_dsl.campaign.records import WrittenFinding
from foresee_dsl.campaign.triage.standing import Since, Standing
from foresee_dsl.report.safe_text import safe

_CHANGE = "smallest change"
_LONGEST_CHANGE = 24
"""Maximum width of the column of changes, columns. Ours: nearly all fit; a longer one begins before it.
"""
_SINCE = {Since.NEW: "new", Since.STILL: "still", Since.FIRST: ""}
"""The column of the table that says whether the campaign before found a story."""


@dataclass(frozen=True)
class FindingRow:
    """A finding in the table.

    Attributes:
        change: its first change. since: what became of its story since the campaign before; "" if there is nothing to
            say.
    """

    record: WrittenFinding
    change: str
    since: str = ""

    @classmethod
    def of(cls, record: WrittenFinding, standing: Standing, changes: Sequence[str] | None) -> FindingRow:
        """Return the row of a finding. `changes`: those of its mutant; () for a test case, None if not known."""
        return cls(record, "" if changes is None else _change(changes), _since(record.story, standing))

    @property
    def code(self) -> str:
        """Return its verdict, or how many of its runs fail."""
        return self.record.rate or self.record.verdict.value

    @property
    def whose(self) -> str:
        """Return whose failure it is, in words; "" without a judgement."""
        return self.record.judgement.text if self.record.judgement is not None else ""


def _since(story: str, standing: Standing) -> str:
    """Return a word for what became of a story: how it was triaged, or whether the campaign before found it."""
    decision = standing.decisions.get(story)
    return decision.triage.text if decision is not None else _SINCE[standing.of(story)]


def _change(changes: Sequence[str]) -> str:
    """Return the first of a mutant's changes, shortened, such as `walker.timing 1.23`."""
    if not changes:
        return "as written"
    what, _, values = changes[0].partition(": ")
    now = values.partition("=> ")[2].split(" from ")[0]
    return f"{what} {now}" + (f" +{len(changes) - 1}" if len(changes) > 1 else "")


def table_lines(rows: Sequence[FindingRow], width: int, room: int | None = None) -> tuple[list[Text], int]:
    """Return the lines of the table, and the number of findings that are in it.

    Args:
        rows: the findings, sorted by judgement. width: columns of the terminal. room: maximum number of lines; None for
            no limit.
    """
    if not rows:
        return [], 0
    columns = _Columns.of(rows, width)
    lines, count = [columns.head()], 0
    for whose, group in groupby(rows, key=lambda row: row.whose):
        for first, row in enumerate(group):
            more = [] if first else [Text(f"     {whose}", style="dim")]
            more += columns.lines(row)
            if room is not None and len(lines) + len(more) > room:
                return lines, count
            lines, count = lines + more, count + 1
    return lines, count


@dataclass(frozen=True)
class _Columns:
    """The columns of the table. `since`: width of the column with what became of a story. `title`, `change`: where the
    titles and the changes begin.
    """

    since: int
    title: int
    change: int
    width: int

    @classmethod
    def of(cls, rows: Sequence[FindingRow], width: int) -> _Columns:
        since = max(len(row.since) for row in rows)
        since = max(since, len("since")) + 2 if since else 0
        title = 5 + since + 7
        change = min(max(len(_CHANGE), *(len(safe(row.change)) for row in rows)), _LONGEST_CHANGE)
        longest = max(len("what happens"), *(len(safe(row.record.title)) for row in rows))
        return cls(since, title, min(title + longest + 2, max(width - change, title + 20)), width)

    def head(self) -> Text:
        since = f"{'since' if self.since else '':<{self.since}}"
        return Text(f"{f'  #  {since}code   what happens':<{self.change}}{_CHANGE}", style="dim")

    def lines(self, row: FindingRow) -> list[Text]:
        """Return the lines of a finding."""
        first, *others = textwrap.wrap(safe(row.record.title), self.width - self.title, break_on_hyphens=False) or [""]
        start = Text(f"{row.record.number:>3}  {row.since:<{self.since}}")
        start.append(f"{row.code:<5}  ", "red").append(first, "bold")
        lines = [start, *(Text(" " * self.title).append(title, "bold") for title in others)]
        change, last = safe(row.change), lines[-1]
        if last.cell_len + 2 + len(change) > self.width:
            lines.append(last := Text())
        # In its column, or as far to the left of it as the change is too long for it.
        place = max(min(self.change, self.width - len(change)), last.cell_len and last.cell_len + 2)
        last.append(f"{'':{place - last.cell_len}}{change}" if change else "")
        return lines
