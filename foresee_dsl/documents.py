"""Conversion of records to JSON: a record states which values its document contains; data and schema follow from that.

A dataclass whose document is not simply its fields has a method `as_document`, which returns the values by key, in the
order of the document:

    def as_document(self) -> dict[str, object]:
        return {"name": self.name, "class": self.story and self.story.contact, "time_s": rounded(self.time_s, 2)}

The method returns attributes (also of other records), or nested objects of them. The schema comes from the same method,
which is then called with a stand-in for the record: it knows the types of the attributes instead of their values. So
does reading: `read_record` puts the value of a key into the field that `as_document` wrote there. A class whose
document has more to read has a class method `from_document`, too.
"""

from __future__ import annotations

import inspect
import json
import math
import sys
import types
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, partial
from pathlib import PurePath
from typing import (
    TYPE_CHECKING,
    Any,
    NotRequired,  # pydantic requires this one before Python 3.12
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import BaseModel
from typing_extensions import TypedDict

from foresee_dsl.files import unpacked_within

if TYPE_CHECKING:  # pydantic imports it only when it is used
    from pydantic import TypeAdapter

Record = TypeVar("Record")
_PLAIN = frozenset((str, int, bool, types.NoneType))


def plain(value: Any, digits: int | None = None) -> Any:  # noqa: ANN401, PLR0911 - data of any kind
    """Return a value as JSON data: records become dictionaries, enums their values, paths texts."""
    kind = value.__class__
    if kind in _PLAIN:  # shortcut for nearly all values of a campaign's document: `match` takes ten times as long
        return value
    if kind is float:
        return value if digits is None else round(value, digits)
    if kind is tuple or kind is list:
        return [plain(part, digits) for part in value]
    if hasattr(kind, "as_document"):
        return {key: plain(part) for key, part in value.as_document().items() if part is not _ABSENT}
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
        return {name: plain(getattr(value, name)) for name in _names(kind)}
    return [plain(part, digits) for part in value]


def rounded(value: object, digits: int) -> object:
    """Return a value of a document with its numbers rounded to this number of decimals, also those of containers."""
    return value if isinstance(value, _StandIn) else plain(value, digits)


def or_null(value: object) -> object:
    """Return a value of a document; None if it is empty or a float that is not finite."""
    if isinstance(value, _StandIn):
        return _StandIn(value._type, null=True, path=value._path)
    empty = not math.isfinite(value) if isinstance(value, float) else not value and value != 0
    return None if empty else value


def where_set(value: object) -> object:
    """Return a value of a document; if it is None or an empty text, the document does not have its key."""
    if isinstance(value, _StandIn):
        return _StandIn(value._type, optional=True, path=value._path)
    return _ABSENT if value is None or value == "" else value


_ABSENT = object()
"""In the place of a value in `as_document`: the document does not have the key."""


def every_field(record: object, digits: int | None = None) -> dict[str, object]:
    """Return all fields of a record by name, for `as_document`; with `digits`, their numbers are rounded."""
    kind: Any = record._type if isinstance(record, _StandIn) else record.__class__
    names = _names(kind)
    values = {name: getattr(record, name) for name in names}
    return values if digits is None else {name: rounded(value, digits) for name, value in values.items()}


class _StandIn:
    """Stands for a record in `as_document`: its attributes are stand-ins for values of their types.

    `_type`: the type of the value. `_null`: the value may also be None. `_optional`: the document may lack the key.
    `_path`: the attributes that lead from the record to the value.
    """

    __slots__ = ("_null", "_optional", "_path", "_type")

    def __init__(
        self,
        type_: Any,  # noqa: ANN401 - any type
        *,
        null: bool = False,
        optional: bool = False,
        path: tuple[str, ...] = (),
    ) -> None:
        self._type, self._null, self._optional, self._path = type_, null, optional, path

    def __getattr__(self, name: str) -> _StandIn:
        kind, null = self._type, self._null
        if isinstance(kind, types.UnionType):
            members = [part for part in get_args(kind) if part is not types.NoneType]
            null, kind = null or len(members) < len(get_args(kind)), members[0]
        own = getattr(kind, name, None)
        call = getattr(own, "fget", None) or getattr(own, "func", None) or own
        if callable(call):
            member = get_type_hints(call, include_extras=True)["return"]
        else:  # resolve this field alone: other fields may have types that exist only for the type checker
            owner = next(part for part in kind.__mro__ if name in inspect.get_annotations(part))
            holder = types.SimpleNamespace(__annotations__={name: owner.__annotations__[name]})
            member = get_type_hints(holder, vars(sys.modules[owner.__module__]), include_extras=True)[name]
        return _StandIn(member, null=null, path=(*self._path, name))

    def __call__(self) -> _StandIn:
        """Return a stand-in for the value of a method without arguments."""
        return self


def shape(kind: Any, name: str = "") -> Any:  # noqa: ANN401, PLR0911 - types of any kind
    """Return the type of the data that `plain` returns for values of a type.

    Besides types, it accepts a mapping of keys to types, a list of one type, and a tuple of alternatives.
    """
    origin, parts = get_origin(kind), [part for part in get_args(kind) if part is not Ellipsis]
    match kind:
        case _StandIn() if kind._optional:
            return NotRequired[shape(_not_none(kind._type))]
        case _StandIn():
            return shape(kind._type | None if kind._null and kind._type is not Any else kind._type)
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


def _not_none(kind: Any) -> Any:  # noqa: ANN401 - a type of any kind
    """Return the type of the values of `kind` that are not None."""
    if get_origin(kind) not in (Union, types.UnionType):
        return kind
    return Union[tuple(part for part in get_args(kind) if part is not types.NoneType)]  # noqa: UP007


def read_record(kind: type[Record], data: Mapping[str, Any]) -> Record:
    """Return the record whose document `plain` wrote.

    Computed values are not read, because the record computes them again. A field that the document lacks has its
    default, a number that is null is infinite.

    Raises:
        KeyError: the document lacks the key of a field without a default; or what `data` raises for a missing key.
        TypeError: it is not an object of JSON.
    """
    if data.__class__ is not dict and not isinstance(data, Mapping):  # the first test is far faster
        raise TypeError(f"{data!r} is not the document of a record")
    own: Callable[[Mapping[str, Any]], Record] | None = getattr(kind, "from_document", None)
    return own(data) if own is not None else kind(**read_fields(kind, data))


def read_fields(kind: Any, data: Mapping[str, Any], *always: str) -> dict[str, Any]:  # noqa: ANN401 - class of records
    """Return the values of a record's fields by name, for `from_document`; see `read_record`.

    `always`: keys that the document must have although their fields have defaults.
    """
    return {
        name: read(data[key])
        for key, name, read, required in _fields_by_key(kind)
        if required or key in data or key in always
    }


@cache
def _reader(kind: Any) -> Callable[[Any], Any]:  # noqa: ANN401 - types and values of any kind
    """Return the function that reads the values of a type."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        read = _reader(next(part for part in parts if part is not types.NoneType))
        return lambda value: None if value is None else read(value)
    if origin is tuple:
        read = _reader(parts[0])
        return lambda value: tuple(map(read, value))
    if isinstance(kind, type) and (is_dataclass(kind) or hasattr(kind, "_fields")):
        return partial(read_record, kind)
    if kind is float:
        return lambda value: math.inf if value is None else float(value)
    if kind is str:
        return lambda value: "" if value is None else value
    return kind if isinstance(kind, type) and issubclass(kind, Enum) else lambda value: value


@cache
def _fields_by_key(kind: Any) -> tuple[tuple[str, str, Callable[[Any], Any], bool], ...]:  # noqa: ANN401 - as above
    """Return each key of a record's document that holds a field: the key, the field's name, the function that reads it,
    and whether the field has no default.
    """
    record = _StandIn(kind)
    document = kind.as_document(record) if hasattr(kind, "as_document") else every_field(record)
    names, parameters = {(name,): name for name in _names(kind)}, inspect.signature(kind).parameters
    return tuple(
        (key, names[part._path], _reader(part._type), parameters[names[part._path]].default is inspect.Parameter.empty)
        for key, part in document.items()
        if isinstance(part, _StandIn) and part._path in names
    )


@cache
def _shape_of_record(kind: Any) -> Any:  # noqa: ANN401 - as above
    record = _StandIn(kind)
    document = kind.as_document(record) if hasattr(kind, "as_document") else every_field(record)
    record_type = shape(document, kind.__name__)
    record_type.__doc__ = (kind.__doc__ or "").partition("\n\n")[0]
    return record_type


@cache
def _names(kind: Any) -> tuple[str, ...]:  # noqa: ANN401 - a dataclass or a class of named tuples
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else tuple(kind._fields)


def packed(adapter: TypeAdapter[Record], record: Record) -> bytes:
    """Return a record as compressed JSON; floats keep every bit."""
    plain = adapter.dump_python(record, mode="json")
    # Level 1, because it packs a clip's 8 kB of text to 2 kB in 0.1 ms; level 6 saves another tenth and takes three
    # times as long.
    return zlib.compress(json.dumps(plain, separators=(",", ":")).encode(), 1)


def unpacked(adapter: TypeAdapter[Record], data: bytes) -> Record:
    """Return the record of compressed JSON.

    Raises:
        ValueError: another version of the record's class wrote it, or it is larger than the limit `record` allows.
    """
    return adapter.validate_json(unpacked_within("record", data))
