"""Recalculates the statements of parameters after an extension has changed defaults."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values, references
from foresee_dsl.language.traversal import walk

_T = TypeVar("_T", bound=m.Item)
Moved = Callable[[m.Item, m.Item], None]
"""A function that is called for every replaced item with (old item, new item)."""


def settled_again(name: str, body: Sequence[m.ScenarioItem], moved: Moved) -> tuple[m.ScenarioItem, ...]:
    """Return the statements of a scenario, with the values of its parameters recalculated; the same statements if none
    are calculated.

    Raises:
        ExpressionError: a calculation has no result with these defaults.
    """
    params = (item for item in body if isinstance(item, m.Param))
    if not any(isinstance(part, m.Calculated) and any(references(part)) for item in params for part in walk(item)):
        return tuple(body)
    whole = m.Scenario(name=name, body=tuple(body))
    values = case_values(whole, m.Case(name="defaults", values=()))
    return tuple(_settled(item, values, moved) if isinstance(item, m.Param) else item for item in body)


def _settled(item: _T, values: Mapping[str, m.ParamValue], moved: Moved) -> _T:
    new: dict[str, object] = {}
    if isinstance(item, m.Calculated):
        from foresee_dsl.language.arithmetic.evaluate import evaluate

        result = evaluate(item.expression, values)
        new = {"value": result.value, "unit": result.unit}
    else:
        for field in type(item).model_fields:
            value = getattr(item, field)
            if isinstance(value, tuple):
                new[field] = tuple(
                    _settled(part, values, moved) if isinstance(part, m.Item) else part for part in value
                )
            elif isinstance(value, m.Item):
                new[field] = _settled(value, values, moved)
    settled = item.model_copy(update=new) if new else item
    if settled is not item:
        moved(item, settled)
    return settled
