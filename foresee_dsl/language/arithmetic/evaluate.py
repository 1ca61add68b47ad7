"""Computes the value of an expression in a case: exactly, and in the units that the author uses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache
from types import MappingProxyType
from typing import assert_never

from pydantic import ValidationError

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.dimensions import POWERS, Powers, in_words, named
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.units import UNITS

_DIGITS = 12
"""Number of significant digits of a value without an exact decimal form, such as a third (ours: fewer than a float has,
and three more than are used to compare meanings)."""
_NO_VALUES: Mapping[str, m.ParamValue] = MappingProxyType({})


def evaluate(value: m.AnyValue, values: Mapping[str, m.ParamValue] = _NO_VALUES) -> m.Quantity:
    """Return the value of an expression as a quantity, given the parameters' values.

    A sum has the unit of its first part, a multiple the unit of the value that is multiplied. A product of two
    dimensions has the unit of generated files (`20 km/h * 1.8 s` is `10 m`).

    Raises:
        ExpressionError: the expression divides by zero, is too large, or combines values that do not fit each other.
    """
    if isinstance(value, m.Quantity):
        return value
    if isinstance(value, m.Ref):
        return _value_of(value, values)
    number = _number(value, values)
    dimension = named(number.powers)
    if dimension is None:
        message = f"`{written(value)}` is {in_words(number.powers)}, which is not a kind of value of the language"
        raise ExpressionError(value, message)
    unit = number.unit if number.unit is not None else {"angle": "deg", "angular_rate": "deg/s"}.get(dimension)
    if unit is None:
        unit = next(
            (word for word, candidate in UNITS.items() if candidate.dimension == dimension and candidate.to_si == 1), ""
        )
    result = number.amount / (factor(unit) if number.unit is None else 1)
    try:
        return m.Quantity(value=as_decimal(result), unit=unit)
    except ValidationError:
        message = f"`{written(value)}` is {float(result):.3g} {unit}".rstrip() + ", more than the largest value allowed"
        raise ExpressionError(value, message) from None


def _value_of(reference: m.Ref, values: Mapping[str, m.ParamValue]) -> m.Quantity:
    value = values.get(reference.name)
    if isinstance(value, m.Quantity):
        return value
    what = f"is `{value_text(value)}`, which is not a number" if value is not None else "has no value"
    raise ExpressionError(reference, f"'{reference.name}' {what}")


@dataclass(frozen=True)
class _Number:
    """An exact number, either in a unit that the author wrote or (unit None) in metres, seconds, degrees and
    kilogrammes."""

    amount: Fraction
    unit: str | None
    powers: Powers

    @property
    def base(self) -> Fraction:
        return self.amount * factor(self.unit) if self.unit is not None else self.amount

    def within(self, unit: str | None) -> Fraction:
        """Return the amount in another unit of the same dimension."""
        if self.unit == unit:
            return self.amount
        return self.base / (factor(unit) if unit is not None else 1)


def _number(value: m.AnyValue, values: Mapping[str, m.ParamValue]) -> _Number:
    match value:
        case m.Quantity():
            return _Number(Fraction(value.value), value.unit, POWERS[value.dimension])
        case m.Ref():
            return _number(_value_of(value, values), values)
        case m.Sum(left=left, op=op, right=right):
            augend, addend = _alike(value, (_number(left, values), _number(right, values)))
            unit = addend.unit if not augend.unit and addend.unit else augend.unit
            added = addend.within(unit)
            return _Number(augend.within(unit) + (added if op == "+" else -added), unit, augend.powers)
        case m.Product(left=left, op=op, right=right):
            return _product(value, _number(left, values), op, _number(right, values))
        case m.Negative(value=inner):
            number = _number(inner, values)
            return _Number(-number.amount, number.unit, number.powers)
        case m.Extreme(which=which, values=several):
            numbers = _alike(value, tuple(_number(part, values) for part in several))
            return (min if which == "min" else max)(numbers, key=lambda number: number.base)
        case _:
            assert_never(value)


def _alike(value: m.Item, numbers: tuple[_Number, ...]) -> tuple[_Number, ...]:
    if len({number.powers for number in numbers}) > 1:
        kinds = " and ".join(dict.fromkeys(in_words(number.powers) for number in numbers))
        raise ExpressionError(value, f"`{written(value)}`: {kinds} cannot be combined")
    return numbers


def _product(whole: m.Product, left: _Number, op: str, right: _Number) -> _Number:
    if op == "/" and right.amount == 0:
        raise ExpressionError(whole, f"`{written(whole)}` divides by zero: `{written(whole.right)}` is 0")
    powers = left.powers.times(right.powers, 1 if op == "*" else -1)
    if right.powers == Powers():  # a multiple or a fraction of a value keeps the unit of that value
        return _Number(left.amount * right.amount if op == "*" else left.amount / right.amount, left.unit, powers)
    if left.powers == Powers() and op == "*":
        return _Number(left.amount * right.amount, right.unit, powers)
    result = left.base * right.base if op == "*" else left.base / right.base
    return _Number(result, "" if powers == Powers() else None, powers)


@cache
def factor(unit: str) -> Fraction:
    """Return the exact factor from a unit to metres, seconds, degrees, kilogrammes, or combinations of these."""
    if not unit:
        return Fraction(1)
    to_si = UNITS[unit].to_si
    if UNITS[unit].dimension in ("angle", "angular_rate"):
        return Fraction(1) if unit.startswith("deg") else Fraction(180 / math.pi)
    return Fraction(to_si).limit_denominator(10**6)


def as_decimal(number: Fraction) -> Decimal:
    """Return a number exactly, or with 12 significant digits if it has more."""
    result = Context(prec=_DIGITS).divide(Decimal(number.numerator), Decimal(number.denominator))
    return result if result else Decimal(0)
