"""Renders diagnostics as text for people, on a terminal or one per line."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

from foresee_dsl.errors import Diagnostic, Span

_WIDTH = 100
"""Maximum number of columns of a source line that are shown (ours: the width of a review tool without wrapping)."""
_TAB = 4
_RED, _CYAN, _BOLD, _OFF = "\x1b[31m", "\x1b[36m", "\x1b[1m", "\x1b[0m"


def render_full(diagnostic: Diagnostic, colour: bool = False) -> str:
    """Return a diagnostic for a terminal: the place, the source line with the place underlined, the help."""
    tint = _CYAN if diagnostic.severity == "warning" else _RED
    tint, bold, off = (tint, _BOLD, _OFF) if colour else ("", "", "")
    severity = f"{tint}{diagnostic.severity} {diagnostic.code}{off}"
    lines = [f"{bold}{_place(diagnostic)}{off}: {severity}: {_plain(diagnostic.message)}"]
    if diagnostic.span is not None and diagnostic.source_line:
        source, blank, marks = _underlined(diagnostic.span, diagnostic.source_line)
        number = str(diagnostic.span.line)
        lines.append(f"  {number} | {source}".rstrip())
        lines.append(f"  {' ' * len(number)} | {blank}{tint}{marks}{off}")
    if diagnostic.help:
        lines.append(f"  help: {_plain(diagnostic.help)}")
    return "\n".join(lines)


def render_all(diagnostics: Sequence[Diagnostic], colour: bool = False) -> str:
    """Return several diagnostics in the full form, one below the other."""
    return "\n\n".join(render_full(diagnostic, colour) for diagnostic in diagnostics)


def render_concise(diagnostic: Diagnostic) -> str:
    """Return a diagnostic on one line, the form that editors and `grep` read."""
    text = f"{_place(diagnostic)}: {diagnostic.severity} {diagnostic.code}: {_plain(diagnostic.message)}"
    return f"{text} ({_plain(diagnostic.help)})" if diagnostic.help else text


def _place(diagnostic: Diagnostic) -> str:
    span = diagnostic.span
    path = _plain(diagnostic.path)
    return path if span is None else f"{path}:{span.line}:{span.column}"


def _underlined(span: Span, line: str) -> tuple[str, str, str]:
    """Return the part of the source line to show, the blanks that precede the marks under it, and the marks."""
    start = min(span.column - 1, len(line))
    end = span.end_column - 1 if span.end_line == span.line else len(line.rstrip())
    end = min(max(end, start + 1), max(len(line), start + 1))
    first, last = 0, len(line)
    if last > _WIDTH:  # of a long line, only the part that contains the place is shown
        first = max(0, start - max(_WIDTH - (end - start), 20) // 2)
        last = min(last, first + _WIDTH)
    before, under, after = line[first:start], line[start : min(end, last)], line[end:last]
    left = "..." if first > 0 else ""
    right = "..." if last < len(line) else ""
    source = f"{left}{''.join(map(_glyph, before + under + after))}{right}"
    return source, " " * (len(left) + sum(map(_width, before))), "^" * max(1, sum(map(_width, under)))


def _glyph(char: str) -> str:
    """Return a character in a printable form: tabs as blanks, and nothing that moves a terminal's cursor."""
    if char == "\t":
        return " " * _TAB
    return "�" if unicodedata.category(char) in ("Cc", "Cs", "Zl", "Zp", "Cf") else char


def _width(char: str) -> int:
    if char == "\t":
        return _TAB
    if unicodedata.combining(char):
        return 0
    return 2 if unicodedata.east_asian_width(char) in ("W", "F") else 1


def _plain(text: str) -> str:
    return "".join(c if c == "\n" else _glyph(c) for c in text)
