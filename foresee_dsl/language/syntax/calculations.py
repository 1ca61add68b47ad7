"""Turns the flat list of a calculation into nodes: `*` and `/` bind stronger than `+` and `-`, and operators of equal
strength are applied from left to right."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal

from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.syntax.node import Node

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
