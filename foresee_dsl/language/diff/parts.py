"""The records of a comparison, each difference in words and as an edit, and the function that applies edits to a
model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, get_args, get_origin

from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import changed_fields

Group = Literal["parent", "stimulus", "ego", "environment", "network", "expectation"]
GROUPS: Mapping[Group, str] = {
    "parent": "Parent",
    "stimulus": "Stimulus",
    "ego": "Ego",
    "environment": "Environment",
    "network": "Network",
    "expectation": "Expectation and end",
}
"""The groups of differences in the order of the report, each with its heading."""

Kind = Literal["changed", "added", "removed", "renamed", "moved"]
Op = Literal["set", "insert", "remove", "order", "rename"]
At = tuple[str | int, ...]


@dataclass(frozen=True)
class Edit:
    """One step of an edit script. All places refer to the first model before any edit, whatever other edits the script
    has.

    Attributes:
        op: `set` a field or an element; `insert` or `remove` an element; give elements an `order`; `rename` a name
            everywhere in the model (before all other edits).
        at: the path: `("body", 3, "speed")`. For `insert` its last part is the index of the element before (-1: none);
            for `order` it is the path of the tuple; for `rename` it is empty.
        value: the new value; for `order` the elements' old indices in their new order; for `rename` the old and the
            new name.
        rank: order of the elements that are inserted behind the same element.
    """

    op: Op
    at: At
    value: Any = None
    rank: int = 0


@dataclass(frozen=True)
class Difference:
    """One difference in meaning.

    Attributes:
        group: its group in the report.
        path: its place in words: `runner.speed`, `case r02.gap`, `when ego.eta(j4) < 4 s`.
        kind: the kind of change.
        was: the text in the first file, as the language prints it; None for an addition.
        now: the text in the second file; None for a removal.
        note: the difference of two numbers (`+10 km/h`), or the elements added to and removed from a list; or "".
        edit: the edit that makes this change in the first model; see `apply`.
    """

    group: Group
    path: str
    kind: Kind
    was: str | None
    now: str | None
    note: str
    edit: Edit

    def __str__(self) -> str:
        if self.kind == "added":
            return f"added {once(self.path, first_line(self.now))}"
        if self.kind == "removed":
            return f"removed {once(self.path, first_line(self.was))}"
        if self.kind == "renamed":
            return f"renamed {self.was}: {self.now}"
        note = f" ({self.note})" if self.note else ""
        return f"{self.path}: {first_line(self.was)} => {first_line(self.now)}{note}"


def kind_of(was: str | None, now: str | None) -> Kind:
    """Return the kind of change, which follows from the old and the new text."""
    if was is None:
        return "added"
    return "changed" if now is not None else "removed"


def first_line(text: str | None) -> str:
    """Return a statement's first line; `...` stands for its block."""
    head, _, rest = (text or "").partition("\n")
    return f"{head} ... }}" if rest and head.endswith("{") else head


def once(path: str, statement: str | None) -> str:
    """Return a difference's path and statement; the statement alone if it already contains the path."""
    if not statement or statement == path:
        return path
    return statement if path in statement else f"{path}: {statement}"


_T = TypeVar("_T", bound=m.Item)


def apply(model: _T, changes: Iterable[Difference | Edit]) -> _T:
    """Return a model with differences applied: `apply(a, diff_models(a, b))` has the meaning of `b`.

    The model may also be another one that has statements in the same places. `changes` holds all or some of the
    differences, in any order, or their edits.

    Raises:
        ValueError: an edit's place is not in the model, or the result is not valid (pydantic's `ValidationError`).
    """
    edits = [change.edit if isinstance(change, Difference) else change for change in changes]
    for edit in edits:
        if edit.op == "rename":
            old, new = edit.value
            model = renamed(model, old, new)
    result = _item(model, [edit for edit in edits if edit.op != "rename"], ())
    if not isinstance(result, type(model)):
        raise ValueError(f"the edits change a {type(model).__name__} into a {type(result).__name__}")
    return result


def _item(item: m.Item, edits: Sequence[Edit], at: At) -> m.Item:
    """Return a validated copy of an item with the edits at or below its place."""
    changed: dict[str, Any] = {}
    for name, mine in _by_step(edits, at).items():
        if not isinstance(name, str) or name not in type(item).model_fields:
            raise ValueError(f"there is no {'.'.join(map(str, (*at, name)))}")
        changed[name] = _value(getattr(item, name), mine, (*at, name))
    values = {name: getattr(item, name) for name in type(item).model_fields if name in item.model_fields_set}
    return type(item).model_validate(values | changed) if changed else item


def _value(value: object, edits: Sequence[Edit], at: At) -> object:
    whole = next((edit for edit in edits if edit.op == "set" and edit.at == at), None)
    if whole is not None:
        return whole.value
    if isinstance(value, tuple):
        return _elements(value, edits, at)
    if isinstance(value, m.Item):
        return _item(value, edits, at)
    raise ValueError(f"there is nothing in {'.'.join(map(str, at))}")


def _elements(parts: tuple[object, ...], edits: Sequence[Edit], at: At) -> tuple[object, ...]:
    """Return a tuple after its edits: elements are changed, removed and reordered, and each new element is inserted
    behind the element that it follows."""
    order = list(range(len(parts)))
    behind: dict[int, list[Edit]] = {}
    own: list[Edit] = []
    for edit in edits:
        if edit.op == "insert" and edit.at[:-1] == at:
            behind.setdefault(int(edit.at[-1]), []).append(edit)
        elif edit.op == "order" and edit.at == at:  # the elements in their new order go to the places that they had
            for place, number in zip(sorted(edit.value), edit.value, strict=True):
                order[place] = number
        else:
            own.append(edit)
    mine = _by_step(own, at)
    outside = [step for step in (*mine, *behind) if not (isinstance(step, int) and -1 <= step < len(parts))]
    if outside:
        raise ValueError(f"there is no element {outside[0]} in {'.'.join(map(str, at))}")
    elements: list[object] = []
    for number in (-1, *order):
        edits_here = mine.get(number, [])
        if number >= 0 and not any(edit.op == "remove" and edit.at == (*at, number) for edit in edits_here):
            elements.append(_value(parts[number], edits_here, (*at, number)) if edits_here else parts[number])
        elements += [edit.value for edit in sorted(behind.get(number, []), key=lambda edit: edit.rank)]
    return tuple(elements)


def _by_step(edits: Sequence[Edit], at: At) -> Mapping[str | int, list[Edit]]:
    """Return the edits below a place, grouped by the next step of their path."""
    groups: dict[str | int, list[Edit]] = {}
    for edit in edits:
        groups.setdefault(edit.at[len(at)], []).append(edit)
    return groups


def renamed(item: _T, old: str, new: str) -> _T:
    """Return an item in which one name is replaced in every field that holds names."""

    def renamed_part(name: str, part: object) -> object:
        if isinstance(part, m.Item) and (isinstance(part, m.Calculated) or not isinstance(part, m.Quantity)):
            return renamed(part, old, new)
        return new if part == old and not _takes_words(type(item).model_fields[name].annotation) else part

    changed = changed_fields(item, renamed_part)
    return item.model_copy(update=changed) if changed else item


def _takes_words(annotation: object) -> bool:
    """Return whether a field takes words of the language, such as `left` or `stop`, which must not be renamed."""
    return get_origin(annotation) is Literal or any(map(_takes_words, get_args(annotation)))
