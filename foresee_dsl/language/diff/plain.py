"""Prints a file in a normal form, so that files with the same meaning have the same text, for `git diff` with
`foresee textconv`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from decimal import Decimal
from typing import Any, NamedTuple, TypeVar, cast, get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.evaluate import evaluate
from foresee_dsl.language.diff.wording import field_path, is_statement, join, label, text
from foresee_dsl.language.meaning import SIGNIFICANT_DIGITS, order_counts, same_value
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.units import SI_WORD, UNITS, Dimension

_UNITS: Mapping[Dimension, str] = {**SI_WORD, "speed": "km/h"}
"""The unit in which each dimension is printed; speeds are in km/h, which road users read (ours)."""

_SORTED = (m.Scenario, m.Clip, m.Ego, m.Actor, m.Case, m.Catalogue, m.Mutant)
"""Blocks in which the order of statements counts only as `order_counts` says, so that all other statements are
sorted."""

_WORKED_OUT = (*m.EXPRESSIONS, m.Calculated)

_T = TypeVar("_T", bound=m.Item)


def plain_text(model: m.Definition, *, people: bool = False) -> str:
    """Return a definition as text: one unit for each dimension, no comments, statements in a fixed order.

    Names and labels stay, because other files refer to them, and expected results, because builds depend on them. With
    `people`, the statements for people stay too: `doc`, tags, risk, fidelity, origin.
    """
    return print_model(_plain(model, people))


class TextChange(NamedTuple):
    """A difference that does not change the meaning: in a `doc`, tags, an origin, or the form of a calculation.

    `path` is the label of the statement.
    """

    path: str
    was: str | None
    now: str | None


def texts(a: m.Item, b: m.Item) -> tuple[TextChange, ...]:
    """Return those differences between two definitions that do not change the meaning."""
    before, after = (
        {label(item): item for item in getattr(model, "body", ()) if isinstance(item, m.FOR_PEOPLE)} for model in (a, b)
    )
    labels = [*before, *(words for words in after if words not in before)]
    labelled = [(words, before.get(words), after.get(words)) for words in labels]
    unmeant = tuple(
        TextChange(words, text(was) if was else None, text(now) if now else None)
        for words, was, now in labelled
        if was is None or now is None or not same_value((was,), (now,)) or was != now
    )
    return (*unmeant, *_respelled("", a, b))


def _respelled(path: str, a: m.Item, b: m.Item) -> Iterator[TextChange]:
    """Yield the calculations that are written differently but always have the same result, such as `gap + gap` and `2 *
    gap`."""
    for name in type(a).model_fields if type(a) is type(b) else ():
        was, now = getattr(a, name), getattr(b, name)
        if isinstance(was, tuple) and isinstance(now, tuple):
            statements = {label(part): part for part in now if is_statement(part)}
            pairs = [
                (part, statements[label(part)]) for part in was if is_statement(part) and label(part) in statements
            ]
            if not pairs and len(was) == len(now):
                pairs = [(x, y) for x, y in zip(was, now, strict=True) if isinstance(x, m.Item)]
        else:
            pairs = [(was, now)] if isinstance(was, m.Item) and isinstance(now, m.Item) else []
        for old, new in pairs:
            inside = join(path, label(old)) if is_statement(old) else path
            if isinstance(old, _WORKED_OUT) or isinstance(new, _WORKED_OUT):
                if old != new and same_value(old, new):
                    yield TextChange(f"{field_path(inside, a, name)}", text(old), text(new))
            else:
                yield from _respelled(inside, old, new)


def _plain(item: _T, people: bool) -> _T:
    if isinstance(item, m.Calculated) and any(references(item)):
        return cast(_T, item.model_copy(update={"expression": _plain(item.expression, people)}))
    if isinstance(item, m.Quantity):
        return cast(_T, _one_unit(item.plain if isinstance(item, m.Calculated) else item))
    if isinstance(item, m.EXPRESSIONS) and not any(references(item)):
        with contextlib.suppress(ExpressionError):
            return cast(_T, _one_unit(evaluate(item)))
    fields: dict[str, Any] = {}
    for name in type(item).model_fields:
        value = getattr(item, name)
        if isinstance(value, m.Item):
            fields[name] = _plain(value, people)
        elif isinstance(value, tuple):
            fields[name] = _parts(item, name, value, people)
    if isinstance(item, m.When) and item.repeat == "once":
        fields["repeat"] = None  # `once` is the default of a trigger
    return item.model_copy(update=fields)


def _parts(owner: m.Item, name: str, parts: tuple[object, ...], people: bool) -> tuple[object, ...]:
    meant = [p for p in parts if people or isinstance(p, m.Expected) or not isinstance(p, m.FOR_PEOPLE)]
    printed = [_plain(part, people) if isinstance(part, m.Item) else part for part in meant]
    if not isinstance(owner, _SORTED) or not all(is_statement(part) for part in printed):
        # The order of the other statements matters here; the places of expected results among them do not.
        return tuple(sorted(printed, key=lambda part: isinstance(part, m.Expected)))
    rank = {kind: number for number, kind in enumerate(_classes(type(owner).model_fields[name].annotation))}

    def place(item: m.Item) -> tuple[int, str, str]:
        ordered = order_counts(item) is not None
        return rank.get(type(item), len(rank)), "" if ordered else label(item), "" if ordered else text(item)

    return tuple(sorted((part for part in printed if isinstance(part, m.Item)), key=place))


def _classes(annotation: object) -> Iterator[type]:
    """Yield the classes that a field may hold, in the order in which the model lists them."""
    parts = get_args(annotation)
    if not parts and isinstance(annotation, type):
        yield annotation
    for part in parts:
        yield from _classes(part)


def _one_unit(value: m.Quantity) -> m.Quantity:
    unit = _UNITS[value.dimension]
    number = value.si / (UNITS[unit].to_si if unit else 1.0) + 0.0
    digits = Decimal(f"{number:.{SIGNIFICANT_DIGITS}g}").normalize()
    return value.model_copy(update={"value": digits, "unit": unit})
