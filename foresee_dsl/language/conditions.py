"""What all users of conditions need: going through their parts, whom they mention, rebuilding them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeGuard, get_args

from foresee_dsl.language.model import (
    AlongRoute,
    Both,
    Condition,
    Either,
    Item,
    Measure,
    Named,
    Not,
    PastJunction,
    Sustained,
)

_KINDS: tuple[type[Item], ...] = get_args(get_args(Condition)[0])


def is_condition(value: object) -> TypeGuard[Condition]:
    """Whether a value is a condition, of whatever class."""
    return isinstance(value, _KINDS)


def parts(condition: Condition) -> Iterator[Condition]:
    """Yield a condition and every condition in it, outer ones first."""
    yield condition
    if isinstance(condition, Both | Either):
        for inner in condition.conditions:
            yield from parts(inner)
    elif isinstance(condition, Not | Sustained):
        yield from parts(condition.condition)


def mapped(condition: Condition, change: Callable[[Condition], Condition]) -> Condition:
    """Return the condition with every innermost part replaced by `change(part)`; the same object where none changes."""
    if isinstance(condition, Both | Either):
        inner = tuple(mapped(part, change) for part in condition.conditions)
        same = all(a is b for a, b in zip(inner, condition.conditions, strict=True))
        return condition if same else condition.model_copy(update={"conditions": inner})
    if isinstance(condition, Not | Sustained):
        part = mapped(condition.condition, change)
        return condition if part is condition.condition else condition.model_copy(update={"condition": part})
    return change(condition)


def mentioned(condition: Condition) -> frozenset[str]:
    """Return every name (of an actor, a junction or an edge) in a condition; parameters are no names."""
    return frozenset(name for part in parts(condition) for name in _names(part))


def _names(part: Item) -> Iterator[str]:
    if isinstance(part, Both | Either | Not | Sustained):
        return
    for field in type(part).model_fields:
        value = getattr(part, field)
        if isinstance(value, Measure | Named | AlongRoute | PastJunction):
            yield from _names(value)
        elif isinstance(value, str) and field in ("actor", "other", "junction", "name"):
            yield value
