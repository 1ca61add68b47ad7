"""Computes the value and the dimension of an expression under the cursor, with the parameters' defaults."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import get_args

from foresee_dsl.editor.files import Files
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.dimensions import Dimensions, in_words
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.syntax.builder import Builder
from foresee_dsl.language.syntax.node import Node


def describe_expression(files: Files, path: Path, line: int, column: int) -> tuple[str, Span] | None:
    """Return a description of the outermost expression at a place (1-based), and its span; None without an
    expression."""
    root = files.root(path)
    node = _expression_at(root, line, column) if root is not None else None
    value = Builder(partial=True).build(node) if node is not None else None
    if node is None or not isinstance(value, m.Expression):
        return None
    return _description(value, *_parameters(files, path)), node.span


def results(files: Files, path: Path) -> Iterator[tuple[Span, str]]:
    """Yield the span and the value of every outermost expression of a file, with the parameters' defaults; expressions
    without a value are left out."""
    root = files.root(path)
    expressions = list(_expressions(root)) if root is not None else []
    values = _parameters(files, path)[1] if expressions else {}
    for node in expressions:
        value = Builder(partial=True).build(node)
        if isinstance(value, m.Expression):
            with suppress(ExpressionError):
                yield node.span, value_text(evaluate(value, values))


def _parameters(files: Files, path: Path) -> tuple[dict[str, m.ParamType], dict[str, m.ParamValue]]:
    """Return the types and the defaults of the parameters that are defined for a file."""
    types: dict[str, m.ParamType] = {}
    values: dict[str, m.ParamValue] = {}
    for name, definition in files.definitions(path, "parameter").items():
        param = Builder(partial=True).build(definition.occurrence.owner)
        if isinstance(param, m.Param):
            types[name], values[name] = param.type, param.default
    return types, values


def _expressions(node: Node) -> Iterator[Node]:
    """Yield the outermost expressions in a node."""
    if node.kind in get_args(m.Expression):
        yield node
        return
    for part in _parts(node):
        yield from _expressions(part)


def _description(value: m.Expression, types: dict[str, m.ParamType], values: dict[str, m.ParamValue]) -> str:
    dimensions = Dimensions(types)
    powers = dimensions.of(value)
    if dimensions.mismatches:
        return f"`{written(value)}`: {dimensions.mismatches[0].message}"
    if powers is None:
        return ""
    try:
        result = value_text(evaluate(value, values))
    except ExpressionError as error:
        return f"{error.message} (with the defaults)" if any(references(value)) else error.message
    by_default = " with the defaults" if any(references(value)) else ""
    return f"`{written(value)}` is `{result}`{by_default}, {in_words(powers)}"


def _expression_at(node: Node, line: int, column: int) -> Node | None:
    """Return the outermost expression that contains a place."""
    if node.kind in get_args(m.Expression) and _holds(node.span, line, column):
        return node
    return next((inner for part in _parts(node) if (inner := _expression_at(part, line, column)) is not None), None)


def _parts(node: Node) -> Iterator[Node]:
    for value in node.fields.values():
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Node):
                yield part


def _holds(span: Span, line: int, column: int) -> bool:
    return (span.line, span.column) <= (line, column) < (span.end_line, span.end_column + 1)
