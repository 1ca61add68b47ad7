"""A table of values with groups of columns, which can be shown in the terminal, as Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import groupby
from pathlib import Path

from foresee_dsl.files import templates
from foresee_study.results import total

PAGE_WIDTH = 120
"""Maximum width of a table on a page, characters. Ours: wider tables need a scroll bar on a code host's page."""
Value = str | int | float | None


class RowKind(StrEnum):
    """The kind of a row."""

    ROW = "row"
    HEADING = "heading"
    SUM = "sum"


@dataclass(frozen=True)
class Column:
    """A column.

    Attributes:
        title: its own heading. groups: headings of the groups above it, the outermost first. digits: maximum number of
            decimals.
    """

    title: str
    groups: tuple[str, ...] = ()
    digits: int = 2

    @property
    def whole_title(self) -> str:
        """Return all headings of the column, for a table with a single line of headings."""
        return ", ".join(part for part in (*self.groups, self.title) if part)

    def text(self, value: Value) -> str:
        """Return a value as text without trailing zeros; without a value, a dash."""
        if value is None:
            return "-"
        if not isinstance(value, float):
            return str(value)
        if math.isnan(value):
            return "-"
        if math.isinf(value):
            return "inf" if value > 0 else "-inf"
        text = f"{value:.{self.digits}f}"
        text = text.rstrip("0").rstrip(".") if "." in text else text
        return "0" if text in ("-0", "") else text


@dataclass(frozen=True)
class Row:
    """A row of a table: its label, and a value for each column."""

    label: str
    values: tuple[Value, ...] = ()
    kind: RowKind = RowKind.ROW


def section(heading: str, lines: Sequence[Row]) -> list[Row]:
    """Return rows below a heading; without rows, nothing."""
    return [Row(heading, kind=RowKind.HEADING), *lines] if lines else []


def family_rows(
    heading: str,
    families: Sequence[str],
    lines: Sequence[Sequence[float | None]],
    values_of: Callable[[tuple[float | None, ...]], tuple[Value, ...]] = tuple,
) -> list[Row]:
    """Return a heading, a row for each family, and the row of their sum; nothing if no line has a value. `values_of`:
    function that returns a row's values from a line.
    """
    if not any(value is not None for line in lines for value in line):
        return []
    rows = [Row(f"Scenario{f}", values_of(tuple(line))) for f, line in zip(families, lines, strict=True)]
    sums = values_of(tuple(map(total, zip(*lines, strict=True))))
    return section(heading, [*rows, Row("Σ", sums, RowKind.SUM)])


@dataclass(frozen=True)
class ShownRow:
    """A row as text: its label, its kind, and a text for each column."""

    label: str
    kind: RowKind
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        name: name of its files. title: text above it. first: heading of the labels. notes: texts below it, one sentence
            each.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    first: str = ""
    notes: tuple[str, ...] = field(default=())

    def texts(self, row: Row) -> tuple[str, ...]:
        """Return the values of a row as texts."""
        if row.kind is RowKind.HEADING:
            return ("",) * len(self.columns)
        return tuple(column.text(value) for column, value in zip(self.columns, row.values, strict=True))

    @property
    def spans(self) -> tuple[tuple[tuple[str, int], ...], ...]:
        """Return the lines of headings above those of the columns: each group with the number of columns that
        it spans.
        """
        depth = max((len(column.groups) for column in self.columns), default=0)
        return tuple(
            tuple(
                (key[-1] if key else "", len(list(group)))
                for key, group in groupby(self.columns, key=lambda column, level=level: column.groups[: level + 1])  # type: ignore[misc]
            )
            for level in range(depth)
        )

    @property
    def stacked(self) -> tuple[str, ...]:
        """Return the headings of each column as lines; a group's heading is only above its first column."""
        lines: list[tuple[str, ...]] = []
        for before, column in zip((None, *self.columns), self.columns, strict=False):
            same = before is not None and before.groups == column.groups
            inner = [
                ""
                if same or (before is not None and before.groups[: level + 1] == column.groups[: level + 1])
                else title
                for level, title in enumerate(column.groups)
            ]
            lines.append((*inner, column.title))
        return tuple("\n".join(line) for line in lines)

    @property
    def named_once(self) -> tuple[str, ...]:
        """Return the headings of each column as one line; the heading of a group is only before the group's first
        column.
        """
        lines = []
        for before, column in zip((None, *self.columns), self.columns, strict=False):
            new = () if before is not None and before.groups == column.groups else column.groups
            lines.append(": ".join(part for part in (", ".join(filter(None, new)), column.title) if part))
        return tuple(lines)

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "title": self.title,
            "columns": self.headings,
            "rows": self.shown_rows,
            "notes": self.notes,
        }

    @property
    def headings(self) -> tuple[str, ...]:
        """Return all headings of each column."""
        return tuple(column.whole_title for column in self.columns)

    @property
    def shown_rows(self) -> tuple[ShownRow, ...]:
        """Return the rows as texts."""
        return tuple(ShownRow(row.label, row.kind, self.texts(row)) for row in self.rows)

    def parts(self, width: int, *, gap: int = 1, wraps: bool = False) -> tuple[Table, ...]:
        """Return the table, split into parts of at most `width` characters.

        Groups of columns stay together, and a part with only one group has the group in its title. The notes are below
        the last part.

        Args:
            gap: characters between columns.
            wraps: whether headings are wrapped between words, as on a page.
        """
        labels = max(map(len, (self.first, *(row.label for row in self.rows))))
        parts: list[list[int]] = [[]]
        left = width - labels
        for _, indices in groupby(range(len(self.columns)), key=lambda k: self.columns[k].groups[:1] or k):
            group = list(indices)
            needed = sum(gap + self._width(k, wraps=wraps) for k in group)
            if parts[-1] and needed > left:
                parts.append([])
                left = width - labels
            parts[-1] += group
            left -= needed
        if len(parts) == 1:
            return (self,)
        return tuple(self._part(part, first=part is parts[0], last=part is parts[-1]) for part in parts)

    def _width(self, k: int, *, wraps: bool) -> int:
        heads = self.named_once[k].split() if wraps else self.stacked[k].splitlines()
        return max(map(len, (*heads, *(self.texts(row)[k] for row in self.rows))), default=0)

    def _part(self, chosen: Sequence[int], *, first: bool, last: bool) -> Table:
        columns = [self.columns[k] for k in chosen]
        title = self.title if first else f"{self.title}, continued"
        common = {column.groups[:1] for column in columns}
        if len(common) == 1 and columns[0].groups:
            title = f"{self.title}: {columns[0].groups[0]}"
            columns = [replace(column, groups=column.groups[1:]) for column in columns]
        rows = tuple(
            row if row.kind is RowKind.HEADING else replace(row, values=tuple(row.values[k] for k in chosen))
            for row in self.rows
        )
        rows = tuple(row for section in _sections(rows) if any(_has_value(row) for row in section) for row in section)
        return replace(self, title=title, columns=tuple(columns), rows=rows, notes=self.notes if last else ())

    def as_markdown(self) -> str:
        """Return the table as Markdown, with its title and notes; as several tables if it is wider than a page."""
        return "\n".join(part.one_markdown() for part in self.parts(PAGE_WIDTH, gap=3, wraps=True))

    def one_markdown(self) -> str:
        """Return the table as a single Markdown table, of any width."""
        heads = (self.first, *self.named_once)
        lines = [f"**{self.title}**", "", _barred(heads), _barred(("---", *("---:",) * len(self.columns)))]
        for row in self.rows:
            bold = row.kind is not RowKind.ROW
            cells = (row.label, *self.texts(row))
            lines.append(_barred(tuple(f"**{c}**" if bold and c else c for c in cells)))
        return "\n".join((*lines, "", *(f"{note}  " for note in self.notes[:-1]), *self.notes[-1:])).rstrip() + "\n"

    def as_csv(self) -> str:
        """Return the table as CSV, with one line of headings; headings among the rows become a column of their own."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("part", self.first or "row", *(column.whole_title for column in self.columns)))
        part = ""
        for row in self.rows:
            if row.kind is RowKind.HEADING:
                part = row.label
            else:
                texts = ("" if text == "-" else text for text in self.texts(row))
                writer.writerow((part, row.label, *texts))
        return file.getvalue()

    def as_latex(self) -> str:
        """Return the table as LaTeX in the style of the paper: with booktabs, and groups above their columns."""
        environment = templates(str(Path(__file__).parents[1] / "templates"), markup=False)
        environment.filters["tex"] = _escaped
        return environment.get_template("table.tex.j2").render(table=self, rules=tuple(self._rules()))

    def _rules(self) -> Iterator[tuple[tuple[int, int], ...]]:
        """Yield the first and last column under each group, one tuple for each line; the labels are column 1."""
        for line in self.spans:
            at, rules = 2, []
            for title, width in line:
                if title:
                    rules.append((at, at + width - 1))
                at += width
            yield tuple(rules)


def _sections(rows: Sequence[Row]) -> list[list[Row]]:
    """Return rows in sections, each of which begins with a heading."""
    sections: list[list[Row]] = []
    for row in rows:
        if not sections or row.kind is RowKind.HEADING:
            sections.append([])
        sections[-1].append(row)
    return sections


def _has_value(row: Row) -> bool:
    return any(value is not None for value in row.values)


def _barred(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


_TEX = {
    "&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "$": r"\$", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", "\\": r"\textbackslash{}", "Σ": r"$\Sigma$", "<": r"$<$", ">": r"$>$",
}  # fmt: skip


def _escaped(text: str) -> str:
    return "".join(_TEX.get(sign, sign) for sign in text)
