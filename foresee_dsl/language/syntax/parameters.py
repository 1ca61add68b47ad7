"""Evaluates the expressions in the statements that define parameters and draw cases, with the parameters' defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from typing import cast, get_args

from foresee_dsl.errors import Diagnostic
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.dimensions import Dimensions
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.syntax.builder import Builder
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.units import SI_WORD, Dimension, dimension_of

_WORKED_OUT = (*m.EXPRESSIONS, m.Ref)
_Slot = tuple[Node, str, int | None]
"""A value in a statement, by its node, its field, and its index in a list (None if it is not in one)."""


def settle(statements: Sequence[Node], *, whole: bool, partial: bool = False) -> list[Diagnostic]:
    """Replace each expression in the `param` and `cases` statements of a file by its result, which keeps the
    expression's text; return the errors.

    Args:
        statements: the statements.
        whole: True if every parameter is in this file (in an extension they are not).
        partial: True if some statements could not be read; calculations that need a parameter of such a statement then
            get an arbitrary value.
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
    return [error for error in settler.errors if error.code != "FS031"]


class _Settler:
    """Evaluates the expressions in some statements of one file, and collects the errors."""

    def __init__(self, statements: Sequence[Node], *, whole: bool) -> None:
        self.errors: list[Diagnostic] = []
        self._statements, self._whole = statements, whole
        self._params = {str(node.fields.get("name")): node for node in statements if node.kind is m.Param}
        types = ((name, node.fields.get("type")) for name, node in self._params.items())
        self._types: dict[str, m.ParamType] = {n: t for n, word in types for t in get_args(m.ParamType) if t == word}

    def settle(self) -> None:
        """Replace each expression by its result, with its text."""
        for node in self._statements:
            for slot in _slots(node):
                self._settle(slot, ())

    def _settle(self, slot: _Slot, asking: tuple[str, ...]) -> None:
        holder, field, k = slot
        raw = _value_of(slot)
        if not isinstance(raw, Node) or raw.kind not in _WORKED_OUT:
            return
        name = str(raw.fields.get("name"))
        own = raw.kind is m.Ref and name == holder.fields.get("name")
        is_number = name in self._types and dimension_of(self._types[name]) is not None
        # An option of a parameter of words may be the same word as the parameter's name.
        settled = (
            name
            if own and not is_number and field in ("default", "options")
            else self._result_node(raw, holder, asking)
        )
        values = holder.fields[field]
        if k is None:
            holder.fields[field] = settled
        elif isinstance(values, tuple):
            holder.fields[field] = (*values[:k], settled, *values[k + 1 :])

    def _result_node(self, raw: Node, holder: Node, asking: tuple[str, ...]) -> Node:
        """Return the node of an expression with its result; if it has none, an empty node, without a further error."""
        nothing = Node(m.Quantity, raw.span)
        builder = Builder(partial=True)
        expression = builder.build(raw)
        self.errors += builder.errors
        if not isinstance(expression, m.Ref | m.Expression):
            return nothing
        if not self._names_are_parameters(expression, raw, builder):
            return nothing
        dimensions = Dimensions(self._types)
        if dimensions.of(expression) is None:
            for mismatch in dimensions.mismatches:
                place = builder.spans.get((id(mismatch.item), ""), raw.span)
                self.errors.append(Diagnostic.of("FS062", mismatch.message, mismatch.help, span=place))
            return nothing
        values = self._defaults(expression, holder, asking)
        if values is None:
            return nothing
        try:
            result = evaluate(expression, values)
        except ExpressionError as error:
            place = builder.spans.get((id(error.item), ""), raw.span)
            self.errors.append(Diagnostic.of("FS063", error.message, "write another value", span=place))
            return nothing
        fields: dict[str, object] = {"value": result.value, "unit": result.unit, "expression": raw}
        return Node(m.Calculated, raw.span, fields, {"expression": raw.span})

    def _names_are_parameters(self, expression: m.Item, raw: Node, builder: Builder) -> bool:
        """Report the names in an expression that are not parameters; return True if all are."""
        unknown = [ref for ref in references(expression) if ref.name not in self._types]
        for ref in unknown:
            help = did_you_mean(ref.name, self._types)
            if not self._whole:
                help = "write a value: the parameters of the extended scenario cannot be used here"
            place = builder.spans.get((id(ref), ""), raw.span)
            self.errors.append(Diagnostic.of("FS031", f"unknown parameter '{ref.name}'", help, span=place))
        return not unknown

    def _defaults(self, expression: m.Item, holder: Node, asking: tuple[str, ...]) -> Mapping[str, m.ParamValue] | None:
        """Return the defaults of the parameters in an expression; None if one has none, which is reported."""
        own = str(holder.fields.get("name")) if holder.kind is m.Param else ""
        defaults: dict[str, m.ParamValue] = {}
        for ref in references(expression):
            chain = (*asking, own, ref.name) if own else (*asking, ref.name)
            if ref.name in chain[:-1]:
                path = " -> ".join(chain[chain.index(ref.name) :])
                message = f"'{ref.name}' depends on itself: {path}"
                self.errors.append(Diagnostic.of("FS063", message, "write a value", span=holder.span))
                return None
            param = self._params[ref.name]
            self._settle((param, "default", None), (*asking, own) if own else asking)
            default = param.fields.get("default")
            value = Builder(partial=True).build(default) if isinstance(default, Node) and default.fields else default
            if not isinstance(value, m.Quantity):
                return None
            defaults[ref.name] = value
        return defaults


def _slots(node: Node) -> Iterator[_Slot]:
    """Yield the values of a statement that may be expressions."""
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
