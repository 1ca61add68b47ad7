"""The record between the tree and the model: a node with the places of its parts; and the nodes of calculations.

A calculation is a flat list in the tree. In its nodes, `*` and `/` bind stronger than `+` and `-`, and operators of
equal strength are applied from left to right.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal

from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Key


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


_STRONG = ("*", "/")


def calculation(operands: Sequence[tuple[Node, Span]], signs: Sequence[tuple[str, Span]]) -> Node:
    """Return the node of `a + b * c`, from its operands and the signs between them; each operand has its place,
    including brackets."""
    terms, between = [operands[0]], []
    for sign, operand in zip(signs, operands[1:], strict=True):
        if sign[0] in _STRONG:
            terms[-1] = _of(m.Product, terms[-1], sign, operand)
        else:
            terms.append(operand)
            between.append(sign)
    total = terms[0]
    for sign, operand in zip(between, terms[1:], strict=True):
        total = _of(m.Sum, total, sign, operand)
    return total[0]


def negative(operand: Node, span: Span) -> Node:
    """Return the node of `-gap`; `- 2 m` is the number -2 m."""
    if operand.kind is m.Quantity:
        number = operand.fields.get("value")
        if isinstance(number, Decimal):
            operand.fields["value"] = -number
        operand.span = span
        return operand
    return Node(m.Negative, span, {"value": operand}, {"value": operand.span})


def _of(
    kind: type[m.Item], left: tuple[Node, Span], sign: tuple[str, Span], right: tuple[Node, Span]
) -> tuple[Node, Span]:
    span = Span(left[1].line, left[1].column, right[1].end_line, right[1].end_column)
    places = {"left": left[0].span, "op": sign[1], "right": right[0].span}
    return Node(kind, span, {"left": left[0], "op": sign[0], "right": right[0]}, places), span
