"""The help text for the word under the cursor."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.editor import navigate
from foresee_dsl.editor.answers.worked_out import worked_out
from foresee_dsl.editor.files import Files, Found
from foresee_dsl.editor.symbols import Occurrence
from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.parser import plain
from foresee_dsl.language.project.addresses import shown
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.units import SI_WORD, UNITS, Unit

_TOKEN = re.compile(
    r'#.*|"[^"]*"?|(?P<number>-?[0-9]+(?:\.[0-9]+)?)(?:[ \t]*(?P<unit>[^\W\d][\w/^]*))?|(?P<word>[^\W\d]\w*)'
)
_LONGEST = 12
"""So many lines of a definition are shown (ours: a model has eleven)."""


@dataclass(frozen=True)
class Hover:
    """A text in Markdown, about a place."""

    markdown: str
    span: Span


def hover(files: Files, path: Path, line: int, column: int) -> Hover | None:
    """Return what is known of a place (1-based), or None."""
    text = plain(files.text(path) or "")
    lines = text.split("\n")
    if line > len(lines):
        return None
    found = navigate.at(files, path, line, column)
    result = worked_out(files, path, line, column)
    if found is not None and (about := _of_name(files, path, found)):
        return Hover(f"{about}\n\n{result[0]}" if result is not None else about, found.span)
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
    """Four digits that matter, and never an exponent for what people write."""
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
        return f"{about}`{shown(place.path)}`" + _doc(root)
    if use.kind == "model" and (model := _model(files, path, use.name)) is not None:
        return model
    found = files.define(path, use)
    if found is None:
        return ""
    text = f"{_code(_written(files, found))}\n\n{_where(path, found)}"
    name = found.occurrence.owner.fields.get("model")
    model = _model(files, path, name) if isinstance(name, str) else None
    return f"{text}\n\n{model}" if model is not None else text


def _model(files: Files, path: Path, name: str) -> str | None:
    """A model's size and abilities, as in its catalogue."""
    found = files.definitions(path, "model").get(name)
    if found is None:
        return None
    rows = [f"**{name}** {_where(path, found)}", ""]
    for field, value in found.occurrence.owner.fields.items():
        if isinstance(value, Node) and value.kind is m.Quantity:
            number, unit = value.fields["value"], value.fields.get("unit", "")
            rows.append(f"- {field.replace('_', ' ')} {number:f} {unit}".rstrip())
    return "\n".join(rows)


def _written(files: Files, found: Found) -> str:
    """The lines of a definition, as they stand in its file."""
    span = found.occurrence.owner.span
    lines = plain(files.text(found.path) or "").split("\n")[span.line - 1 : span.end_line]
    if not lines:
        return ""
    if span.line == span.end_line:
        return lines[0][span.column - 1 : span.end_column - 1]
    indent = span.column - 1
    block = [line if k == 0 else line[min(indent, len(line) - len(line.lstrip())) :] for k, line in enumerate(lines)]
    block[0] = block[0][indent:]
    return "\n".join(block if len(block) <= _LONGEST else [*block[: _LONGEST - 1], "  ..."])


def _where(path: Path, found: Found) -> str:
    place = "in this file" if found.path == path else f"in `{found.path.name}`"
    return f"({found.occurrence.kind}, {place}, line {found.occurrence.span.line})"


def _doc(root: Node | None) -> str:
    body = root.fields.get("body") if root is not None else None
    for item in body if isinstance(body, tuple) else ():
        if isinstance(item, Node) and item.kind is m.Doc:
            return f"\n\n{item.fields.get('text', '')}"
    return ""


def _code(text: str) -> str:
    return f"```foresee\n{text}\n```"
