"""Reads the notation of `Item.pattern`: the fields of a class in their order, and the text around them.

    delay {time}                       a word and a field
    steers {value} [from {start}]      what stands in [ ] is written when all its fields are given
    route from {start} {legs: }        a field of several parts, with what stands between them; without a colon [a, b]
    when {condition} { ...actions }    a block of statements, which the field `actions` holds
    road {name} [{ lanes; via {via} }]     a block of settings, each when it is given; `lanes` is short for
                                       `lanes {lanes}`; a block in [ ] is left out when nothing is in it

A `[` that is meant as itself is written `\\[`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import cache
from itertools import pairwise
from typing import Any, Literal, get_args, get_origin

from foresee_dsl.language.model.item import Bounds, Item, Names
from foresee_dsl.language.units import Dimension

_BLOCK = re.compile(r"(?P<head>.*?)(?P<optional> \[)? ?\{ (?P<lines>.*) \}\]?")
_TOKEN = re.compile(
    r"(?P<group> ?\[(?:\\.|[^\[\]\\])*\])"
    r"|\{(?P<slot>\w+)(?::(?P<between>[^}]*))?\}"
    r"|(?P<text>\\.|[^\[{\\])"
)


class Form(Enum):
    """How a text in a field is written."""

    NAME = auto()  # as it is
    MODEL = auto()  # as it is; if a parameter is allowed, a name without a dot is read as one
    ID = auto()  # as it is if it is a valid name, otherwise in quotes
    WORD = auto()  # as an id, or as the name of a model
    TEXT = auto()  # in quotes


@dataclass(frozen=True, slots=True)
class Slot:
    """A field in a pattern. `between` is the text between its parts; None stands for a list in brackets."""

    field: str
    between: str | None = None


@dataclass(frozen=True, slots=True)
class Optional:
    """A part of a pattern that is written when all its fields are given."""

    parts: tuple[str | Slot, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """The names of its fields."""
        return tuple(part.field for part in self.parts if isinstance(part, Slot))


Parts = Sequence[str | Slot | Optional]


@dataclass(frozen=True, slots=True)
class Pattern:
    """The parts of a pattern.

    Attributes:
        head: the part before the braces.
        settings: the lines in the braces that are fields of the item.
        body: the field with the statements in the braces; "" for none.
        braces: when the braces are written: always, never, or if they are not empty.
    """

    head: Parts
    settings: tuple[Parts, ...] = ()
    body: str = ""
    braces: Literal["always", "never", "filled"] = "never"

    @property
    def slots(self) -> tuple[Slot, ...]:
        """The fields before the braces, in the order in which they are written."""
        return tuple(slots_of(self.head))


@cache
def read_pattern(text: str) -> Pattern:
    """Return the parts of a pattern."""
    block = _BLOCK.fullmatch(text)
    if block is None:
        return Pattern(_parts(text))
    lines = block["lines"].split("; ")
    body = next((line.removeprefix("...") for line in lines if line.startswith("...")), "")
    settings = (_parts(f"{line} {{{line}}}" if line.isidentifier() else line) for line in lines if line[0] != ".")
    return Pattern(_parts(block["head"]), tuple(settings), body, "filled" if block["optional"] else "always")


def _parts(text: str) -> tuple[str | Slot | Optional, ...]:
    parts: list[str | Slot | Optional] = []
    for token in _TOKEN.finditer(text):
        if token["group"]:
            space, _, inner = token["group"][:-1].partition("[")
            parts.append(Optional(tuple(part for part in _parts(space + inner) if not isinstance(part, Optional))))
        elif token["slot"]:
            parts.append(Slot(token["slot"], token["between"]))
        elif parts and isinstance(parts[-1], str):
            parts[-1] += token["text"].removeprefix("\\")
        else:
            parts.append(token["text"].removeprefix("\\"))
    return tuple(parts)


def slots_of(parts: Parts) -> Iterator[Slot]:
    """Yield the fields in a part of a pattern, in their order."""
    for part in parts:
        if isinstance(part, Slot):
            yield part
        elif isinstance(part, Optional):
            yield from slots_of(part.parts)


def words_before(pattern: Pattern) -> Iterator[tuple[str, str]]:
    """Yield each word of the language with the field right behind it."""
    for parts in (pattern.head, *pattern.settings):
        flat = [p for part in parts for p in (part.parts if isinstance(part, Optional) else (part,))]
        for before, part in pairwise(flat):
            word = re.search(r"(\w+) $", before) if isinstance(before, str) else None
            if word is not None and isinstance(part, Slot):
                yield word[1], part.field


@cache
def word_before(kind: type[Item], field: str) -> str:
    """Return the word before a field, by which messages name the field: `timing` for its `factor`."""
    return next((word for word, name in words_before(read_pattern(kind.pattern)) if name == field), field)


# ---- fields, by their annotations -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FieldForm:
    """The values that a field takes, read from its annotation.

    Attributes:
        form: how a text in it is written.
        parameter: True if the name of a parameter may replace its text.
        dimension: the dimension of its quantity; None if it takes no quantity, or several dimensions are possible.
        words: the fixed words that it takes.
        names: the kind of object that a name in it stands for; None if it takes no name, or the kind depends on other
            fields.
        bounds: the bounds of its quantity, SI; None if any value is allowed.
    """

    form: Form
    parameter: bool
    dimension: Dimension | None
    words: tuple[str, ...]
    names: Names | None
    bounds: Bounds | None


@cache
def form_of(kind: type[Item], field: str) -> FieldForm:
    """Return the values that a field of a class takes; empty for a field that the class does not have."""
    info = kind.model_fields.get(field)
    leaves = [*_leaves(info.annotation), *info.metadata] if info is not None else []
    form = next(
        (leaf for leaf in reversed(leaves) if isinstance(leaf, Form)), Form.NAME
    )  # the last form counts: the annotation of a `Word` also has the form of an `Id`
    parameter = any(isinstance(leaf, type) and leaf.__name__ == "Ref" for leaf in leaves)
    dimension = next((d for leaf in leaves if (d := getattr(leaf, "dimension", None)) in get_args(Dimension)), None)
    names = next((leaf for leaf in reversed(leaves) if isinstance(leaf, Names)), None)  # the outermost
    bounds = next((leaf for leaf in leaves if isinstance(leaf, Bounds)), None)
    words = tuple(leaf for leaf in leaves if isinstance(leaf, str))
    return FieldForm(form, parameter, dimension, words, names, bounds)


def _leaves(annotation: Any) -> Iterator[Any]:  # noqa: ANN401 - a type form
    """Yield the types, fixed words and metadata in an annotation."""
    yield from getattr(annotation, "__metadata__", ())
    parts = get_args(annotation)
    if get_origin(annotation) is Literal or not parts:
        yield from parts or (annotation,)
    elif hasattr(annotation, "__metadata__"):
        yield from _leaves(parts[0])
    else:
        for part in parts:
            yield from _leaves(part)
