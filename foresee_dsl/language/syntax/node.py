"""A node: one item of the model to be, with the places of its parts; and an error that was seen on the way."""

from __future__ import annotations

from dataclasses import dataclass, field

from foresee_dsl.errors import Span
from foresee_dsl.helps import HelpText
from foresee_dsl.language import model as m

Key = tuple[str | int, ...]
"""The path of a statement in the model."""


@dataclass(slots=True)
class Node:
    """One item of the model to be: its class, the place of the whole statement, and its fields.

    Attributes:
        fields: raw values by name: str, Decimal, bool, Node, or a tuple of these.
        places: where each field stands (`green`, and `green.1` for the second element).
        lines: the statements inside its braces: their key in the model's path, their place, their node if they are
        items themselves.
        block: where its braces are, if it has any.
    """

    kind: type[m.Item]
    span: Span
    fields: dict[str, object] = field(default_factory=dict)
    places: dict[str, Span] = field(default_factory=dict)
    lines: list[tuple[Key, Span, Node | None]] = field(default_factory=list)
    block: Span | None = None


@dataclass(frozen=True, slots=True)
class TextError:
    """Something wrong that was seen on the way; the parser adds the file and the source line."""

    code: str
    message: str
    help: HelpText
    span: Span
