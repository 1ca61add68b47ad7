"""Lints about divisors that can be zero within the parameters' ranges, so that a drawn case could have no value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import assert_never

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import walk

Interval = tuple[float, float]
_EVERYTHING = (-math.inf, math.inf)


def divisions_by_zero(lints: Collector, scenario: m.Scenario) -> None:
    """Report divisions whose divisor can be zero within the parameters' ranges."""
    quotients = [
        part
        for item in scenario.body
        if not isinstance(item, m.Param)
        for part in walk(item)
        if isinstance(part, m.Product) and part.op == "/"
    ]
    if not quotients:
        return
    ranges = intervals(scenario)
    for quotient in quotients:
        names = list(dict.fromkeys(ref.name for ref in references(quotient.right)))
        if not names or not set(names) <= ranges.keys() or not _holds_zero(interval_of(quotient.right, ranges)):
            continue
        if isinstance(quotient.right, m.Ref) and not _takes_zero(scenario, quotient.right.name):
            continue
        by = written(quotient.right)
        message = f"`{written(quotient)}` has no value if `{by}` is 0, which the range of '{names[0]}' allows"
        help = f"exclude zero: `require {names[0]} > 0{_unit(scenario, names[0])}`, or use another range"
        lints.add(quotient, "", "FS314", message, help)


def _takes_zero(scenario: m.Scenario, name: str) -> bool:
    """Return whether zero is among a parameter's options or on one of its steps; True if it has neither."""
    param = next(param for param in scenario.all(m.Param) if param.name == name)
    if param.options is not None:
        return any(isinstance(option, m.Quantity) and option.value == 0 for option in param.options)
    if param.range is None or param.range.step is None:
        return True
    steps = -param.range.low.si / param.range.step.si
    return abs(steps - round(steps)) < 1e-6


def _unit(scenario: m.Scenario, name: str) -> str:
    param = next(param for param in scenario.all(m.Param) if param.name == name)
    unit = param.default.unit if isinstance(param.default, m.Quantity) else ""
    return f" {unit}" if unit else ""


# ---- the smallest and largest value of an expression, for parameters within their ranges -----------------------------


def intervals(scenario: m.Scenario) -> dict[str, Interval]:
    """Return the smallest and the largest value, SI, of each parameter with a range or with numbers as options.

    A `require` that compares a parameter with a number narrows its interval.
    """
    ranges: dict[str, Interval] = {}
    for param in scenario.all(m.Param):
        if (interval := interval_of_param(param)) is not None:
            ranges[param.name] = interval
    for require in scenario.all(m.Require):
        for part in _all_of(require.condition):
            if isinstance(part.left, m.Ref) and isinstance(part.right, m.Quantity) and part.left.name in ranges:
                ranges[part.left.name] = _cut(ranges[part.left.name], part.op, part.right.si)
    return ranges


def interval_of_param(param: m.Param) -> Interval | None:
    """Return the smallest and the largest value of a parameter, SI; None if a case may give it any value."""
    if param.range is not None:
        return param.range.low.si, param.range.high.si
    options = [option.si for option in param.options or () if isinstance(option, m.Quantity)]
    return (min(options), max(options)) if options else None


def _all_of(condition: m.Condition) -> Iterator[m.Comparison]:
    if isinstance(condition, m.Both):
        for part in condition.conditions:
            yield from _all_of(part)
    elif isinstance(condition, m.Comparison):
        yield condition


def _cut(interval: Interval, op: str, bound: float) -> Interval:
    low, high = interval
    bound = bound if op.endswith("=") else math.nextafter(bound, math.inf if op == ">" else -math.inf)
    return (max(low, bound), high) if op[0] == ">" else (low, min(high, bound))


def interval_of(value: m.AnyValue, ranges: Mapping[str, Interval]) -> Interval:
    """Return the smallest and the largest value of an expression, SI; infinite if unknown."""
    match value:
        case m.Quantity():
            return value.si, value.si
        case m.Ref(name=name):
            return ranges.get(name, _EVERYTHING)
        case m.Sum(left=left, op=op, right=right):
            (a, b), (c, d) = interval_of(left, ranges), interval_of(right, ranges)
            return (a + c, b + d) if op == "+" else (a - d, b - c)
        case m.Negative(value=inner):
            low, high = interval_of(inner, ranges)
            return -high, -low
        case m.Extreme(which=which, values=values):
            ends = [interval_of(part, ranges) for part in values]
            take = min if which == "min" else max
            return take(low for low, _ in ends), take(high for _, high in ends)
        case m.Product():
            return _product(value, ranges)
        case _:
            assert_never(value)


def _product(value: m.Product, ranges: Mapping[str, Interval]) -> Interval:
    left, right = interval_of(value.left, ranges), interval_of(value.right, ranges)
    if value.op == "/":
        if _holds_zero(right):
            return _EVERYTHING
        right = (1 / right[1], 1 / right[0])
    ends = [0.0 if 0.0 in (a, b) else a * b for a in left for b in right]
    return min(ends), max(ends)


def _holds_zero(interval: Interval) -> bool:
    """Return whether zero lies in an interval."""
    return interval[0] <= 0.0 <= interval[1]
