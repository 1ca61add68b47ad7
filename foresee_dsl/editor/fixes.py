"""Quick fixes: for every text that a diagnostic's help suggests, the edit that makes the diagnostic go away."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from foresee_dsl.editor.positions import Positions
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.messages.suggest import replacement

_SUGGESTED = re.compile(r"`([^`\n]+)`")
_MOST_TRIED = 12
"""So many edits are tried for one diagnostic at most (ours: each is a check of the file, 20 to 80 ms)."""

Check = Callable[[str], tuple[Diagnostic, ...]]
"""Returns what is wrong with a text."""


@dataclass(frozen=True)
class Fix:
    """An edit: what is written, where, and what it is called."""

    title: str
    span: Span
    text: str


def fixes(message: str, code: str, span: Span, positions: Positions, check: Check) -> tuple[Fix, ...]:
    """Return what a diagnostic (its message with the help) offers; each was tried, and leaves one mistake less.

    Args:
        message, code, span: of the diagnostic. positions: of the text. check: says what is wrong with a text.
    """
    text = "\n".join(positions.lines)
    written = text[positions.offset_of(span.line, span.column) : positions.offset_of(span.end_line, span.end_column)]
    meant = replacement(message, written) if span.line == span.end_line else None
    if meant is not None:
        start, end, right = meant
        where = Span(span.line, span.column + start, span.line, span.column + end)
        return (Fix(f"Write '{right}'", where, right),)
    suggested = list(dict.fromkeys(_SUGGESTED.findall(message.partition("\n")[2])))
    suggested = [one for one in suggested if not one.startswith("foresee ") or one == "foresee 1"]
    found: dict[str, Fix] = {}
    tried = 0
    before = _keys(check(text)) if suggested else []
    first = message.partition("\n")[0]
    for words in suggested:
        for fix in _ways(words, span, positions):
            tried += 1
            if tried > _MOST_TRIED or words in found:
                break
            left = _keys(check(applied(text, positions, fix)))
            if (code, first) not in left and len(left) < len(before):
                found[words] = fix
    return tuple(found.values())


def applied(text: str, positions: Positions, fix: Fix) -> str:
    """Return a text with an edit made."""
    start = positions.offset_of(fix.span.line, fix.span.column)
    end = positions.offset_of(fix.span.end_line, fix.span.end_column)
    return text[:start] + fix.text + text[end:]


def _ways(words: str, span: Span, positions: Positions) -> Iterator[Fix]:
    """Yield the edits by which a suggested text can be put in: in the place of what is marked, behind it, before it,
    and as a statement of its own."""
    yield Fix(f"Write `{words}`", span, words)
    end = Span(span.end_line, span.end_column, span.end_line, span.end_column)
    yield Fix(f"Add `{words}`", end, f" {words}")
    start = Span(span.line, span.column, span.line, span.column)
    yield Fix(f"Add `{words}`", start, f"{words} ")
    line = positions.lines[span.line - 1]
    rest = Span(span.line, span.column, span.line, len(line.partition("#")[0].rstrip()) + 1)
    yield Fix(f"Write `{words}`", rest, words)
    statement = Span(span.line, len(line) - len(line.lstrip()) + 1, span.line, len(line.partition("#")[0].rstrip()) + 1)
    yield Fix(f"Write `{words}`", statement, words)
    inner = " " * (len(line) - len(line.lstrip()) + 2)
    brace = line.find("{", span.column - 1)
    if brace >= 0:  # the first statement of the block that begins here
        place = Span(span.line, brace + 2, span.line, brace + 2)
        yield Fix(f"Add `{words}`", place, f"\n{inner}{words}")
    else:
        place = Span(span.line, len(line) + 1, span.line, len(line) + 1)
        yield Fix(f"Add `{words}`", place, f" {{ {words} }}")
    last = next((k for k in range(len(positions.lines), 0, -1) if positions.lines[k - 1].startswith("}")), None)
    if last is not None:
        yield Fix(f"Add `{words}`", Span(last, 1, last, 1), f"  {words}\n")


def _keys(found: tuple[Diagnostic, ...]) -> list[tuple[str, str]]:
    return [(one.code, one.message) for one in found if one.severity == "error"]
