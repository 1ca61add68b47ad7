"""What an expression under the cursor comes to with the parameters' defaults, and of which dimension it is."""

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


def worked_out(files: Files, path: Path, line: int, column: int) -> tuple[str, Span] | None:
    """Return what is said of the outermost expression at a place (1-based), and its place; None where there is none."""
    root = files.root(path)
    node = _expression_at(root, line, column) if root is not None else None
    value = Builder(partial=True).build(node) if node is not None else None
    if node is None or not isinstance(value, m.Expression):
        return None
    return _told(value, *_parameters(files, path)), node.span


def results(files: Files, path: Path) -> Iterator[tuple[Span, str]]:
    """Yield the place of every outermost expression of a file and what it comes to with the parameters' defaults; of
    those that come to nothing, none."""
    root = files.root(path)
    found = list(_expressions(root)) if root is not None else []
    values = _parameters(files, path)[1] if found else {}
    for node in found:
        value = Builder(partial=True).build(node)
        if isinstance(value, m.Expression):
            with suppress(ExpressionError):
                yield node.span, value_text(evaluate(value, values))


def _parameters(files: Files, path: Path) -> tuple[dict[str, m.ParamType], dict[str, m.ParamValue]]:
    """Return the types and the defaults of the parameters that a file knows."""
    types: dict[str, m.ParamType] = {}
    values: dict[str, m.ParamValue] = {}
    for name, found in files.definitions(path, "parameter").items():
        param = Builder(partial=True).build(found.occurrence.owner)
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


def _told(value: m.Expression, types: dict[str, m.ParamType], values: dict[str, m.ParamValue]) -> str:
    dimensions = Dimensions(types)
    powers = dimensions.of(value)
    if dimensions.mismatches:
        return f"`{written(value)}`: {dimensions.mismatches[0].message}"
    if powers is None:
        return ""
    try:
        result = value_text(evaluate(value, values))
    except ExpressionError as error:
        return f"{error.message} (by default)" if any(references(value)) else error.message
    by_default = " by default" if any(references(value)) else ""
    return f"`{written(value)}` is `{result}`{by_default}, {in_words(powers)}"


def _expression_at(node: Node, line: int, column: int) -> Node | None:
    """Return the outermost expression that holds a place."""
    if node.kind in get_args(m.Expression) and _holds(node.span, line, column):
        return node
    return next((found for part in _parts(node) if (found := _expression_at(part, line, column)) is not None), None)


def _parts(node: Node) -> Iterator[Node]:
    for value in node.fields.values():
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Node):
                yield part


def _holds(span: Span, line: int, column: int) -> bool:
    return (span.line, span.column) <= (line, column) < (span.end_line, span.end_column + 1)
