"""What differs in meaning between two files of one kind, in words: `runner.model: car.compact => car.sports`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.addresses import parse_address
from foresee_dsl.language.concretise import value_text
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.expand import expanded_model
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.model import (
    Actor,
    Change,
    Clip,
    Definition,
    Doc,
    Ego,
    Fidelity,
    IgnoresRule,
    Item,
    MeetsState,
    Mutant,
    Network,
    Origin,
    Quantity,
    Ref,
    Risk,
    Scenario,
    SignalState,
    Tags,
    Traffic,
    UseModels,
    UseNetwork,
)
from foresee_dsl.language.project import Project
from foresee_dsl.language.project_codes import DIFFERENT_KINDS

_NO_MEANING = (Doc, Tags, Risk, Fidelity, Origin)
_PLAIN = (Ego, Actor, Traffic)
"""Blocks whose name alone says what they are; the path of the others begins with their keyword."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference.

    Attributes:
        path: where, in words: `runner.model`, `case r02.gap`, `weather.rain`.
        was: as the first file has it, as text; None where it was added.
        now: as the second file has it; None where it was removed.
    """

    path: str
    was: str | None
    now: str | None

    def __str__(self) -> str:
        if self.was is None:
            return f"added {self.path}{_of(self.now)}"
        if self.now is None:
            return f"removed {self.path}{_of(self.was)}"
        return f"{self.path}: {self.was} => {self.now}"


def diff_models(a: Definition, b: Definition) -> tuple[Difference, ...]:
    """Return what differs in meaning, in the order of the first file; what was added comes last in its block.

    Names of the definitions, `doc`, tags, layout, units and what is said about a child's origin do not count. Blocks
    with a name are matched by it. To compare a child with its parent, expand both (`expand.expanded_model`).

    Raises:
        InputError: the two are of different kinds.
    """
    if type(a) is not type(b):
        message = f"'{a.name}' is a {a.kind}, but '{b.name}' is a {b.kind}"
        help = "compare two files of one kind, or a child with its expanded parent"
        raise InputError((Diagnostic(code=DIFFERENT_KINDS, message=message, help=help),))
    return tuple(_fields("", a, b, skip=("name",)))


def diff_addresses(old: str, new: str) -> tuple[Difference, ...]:
    """Return what differs between two files, or test cases (`file.foresee::case`).

    Two files of one kind are compared as they are written; a file with a case, or a child and its parent, as the full
    scenarios that they stand for (a stale child too).

    Raises:
        InputError: a mistake in a file, or two files that cannot be compared.
    """
    project = Project(check_pin=False)
    if not any(parse_address(address)[1] for address in (old, new)):
        a, b = project.definition(old), project.definition(new)
        if type(a) is type(b) or not all(isinstance(model, Scenario | Clip | Mutant) for model in (a, b)):
            return diff_models(a, b)
    one, other = project.test_case(old), project.test_case(new)
    return diff_models(*_expanded(one, other))


def _expanded(one: TestCase, other: TestCase) -> tuple[Scenario, Scenario]:
    """Return both in full; without the network where it is the same (each names it from its own folder)."""
    apart = (UseModels,) if one.network != other.network else (UseModels, UseNetwork, Network)
    bodies = (tuple(i for i in expanded_model(case).body if not isinstance(i, apart)) for case in (one, other))
    a, b = (Scenario(name="compared", body=body) for body in bodies)
    return a, b


def to_dict(change: Difference) -> dict[str, str | None]:
    """Return a difference as plain data, for `--json`."""
    return asdict(change)


def render_text(changes: Iterable[Difference]) -> str:
    """Return the differences as text, one a line; empty where there are none."""
    return "".join(f"{change}\n" for change in changes)


def _of(value: str | None) -> str:
    return f": {value}" if value else ""


def _fields(path: str, a: Item, b: Item, skip: Sequence[str] = ()) -> Iterator[Difference]:
    for name in type(a).model_fields:
        if name not in ("kind", *skip):
            yield from _values(_join(path, name), getattr(a, name), getattr(b, name), owner=path)


def _join(path: str, name: str) -> str:
    """Return the path of something inside; the names of blocks and wrappers say nothing."""
    if name in ("body", "value", "values", "edges", "names"):
        return path
    return f"{path}.{name}" if path else name


def _values(path: str, a: object, b: object, owner: str) -> Iterator[Difference]:
    if same_value(a, b):
        return
    if _is_block(a) and _is_block(b) and isinstance(a, tuple) and isinstance(b, tuple):
        yield from _blocks(owner, a, b)
    elif _opens(a) and _opens(b) and type(a) is type(b) and isinstance(a, Item) and isinstance(b, Item):
        yield from _fields(path, a, b)
    else:
        yield Difference(path, _text(a), _text(b))


def _is_block(value: object) -> bool:
    """Return whether a tuple holds statements (`body`, `values`, `stages`, `actions`), which are matched one by one."""
    return isinstance(value, tuple) and all(isinstance(part, Item) and _has_key(part) for part in value)


def _has_key(item: Item) -> bool:
    fields = type(item).model_fields
    return "kind" in fields or "name" in fields


def _opens(value: object) -> bool:
    """Return whether an item is compared field by field; values, places and conditions are compared as a whole."""
    return isinstance(value, Item) and not isinstance(value, Quantity | Ref) and "kind" not in type(value).model_fields


def _blocks(path: str, a: tuple[Item, ...], b: tuple[Item, ...]) -> Iterator[Difference]:
    before, after = _keyed(a), _keyed(b)
    for key, item in before.items():
        other = after.get(key)
        if other is None:
            yield Difference(_join(path, key), _summary(item), None)
        elif not same_value(item, other):
            yield from _statement(_join(path, key), item, other)
    for key, item in after.items():
        if key not in before:
            yield Difference(_join(path, key), None, _summary(item))


def _statement(path: str, a: Item, b: Item) -> Iterator[Difference]:
    if type(a) is not type(b) or _said_in_key(a) != _said_in_key(b):
        yield Difference(path, _summary(a), _summary(b))
        return
    fields = [name for name in type(a).model_fields if name != "kind" and name not in _said_in_key(a)]
    if len(fields) == 1 and not _is_block(getattr(a, fields[0])):
        yield from _values(path, getattr(a, fields[0]), getattr(b, fields[0]), owner=path)
    else:
        yield from _fields(path, a, b, skip=_said_in_key(a))


def _keyed(items: tuple[Item, ...]) -> dict[str, Item]:
    """Give every statement the words that address it; what is equal or alike is told apart by a number."""
    keyed: dict[str, Item] = {}
    for item in items:
        if isinstance(item, _NO_MEANING):
            continue
        key, count = _key(item), 1
        while (numbered := key if count == 1 else f"{key} ({count})") in keyed:
            count += 1
        keyed[numbered] = item
    return keyed


_KEYS: Mapping[type[Item], tuple[str, tuple[str, ...]]] = {
    Change: ("{}.{}", ("actor", "property")),
    Network: ("network", ("name",)),
    SignalState: ("signal {}", ("junction",)),
    IgnoresRule: ("ignores {} at {}", ("what", "junction")),
    MeetsState: ("meets {} at {}", ("other", "junction")),
}
"""How statements without a name of their own are addressed, and the fields that this says."""


def _key(item: Item) -> str:
    """Return the words that address a statement in its block."""
    form, names = _KEYS.get(type(item), ("", ()))
    if form:
        return form.format(*(_text(getattr(item, name)) or "all" for name in names))
    said = [_text(getattr(item, name)) or "" for name in _said_in_key(item) if name != "mode"]
    if isinstance(item, _PLAIN):
        return item.name
    words = [*said, _keyword(item)] if "actor" in _said_in_key(item) else [_keyword(item), *said]
    return " ".join(filter(None, words))


_KEYWORDS = {
    "edge_route": "route",
    "use_network": "use network",
    "use_models": "use models",
    "clip_goal": "goal",
    "start_at": "start at",
    "start_speed": "start speed",
    "walked": "moving",
    "meets_state": "meets",
    "does_ignore": "ignores",
    "changes_speed": "changes speed",
    "changes_lane": "changes lane",
}


def _keyword(item: Item) -> str:
    kind = str(getattr(item, "kind", ""))
    if kind == "expect":
        kind = f"expect {getattr(item, 'mode', '')}"
    return _KEYWORDS.get(kind, kind)


def _said_in_key(item: Item) -> tuple[str, ...]:
    """Return the fields that the item's key already says."""
    if type(item) in _KEYS:
        return _KEYS[type(item)][1]
    return tuple(name for name in ("name", "actor", "mode", "condition") if name in type(item).model_fields)


def _summary(item: Item) -> str:
    """Return a statement's content in a few words: its values, without its blocks."""
    skip = {"kind", "body", "actions", "stages", *_said_in_key(item)}
    parts = [_text(getattr(item, name)) for name in type(item).model_fields if name not in skip]
    return " ".join(part for part in parts if part)


_OPERATORS = {"and": " and ", "or": " or "}


def _text(value: object) -> str | None:
    """Return a value as words; None for what is not there."""
    if value is None or value is False or value == ():
        return None
    if isinstance(value, Quantity):
        return value_text(value)
    if isinstance(value, Ref):
        return value.name
    if isinstance(value, tuple):
        return f"[{', '.join(_text(part) or '' for part in value)}]"
    if isinstance(value, bool):
        return "yes"
    return _item_text(value) if isinstance(value, Item) else str(value)


def _item_text(item: Item) -> str:
    kind = str(getattr(item, "kind", ""))
    if kind == "point":
        return f"({_text(getattr(item, 'x', None))}, {_text(getattr(item, 'y', None))})"
    if kind in _OPERATORS:
        return _OPERATORS[kind].join(_text(part) or "" for part in getattr(item, "conditions", ()))
    if kind in ("measure", "predicate"):
        return _call(item)
    if kind in ("not", "and", "or"):
        return f"not ({_text(getattr(item, 'condition', None))})"
    return " ".join(filter(None, (_text(getattr(item, name)) for name in type(item).model_fields if name != "kind")))


def _call(item: Item) -> str:
    names = [str(found) for name in ("actor", "other") if (found := getattr(item, name, None)) is not None]
    what = str(getattr(item, "what", ""))
    return f"{what}({', '.join(names)})" if names else what
