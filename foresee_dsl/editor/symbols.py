"""The names in a file: where each is defined and where it is used, read off the nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

from foresee_dsl.editor.syntax import read_syntax, walk
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.syntax.nodes import Node

SymbolKind = Literal[
    "actor", "junction", "road", "stage", "parameter", "case", "model", "label", "file", "thing", "word"
]
"""What a name is of. `thing`: an actor or a junction. `word`: what a parameter's type says. `label`: the name of a
trigger or an expectation. `file`: the path of another file."""

_DEFINES: Mapping[str, SymbolKind] = MappingProxyType(
    {
        "Actor": "actor",
        "Traffic": "actor",
        "Junction": "junction",
        "Road": "road",
        "Stage": "stage",
        "Param": "parameter",
        "Case": "case",
        "VehicleModel": "model",
        "When": "label",
        "Expect": "label",
    }
)
"""The classes of the model whose `name` is a definition."""

_FIELDS: Mapping[str, SymbolKind] = MappingProxyType(
    {
        "actor": "actor",
        "other": "thing",
        "junction": "junction",
        "edge": "road",
        "edges": "road",
        "green": "road",
        "model": "model",
        "models": "model",
        "parent": "file",
        "path": "file",
        "case": "case",
        "stage": "stage",
    }
)
"""What a field names, by its own name, in every class but those of `_EXCEPTIONS`."""

_EXCEPTIONS: Mapping[tuple[str, str], SymbolKind] = MappingProxyType(
    {
        ("Road", "start"): "junction",
        ("Road", "end"): "junction",
        ("Route", "start"): "road",
        ("Meets", "other"): "actor",
        ("MeetsState", "other"): "actor",
        ("Named", "name"): "thing",
        ("Ref", "name"): "parameter",
        ("Assignment", "name"): "parameter",
        ("Assignment", "value"): "word",
        ("Param", "default"): "word",
        ("Param", "options"): "word",
        ("Equals", "left"): "parameter",
        ("Equals", "right"): "word",
        ("Shows", "state"): "stage",
        ("Change", "was"): "model",
        ("Change", "now"): "model",
    }
)

_MEASURED_TO: Mapping[str, SymbolKind] = MappingProxyType({"eta": "junction", "ttc": "actor", "headway": "actor"})
"""What a measure is to; a distance is to an actor or a junction."""

_DROPPED: Mapping[str, SymbolKind] = MappingProxyType(
    {"param": "parameter", "signal": "junction", "when": "label", "expect": "label", "case": "case"}
)
"""What the name in a `drop` is of; otherwise an actor."""

_CHANGED: Mapping[str, SymbolKind] = MappingProxyType({"param": "parameter", "expect": "label"})
"""Of a `change param.gap: ...`, what the word behind the dot names."""


@dataclass(frozen=True)
class Occurrence:
    """A name at a place.

    Attributes:
        kind: what it names.
        name: as written, without quotes.
        span: the place, with quotes where it has any.
        defines: it is the definition, not a use.
        owner: the node whose field it is.
        field: that field.
        scope: of a stage: its junction. Of a word: its parameter.
    """

    kind: SymbolKind
    name: str
    span: Span
    defines: bool
    owner: Node
    field: str
    scope: str = ""


def kind_named(node: Node, field: str) -> SymbolKind | None:
    """Return what a field of a node names when it is used, or None where it is no name."""
    owner = node.kind.__name__
    if owner == "Drop" and field == "name":
        return _DROPPED.get(str(node.fields.get("what")), "actor")
    if owner == "Drop":
        return None
    if owner == "Change" and field == "actor" and node.fields.get("actor") in m.OWNERS:
        return None  # `change weather.rain: ...`
    if owner == "Measure" and field == "other":
        return _MEASURED_TO.get(str(node.fields.get("what")), "thing")
    return _EXCEPTIONS.get((owner, field)) or (None if field == "name" else _FIELDS.get(field))


@lru_cache(maxsize=256)
def occurrences(text: str) -> tuple[Occurrence, ...]:
    """Return every name in a text, in the order of the file; of a broken text, those of its sound statements."""
    root = read_syntax(text).root
    if root is None:
        return ()
    found = [o for node, above in walk(root) for o in _of_node(node, above)]
    return tuple(sorted(found, key=lambda o: (o.span.line, o.span.column)))


def _of_node(node: Node, above: tuple[Node, ...]) -> Iterator[Occurrence]:
    if node.kind is m.Ego:
        place = Span(node.span.line, node.span.column, node.span.line, node.span.column + len("ego"))
        yield Occurrence("actor", "ego", place, True, node, "")
    if node.kind is m.Change and (changed := _CHANGED.get(str(node.fields.get("actor")))) is not None:
        whole, name = node.places["property"], str(node.fields["property"])
        place = Span(whole.line, whole.end_column - len(name), whole.line, whole.end_column)
        yield Occurrence(changed, name, place, False, node, "property")
    defined = _DEFINES.get(node.kind.__name__)
    for field, value in node.fields.items():
        parts = value if isinstance(value, tuple) else (value,)
        for k, part in enumerate(parts):
            place_name = f"{field}.{k}" if isinstance(value, tuple) else field
            place_found = node.places.get(place_name) or (node.span if node.kind is m.Ref else None)
            if not isinstance(part, str) or place_found is None:
                continue
            names_itself = defined is not None and field == "name"
            kind = defined if names_itself else _kind_of_word(node, above) or kind_named(node, field)
            # What an extension changes is the other scenario's: there its name is a use.
            defines = names_itself and not (above and above[-1].kind is m.Replace)
            if kind is not None:
                yield Occurrence(kind, part, place_found, defines, node, field, _scope(node, above, kind))


def _kind_of_word(node: Node, above: tuple[Node, ...]) -> SymbolKind | None:
    """In an extension, whose parameters stand elsewhere, a word may be a parameter or what its field says."""
    if node.kind is not m.Ref or not above or above[0].kind is not m.Extension:
        return None
    for field, value in above[-1].fields.items():
        if value is node or (isinstance(value, tuple) and any(part is node for part in value)):
            return kind_named(above[-1], field)
    return None


def _scope(node: Node, above: tuple[Node, ...], kind: SymbolKind) -> str:
    if kind == "stage":
        junction = node.fields.get("junction") or (above[-1].fields.get("name") if above else "")
        return junction if isinstance(junction, str) else ""
    if kind == "word":
        name = node.fields.get("left" if node.kind.__name__ == "Equals" else "name")
        if isinstance(name, Node):
            name = name.fields.get("name")
        return name if isinstance(name, str) else ""
    return ""
