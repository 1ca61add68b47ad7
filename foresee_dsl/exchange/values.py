"""Numbers from elsewhere as quantities of the language."""

from __future__ import annotations

from decimal import Decimal

from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.model import Quantity
from foresee_dsl.language.units import Dimension

DIGITS = 4
"""Decimals of metres, m/s and degrees, as in clips: they rebuild a run exactly."""
_LARGEST = 1e7
"""In SI: map projections come to 1e7 m (ours)."""


def quantity(value_si: float, dimension: Dimension, digits: int = DIGITS) -> Quantity:
    """Return a quantity in the unit of generated files, rounded, without needless zeros.

    Raises:
        ExchangeError: it is larger than anything that is driven.
    """
    if not abs(value_si) <= _LARGEST:
        raise ExchangeError(f"{value_si:g} is no {dimension} that can be meant")
    exact = Quantity.of(value_si, dimension, digits)
    plain = exact.value.normalize()
    if plain.as_tuple().exponent not in range(-digits, 1):  # 1E+2
        plain = plain.quantize(Decimal(1))
    return Quantity(value=plain, unit=exact.unit)
