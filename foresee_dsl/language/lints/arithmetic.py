"""Divisions by what can be zero: in some case that is drawn there would be no value."""

from __future__ import annotations

from collections.abc import Iterator

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import references
from foresee_dsl.language.arithmetic.ranges import holds_zero, interval_of, intervals
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import walk


def divisions_by_zero(scenario: m.Scenario) -> Iterator[tuple[m.Item, str, str]]:
    """Return the divisions whose divisor can be zero within the parameters' ranges: item, message, help."""
    quotients = [
        part
        for item in scenario.body
        if not isinstance(item, m.Param)
        for part in walk(item)
        if isinstance(part, m.Product) and part.op == "/"
    ]
    if not quotients:
        return
    known = intervals(scenario)
    for quotient in quotients:
        names = list(dict.fromkeys(ref.name for ref in references(quotient.right)))
        if not names or not set(names) <= known.keys() or not holds_zero(interval_of(quotient.right, known)):
            continue
        if isinstance(quotient.right, m.Ref) and not _takes_zero(scenario, quotient.right.name):
            continue
        by = written(quotient.right)
        message = f"`{written(quotient)}` has no value where `{by}` is 0, which the range of '{names[0]}' allows"
        yield quotient, message, f"keep zero out: `require {names[0]} > 0{_unit(scenario, names[0])}`, or another range"


def _takes_zero(scenario: m.Scenario, name: str) -> bool:
    """Return whether zero is among a parameter's options or on one of its steps; True where there are neither."""
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
