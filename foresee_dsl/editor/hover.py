"""Returns the help text for the word under the cursor, and the value and the dimension of an expression there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from foresee_dsl.editor import navigate
from foresee_dsl.editor.files import Definition, Files
from foresee_dsl.editor.symbols import Occurrence
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.dimensions import Dimensions, in_words
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.parser import plain
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.project.addresses import display_path
from foresee_dsl.language.syntax.builder import Builder
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.units import SI_WORD, UNITS, Unit

_TOKEN = re.compile(
    r'#.*|"[^"]*"?|(?P<number>-?[0-9]+(?:\.[0-9]+)?)(?:[ \t]*(?P<unit>[^\W\d][\w/^]*))?|(?P<word>[^\W\d]\w*)'
)
_LONGEST = 12
"""Maximum number of lines of a definition that are shown. Ours: a model has eleven."""


@dataclass(frozen=True)
class Hover:
    """The help for a place: a text in Markdown, and the span that it is about."""

    markdown: str
    span: Span


def hover(files: Files, path: Path, line: int, column: int) -> Hover | None:
    """Return the help text of a place (1-based), or None."""
    text = plain(files.text(path) or "")
    lines = text.split("\n")
    if line > len(lines):
        return None
    name = navigate.at(files, path, line, column)
    result = _describe_expression(files, path, line, column)
    if name is not None and (about := _of_name(files, path, name)):
        return Hover(f"{about}\n\n{result[0]}" if result is not None else about, name.span)
    for token in _TOKEN.finditer(lines[line - 1]):
        if not token.start() < column <= token.end() + 1:
            continue
        span = Span(line, token.start() + 1, line, token.end() + 1)
        unit = UNITS.get(token["unit"] or "")
        if token["number"] and unit is not None:
            about = conversions(float(token["number"]), unit)
            return Hover(f"{about}\n\n{result[0]}" if result is not None else about, span)
        if result is not None:
            break
        keyword = KEYWORDS.get(token["word"] or token["unit"] or "")
        if keyword is not None:
            if token["number"]:
                span = Span(line, token.start("unit") + 1, line, token.end() + 1)
            return Hover(f"**{keyword.word}**: {keyword.meaning}\n\n{_code(keyword.example)}", span)
    return Hover(*result) if result is not None else None


def conversions(number: float, unit: Unit) -> str:
    """Return a quantity in the other units of its dimension: `50 km/h = 13.89 m/s = 31.07 mph`."""
    si = number * unit.to_si
    first = SI_WORD[unit.dimension]
    others = sorted(
        (u for u in UNITS.values() if u.dimension == unit.dimension and u is not unit), key=lambda u: u.word != first
    )
    parts = [f"{number:g} {unit.word}", *(f"{_digits(si / u.to_si)} {u.word}" for u in others)]
    return f"`{' = '.join(parts)}`  ({unit.dimension.replace('_', ' ')})"


def _digits(value: float) -> str:
    """Return a number with four significant digits, without an exponent for usual values."""
    if value == 0 or not 1e-4 <= abs(value) < 1e7:
        return f"{value:.4g}"
    if abs(value) >= 1000:
        return f"{value:.1f}".rstrip("0").rstrip(".")
    return f"{float(f'{value:.4g}')}".removesuffix(".0")


def _of_name(files: Files, path: Path, use: Occurrence) -> str:
    if use.kind == "file":
        place = navigate.definition(files, path, use)
        root = files.root(place.path) if place is not None else None
        if place is None:
            return f"no file `{use.name}`"
        about = f"a {root.kind.__name__.lower()}, " if root is not None else ""
        return f"{about}`{display_path(place.path)}`" + _doc(root)
    if use.kind == "model" and (model := _model(files, path, use.name)) is not None:
        return model
    definition = files.define(path, use)
    if definition is None:
        return ""
    text = f"{_code(_written(files, definition))}\n\n{_where(path, definition)}"
    name = definition.occurrence.owner.fields.get("model")
    model = _model(files, path, name) if isinstance(name, str) else None
    return f"{text}\n\n{model}" if model is not None else text


def _model(files: Files, path: Path, name: str) -> str | None:
    """Return a model's size and abilities as Markdown, from its catalogue."""
    definition = files.definitions(path, "model").get(name)
    if definition is None:
        return None
    rows = [f"**{name}** {_where(path, definition)}", ""]
    for field, value in definition.occurrence.owner.fields.items():
        if isinstance(value, Node) and value.kind is m.Quantity:
            number, unit = value.fields["value"], value.fields.get("unit", "")
            rows.append(f"- {field.replace('_', ' ')} {number:f} {unit}".rstrip())
    return "\n".join(rows)


def _written(files: Files, definition: Definition) -> str:
    """Return the lines of a definition as in its file, without their common indentation."""
    span = definition.occurrence.owner.span
    lines = plain(files.text(definition.path) or "").split("\n")[span.line - 1 : span.end_line]
    if not lines:
        return ""
    if span.line == span.end_line:
        return lines[0][span.column - 1 : span.end_column - 1]
    indent = span.column - 1
    block = [line if k == 0 else line[min(indent, len(line) - len(line.lstrip())) :] for k, line in enumerate(lines)]
    block[0] = block[0][indent:]
    return "\n".join(block if len(block) <= _LONGEST else [*block[: _LONGEST - 1], "  ..."])


def _where(path: Path, definition: Definition) -> str:
    place = "in this file" if definition.path == path else f"in `{definition.path.name}`"
    return f"({definition.occurrence.kind}, {place}, line {definition.occurrence.span.line})"


def _doc(root: Node | None) -> str:
    body = root.fields.get("body") if root is not None else None
    for item in body if isinstance(body, tuple) else ():
        if isinstance(item, Node) and item.kind is m.Doc:
            return f"\n\n{item.fields.get('text', '')}"
    return ""


def _code(text: str) -> str:
    return f"```foresee\n{text}\n```"


def _describe_expression(files: Files, path: Path, line: int, column: int) -> tuple[str, Span] | None:
    """Return a description of the outermost expression at a place (1-based), and its span; None without an
    expression."""
    root = files.root(path)
    expressions = _expressions(root) if root is not None else ()
    node = next((node for node in expressions if _holds(node.span, line, column)), None)
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
    for part in node.parts:
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


def _holds(span: Span, line: int, column: int) -> bool:
    return (span.line, span.column) <= (line, column) < (span.end_line, span.end_column + 1)
