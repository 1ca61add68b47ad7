"""Builds the pydantic model from nodes with places; every validation error becomes an error at the field's place."""

from __future__ import annotations

import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import HelpText, one_of, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import closest, did_you_mean, unit_hint
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.units import EXAMPLES, NOUNS

SHOWN = 40
"""Maximum number of characters of a value that a message repeats."""


class Builder:
    """Builds a model from nodes, bottom up. It continues after an error, so that `errors` holds all of them."""

    def __init__(self, *, partial: bool = False) -> None:
        """Make a builder; `partial`: parts of the tree are missing, so a missing field is not an error."""
        self.spans: dict[tuple[int, str], Span] = {}
        self.errors: list[Diagnostic] = []
        self._partial = partial

    def build(self, node: Node) -> m.Item | None:
        """Return the node's item; None if it or a part of it has an error."""
        values: dict[str, object] = {}
        failed: set[str] = set()
        for name, raw in node.fields.items():
            if isinstance(raw, Node):
                built = self.build(raw)
                if built is None:
                    failed.add(name)
                else:
                    values[name] = built
            elif isinstance(raw, tuple):
                parts = [self.build(part) if isinstance(part, Node) else part for part in raw]
                values[name] = tuple(part for part in parts if part is not None)
                if None in parts:
                    failed.add(name)
            else:
                values[name] = raw
        return self._construct(node, values, failed)

    def _construct(self, node: Node, values: dict[str, Any], failed: set[str]) -> m.Item | None:
        try:
            item = node.kind(**values)
        except ValidationError as error:
            self._explain(node, error, failed)
            return None
        if failed:
            return None
        spans, own = self.spans, id(item)
        spans[own, ""] = node.span
        for name, span in node.places.items():
            spans[own, name] = span
        return item

    def _explain(self, node: Node, error: ValidationError, failed: set[str]) -> None:
        """Turn the validation errors of one item into text errors, one for each field."""
        if not node.fields:
            return  # a part is nested too deeply, which is reported at its place
        seen: set[str] = set()
        for detail in error.errors(include_url=False):
            field = str(detail["loc"][0]) if detail["loc"] else ""
            index = f"{field}.{detail['loc'][1]}" if len(detail["loc"]) > 1 else field
            place = node.places.get(index) or node.places.get(field) or node.span
            key = index if index in node.places else field
            if field in failed or key in seen or (self._partial and detail["type"] in ("missing", "too_short")):
                continue
            seen.add(key)
            self.errors.append(_error(node, field, detail, place))


def _error(node: Node, field: str, detail: ErrorDetails, place: Span) -> Diagnostic:
    text_shown = _short(detail["input"])
    if field == "unit":
        return Diagnostic.of("FS005", f"unknown unit '{text_shown}'", unit_hint(str(detail["input"])), span=place)
    text, limits = str(detail["input"]), detail.get("ctx", {})
    match detail["type"]:
        case "missing":
            error = Diagnostic.of("FS014", f"{_what(node)} needs `{field}`", "add a " + write(field), span=_head(node))
        case "literal_error":
            error = _not_one_of(node, field, text, place)
        case "value_error":
            error = _wrong_dimension(detail, text_shown, place)
        case "string_pattern_mismatch":
            error = _wrong_text(node, field, text, place)
        case "too_short":
            least = limits.get("min_length", 1)
            noun = _PARTS.get(field, field.removesuffix("s")) + ("s" if least > 1 else "")
            message = f"{_what(node)} needs at least {least} {noun}"
            between: HelpText = "a line for each" if field == "actions" else write(",") + " between them"
            help: HelpText = f"write {least} or more, with " + between
            error = Diagnostic.of("FS014", message, help, span=place)
        case "string_too_long" | "string_too_short":
            most = limits.get("max_length")
            help = f"use at most {most} characters" if most else "write something between the quotes"
            error = Diagnostic.of("FS017", "this text is empty or too long", help, span=place)
        case "greater_than_equal" | "less_than_equal" | "finite_number":
            error = Diagnostic.of(
                "FS016", f"`{text_shown}` is out of range", "use a number between -1e9 and 1e9", span=place
            )
        case _:
            help = "the value of " + write(field) + " is of another kind" if field else ""
            if node.kind is m.Change:
                help = "write a value with its unit, or the name of a model"
            error = Diagnostic.of("FS010", f"`{text_shown}` does not fit here", help, span=place)
    return error


_PARTS = {"points": "place", "outline": "corner", "green": "road"}
"""What a part of a list is called, if its field has another name."""

_NOUNS = {
    "what": "rule", "turns": "turn", "preventable": "answer", "anticipating": "answer", "manner": "style",
    "how": "allocation",
}  # fmt: skip


def _not_one_of(node: Node, field: str, word: str, place: Span) -> Diagnostic:
    words = form_of(node.kind, field).words
    near = closest(word, words)
    help: HelpText = did_you_mean(word, words) or "write one of " + one_of(words, wrong=word)
    if node.kind is m.Expected and field == "failure":
        help = (
            "write F1 (off the road or into an object), F2 (into a pedestrian), F3 (frontal), F4 (lateral), F5 (rear), "
            "stuck, rule or timeout"
        )
    elif field == "what" and node.kind in (m.Ignores, m.IgnoresRule) and near is None:
        help = "write " + write(f"ignores priority at {word}") + " or " + write(f"ignores signals at {word}")
    noun = _NOUNS.get(field, field)
    return Diagnostic.of("FS012", f"unknown {noun} '{_short(word)}'", help, span=place)


def _wrong_dimension(detail: ErrorDetails, text: str, place: Span) -> Diagnostic:
    if "whole number" in detail["msg"]:
        return Diagnostic.of("FS010", f"`{text}` is not a whole number", "write one such as " + write("2"), span=place)
    error = detail.get("ctx", {}).get("error")
    if not isinstance(error, m.WrongDimensionError):
        return Diagnostic.of("FS010", detail["msg"].removeprefix("Value error, "), "", span=place)
    needed = error.needed
    value = detail["input"]
    help = f"write {NOUNS[needed]} such as " + write(EXAMPLES[needed])
    unit = EXAMPLES[needed].partition(" ")[2]
    if isinstance(value, m.Quantity) and not value.unit:
        help = f"write {NOUNS[needed]} such as " + write(f"{text} {unit}") if unit else help
        return Diagnostic.of("FS010", f"`{text}` has no unit, but {NOUNS[needed]} is needed here", help, span=place)
    is_a = NOUNS[value.dimension] if isinstance(value, m.Quantity) else "something else"
    return Diagnostic.of("FS010", f"`{text}` is {is_a}, but {NOUNS[needed]} is needed here", help, span=place)


def _wrong_text(node: Node, field: str, text: str, place: Span) -> Diagnostic:
    if field == "pin":
        help: HelpText = "a pin is " + write("sha256:") + " and twelve digits or letters a-f, such as "
        help += write("sha256:5ef2c6120a41")
        return Diagnostic.of("FS019", f"`{_short(text)}` is not a pin", help, span=place)
    if field in ("model", "models", "was", "now") or node.kind is m.VehicleModel:
        help = "models are called class.variant, such as " + write("car.compact")
        return Diagnostic.of("FS011", f"`{_short(text)}` is not the name of a model", help, span=place)
    if not text:
        return Diagnostic.of("FS017", f"this {field} is empty", "write something between the quotes", span=place)
    import unicodedata

    letters = unicodedata.normalize("NFKD", text.lower()).encode("ascii", "ignore").decode()
    plain = re.sub(r"[^a-z0-9_]+", "_", letters).strip("_").lstrip("0123456789_")
    help = "names are snake_case: small letters a-z, digits and underscores, a letter first"
    if plain and plain != text:
        help += ", such as " + write(_short(plain))
    return Diagnostic.of("FS011", f"`{_short(text)}` is not a name", help, span=place)


def _what(node: Node) -> str:
    name = node.fields.get("name")
    words = {m.When: "this trigger", m.FollowsPath: "`follows`", m.EdgeRoute: "this route", m.Path: "this path"}
    word = words.get(node.kind) or ("model" if node.kind is m.VehicleModel else node.kind.__name__.lower())
    return f"{word} '{_short(name)}'" if isinstance(name, str) else word


def _head(node: Node) -> Span:
    """Return the place of a statement up to its brace; underlining a whole block would be unreadable."""
    if node.block is None:
        return node.span
    return Span(node.span.line, node.span.column, node.block.line, node.block.column)


def _short(value: object) -> str:
    if isinstance(value, m.Quantity):
        value = f"{value.value:f} {value.unit}".strip()
    elif isinstance(value, m.Ref):
        value = value.name
    text = str(value)
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."
