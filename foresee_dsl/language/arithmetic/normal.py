"""A form of expressions in which two that always have the same value are equal: `gap + gap` is `2 * gap`.

A sum of products, with the units among the factors. `min`, `max` and what divides by a sum are factors of their own.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import assert_never

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.dimensions import POWERS
from foresee_dsl.language.arithmetic.evaluate import factor

_Factors = tuple[tuple[str, int], ...]
"""Names of what is multiplied, each with its power, sorted."""
_Terms = Mapping[_Factors, Fraction]
_UNITS = ("1 m", "1 s", "1 deg", "1 kg")
_MOST_TERMS = 200
"""More terms are not multiplied out (ours: nobody writes as many; the brackets of forty sums would make 2^40)."""
_DIGITS = 9
"""As `meaning.SIGNIFICANT_DIGITS`."""


def normal_form(value: m.AnyValue) -> object:
    """Return a value's normal form as JSON."""
    return _json(_terms(value))


def _json(terms: _Terms) -> list[object]:
    return [[f"{float(amount):.{_DIGITS}g}", [list(part) for part in key]] for key, amount in sorted(terms.items())]


def _terms(value: m.AnyValue) -> _Terms:
    match value:
        case m.Quantity():
            units = zip(_UNITS, POWERS[value.dimension], strict=True)
            return _tidy({tuple((unit, n) for unit, n in units if n): Fraction(value.value) * factor(value.unit)})
        case m.Ref(name=name):
            return {((name, 1),): Fraction(1)}
        case m.Sum(left=left, op=op, right=right):
            return _sum(_terms(left), _terms(right), 1 if op == "+" else -1)
        case m.Negative(value=inner):
            return _sum({}, _terms(inner), -1)
        case m.Product(left=left, op=op, right=right):
            return _product(_terms(left), _terms(right) if op == "*" else _inverse(_terms(right)))
        case m.Extreme():
            return _extreme(value)
        case _:
            assert_never(value)


def _extreme(value: m.Extreme) -> _Terms:
    """The order of what is compared does not count, nor does what stands there twice."""
    parts = sorted({json.dumps(_json(_terms(part))) for part in _flat(value)})
    if len(parts) == 1:
        return _terms(value.values[0])
    return {((f"{value.which} {' '.join(parts)}", 1),): Fraction(1)}


def _flat(extreme: m.Extreme) -> Iterator[m.AnyValue]:
    """Return the values of a minimum with those of the minima in it."""
    for value in extreme.values:
        if isinstance(value, m.Extreme) and value.which == extreme.which:
            yield from _flat(value)
        else:
            yield value


def _tidy(terms: _Terms) -> _Terms:
    return {tuple(sorted(key)): amount for key, amount in terms.items() if amount}


def _sum(one: _Terms, other: _Terms, sign: int) -> _Terms:
    found = dict(one)
    for key, amount in other.items():
        found[key] = found.get(key, Fraction(0)) + sign * amount
    return _tidy(found)


def _product(one: _Terms, other: _Terms) -> _Terms:
    if len(one) * len(other) > _MOST_TERMS:
        return {tuple(sorted((json.dumps(_json(part)), 1) for part in (one, other))): Fraction(1)}
    found: dict[_Factors, Fraction] = {}
    for left, amount in one.items():
        for right, times in other.items():
            powers = dict(left)
            for name, n in right:
                powers[name] = powers.get(name, 0) + n
            key = tuple(sorted((name, n) for name, n in powers.items() if n))
            found[key] = found.get(key, Fraction(0)) + amount * times
    return _tidy(found)


def _inverse(terms: _Terms) -> _Terms:
    if len(terms) == 1:
        ((key, amount),) = terms.items()
        return {tuple((name, -n) for name, n in key): 1 / amount}
    return {((json.dumps(_json(terms)), -1),): Fraction(1)}  # of nothing too: a division by zero
