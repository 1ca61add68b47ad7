"""What a comparison finds: differences in words, each with the edit that makes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

from foresee_dsl.language.model import Item

Group = Literal["parent", "stimulus", "ego", "environment", "network", "expectation"]
GROUPS: Mapping[Group, str] = {
    "parent": "Parent",
    "stimulus": "Stimulus",
    "ego": "Ego",
    "environment": "Environment",
    "network": "Network",
    "expectation": "Expectation and end",
}
"""What a difference touches, in the order in which they are shown, with the heading."""

Kind = Literal["changed", "added", "removed", "renamed", "moved"]
Op = Literal["set", "insert", "remove", "order", "rename"]
At = tuple[str | int, ...]


@dataclass(frozen=True)
class Edit:
    """One step of an edit script. All places are those of the first model, whatever else the script does.

    Attributes:
        op: `set` a field or an element; `insert` an element; `remove` one; give elements an `order`; `rename` a name
            wherever the model says it (before everything else).
        at: the way to it: `("body", 3, "speed")`. Of `insert` the last part is the element that it follows (-1: none);
            of `order` it is the tuple; of `rename` there is none.
        value: the new value; of `order` the elements' old numbers in their new order; of `rename` the old and the new
            name.
        rank: the order of what is inserted behind the same element.
    """

    op: Op
    at: At
    value: Any = None
    rank: int = 0


@dataclass(frozen=True)
class Difference:
    """One difference in meaning.

    Attributes:
        group: what it touches.
        path: where, in words: `runner.speed`, `case r02.gap`, `when ego.eta(j4) < 4 s`.
        kind: what happened to it.
        was: as the first file has it, as the language prints it; None where it was added.
        now: as the second file has it; None where it was removed.
        note: the difference of two numbers (`+10 km/h`), or what came into a list and what went; or "".
        edit: what makes the first model have it; see `apply`.
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
    """Return what happened to something that was, or is now, or both."""
    if was is None:
        return "added"
    return "changed" if now is not None else "removed"


def first_line(text: str | None) -> str:
    """Return a statement's first line; `...` stands for its block."""
    head, _, rest = (text or "").partition("\n")
    return f"{head} ... }}" if rest and head.endswith("{") else head


def once(path: str, statement: str | None) -> str:
    """Return path and statement; the statement alone where it says the path."""
    if not statement or statement == path:
        return path
    return statement if path in statement else f"{path}: {statement}"


def to_dict(change: Difference) -> dict[str, Any]:
    """Return a difference as plain data, for `--format json`."""
    fields = ("group", "path", "kind", "was", "now", "note")
    return {name: getattr(change, name) for name in fields} | {"edit": edit_to_dict(change.edit)}


def edit_to_dict(edit: Edit) -> dict[str, Any]:
    """Return an edit as plain data; `edit_from_dict` takes it back."""
    return {"op": edit.op, "at": list(edit.at), "value": _plain(edit.value), "rank": edit.rank}


def edit_from_dict(data: Mapping[str, Any]) -> Edit:
    """Return the edit of `edit_to_dict`; its values become items when it is applied."""
    return Edit(cast(Op, data["op"]), tuple(data["at"]), data["value"], data["rank"])


def _plain(value: object) -> object:
    if isinstance(value, Item):
        return value.model_dump(mode="json")
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return value
