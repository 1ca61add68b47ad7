"""Items as text, by the patterns of their classes: `written` for a part of a statement, `layout` for a statement."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from foresee_dsl.language import model as m
from foresee_dsl.language.model.pattern import Form, Parts, Slot, form_of, read_pattern, slots_of
from foresee_dsl.language.model.values import NAME_PATTERN
from foresee_dsl.language.syntax.nodes import Key

_NAME = re.compile(NAME_PATTERN)
_DOTTED = re.compile(rf"{NAME_PATTERN}\.{NAME_PATTERN}")
_NONE: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Layout:
    """A statement to print: its head, and what is in its braces.

    `inside` is None for a statement without braces; otherwise the key of each inner statement in the model's path,
    and the item or (for a setting) its text. `inline`: in one line when nothing in it has a comment.
    """

    head: str
    inside: Sequence[tuple[Key, m.Item | str]] | None = None
    inline: bool = False


def layout(item: m.Item, parameters: frozenset[str] = _NONE) -> Layout:
    """Return how a statement is written.

    Args:
        item: any statement of the model.
        parameters: the names of the scenario's parameters (an id of the same name is quoted).
    """
    if isinstance(item, m.Add | m.Replace):
        return _held("add" if isinstance(item, m.Add) else "change", item.item, parameters)
    pattern = read_pattern(item.own_pattern())
    inside: list[tuple[Key, m.Item | str]] = []
    for parts in pattern.settings:
        (slot,) = slots_of(parts)
        if _is_given(item, slot.field):
            inside.append(((slot.field,), _phrase(parts, item, parameters)))
    inside += [((pattern.body, k), inner) for k, inner in enumerate(getattr(item, pattern.body, ()))]
    braces = pattern.braces == "always" or (pattern.braces == "filled" and bool(inside))
    head = _phrase(pattern.head, item, parameters)
    return Layout(head, inside if braces else None, item.fits_one_line(len(inside)))


def _held(word: str, item: m.Item, parameters: frozenset[str]) -> Layout:
    """A statement with a word in front of it."""
    shape = layout(item, parameters)
    head = "network" if isinstance(item, m.Network) and item.name == "here" else shape.head
    inside = None if shape.inside is None else [(("item", *key), inner) for key, inner in shape.inside]
    return Layout(f"{word} {head}", inside, shape.inline)


def written(item: m.Item, parameters: frozenset[str] = _NONE) -> str:
    """Return a part of a statement as text: `50 km/h`, `20 m along ego.route`, `time > 5 s and not arrived(ego)`.

    Digits are the author's, and a condition has no more brackets than it needs.

    Args:
        item: a value, place, condition or the like; of a statement, what stands before its braces.
        parameters: the names of the scenario's parameters (an id of the same name is quoted).
    """
    if isinstance(item, m.Quantity):
        return f"{item.value:f} {item.unit}" if item.unit else f"{item.value:f}"
    return _phrase(read_pattern(item.own_pattern()).head, item, parameters)


def identifier(text: str, parameters: frozenset[str] = _NONE) -> str:
    """Return a name, or a string when it is no name, or would be taken for one of the scenario's parameters."""
    return text if _NAME.fullmatch(text) and text not in parameters else f'"{text}"'


def word(value: m.ParamValue) -> str:
    """Return a parameter's value: a quantity, a name, a model or a string."""
    if isinstance(value, m.Quantity):
        return written(value)
    return value if _DOTTED.fullmatch(value) else identifier(value)


def listing(texts: Iterable[str]) -> str:
    """Return `[a, b]`."""
    return f"[{', '.join(texts)}]"


def _phrase(parts: Parts, item: m.Item, parameters: frozenset[str]) -> str:
    text = ""
    for part in parts:
        if isinstance(part, str):
            text += part
        elif isinstance(part, Slot):
            text += _field(item, part, parameters)
        elif all(_is_given(item, field) and getattr(item, field) != () for field in part.fields):
            text += _phrase(part.parts, item, parameters)
    return text


def _is_given(item: m.Item, field: str) -> bool:
    """Whether a field that may be left out is written: a default is, where the author wrote it."""
    value = getattr(item, field)
    if value is None:
        return False
    return value != type(item).model_fields[field].default or (value != () and field in item.model_fields_set)


def _field(item: m.Item, slot: Slot, parameters: frozenset[str]) -> str:
    value = getattr(item, slot.field)
    if not isinstance(value, tuple):
        return _text(value, item, slot.field, parameters)
    texts = [_text(part, item, slot.field, parameters) for part in value]
    return listing(texts) if slot.between is None else slot.between.join(texts)


def _text(value: m.Item | str, item: m.Item, field: str, parameters: frozenset[str]) -> str:
    if isinstance(value, m.Item):
        text = written(value, parameters)
        return f"({text})" if getattr(value, "kind", None) in item.in_brackets else text
    form = form_of(type(item), field)
    match form.form:
        case Form.NAME | Form.MODEL:
            return value
        case Form.ID:
            if value in item.never_bare:
                return f'"{value}"'
            return identifier(value, parameters if form.parameter else _NONE)
        case Form.WORD:
            return word(value)
        case Form.TEXT:
            return f'"{value}"'
