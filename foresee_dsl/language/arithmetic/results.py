"""Computes expressions and parameters in every case, and reports divisions by zero and results out of bounds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal

from foresee_dsl.helps import Help, HelpText, write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.model.pattern import form_of, word_before
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.traversal import fields_of, walk
from foresee_dsl.language.units import UNITS

Values = Mapping[str, m.ParamValue]
_Arguments = tuple[m.Item, str, str, str, HelpText]
"""Item, field, code, message and help of an error, as `Collector.add` takes them."""
_DIGITS = Decimal("0.0001")
"""A message rounds a bound to a multiple of this number (ours)."""


@dataclass(frozen=True)
class Use:
    """A place where a parameter or an expression is used: the item that contains it, and the item's field."""

    item: m.Item
    field: str
    value: m.Ref | m.Expression

    @property
    def limited(self) -> bool:
        """True if the result must be computed in every case: it is calculated, or the place does not allow every
        value."""
        form = form_of(type(self.item), self.field.partition(".")[0])
        return isinstance(self.value, m.EXPRESSIONS) or form.bounds is not None or form.dimension == "count"


def uses(items: Iterable[m.Item]) -> Iterator[Use]:
    """Yield every place where statements use a parameter or an expression; `param` and `case` statements are left
    out."""
    for root in items:
        if isinstance(root, m.Param | m.Case | m.Cases):
            continue
        for item in walk(root):
            for field, value in fields_of(item):
                if isinstance(value, m.Ref | m.Expression) and not isinstance(item, m.EXPRESSIONS):
                    use = Use(item, field, value)
                    if use.limited:
                        yield use


def unfit(places: Sequence[Use], cases: Sequence[tuple[str, Values]]) -> Iterator[_Arguments]:
    """Yield each use whose result is an error or out of bounds in some case, with the first such case and the number of
    further such cases.

    `cases` holds the name and the values of each case; for a scenario without cases, the name "" and the defaults.
    """
    for use in places:
        needed = {ref.name for ref in references(use.value)}
        wrong = [
            (name, problem)
            for name, values in cases
            if needed <= values.keys() and (problem := _problem(use, values)) is not None
        ]
        if wrong:
            name, (item, field, code, message, help) = wrong[0]
            yield item, field, code, f"{_where(name, len(wrong) - 1)}{message}", help


def _problem(use: Use, values: Values) -> _Arguments | None:
    try:
        result = _result(use.value, values)
    except ExpressionError as error:
        return error.item, "", "FS063", error.message, not_by_zero(error.item, values)
    form = form_of(type(use.item), use.field.partition(".")[0])
    statement = f"`{written(use.value)}` is {value_text(result)}{_with(use, values)}"
    if form.dimension == "count" and (result.value != result.value.to_integral_value() or result.value < 0):
        message = f"{statement}, but this place needs a whole number"
        return use.item, use.field, "FS032", message, "write one such as " + write("2")
    bounds = form.bounds
    if bounds is None or bounds.low <= result.si <= bounds.high:
        return None
    small = result.si < bounds.low
    place = word_before(type(use.item), use.field)
    message = f"{statement}, which is too {'small' if small else 'large'} for `{place}`"
    within = f"{'max' if small else 'min'}({written(use.value)}, {written(nearest(bounds, result))})"
    help = limit(bounds, result) + ", for example with " + write(within)
    return use.item, use.field, out_of_bounds(use.item, use.field), message, help


def out_of_bounds(item: m.Item, field: str) -> str:
    """Return the code of the error about a value that is too small or too large for its place."""
    is_ratio = form_of(type(item), field.partition(".")[0]).dimension == "ratio"
    return "FS043" if is_ratio and isinstance(item, m.Weather | m.Steers | m.Timing) else "FS050"


def limit(bounds: m.Bounds, value: m.Quantity) -> Help:
    """Return what to write instead of a value that is too small or too large."""
    return f"use at {'least' if value.si < bounds.low else 'most'} " + write(written(nearest(bounds, value)))


def nearest(bounds: m.Bounds, value: m.Quantity) -> m.Quantity:
    """Return the bound that a value is beyond, in the value's unit, rounded to a value that is not beyond it."""
    bound, up = (bounds.low, True) if value.si < bounds.low else (bounds.high, False)
    exact = Decimal(repr(bound / (UNITS[value.unit].to_si if value.unit else 1.0)))
    rounded = exact.quantize(_DIGITS, ROUND_HALF_EVEN)
    result = m.Quantity(value=_shortest(rounded), unit=value.unit)
    if bounds.low <= result.si <= bounds.high:
        return result
    return m.Quantity(value=_shortest(rounded + (_DIGITS if up else -_DIGITS)), unit=value.unit)


def _shortest(number: Decimal) -> Decimal:
    return Decimal(f"{number.normalize():f}")


def not_by_zero(item: m.Item, values: Values) -> HelpText:
    """Return the help for a division by zero: how to keep the divisor above zero, or to write another value."""
    if not isinstance(item, m.Product):
        return "write another value"
    from foresee_dsl.language.arithmetic.evaluate import evaluate

    try:
        zero = evaluate(item.right, values)
    except ExpressionError:
        return "keep it out with a " + write("require")
    least = written(m.Quantity(value=Decimal("0.1"), unit=zero.unit))
    left = f"({written(item.left)})" if isinstance(item.left, m.Sum) else written(item.left)
    above = write(f"{left} / max({written(item.right)}, {least})")
    return "keep the divisor above zero: " + above + ", or with a " + write("require")


def _where(name: str, more: int) -> str:
    if not name:
        return "with the defaults, "
    others = f" (and {more} more)" if more else ""
    return f"in case '{name}'{others}, "


def _with(use: Use, values: Values) -> str:
    if isinstance(use.value, m.Ref):
        return ""
    assignments = [
        f"{name} is {value_text(values[name])}" for name in dict.fromkeys(r.name for r in references(use.value))
    ]
    return f" ({', '.join(assignments)})" if assignments else ""


def _result(value: m.Ref | m.Expression, values: Values) -> m.Quantity:
    parameter = values[value.name] if isinstance(value, m.Ref) else None
    if isinstance(parameter, m.Quantity):
        return parameter
    from foresee_dsl.language.arithmetic.evaluate import evaluate

    return evaluate(value, values)
