"""Reads comments such as `# foresee: allow FS301`, which suppress a lint.

A comment at the end of a line applies to the statements that begin on that line and their blocks; a comment on a line
of its own to those of the next line that begins a statement; one inside a list to the statement with the list; and one
before the definition to the whole file. `syntax/comments.py` keeps this when a file is formatted. Only warnings can be
allowed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import remove
from foresee_dsl.language.codes import NETWORK_LINTS, diagnostic_of
from foresee_dsl.language.document import Document

if TYPE_CHECKING:
    from foresee_dsl.language.syntax.scan import Lines, Raw

Place = tuple[int, int]
_CODE = re.compile(r"FS[0-9]{3}")


@dataclass
class _Allowance:
    """One code in one comment: its place, the text that it applies to (the line and column of its start and its end),
    and whether it suppressed a lint."""

    code: str
    span: Span
    first: Place
    last: Place
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
    matching = [a for a in allowances if a.code == diagnostic.code and a.first <= diagnostic.start <= a.last]
    for allowance in matching:
        allowance.needed = True
    return bool(matching)


def _allowances(text: str) -> Iterator[_Allowance]:
    if "foresee:" not in text:
        return
    from foresee_dsl.language.syntax.scan import scan  # few files have such a comment

    cut, rows = scan(text), text.split("\n")
    statements = list(_statements(cut.statements, cut.lines))
    definition = max((s.first for s in statements if s.top), default=(1, 1))
    for comment in cut.comments:
        allow = comment.allow
        if allow is None:
            continue
        line, column = comment.line, comment.column
        own_line = not rows[line - 1][: column - 1].strip()
        first, last = _reach(line, own_line, statements)
        if line <= definition[0]:
            first, last = (1, 1), (len(rows) + 1, 1)
        for code in _CODE.finditer(allow[1]):
            at = column + allow.start(1) + code.start()
            yield _Allowance(code[0], Span(line, at, line, at + len(code[0])), first, last)


def _reach(line: int, own_line: bool, statements: Sequence[_Places]) -> tuple[Place, Place]:
    """Return the start and the end of the text that a comment applies to."""
    if own_line or all(s.first[0] != line for s in statements):
        with_list = [s for s in statements if s.first[0] < line <= s.head[0]]
        if with_list:
            return with_list[-1].first, with_list[-1].last
    if own_line:
        line = min((s.first[0] for s in statements if s.first[0] > line), default=line)
    return (line, 1), max((s.last for s in statements if s.first[0] == line), default=(line, 1))


class _Places(NamedTuple):
    """The places of a statement: its start, the end of its head, its end; and whether it is at the top level."""

    first: Place
    head: Place
    last: Place
    top: bool


def _statements(raws: Sequence[Raw], lines: Lines, *, top: bool = True) -> Iterator[_Places]:
    for raw in raws:
        head, last = (raw.open, raw.close - 1) if raw.block is not None else (raw.end, raw.end)
        yield _Places(lines.place(raw.start), lines.place(head), lines.place(last), top)
        yield from _statements(raw.block or (), lines, top=False)
