"""The records between the tree and the model: a node with the places of its parts, and an error in the text."""

from __future__ import annotations

from dataclasses import dataclass, field

from foresee_dsl.errors import Span
from foresee_dsl.helps import HelpText
from foresee_dsl.language import model as m

Key = tuple[str | int, ...]
"""The path of a statement in the model."""


@dataclass(slots=True)
class Node:
    """A part of the tree that becomes one item of the model: its class, the place of the whole statement, and its
    fields.

    Attributes:
        fields: raw values by name: str, Decimal, bool, Node, or a tuple of these.
        places: the place of each field (`green`, and `green.1` for the second element).
        lines: for each statement inside its braces, the key in the model's path, the place, and the node if it is an
            item itself.
        block: the place of its braces, if it has any.
    """

    kind: type[m.Item]
    span: Span
    fields: dict[str, object] = field(default_factory=dict)
    places: dict[str, Span] = field(default_factory=dict)
    lines: list[tuple[Key, Span, Node | None]] = field(default_factory=list)
    block: Span | None = None


@dataclass(frozen=True, slots=True)
class TextError:
    """An error in the text; the parser adds the file and the source line."""

    code: str
    message: str
    help: HelpText
    span: Span
