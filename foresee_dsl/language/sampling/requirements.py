"""Whether the values of a case satisfy what a scenario requires of them, and in words why not."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

from foresee_dsl.language import model as m
from foresee_dsl.language.meaning import SIGNIFICANT_DIGITS
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import parts

_COMPARED: MappingProxyType[str, Callable[[float, float], bool]] = MappingProxyType(
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
)


def holds(condition: m.Condition, values: Mapping[str, m.ParamValue]) -> bool | None:
    """Return whether a condition over parameters holds; None where the values that are given do not decide it.

    Quantities are compared by their SI value, to as many digits as the hash of a meaning has: `7.2 km/h` is `2 m/s`.

    Args:
        condition: of a `require`.
        values: of the parameters, by name; any may be absent.
    """
    match condition:
        case m.Comparison(left=m.Ref(name=name), op=op, right=right):
            one, other = _si(values.get(name)), _si(right, values)
            return None if one is None or other is None else _COMPARED[op](one, other)
        case m.Equals(left=left, right=word):
            value = values.get(left.name)
            return value == word if isinstance(value, str) else None
        case m.Not(condition=inner):
            found = holds(inner, values)
            return None if found is None else not found
        case m.Both(conditions=several):
            return _joined([holds(part, values) for part in several], decisive=False)
        case m.Either(conditions=several):
            return _joined([holds(part, values) for part in several], decisive=True)
    return None  # about the world: the checks report it


def requirement_text(require: m.Require) -> str:
    """Return a requirement as it is written."""
    return f"require {written(require.condition)}"


def violation(require: m.Require, values: Mapping[str, m.ParamValue]) -> str:
    """Return in words why values do not satisfy a requirement: `gap is 3 s, but `require gap < 2 s``."""
    names = dict.fromkeys(name for name in parameters_of(require.condition) if name in values)
    described = " and ".join(f"{name} is {_text(values[name])}" for name in names)
    return f"{described or 'this'}, but `{requirement_text(require)}`"


def parameters_of(condition: m.Condition) -> Iterator[str]:
    """Yield the parameters that a condition of a `require` is about, in the order in which they are written."""
    for part in parts(condition):
        if isinstance(part, m.Comparison | m.Equals):
            sides = (part.left, part.right)
            yield from (side.name for side in sides if isinstance(side, m.Ref))


def _joined(found: list[bool | None], *, decisive: bool) -> bool | None:
    if decisive in found:
        return decisive
    return None if None in found else not decisive


def _si(value: object, values: Mapping[str, m.ParamValue] = MappingProxyType({})) -> float | None:
    if isinstance(value, m.Ref):
        value = values.get(value.name)
    return float(f"{value.si:.{SIGNIFICANT_DIGITS}g}") if isinstance(value, m.Quantity) else None


def _text(value: m.ParamValue) -> str:
    return written(value) if isinstance(value, m.Quantity) else value
