"""Computes the normal form of expressions. Two expressions that always have the same value, such as `gap + gap` and
`2 * gap`, have the same normal form.

The form is a sum of products, with the units among the factors. A `min`, a `max` and a division by a sum each count as
one factor.
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
"""Names of the factors, each with its power, sorted."""
_Terms = Mapping[_Factors, Fraction]
_UNITS = ("1 m", "1 s", "1 deg", "1 kg")
_MOST_TERMS = 200
"""Maximum number of terms that are multiplied out (ours: far more than people write; a product of forty sums of two
values would give 2^40 terms)."""
_DIGITS = 9
"""Number of significant digits of a factor, as many as `meaning.SIGNIFICANT_DIGITS`."""


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
    """Return a minimum or maximum as one factor; the order of its values and repeated values make no difference."""
    parts = sorted({json.dumps(_json(_terms(part))) for part in _flat(value)})
    if len(parts) == 1:
        return _terms(value.values[0])
    return {((f"{value.which} {' '.join(parts)}", 1),): Fraction(1)}


def _flat(extreme: m.Extreme) -> Iterator[m.AnyValue]:
    """Yield the values of a minimum and of the minima in it (the same for a maximum)."""
    for value in extreme.values:
        if isinstance(value, m.Extreme) and value.which == extreme.which:
            yield from _flat(value)
        else:
            yield value


def _tidy(terms: _Terms) -> _Terms:
    return {tuple(sorted(key)): amount for key, amount in terms.items() if amount}


def _sum(first: _Terms, second: _Terms, sign: int) -> _Terms:
    terms = dict(first)
    for key, amount in second.items():
        terms[key] = terms.get(key, Fraction(0)) + sign * amount
    return _tidy(terms)


def _product(first: _Terms, second: _Terms) -> _Terms:
    if len(first) * len(second) > _MOST_TERMS:
        return {tuple(sorted((json.dumps(_json(part)), 1) for part in (first, second))): Fraction(1)}
    terms: dict[_Factors, Fraction] = {}
    for left, amount in first.items():
        for right, times in second.items():
            powers = dict(left)
            for name, n in right:
                powers[name] = powers.get(name, 0) + n
            key = tuple(sorted((name, n) for name, n in powers.items() if n))
            terms[key] = terms.get(key, Fraction(0)) + amount * times
    return _tidy(terms)


def _inverse(terms: _Terms) -> _Terms:
    if len(terms) == 1:
        ((key, amount),) = terms.items()
        return {tuple((name, -n) for name, n in key): 1 / amount}
    # The divisor may also have no terms: then it is a division by zero.
    return {((json.dumps(_json(terms)), -1),): Fraction(1)}
