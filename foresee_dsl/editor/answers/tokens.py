"""Semantic tokens: what each word of a text is, names by what they are of, the rest as the highlighter reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from foresee_dsl.editor.symbols import occurrences
from foresee_dsl.editor.syntax import read_syntax, walk
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.model.item import SymbolKind

_TYPES: Mapping[SymbolKind, str] = MappingProxyType(
    {
        "actor": "variable",
        "junction": "class",
        "road": "struct",
        "stage": "enumMember",
        "parameter": "parameter",
        "case": "enumMember",
        "model": "type",
        "label": "event",
        "patch": "event",
        "thing": "variable",
    }
)


class Token(NamedTuple):
    """A word on one line: its place, the protocol's name of its kind, and whether it defines a name."""

    span: Span
    type: str
    defines: bool = False


def tokens(text: str) -> Iterator[Token]:
    """Yield the names and quantities of a text in order; words of the grammar have the highlighter's colours."""
    found = [*_names(text), *_quantities(text)]
    found.sort(key=lambda token: (token.span.line, token.span.column))
    line = end = 0
    for token in found:
        if token.span.line == line and token.span.column < end:
            continue  # within another
        line, end = token.span.line, token.span.end_column
        yield token


def _names(text: str) -> Iterator[Token]:
    for o in occurrences(text):
        type_ = _TYPES.get(o.kind)
        one_line = o.span.line == o.span.end_line
        if type_ is not None and one_line and o.span.end_column - o.span.column == len(o.name):  # in quotes: a text
            yield Token(o.span, type_, o.defines)


def _quantities(text: str) -> Iterator[Token]:
    root = read_syntax(text).root
    for node, _ in walk(root) if root is not None else ():
        if node.kind is m.Quantity and node.span.line == node.span.end_line:
            yield Token(node.span, "number")
