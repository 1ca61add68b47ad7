"""What is worked out in the statements that define parameters and draw cases: values, by the parameters' defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from typing import cast, get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.dimensions import Dimensions
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.syntax.builder import Builder
from foresee_dsl.language.syntax.node import Node, TextError
from foresee_dsl.language.units import SI_WORD, Dimension

_WORKED_OUT = (*m.EXPRESSIONS, m.Ref)
_Slot = tuple[Node, str, int | None]
"""A value in a statement: the node that has it, the field, and its number in a list."""


def settle(statements: Sequence[Node], *, whole: bool, partial: bool = False) -> list[TextError]:
    """Put what each value in the `param` and `cases` statements of a file comes to, with how it is written, in its
    place; return what is wrong.

    Args:
        whole: every parameter is in this file (in an extension they are not).
        partial: some statements could not be read: what is worked out of their parameters has some value, not known.
    """
    settler = _Settler(statements, whole=whole)
    settler.settle()
    if not partial:
        return settler.errors
    for node in statements:
        unit = SI_WORD.get(cast(Dimension, node.fields.get("type")))
        unsettled = [value for slot in _slots(node) if isinstance(value := _value_of(slot), Node) and not value.fields]
        if node.kind is m.Param and unit is not None and unsettled:
            value = Node(m.Quantity, node.span, {"value": Decimal(1), **({"unit": unit} if unit else {})})
            node.fields = {"name": node.fields.get("name"), "type": node.fields.get("type"), "default": value}
    return [error for error in settler.errors if error.code != c.UNKNOWN_PARAMETER]


class _Settler:
    """Works out what stands in some statements of one file; errors are collected."""

    def __init__(self, statements: Sequence[Node], *, whole: bool) -> None:
        self.errors: list[TextError] = []
        self._statements, self._whole = statements, whole
        self._params = {str(node.fields.get("name")): node for node in statements if node.kind is m.Param}
        types = ((name, node.fields.get("type")) for name, node in self._params.items())
        self._types: dict[str, m.ParamType] = {n: t for n, word in types for t in get_args(m.ParamType) if t == word}

    def settle(self) -> None:
        """Put what each value comes to, with how it is written, in its place."""
        for node in self._statements:
            for slot in _slots(node):
                self._settle(slot, ())

    def _settle(self, slot: _Slot, asking: tuple[str, ...]) -> None:
        holder, field, k = slot
        raw = _value_of(slot)
        if not isinstance(raw, Node) or raw.kind not in _WORKED_OUT:
            return
        own = raw.kind is m.Ref and raw.fields.get("name") == holder.fields.get("name")
        # One of the words that a parameter may be can be its own name.
        made = str(raw.fields["name"]) if own and field in ("default", "options") else self._made(raw, holder, asking)
        values = holder.fields[field]
        if k is None:
            holder.fields[field] = made
        elif isinstance(values, tuple):
            holder.fields[field] = (*values[:k], made, *values[k + 1 :])

    def _made(self, raw: Node, holder: Node, asking: tuple[str, ...]) -> Node:
        """Return the node of a value with what it comes to; an empty one, which is no error of its own, for none."""
        nothing = Node(m.Quantity, raw.span)
        builder = Builder(partial=True)
        expression = builder.build(raw)
        self.errors += builder.errors
        if not isinstance(expression, m.Ref | m.Expression):
            return nothing
        if not self._known(expression, raw, builder):
            return nothing
        dimensions = Dimensions(self._types)
        if dimensions.of(expression) is None:
            for mismatch in dimensions.mismatches:
                place = builder.spans.get((id(mismatch.item), ""), raw.span)
                self.errors.append(TextError(c.MIXED_KINDS, mismatch.message, mismatch.help, place))
            return nothing
        values = self._defaults(expression, holder, asking)
        if values is None:
            return nothing
        try:
            found = evaluate(expression, values)
        except ExpressionError as error:
            place = builder.spans.get((id(error.item), ""), raw.span)
            self.errors.append(TextError(c.NO_RESULT, error.message, "write another value", place))
            return nothing
        fields: dict[str, object] = {"value": found.value, "unit": found.unit, "expression": raw}
        return Node(m.Calculated, raw.span, fields, {"expression": raw.span})

    def _known(self, expression: m.Item, raw: Node, builder: Builder) -> bool:
        """Report the names in an expression that are no parameters; return whether there are none."""
        unknown = [ref for ref in references(expression) if ref.name not in self._types]
        for ref in unknown:
            help = did_you_mean(ref.name, self._types)
            if not self._whole:
                help = "a scenario that extends another writes values here: the other's parameters are not known"
            place = builder.spans.get((id(ref), ""), raw.span)
            self.errors.append(TextError(c.UNKNOWN_PARAMETER, f"unknown parameter '{ref.name}'", help, place))
        return not unknown

    def _defaults(self, expression: m.Item, holder: Node, asking: tuple[str, ...]) -> Mapping[str, m.ParamValue] | None:
        """Return the defaults of the parameters in an expression; None where one has none, which is reported."""
        own = str(holder.fields.get("name")) if holder.kind is m.Param else ""
        found: dict[str, m.ParamValue] = {}
        for ref in references(expression):
            chain = (*asking, own, ref.name) if own else (*asking, ref.name)
            if ref.name in chain[:-1]:
                shown = " -> ".join(chain[chain.index(ref.name) :])
                message = f"'{ref.name}' is worked out of itself: {shown}"
                self.errors.append(TextError(c.NO_RESULT, message, "write a value", holder.span))
                return None
            param = self._params[ref.name]
            self._settle((param, "default", None), (*asking, own) if own else asking)
            default = param.fields.get("default")
            value = Builder(partial=True).build(default) if isinstance(default, Node) and default.fields else default
            if not isinstance(value, m.Quantity):
                return None
            found[ref.name] = value
        return found


def _slots(node: Node) -> Iterator[_Slot]:
    """Yield the values of a statement that may be worked out."""
    for field in ("default", "count", "seed"):
        yield node, field, None
    options = node.fields.get("options")
    yield from ((node, "options", k) for k in range(len(options) if isinstance(options, tuple) else 0))
    for part in (node.fields.get("range"), node.fields.get("distribution")):
        if isinstance(part, Node):
            yield from ((part, field, None) for field in ("low", "high", "step", "mean", "deviation"))
            weights = part.fields.get("weights")
            yield from ((part, "weights", k) for k in range(len(weights) if isinstance(weights, tuple) else 0))


def _value_of(slot: _Slot) -> object:
    holder, field, k = slot
    value = holder.fields.get(field)
    return value[k] if isinstance(value, tuple) and k is not None else value
