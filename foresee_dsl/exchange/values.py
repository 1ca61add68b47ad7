"""Numbers from elsewhere as quantities of the language."""

from __future__ import annotations

from decimal import Decimal

from foresee_dsl.language.model import Quantity
from foresee_dsl.language.units import Dimension

DIGITS = 4
"""Decimals of metres, m/s and degrees, as in clips: they rebuild a run exactly."""


def quantity(value_si: float, dimension: Dimension, digits: int = DIGITS) -> Quantity:
    """Return a quantity in the unit of generated files, rounded, without needless zeros."""
    exact = Quantity.of(value_si, dimension, digits)
    plain = exact.value.normalize()
    if plain.as_tuple().exponent not in range(-digits, 1):  # 1E+2
        plain = plain.quantize(Decimal(1))
    return Quantity(value=plain, unit=exact.unit)
