"""Renders differences as text for a terminal (80 columns) and as markdown for a pull request."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Sequence

from foresee_dsl.language import model as m
from foresee_dsl.language.diff.parts import GROUPS, Difference, Group, once
from foresee_dsl.language.diff.plain import TextChange

_WIDTH = 80
_MARKS = {"changed": "~", "added": "+", "removed": "-", "renamed": "=", "moved": "^"}
_COLOURS = {"changed": "33", "added": "32", "removed": "31", "renamed": "36", "moved": "36"}
"""ANSI colours: yellow, green, red, cyan."""
_BOLD = "1"
_FOR_PEOPLE = tuple(m.rule_of(kind) for kind in m.FOR_PEOPLE)
"""Words of the statements for people: a report only names them and does not print their texts."""
_LONG_LIST = 12
"""Number of differences from which a group in a pull request's comment is folded (ours: more than a screen shows)."""


def render_groups(changes: Sequence[Difference], texts: Sequence[TextChange] = (), *, colour: bool = False) -> str:
    """Return the differences as text, by group, in 80 columns; `texts` are the differences without a change of
    meaning."""
    blocks = []
    for group, members in _grouped(changes):
        lines = [_paint(GROUPS[group], _BOLD, colour)]
        for change in members:
            lines += [_paint(line, _COLOURS[change.kind], colour) for line in _lines(change)]
        blocks.append("\n".join(lines))
    if not changes:
        blocks.append("no difference in meaning")
    if texts:
        blocks.append(f"No change of meaning: {', '.join(map(_unmeant, texts))}")
    return "\n\n".join(blocks) + "\n"


def render_markdown(
    changes: Sequence[Difference], texts: Sequence[TextChange] = (), *, old: str = "", new: str = ""
) -> str:
    """Return the differences for a pull request's comment: a heading and a table for each group, long parts folded."""
    parts = [f"**`{old}`** → **`{new}`**"] if old else []
    for group, members in _grouped(changes):
        table = _table(members)
        if len(members) >= _LONG_LIST:
            table = f"<details><summary>{len(members)} differences</summary>\n\n{table}\n\n</details>"
        parts += [f"### {GROUPS[group]}", table]
        parts += [_code_block(change) for change in members if _is_long(change)]
    if not changes:
        parts.append("No difference in meaning.")
    if texts:
        parts.append(f"<sub>No change of meaning: {', '.join(_code(label) for label, _, _ in texts)}</sub>")
    return "\n\n".join(parts) + "\n"


def _unmeant(change: TextChange) -> str:
    """Return the label of a change that does not change the meaning; if a value is written differently, also its old
    and new form."""
    if change.was is None or change.now is None or change.path.split()[0] in _FOR_PEOPLE:
        return change.path
    return f"{change.path} ({change.was} is {change.now})"


def _grouped(changes: Sequence[Difference]) -> list[tuple[Group, list[Difference]]]:
    grouped = [(group, [change for change in changes if change.group == group]) for group in GROUPS]
    return [(group, mine) for group, mine in grouped if mine]


# ---- text ----------------------------------------------------------------------------------------------------------


def _lines(change: Difference) -> list[str]:
    if _is_long(change):
        return _statements(change)
    line = f"  {_MARKS[change.kind]} {_sentence(change)}"
    if len(line) <= _WIDTH:
        return [line]
    labelled = [(word, text) for word, text in (("was ", change.was), ("now ", change.now)) if text is not None]
    below = [f"      {word if len(labelled) > 1 else ''}{text}" for word, text in labelled]
    return [*_wrapped(_heading(change), "      "), *(line for text in below for line in _wrapped(text, " " * 10))]


def _sentence(change: Difference) -> str:
    if change.kind == "renamed":
        return f"{change.was} => {change.now} (renamed)"
    if change.kind in ("added", "removed"):
        return once(change.path, change.now if change.kind == "added" else change.was)
    return f"{change.path}: {change.was} => {change.now}{_note(change)}"


def _heading(change: Difference) -> str:
    return f"  {_MARKS[change.kind]} {change.path}{_note(change)}"


def _note(change: Difference) -> str:
    return f" ({change.note})" if change.note else ""


def _wrapped(line: str, indent: str) -> list[str]:
    return textwrap.wrap(
        line, _WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )  # an id that is longer than the line stays whole


def _statements(change: Difference) -> list[str]:
    """Return the lines of a change of whole blocks. A block whose first line contains the path gets no heading."""
    statements = [text for text in (change.was, change.now) if text is not None]
    first, *rest = statements[0].split("\n")
    if len(statements) == 1 and change.path in first:
        return [f"  {_MARKS[change.kind]} {first}", *(f"    {line}" for line in rest)]
    lines = [_heading(change)]
    for word, text in zip(("was", "now") if len(statements) > 1 else ("",), statements, strict=True):
        lines += [f"      {word}"] if word else []
        lines += [f"      {line}" for line in text.split("\n")]
    return lines


def _is_long(change: Difference) -> bool:
    return any(side is not None and "\n" in side for side in (change.was, change.now))


def _paint(line: str, code: str, colour: bool) -> str:
    return f"\033[{code}m{line}\033[0m" if colour else line


# ---- markdown ------------------------------------------------------------------------------------------------------


def _table(changes: Sequence[Difference]) -> str:
    rows = ["| | where | was | now | |", "| --- | --- | --- | --- | --- |"]
    rows += [f"| {change.kind} | {_code(change.path)} | {_cell(change.was)} | {_cell(change.now)} | {change.note} |"
             for change in changes]  # fmt: skip
    return "\n".join(rows)


def _cell(text: str | None) -> str:
    if text is None:
        return ""
    return "see below" if "\n" in text else _code(text)


def _code(text: str) -> str:
    """Return text as code that a table's cell can hold."""
    fence = "``" if "`" in text else "`"
    pad = " " if "`" in text else ""
    return f"{fence}{pad}{text}{pad}{fence}".replace("|", "\\|") if text else ""


def _code_block(change: Difference) -> str:
    lines = [f"- {line}" for line in change.was.split("\n")] if change.was is not None else []
    lines += [f"+ {line}" for line in change.now.split("\n")] if change.now is not None else []
    fence = "```"
    while any(fence in line for line in lines):  # a string in the file may contain the fence
        fence += "`"
    body = "\n".join(lines)
    summary = html.escape(change.path, quote=False)
    return f"<details><summary>{summary}</summary>\n\n{fence}diff\n{body}\n{fence}\n\n</details>"
