"""Marks that an editor shows in a text: the kinds of words, speeds in m/s, and commands above scenarios and cases."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from foresee_dsl.editor.symbols import occurrences
from foresee_dsl.editor.syntax import read_syntax, walk
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.units import UNITS

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


@dataclass(frozen=True)
class Lens:
    """A command that the editor shows above a place: `run`, `forecast` or `draw`, with the address to call it for."""

    span: Span
    command: str
    address: str


def hints(text: str, first: int, last: int) -> Iterator[tuple[int, int, str]]:
    """Yield the hints for some lines of a text: line, column, and the text that the editor shows behind that place.

    Each speed in another unit is also shown in m/s.
    """
    root = read_syntax(text).root
    for node, _ in walk(root) if root is not None else ():
        if node.kind is not m.Quantity or not first <= node.span.line <= last:
            continue
        unit = UNITS.get(str(node.fields.get("unit", "")))
        value = node.fields.get("value")
        if unit is not None and unit.dimension == "speed" and unit.to_si != 1 and isinstance(value, Decimal):
            yield node.span.end_line, node.span.end_column, f"= {float(value) * unit.to_si:.2f} m/s"


def lenses(path: Path, text: str) -> Iterator[Lens]:
    """Yield the commands of a file's definition, and of each of its cases."""
    root = read_syntax(text).root
    if root is None:
        return
    head = root.places.get("name") or root.span
    own = [node for node, above in walk(root) if node.kind is m.Case and above == (root,)]
    if root.kind in (m.Network, m.Scenario, m.Extension, m.Clip, m.Mutant):
        yield Lens(head, "draw", str(path))
    drawn = any(node.kind is m.Cases for node, _ in walk(root))
    if root.kind in (m.Clip, m.Mutant) or (root.kind is m.Scenario and not own and not drawn):
        yield Lens(head, "run", str(path))
        if root.kind is m.Scenario:
            yield Lens(head, "forecast", str(path))
    for case in own:
        address = f"{path}::{case.fields.get('name')}"
        yield from (Lens(case.places.get("name") or case.span, word, address) for word in ("run", "forecast", "draw"))


# ---- what kind of thing each word is ---------------------------------------------------------------------------------


class Token(NamedTuple):
    """A word on one line: its place, the protocol's name of its kind, and whether it defines a name."""

    span: Span
    type: str
    defines: bool = False


def tokens(text: str) -> Iterator[Token]:
    """Yield the names and quantities of a text in order; the highlighter colours the words of the grammar."""
    in_order = [*_names(text), *_quantities(text)]
    in_order.sort(key=lambda token: (token.span.line, token.span.column))
    line = end = 0
    for token in in_order:
        if token.span.line == line and token.span.column < end:
            continue  # the match is inside another token
        line, end = token.span.line, token.span.end_column
        yield token


def _names(text: str) -> Iterator[Token]:
    for o in occurrences(text):
        type_ = _TYPES.get(o.kind)
        one_line = o.span.line == o.span.end_line
        # In quotes, it is a text.
        if type_ is not None and one_line and o.span.end_column - o.span.column == len(o.name):
            yield Token(o.span, type_, o.defines)


def _quantities(text: str) -> Iterator[Token]:
    root = read_syntax(text).root
    for node, _ in walk(root) if root is not None else ():
        if node.kind is m.Quantity and node.span.line == node.span.end_line:
            yield Token(node.span, "number")
