"""What a field of the model takes, read off its annotations: words, a dimension."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Literal, get_args, get_origin

from foresee_dsl.language import model as m
from foresee_dsl.language.checks.values import dimensions_of
from foresee_dsl.language.units import UNITS, Dimension


@cache
def words_of_field(kind: type[m.Item], field: str) -> tuple[str, ...]:
    """Return the fixed words that a field takes (`straight`, `left`, ...), in the model's order."""
    found = kind.model_fields.get(field)
    if found is None:
        return ()
    return tuple(word for word in _literals(found.annotation) if isinstance(word, str) and word[:1].isalpha())


@cache
def dimension_of_field(kind: type[m.Item], field: str) -> Dimension | None:
    """Return the dimension of a field that holds a quantity; None where several are possible."""
    return dimensions_of(kind).get(field)


def units_of(dimension: Dimension | None) -> tuple[str, ...]:
    """Return the unit words of a dimension; all of them for None."""
    return tuple(unit.word for unit in UNITS.values() if dimension in (None, unit.dimension))


def model_words() -> frozenset[str]:
    """Return every fixed word that a field of the model takes."""
    kinds = [kind for kind in vars(m).values() if isinstance(kind, type) and issubclass(kind, m.Item)]
    return frozenset(w for kind in kinds for f in kind.model_fields if f != "kind" for w in words_of_field(kind, f))


def _literals(annotation: object) -> Iterator[object]:
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    else:
        for part in get_args(annotation):
            yield from _literals(part)
