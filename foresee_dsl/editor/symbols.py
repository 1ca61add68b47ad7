"""Lists the names in a file (where each is defined and used), its outline, and its foldable ranges."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from types import MappingProxyType

from foresee_dsl.editor.syntax import read_syntax, walk
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.parser import plain
from foresee_dsl.language.syntax.node import Node

_MEASURED_TO: Mapping[str, SymbolKind] = MappingProxyType(
    {"eta": "junction", **dict.fromkeys(m.BETWEEN_ACTORS, "actor")}
)
"""The kind of thing to which a measure relates; a distance relates to an actor or a junction."""

_DROPPED: Mapping[str, SymbolKind] = MappingProxyType(
    {
        "param": "parameter",
        "signal": "junction",
        "when": "label",
        "expect": "label",
        "case": "case",
        "slippery": "patch",
    }
)
"""The kind of the name in a `drop`; an actor for other words."""

_CHANGED: Mapping[str, SymbolKind] = MappingProxyType({"param": "parameter", "expect": "label"})
"""The kind of the word after the dot in `change param.gap: ...`."""

_UNNAMED = (m.When, m.Expect, m.Origin, m.Window, m.Weather)
"""Statements without a name of their own that an outline still shows."""


@dataclass(frozen=True)
class Occurrence:
    """A name at a place of a text.

    Attributes:
        name: the name as written, without quotes.
        span: its place, including quotes.
        defines: True if it is the definition, not a use.
        owner, field: the node and its field with the name.
        scope: for a stage, its junction; for a word, its parameter.
    """

    kind: SymbolKind
    name: str
    span: Span
    defines: bool
    owner: Node
    field: str
    scope: str = ""


def kind_named(node: Node, field: str) -> SymbolKind | None:
    """Return the kind of name that a field of a node uses; None if the field is not a use of a name."""
    if node.kind is m.Drop and field == "name":
        return _DROPPED.get(str(node.fields.get("what")), "actor")
    if node.kind is m.Change and field == "actor" and node.fields.get("actor") in m.OWNERS:
        return None  # `change weather.rain: ...`
    if node.kind is m.Measure and field == "other":
        return _MEASURED_TO.get(str(node.fields.get("what")), "thing")
    names = form_of(node.kind, field).names
    return names.kind if names is not None and not names.defines else None


@lru_cache(maxsize=256)
def occurrences(text: str) -> tuple[Occurrence, ...]:
    """Return all names in a text in the order of the file; for a text with errors, those in its valid statements."""
    root = read_syntax(text).root
    if root is None:
        return ()
    names = [o for node, above in walk(root) for o in _of_node(node, above)]
    return tuple(sorted(names, key=lambda o: (o.span.line, o.span.column)))


def _of_node(node: Node, above: tuple[Node, ...]) -> Iterator[Occurrence]:
    if node.kind is m.Ego:
        yield Occurrence("actor", "ego", _first_word(node, "ego"), True, node, "")
    if node.kind is m.Change and (changed := _CHANGED.get(str(node.fields.get("actor")))) is not None:
        whole, name = node.places["property"], str(node.fields["property"])
        place = Span(whole.line, whole.end_column - len(name), whole.line, whole.end_column)
        yield Occurrence(changed, name, place, False, node, "property")
    for field, value in node.fields.items():
        parts = value if isinstance(value, tuple) else (value,)
        names = form_of(node.kind, field).names
        for k, part in enumerate(parts):
            place_name = f"{field}.{k}" if isinstance(value, tuple) else field
            place_found = node.places.get(place_name) or (node.span if node.kind is m.Ref else None)
            if not isinstance(part, str) or place_found is None:
                continue
            named = names if names is not None and names.defines else None
            kind = named.kind if named else _kind_of_word(node, above) or kind_named(node, field)
            # An extension changes statements of another scenario, so their names are uses there.
            defines = named is not None and not (above and above[-1].kind is m.Replace)
            if kind is not None:
                yield Occurrence(kind, part, place_found, defines, node, field, _scope(node, above, kind))


def _kind_of_word(node: Node, above: tuple[Node, ...]) -> SymbolKind | None:
    """Return the kind of a word in an extension, which may be a parameter of the other file or a name of its field's
    kind."""
    if node.kind is not m.Ref or not above or above[0].kind is not m.Extension:
        return None
    for field, value in above[-1].fields.items():
        if value is node or (isinstance(value, tuple) and any(part is node for part in value)):
            return kind_named(above[-1], field)
    return None


def _scope(node: Node, above: tuple[Node, ...], kind: SymbolKind) -> str:
    if kind == "stage":
        junction = node.fields.get("junction")
        if junction is None and above:  # inside its junction, or a word in an extension that may be a parameter
            junction = above[-1].fields.get("name" if above[-1].kind is m.Junction else "junction")
        return junction if isinstance(junction, str) else ""
    if kind == "word":
        name = node.fields.get("left" if node.kind is m.Equals else "name")
        if isinstance(name, Node):
            name = name.fields.get("name")
        return name if isinstance(name, str) else ""
    return ""


# ---- outline and folding ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Entry:
    """A line of the outline: its name, its class in the model (`Actor`), details, its places, and the entries
    inside."""

    name: str
    kind: str
    detail: str
    span: Span
    name_span: Span
    children: tuple[Entry, ...] = ()


def outline(text: str) -> tuple[Entry, ...]:
    """Return the outline of a text, as far as it can be read."""
    root = read_syntax(text).root
    if root is None:
        return ()
    return _entries(root, plain(text).split("\n"))


def folds(text: str) -> tuple[tuple[int, int, str], ...]:
    """Return the ranges of lines (1-based, both ends) that can be folded, with `region` or `comment`."""
    syntax = read_syntax(text)
    ranges: dict[tuple[int, int, str], None] = {}
    if syntax.root is not None:
        for node, _ in walk(syntax.root):
            if node.block is not None and node.block.end_line > node.span.line + 1:
                ranges[node.span.line, node.block.end_line - 1, "region"] = None
    run: list[int] = []
    lines = plain(text).split("\n")
    for number, line in enumerate([*lines, ""], start=1):
        if line.lstrip().startswith("#"):
            run.append(number)
            continue
        if len(run) > 1:
            ranges[run[0], run[-1], "comment"] = None
        run = []
    return tuple(sorted(ranges))


def _entries(node: Node, lines: list[str]) -> tuple[Entry, ...]:
    """Return the entry of a node; if the node has none, the entries inside it."""
    inside = [entry for part in node.parts for entry in _entries(part, lines)]
    inside.sort(key=lambda entry: (entry.span.line, entry.span.column))
    kind = node.kind
    name = node.fields.get("name")
    head = "".join(lines[node.span.line - 1 : node.span.line])[node.span.column - 1 :].split("{")[0].strip()
    entry = partial(Entry, kind=kind.__name__, span=node.span, children=tuple(inside))
    if kind is m.Ego:
        return (entry("ego", detail=head, name_span=_first_word(node, "ego")),)
    if isinstance(name, str) and "name" in node.places and kind not in (m.Ref, m.Assignment, m.Named, m.Drop):
        return (entry(name, detail=head, name_span=node.places["name"]),)
    if kind in _UNNAMED:
        return (entry(head, detail="", name_span=_first_word(node, kind.pattern.split()[0])),)
    return tuple(inside)


def _first_word(node: Node, word: str) -> Span:
    return Span(node.span.line, node.span.column, node.span.line, node.span.column + len(word))
