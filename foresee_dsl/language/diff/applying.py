"""An edit script at work: the first model becomes, in meaning, the second."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from foresee_dsl.language.diff.matching import renamed
from foresee_dsl.language.diff.parts import At, Difference, Edit
from foresee_dsl.language.model import Item

_T = TypeVar("_T", bound=Item)


def apply(model: _T, changes: Iterable[Difference | Edit]) -> _T:
    """Return a model with differences made: `apply(a, diff_models(a, b))` means what `b` means.

    Args:
        model: the first of the two that were compared. It may also be another one with statements in the same places.
        changes: what `diff_models` found, all or some, in any order; or their edits (`edit_from_dict`).

    Raises:
        ValueError: an edit's place is not in the model, or what comes out is no model (pydantic's `ValidationError`).
    """
    edits = [change.edit if isinstance(change, Difference) else change for change in changes]
    for edit in edits:
        if edit.op == "rename":
            old, new = edit.value
            model = renamed(model, old, new)
    made = _item(model, [edit for edit in edits if edit.op != "rename"], ())
    if not isinstance(made, type(model)):
        raise ValueError(f"the edits make a {type(made).__name__} of a {type(model).__name__}")
    return made


def _item(item: Item, edits: Sequence[Edit], at: At) -> Item:
    """Rebuild an item, validated, with the edits at or below its place."""
    changed: dict[str, Any] = {}
    for name, mine in _by_step(edits, at).items():
        if not isinstance(name, str) or name not in type(item).model_fields:
            raise ValueError(f"there is no {'.'.join(map(str, (*at, name)))}")
        changed[name] = _value(getattr(item, name), mine, (*at, name))
    if not changed:
        return item
    given = {name: getattr(item, name) for name in type(item).model_fields if name in item.model_fields_set}
    return type(item).model_validate(given | changed)


def _value(value: object, edits: Sequence[Edit], at: At) -> object:
    whole = next((edit for edit in edits if edit.op == "set" and edit.at == at), None)
    if whole is not None:
        return whole.value
    if isinstance(value, tuple):
        return _elements(value, edits, at)
    if isinstance(value, Item):
        return _item(value, edits, at)
    raise ValueError(f"there is nothing in {'.'.join(map(str, at))}")


def _elements(parts: tuple[object, ...], edits: Sequence[Edit], at: At) -> tuple[object, ...]:
    """Rebuild a tuple: elements edited or left out, in their new order, and what comes in behind each."""
    order = _order(len(parts), [edit for edit in edits if edit.op == "order" and edit.at == at])
    behind: dict[int, list[Edit]] = {}
    own: list[Edit] = []
    for edit in edits:
        if edit.op == "insert" and edit.at[:-1] == at:
            behind.setdefault(int(edit.at[-1]), []).append(edit)
        elif edit.op != "order" or edit.at != at:
            own.append(edit)
    mine = _by_step(own, at)
    outside = [step for step in (*mine, *behind) if not (isinstance(step, int) and -1 <= step < len(parts))]
    if outside:
        raise ValueError(f"there is no element {outside[0]} in {'.'.join(map(str, at))}")
    made: list[object] = []
    for number in (-1, *order):
        edits_here = mine.get(number, [])
        if number >= 0 and not any(edit.op == "remove" and edit.at == (*at, number) for edit in edits_here):
            made.append(_value(parts[number], edits_here, (*at, number)) if edits_here else parts[number])
        made += [edit.value for edit in sorted(behind.get(number, []), key=lambda edit: edit.rank)]
    return tuple(made)


def _order(count: int, edits: Sequence[Edit]) -> list[int]:
    """Return the elements' numbers with each order put into the places that its elements had."""
    order = list(range(count))
    for edit in edits:
        for place, number in zip(sorted(edit.value), edit.value, strict=True):
            order[place] = number
    return order


def _by_step(edits: Sequence[Edit], at: At) -> Mapping[str | int, list[Edit]]:
    """Group the edits below a place by the next step of their way."""
    groups: dict[str | int, list[Edit]] = {}
    for edit in edits:
        groups.setdefault(edit.at[len(at)], []).append(edit)
    return groups
