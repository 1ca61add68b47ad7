"""Checks of random draws: the distributions of parameters, and the names of the cases that are drawn from them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Decimal

from foresee_dsl.helps import rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.sampling import MAX_CASES, case_names
from foresee_dsl.language.units import UNITS
from foresee_dsl.limits import most, raised_by

_MAX_SEED = 10**9
"""Largest seed: the largest number that the language allows."""

_DIVISIONS = 4
"""How many powers of ten are tried as a step at most (ours: finer values are rare)."""


def check_drawn(collector: Collector, scenario: m.Scenario) -> None:
    """Check the distributions of a scenario's parameters and its `cases`."""
    for parameter in scenario.all(m.Param):
        if parameter.distribution is not None:
            _check_distribution(collector, parameter, parameter.distribution, scenario.all(m.Case))
    _check_case_names(collector, scenario)


def _check_case_names(collector: Collector, scenario: m.Scenario) -> None:
    """Report case names that occur twice; of a `cases` statement with several such names, only the first name is
    reported."""
    named: list[tuple[m.Item, str, str]] = [(case, "name", case.name) for case in scenario.all(m.Case)]
    drawn_cases = 0
    for cases in scenario.all(m.Cases):
        if _check_cases(collector, cases):
            drawn_cases += int(cases.count.value)
            if drawn_cases > most("cases"):
                message = f"with these the scenario has more than {most('cases'):,.0f} drawn cases"
                collector.add(cases, "count", "FS050", message, f"ask for less; {raised_by('cases', drawn_cases)}")
                return
            named += [(cases, "seed", name) for name in case_names(cases)]
    seen: dict[str, m.Item] = {}
    reported: set[int] = set()
    for item, field, name in named:
        if seen.setdefault(name, item) is item or id(item) in reported:
            continue
        reported.add(id(item))
        drawn = isinstance(item, m.Cases)
        help = rename("give the written case another name" if drawn else "give one of them another name")
        help = "take another seed, or " + help if drawn else help
        collector.add(item, field, "FS030", f"there are two cases called '{name}'", help)


def _check_cases(collector: Collector, cases: m.Cases) -> bool:
    """Report a number of cases or a seed that is not allowed; return whether cases can be drawn."""
    sound = True
    for field, low, high in (("count", 1, MAX_CASES), ("seed", 0, _MAX_SEED)):
        value: m.Quantity = getattr(cases, field)
        if value.unit or value.value != value.value.to_integral_value():
            message = f"`{written(value)}` is not a whole number"
            collector.add(cases, field, "FS010", message, "write one such as " + write("20"))
            sound = False
        elif not low <= value.value <= high:
            message = f"`{written(value)}` cannot be the {'number of cases' if field == 'count' else 'seed'} of a draw"
            collector.add(cases, field, "FS050", message, "use " + write(str(low)) + " to " + write(str(high)))
            sound = False
    return sound


def _check_distribution(
    collector: Collector, parameter: m.Param, distribution: m.Distribution, cases: Iterable[m.Case]
) -> None:
    kind = distribution.kind
    if parameter.range is None and parameter.options is None:
        default = parameter.default
        if isinstance(default, m.Quantity):
            twice = m.Quantity(value=default.value * 2 or Decimal(1), unit=default.unit)
            low = m.Quantity(value=Decimal(0) * default.value, unit=default.unit)
            usage = f"{_head(parameter)} in {written(low)}..{written(twice)} as {written(distribution)}"
            help = "give it a range: " + write(usage)
        else:
            help = "give it options: " + write(f"{_head(parameter)} in [{default}] as {written(distribution)}")
        collector.add(distribution, "", "FS051", f"'{parameter.name}' has no range or options to draw from", help)
    elif isinstance(distribution, m.Normal):
        _check_normal(collector, parameter, distribution)
    elif isinstance(distribution, m.Choice):
        _check_choice(collector, parameter, distribution)
    elif kind == "grid" and parameter.range is not None and parameter.range.step is None and parameter.type != "count":
        low, high = parameter.range.low, parameter.range.high
        steps = f"{written(low)}..{written(high)} step {written(_step(parameter, parameter.range, cases))}"
        help = "write it like " + write(f"{_head(parameter)} in {steps} as grid")
        collector.add(distribution, "", "FS051", "a grid needs steps, but this range has no step", help)


def _check_normal(collector: Collector, parameter: m.Param, normal: m.Normal) -> None:
    limits = parameter.range
    if limits is None:
        weights = ", ".join("1" for _ in parameter.options or ())
        help = "draw options as " + write("uniform") + ", " + write(f"choice({weights})") + " or " + write("grid")
        collector.add(normal, "", "FS051", "a normal distribution needs a range, but this parameter has options", help)
        return
    needed = limits.low.dimension
    for field in ("mean", "deviation"):
        value: m.Quantity = getattr(normal, field)
        if value.dimension != needed:
            collector.wrong_dimension(normal, field, value, needed, code="FS051")
            return
    if not limits.low.si <= normal.mean.si <= limits.high.si:
        ends = f"{written(limits.low)}..{written(limits.high)}"
        message = f"the mean `{written(normal.mean)}` is outside the range, {ends}"
        near = written(limits.low if normal.mean.si < limits.low.si else limits.high)
        help = "use one inside it, such as " + write(near) + ", or widen the range"
        collector.add(normal, "mean", "FS051", message, help)
    if normal.deviation.si <= 0:
        message = f"the standard deviation `{written(normal.deviation)}` is too small"
        help = "it must be more than zero, such as " + write(written(_tenth(limits)))
        collector.add(normal, "deviation", "FS051", message, help)


def _check_choice(collector: Collector, parameter: m.Param, choice: m.Choice) -> None:
    options, weights = parameter.options, choice.weights
    if options is None:
        help = "write the values to choose from, in brackets behind " + write("in") + ", or draw as " + write("uniform")
        collector.add(choice, "", "FS051", "a choice needs options, but this parameter has a range", help)
        return
    if len(options) != len(weights):
        message = f"the number of weights, {len(weights)}, differs from the number of options, {len(options)}"
        more = [m.Quantity(value=Decimal(1))] * max(len(options) - len(weights), 0)
        example = ", ".join(written(weight) for weight in [*weights[: len(options)], *more])
        help = "write one weight for each option, in their order: " + write(f"choice({example})")
        collector.add(choice, "", "FS051", message, help)
    for k, weight in enumerate(weights):
        if weight.unit:
            help = "a weight has no unit: " + write(written(m.Quantity(value=weight.value)))
        elif weight.value <= 0:
            help = "a weight is more than zero, such as " + write("1") + "; to draw an option never, remove it"
        else:
            continue
        collector.add(choice, f"weights.{k}", "FS051", f"`{written(weight)}` is not a weight", help)


def _head(parameter: m.Param) -> str:
    """Return the text of a parameter's statement, in the language, up to its default."""
    return f"param {parameter.name}: {parameter.type} = {value_text(parameter.default)}"


def _tenth(limits: m.Range) -> m.Quantity:
    """Return a tenth of a range, in the unit of its end; if the range has no width, one."""
    low, high = limits.low, limits.high
    begin = low.value
    if low.unit != high.unit:
        begin = Decimal(f"{low.si / (UNITS[high.unit].to_si if high.unit else 1.0):.3f}")
    return m.Quantity(value=((high.value - begin) / 10 or Decimal(1)).normalize(), unit=high.unit)


def _step(parameter: m.Param, limits: m.Range, cases: Iterable[m.Case]) -> m.Quantity:
    """Return a step for a range on which its parameter's default and its values in the cases are: a tenth of the range,
    or less."""
    assigned = [item.value for case in cases for item in case.values if item.name == parameter.name]
    values = [value.si - limits.low.si for value in (parameter.default, *assigned) if isinstance(value, m.Quantity)]
    step = _tenth(limits)
    for k in range(_DIVISIONS):
        if all(math.isclose(value / step.si, round(value / step.si), abs_tol=1e-6) for value in values):
            break
        step = m.Quantity(value=Decimal(10) ** (_tenth(limits).value.adjusted() - k), unit=step.unit)
    return step
