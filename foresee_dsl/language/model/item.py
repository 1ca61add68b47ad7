"""The base of every class of the model: immutable, compared by value, with the pattern of its text."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, SerializationInfo, TypeAdapter
from pydantic_core import CoreSchema, core_schema

Group = Literal["definition", "statement", "setting", "action", "condition", "link", "type", "constant"]
"""The kind of a word of the language.

definition: the first word of a file's definition. statement: the first word of a statement. setting: a line of a
block, or a part of one, that gives one value. action: a word of an action in a trigger. condition: a word that measures
something, or joins conditions. link: a word inside a statement. type: the type of a parameter. constant: one of a fixed
set of values (a turn, a control, a property), which is not a word of the grammar and may be a name elsewhere.
"""

SymbolKind = Literal[
    "actor",
    "junction",
    "road",
    "stage",
    "stop",
    "patch",
    "parameter",
    "case",
    "model",
    "label",
    "file",
    "thing",
    "word",
]
"""The kind of object that a name stands for. `thing`: an actor or a junction. `word`: the parameter's type determines
the kind. `label`: the name of a trigger or an expectation. `file`: the path of another file."""


@dataclass(frozen=True, slots=True)
class Names:
    """Marks the type of a field that holds a name: the kind of object that it names, and whether the field defines or
    uses the name."""

    kind: SymbolKind
    defines: bool = False


@dataclass(frozen=True, slots=True)
class Bounds:
    """Marks the type of a value with the smallest and the largest allowed value, SI."""

    low: float
    high: float = 1e9


class Item(BaseModel):
    """Base of every statement and part of a file: immutable, compared by value, without unknown fields.

    The grammar's rule with the same name in small letters makes a class (`start_at` makes `StartAt`).

    Attributes:
        kind: its tag in data and hashes: by default the name of its rule. `class Both(Phrase, kind="and")` sets another
            one; with `kind=""` it has none.
        pattern: the form of its text (`model.pattern` explains the notation). Nodes, printed text, and the dimensions
            that messages name derive from it.
        words: the words of the language that this class introduces, as `word (group): meaning | example of a line` (no
            full stop). Each word of a pattern is explained by one class, or in `language.keywords` if several classes
            share it.
        in_brackets: the kinds of condition that need brackets when they are parts of this condition.
        in_brackets_of: for some fields, the kinds of calculation that need brackets there.
        never_bare: names that are quoted here, because the parser would take them for the rest of the statement.
        one_line_without: the fields that must be empty for a short block to be written on the line of its head; None:
            the block always has lines of its own.
    """

    # A class's validator is built at its first use: a file uses a third of the classes.
    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True, ignored_types=(str, tuple, NoneType))

    if TYPE_CHECKING:
        kind: str = ""
        pattern: ClassVar[str]
        words: ClassVar[str]
        in_brackets: ClassVar[tuple[str, ...]]
        in_brackets_of: ClassVar[tuple[tuple[str, tuple[str, ...]], ...]]
        never_bare: ClassVar[tuple[str, ...]]
        one_line_without: ClassVar[tuple[str, ...] | None]

    # These are annotated only for the type checker (see above), because pydantic 2.14 evaluates the annotations of a
    # base again for each of its hundred subclasses. Without an annotation, texts, tuples and None are not fields.
    pattern = words = ""
    in_brackets = in_brackets_of = never_bare = ()
    one_line_without = None

    def __init_subclass__(cls, kind: str | None = None, **_: Any) -> None:  # noqa: ANN401 - pydantic's, for itself
        """Give the class its `kind`, before pydantic collects its fields."""
        tag = rule_of(cls) if kind is None else kind
        own = inspect.get_annotations(cls)
        if tag and "kind" not in own:
            cls.__annotations__ = {"kind": Literal[tag], **own}
            cls.kind = tag

    def own_pattern(self) -> str:
        """Return the pattern of this item; classes with several forms override it."""
        return self.pattern


class Phrase(Item, kind=""):
    """Base of the parts of statements: values, places, conditions."""


_T = TypeVar("_T", bound=Item)


class Block(Item, kind=""):
    """Base of definitions and statements whose braces hold statements, in the author's order."""

    if TYPE_CHECKING:
        body: tuple[Item, ...]

    def all(self, kind: type[_T]) -> tuple[_T, ...]:
        """Return the statements of one kind, in the author's order."""
        return tuple(item for item in self.body if isinstance(item, kind))

    def first(self, kind: type[_T]) -> _T | None:
        """Return the first statement of one kind, or None if there is none."""
        return next((item for item in self.body if isinstance(item, kind)), None)


def rule_of(kind: type[Item]) -> str:
    """Return the name of the grammar's rule that makes a class: `start_at` for `StartAt`."""
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in kind.__name__).lstrip("_")


class _OneOf:
    """Marks a union of items with different `kind`, whose validators are built only at their first use.

    Items are built bottom up, so a part is nearly always a validated instance already. With pydantic's own union,
    every class with a field for statements would build the validators of all statements.
    """

    def __get_pydantic_core_schema__(self, union: Any, handler: object) -> CoreSchema:  # noqa: ANN401 - a type form
        del handler
        kinds = get_args(union)

        @cache
        def whole() -> TypeAdapter[Item]:
            return TypeAdapter(Annotated[union, Field(discriminator="kind")])

        def check(value: object) -> object:
            return value if isinstance(value, kinds) else whole().validate_python(value)

        return checked_by(check)


def checked_by(check: Callable[[object], object]) -> CoreSchema:
    """Return the schema of a type of fields that has a check of its own instead of pydantic's."""
    serialization = core_schema.plain_serializer_function_ser_schema(_dump, info_arg=True)
    return core_schema.no_info_plain_validator_function(check, serialization=serialization)


def _dump(item: Item, info: SerializationInfo) -> dict[str, Any]:
    return item.model_dump(
        mode=info.mode,
        by_alias=info.by_alias,
        exclude_unset=info.exclude_unset,
        exclude_defaults=info.exclude_defaults,
        exclude_none=info.exclude_none,
        round_trip=info.round_trip,
    )


ONE_OF = _OneOf()
"""`Annotated[A | B, ONE_OF]`: one of these items."""
