"""The record between the tree and the model: a node with the places of its parts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from foresee_dsl.errors import Span
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

    @property
    def parts(self) -> Iterator[Node]:
        """The nodes that are direct parts of it, in the order of its fields."""
        for value in self.fields.values():
            for part in value if isinstance(value, tuple) else (value,):
                if isinstance(part, Node):
                    yield part
