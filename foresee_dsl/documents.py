"""Conversion of records to JSON: a dataclass states which values a document contains; data and schema follow from that.

By default every field appears under its own name. A class attribute `shown` selects fields, properties and methods
without arguments instead, separated by spaces, in the order of the document:

    shown = "name class=story.contact time_s:2 opponent?"

`key=path` sets another key; its path may lead through other records, and a None on it gives null. A key `files/first`
is the key `first` of an object `files`. `:2` rounds numbers to two decimals. `?` gives null for an empty value (for
floats: a value that is not finite). `*` means every field, `*:3` with their numbers rounded.
"""

from __future__ import annotations

import math
import re
import sys
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import PurePath
from typing import Any, NamedTuple, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from typing_extensions import TypedDict  # pydantic requires this one before Python 3.12

_WORD = re.compile(r"(?:(\w[\w./-]*)=)?([\w.]+|\*)(\?)?(?::(\d))?")


class _Key(NamedTuple):
    """A key of a document.

    Attributes:
        name: the key, preceded by the keys of the objects that contain it. path: attributes that lead to the value.
        digits: decimals to which numbers are rounded; None: unrounded. empty: an empty value becomes null.
    """

    name: tuple[str, ...]
    path: tuple[str, ...]
    digits: int | None
    empty: bool


_PLAIN = frozenset((str, int, bool, types.NoneType))


def plain(value: Any, digits: int | None = None) -> Any:  # noqa: ANN401, PLR0911 - data of any kind
    """Return a value as JSON data: records become dictionaries, enums their values, paths texts."""
    kind = value.__class__
    if kind in _PLAIN:  # shortcut for nearly all values of a campaign's document: `match` takes ten times as long
        return value
    if kind is tuple or kind is list:
        return [plain(part, digits) for part in value]
    match value:
        case float():
            return value if digits is None else round(value, digits)
        case Enum():
            return value.value
        case str() | int() | None:
            return value
        case PurePath():
            return str(value)
        case BaseModel():
            return value.model_dump(mode="json")
        case Mapping():
            return {plain(key): plain(part, digits) for key, part in value.items()}
    if is_dataclass(value) or hasattr(value, "_asdict"):
        return _nested((key.name, _value(value, key)) for key in _keys(value.__class__))
    return [plain(part, digits) for part in value]


def _nested(values: Iterable[tuple[tuple[str, ...], Any]]) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for (*above, last), value in values:
        inner = document
        for part in above:
            inner = inner.setdefault(part, {})
        inner[last] = value
    return document


def _value(value: Any, key: _Key) -> Any:  # noqa: ANN401 - as above
    for step in key.path:
        if value is None:
            break
        value = getattr(value, step)
        if value.__class__ is types.MethodType:
            value = value()
    if key.empty and (not math.isfinite(value) if isinstance(value, float) else not value and value != 0):
        return None
    return plain(value, key.digits)


def shape(kind: Any, name: str = "") -> Any:  # noqa: ANN401, PLR0911 - types of any kind
    """Return the type of the data that `plain` returns for values of a type.

    Besides types, it accepts a mapping of keys to types, a list of one type, and a tuple of alternatives.
    """
    origin, parts = get_origin(kind), [part for part in get_args(kind) if part is not Ellipsis]
    match kind:
        case Mapping():
            types_of_keys = {key: shape(part, f"{name}{key.title()}") for key, part in kind.items()}
            return TypedDict(name, types_of_keys)  # type: ignore[operator]
        case [part]:
            return list[shape(part, f"{name}Part")]  # type: ignore[misc]
        case tuple():
            return Union[tuple(shape(part, f"{name}{k}") for k, part in enumerate(kind))]  # noqa: UP007
        case type() if issubclass(kind, PurePath):
            return str
        case type() if is_dataclass(kind) or hasattr(kind, "_fields"):
            return _shape_of_record(kind)
    if origin in (Union, types.UnionType):
        return Union[tuple(shape(part) for part in parts)]  # noqa: UP007 - the number of members varies
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return dict[shape(parts[0]), shape([*parts, int][1])]  # type: ignore[misc]  # a Counter's values
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return list[shape(parts[0])]  # type: ignore[misc]
    return kind


@cache
def _shape_of_record(kind: type) -> Any:  # noqa: ANN401 - as above
    record_type = shape(_nested((key.name, _type_of(kind, key)) for key in _keys(kind)), kind.__name__)
    record_type.__doc__ = (kind.__doc__ or "").partition("\n\n")[0]
    return record_type


def _type_of(kind: Any, key: _Key) -> Any:  # noqa: ANN401 - as above
    null = key.empty
    for step in key.path:
        members = [part for part in get_args(kind) if part is not types.NoneType]
        if isinstance(kind, types.UnionType):
            null, kind = null or len(members) < len(get_args(kind)), members[0]
        own = getattr(kind, step, None)
        call = getattr(own, "fget", None) or getattr(own, "func", None) or own
        if callable(call):
            kind = get_type_hints(call, include_extras=True)["return"]
        else:  # resolve this field alone: other fields may have types that exist only for the type checker
            holder = types.SimpleNamespace(__annotations__={step: kind.__annotations__[step]})
            kind = get_type_hints(holder, vars(sys.modules[kind.__module__]), include_extras=True)[step]
    return shape(kind | None if null and kind is not Any else kind)


@cache
def _keys(kind: Any) -> tuple[_Key, ...]:  # noqa: ANN401 - as above
    names = [field.name for field in fields(kind)] if is_dataclass(kind) else list(getattr(kind, "_fields", ()))
    return tuple(_read(getattr(kind, "shown", "*"), names))


def _read(description: str, names: Sequence[str]) -> Iterator[_Key]:
    for word in description.split():
        match = _WORD.fullmatch(word)
        if match is None:
            raise ValueError(f"{word!r} does not describe a key of a document")
        name, path, empty, digits = match.groups()
        for attribute_path in names if path == "*" else [path]:
            steps = tuple(attribute_path.split("."))
            yield _Key(tuple((name or steps[-1]).split("/")), steps, int(digits) if digits else None, bool(empty))
