"""Models with a few things changed, of whatever classes: so that two models to compare cost one that is drawn."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import ValidationError

from foresee_dsl.errors import InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.units import UNITS
from tests.support.strategies import alternatives, hints

_T = TypeVar("_T", bound=m.Item)
_TRIES = 20
"""Number of draws of changes before it gives up, if no file can express them."""


@dataclass(frozen=True)
class _Place:
    """A field, or an element of one: the way to it, and what it may hold."""

    at: tuple[str | int, ...]
    value: object
    hint: Any


def varied(model: _T, rng: random.Random, changes: int = 1) -> _T:
    """Return a model with some changes, each to one field or list: other values, and statements put elsewhere.

    It is one that a file can say; where none is found, the model as it is.
    """
    for _ in range(_TRIES):
        found = model
        for _ in range(changes):
            found = _once(found, rng) or found
        if found is not model and _can_be_said(found):
            return found
    return model


def _can_be_said(model: m.Item) -> bool:
    assert isinstance(model, get_args(m.Definition))
    try:
        return parse(print_model(model), "x").model == model
    except (InputError, TypeError):  # TypeError: a measure without the actor that it needs cannot be printed
        return False


def _once(model: _T, rng: random.Random) -> _T | None:
    places = list(_places(model))
    place = rng.choice(places)
    others: dict[str, list[object]] = defaultdict(list)
    for other in places:
        others[repr(other.hint)].append(other.value)
    found = [value for value in _others(place, others[repr(place.hint)], rng) if value != place.value]
    if not found:
        return None
    try:
        return type(model).model_validate(_replaced(model, place.at, rng.choice(found)))
    except ValidationError:
        return None


def _places(item: m.Item, at: tuple[str | int, ...] = ()) -> Iterator[_Place]:
    for name, hint in hints(type(item)).items():
        value = getattr(item, name)
        if name == "kind" and isinstance(type(item).model_fields[name].default, str):
            continue
        yield _Place((*at, name), value, hint)
        for k, part in enumerate(value if isinstance(value, tuple) else ()):
            if isinstance(part, m.Item):
                yield from _places(part, (*at, name, k))
        if isinstance(value, m.Item) and not isinstance(value, m.Quantity):
            yield from _places(value, (*at, name))


def _others(place: _Place, elsewhere: list[object], rng: random.Random) -> Iterator[object]:
    """Yield other values that a place may have: like its own, like those of the same kind elsewhere, or none."""
    value = place.value
    words = [w for hint in alternatives(place.hint) if get_origin(hint) is Literal for w in get_args(hint)]
    yield from elsewhere
    yield from words
    if type(None) in list(alternatives(place.hint)):
        yield None
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, m.Quantity):
        like = [word for word, unit in UNITS.items() if unit.dimension == value.dimension]
        yield value.model_copy(update={"value": value.value + Decimal(rng.choice(("1", "-0.5", "0.001")))})
        yield value.model_copy(update={"unit": rng.choice(like) if like else value.unit})
    elif isinstance(value, str) and value not in words:
        yield f"{value}_2"
    elif isinstance(value, tuple):
        yield from _other_lists(value, [part for parts in elsewhere if isinstance(parts, tuple) for part in parts], rng)


def _other_lists(value: tuple[object, ...], parts: list[object], rng: random.Random) -> Iterator[tuple[object, ...]]:
    at = rng.randrange(len(value) + 1)
    yield (*value[:at], *value[at + 1 :])
    yield (*value[at:], *value[:at])
    if parts:
        yield (*value[:at], rng.choice(parts), *value[at:])


def _replaced(value: Any, at: tuple[str | int, ...], new: object) -> Any:
    """Return an item's fields (or a list) with another value in one place."""
    if not at:
        return new
    step, *rest = at
    if isinstance(value, tuple):
        return tuple(_replaced(part, tuple(rest), new) if k == step else part for k, part in enumerate(value))
    given = {name: getattr(value, name) for name in value.model_fields_set}
    return given | {step: _replaced(getattr(value, str(step)), tuple(rest), new), "kind": getattr(value, "kind", None)}
