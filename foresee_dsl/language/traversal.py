"""Walks through a model: yields all items in an item, the parts of a condition or the actions of a trigger, and reads
concrete values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from decimal import Decimal
from typing import TypeGuard, get_args

from foresee_dsl.language import model as m

PLAIN = frozenset({str, bool, int, float, Decimal, type(None)})
"""Types of fields that contain no items. They are tested first, because `isinstance` of a pydantic class is slow."""
_KINDS: tuple[type[m.Item], ...] = get_args(get_args(m.Condition)[0])


def walk(item: m.Item) -> Iterator[m.Item]:
    """Return an item and everything in it, in the order of the file."""
    ahead = [item]
    while ahead:
        node = ahead.pop()
        yield node
        inner: list[m.Item] = []
        for value in vars(node).values():  # as `fields_of`, without the names: every check walks a file a dozen times
            if type(value) in PLAIN:
                continue
            if type(value) is tuple:
                inner += [part for part in value if type(part) not in PLAIN and isinstance(part, m.Item)]
            elif isinstance(value, m.Item):
                inner.append(value)
        ahead += reversed(inner)


def fields_of(item: m.Item) -> Iterator[tuple[str, m.Item]]:
    """Return the items that are direct parts of an item, with the names of their fields (`legs.1` in a tuple)."""
    for name, value in vars(item).items():  # the fields and nothing else: `model_fields` is four times slower
        if type(value) in PLAIN:
            continue
        if type(value) is tuple:
            for k, part in enumerate(value):
                if type(part) not in PLAIN and isinstance(part, m.Item):
                    yield f"{name}.{k}", part
        elif isinstance(value, m.Item):
            yield name, value


def changed_fields(item: m.Item, change: Callable[[str, object], object]) -> dict[str, object]:
    """Return the new values of those fields of an item that `change` replaces, by name.

    `change` gets a field's name and its value, or one by one the elements of a tuple; it returns the same object for a
    value that stays.
    """
    changed: dict[str, object] = {}
    for name, value in vars(item).items():
        if type(value) is tuple:
            parts = tuple(change(name, part) for part in value)
            if any(new is not old for new, old in zip(parts, value, strict=True)):
                changed[name] = parts
        elif (new := change(name, value)) is not value:
            changed[name] = new
    return changed


def is_condition(value: object) -> TypeGuard[m.Condition]:
    """Return whether a value is a condition of any class."""
    return isinstance(value, _KINDS)


def parts(condition: m.Condition) -> Iterator[m.Condition]:
    """Yield a condition and every condition in it, outer ones first."""
    yield condition
    if isinstance(condition, m.Both | m.Either):
        for inner in condition.conditions:
            yield from parts(inner)
    elif isinstance(condition, m.Not | m.Sustained):
        yield from parts(condition.condition)


def mapped(condition: m.Condition, change: Callable[[m.Condition], m.Condition]) -> m.Condition:
    """Return the condition with every innermost part replaced by `change(part)`; the same object if none changes."""
    if isinstance(condition, m.Both | m.Either):
        inner = tuple(mapped(part, change) for part in condition.conditions)
        same = all(a is b for a, b in zip(inner, condition.conditions, strict=True))
        return condition if same else condition.model_copy(update={"conditions": inner})
    if isinstance(condition, m.Not | m.Sustained):
        part = mapped(condition.condition, change)
        return condition if part is condition.condition else condition.model_copy(update={"condition": part})
    return change(condition)


def mentioned(condition: m.Condition) -> frozenset[str]:
    """Return every name of an actor, a junction or an edge in a condition, without the names of parameters."""
    return frozenset(name for part in parts(condition) for name in _names(part))


def _names(part: m.Item) -> Iterator[str]:
    if isinstance(part, m.Both | m.Either | m.Not | m.Sustained):
        return
    for field in type(part).model_fields:
        value = getattr(part, field)
        if isinstance(value, m.Measure | m.Named | m.AlongRoute | m.PastJunction | m.OfActor):
            yield from _names(value)
        elif isinstance(value, str) and field in ("actor", "other", "junction", "name"):
            yield value


def all_actions(actions: Iterable[m.Action]) -> Iterator[m.Action]:
    """Yield actions and those inside their `then` blocks, outer ones first."""
    for action in actions:
        yield action
        if isinstance(action, m.Then):
            yield from all_actions(action.actions)


def quantity_of(value: m.AnyValue) -> m.Quantity:
    """Return a value of a concrete scenario; raise `TypeError` if it is still a parameter or an expression."""
    if isinstance(value, m.Quantity):
        return value
    raise TypeError(f"{value!r} has no value: the scenario is not concrete")


def si_of(value: m.AnyValue) -> float:
    """Return a quantity of a concrete scenario in SI units; raise `TypeError` for a parameter or an expression."""
    return quantity_of(value).si


def word_of(value: str | m.Ref) -> str:
    """Return a name of a concrete scenario; raise `TypeError` for a parameter."""
    if isinstance(value, m.Ref):
        raise TypeError(f"the parameter {value.name} has no value: the scenario is not concrete")
    return value
