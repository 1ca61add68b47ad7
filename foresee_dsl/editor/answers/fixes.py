"""Quick fixes: for every text that a diagnostic's help suggests, the edit that makes the diagnostic go away."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from foresee_dsl.editor.protocol.positions import Positions
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.messages.suggest import replacement

_SUGGESTED = re.compile(r"`([^`\n]+)`")
_LISTED = re.compile(r"\bare ((?:[\w./^]+, )*[\w./^]+)$")
"""`its stages are go, wait`: each is offered in the place of one word."""
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
    help = message.partition("\n")[2]
    listed = _LISTED.search(help) if re.fullmatch(r"\S+", written) else None
    each = listed[1].split(", ") if listed is not None else []
    suggested = list(dict.fromkeys([*each, *_SUGGESTED.findall(help)]))
    suggested = [one for one in suggested if not one.startswith("foresee ") or one == "foresee 1"]
    found: dict[str, Fix] = {}
    tried = 0
    before = {(one.code, one.message) for one in check(text)} if suggested else set()
    first = message.partition("\n")[0]
    for words in suggested:
        for fix in _ways(words, span, positions):
            tried += 1
            if tried > _MOST_TRIED or words in found:
                break
            left = [one for one in check(applied(text, positions, fix)) if one.severity == "error"]
            # what could not be seen before the mistake was mended may be wrong elsewhere, but not where it was mended
            last = fix.span.end_line + fix.text.count("\n")
            new = [one for one in left if (one.code, one.message) not in before]
            here = any(one.span is None or fix.span.line <= one.span.line <= last for one in new)
            if (code, first) not in {(one.code, one.message) for one in left} and not here:
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
