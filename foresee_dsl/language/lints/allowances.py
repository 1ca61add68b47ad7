"""Reads comments such as `# foresee: allow FS301`, which suppress a lint.

A comment at the end of a line applies to the statement on that line and its block; a comment on a line of its own to
the statement that follows; and one before the definition to the whole file. Only warnings can be allowed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import remove
from foresee_dsl.language.codes import NETWORK_LINTS, diagnostic_of
from foresee_dsl.language.document import Document

if TYPE_CHECKING:
    from foresee_dsl.language.syntax.scan import Lines, Raw

_ALLOW = re.compile(r"#\s*foresee:\s*allow\b([^\n]*)")
_CODE = re.compile(r"FS[0-9]{3}")


@dataclass
class _Allowance:
    """One code in one comment: its place, the first and last line that it applies to, and whether it suppressed a
    lint."""

    code: str
    span: Span
    first: int
    last: int
    needed: bool = field(default=False)


def left(document: Document, diagnostics: Sequence[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the warnings that remain: those that no comment of the file allows."""
    allowances = list(_allowances(document.text))
    return tuple(diagnostic for diagnostic in diagnostics if not _allowed(diagnostic, allowances))


def without_allowed(document: Document, diagnostics: Sequence[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the diagnostics without the allowed warnings, and with a new warning for each comment that suppresses
    nothing."""
    allowances = list(_allowances(document.text))
    reported = [diagnostic for diagnostic in diagnostics if not _allowed(diagnostic, allowances)]
    lines = document.text.split("\n")
    for allowance in allowances:
        # whether a lint of the network is reported shows only once the network is built
        if not allowance.needed and not allowance.code.startswith(NETWORK_LINTS):
            span = allowance.span
            message = f"no {allowance.code} is reported here, so this comment has no effect"
            source = lines[span.line - 1]
            help = remove("remove the comment")
            reported.append(diagnostic_of("FS312", message, help, document.path, span, source))
    return tuple(sorted(reported, key=lambda d: (*d.start, d.code)))


def _allowed(diagnostic: Diagnostic, allowances: Sequence[_Allowance]) -> bool:
    if diagnostic.severity == "error" or diagnostic.span is None:
        return False
    matching = [a for a in allowances if a.code == diagnostic.code and a.first <= diagnostic.span.line <= a.last]
    for allowance in matching:
        allowance.needed = True
    return bool(matching)


def _allowances(text: str) -> Iterator[_Allowance]:
    if "foresee:" not in text:
        return
    from foresee_dsl.language.syntax.scan import scan  # few files have such a comment

    cut, rows = scan(text), text.split("\n")
    statements = list(_statements(cut.statements, cut.lines))
    definition = max((s for s in statements if s[2]), default=(1, 1, True))
    for comment in cut.comments:
        allow = _ALLOW.match(comment.text)
        if allow is None:
            continue
        line, column = comment.line, comment.column
        own_line = not rows[line - 1][: column - 1].strip()
        first, last = _reach(line, own_line, statements, definition[0], len(rows))
        for code in _CODE.finditer(allow[1]):
            at = column + allow.start(1) + code.start()
            yield _Allowance(code[0], Span(line, at, line, at + len(code[0])), first, last)


def _reach(
    line: int, own_line: bool, statements: Sequence[tuple[int, int, bool]], definition: int, end: int
) -> tuple[int, int]:
    """Return the first and the last line that a comment applies to."""
    if line <= definition:
        return 1, end
    if own_line:
        following = [s for s in statements if s[0] > line]
        return min(following)[:2] if following else (line, line)
    on_line = [s for s in statements if s[0] == line]
    return line, max((s[1] for s in on_line), default=line)


def _statements(raws: Sequence[Raw], lines: Lines, *, top: bool = True) -> Iterator[tuple[int, int, bool]]:
    """For every statement, yield its first line, its last line, and whether it is at the top level."""
    for raw in raws:
        end = raw.close - 1 if raw.block is not None else raw.end
        yield lines.place(raw.start)[0], lines.place(end)[0], top
        yield from _statements(raw.block or (), lines, top=False)
