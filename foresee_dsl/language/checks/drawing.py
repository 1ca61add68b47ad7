"""How values are drawn, which cases are, and what is required of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.messages.words import NOUNS
from foresee_dsl.language.printer import written
from foresee_dsl.language.sampling.draws import MAX_CASES, case_names
from foresee_dsl.language.sampling.requirements import holds, violation
from foresee_dsl.language.traversal import parts
from foresee_dsl.language.units import Dimension

WORD_TYPES = tuple(name for name in get_args(m.ParamType) if name not in get_args(Dimension))
"""Types of parameters whose values are words."""
_MAX_SEED = 10**9
"""The largest seed: the largest number of the language."""


def check_drawing(findings: Findings, scenario: m.Scenario) -> None:
    """Check the distributions of a scenario's parameters, its `cases` statements, and the names of all cases."""
    for parameter in scenario.all(m.Param):
        if parameter.distribution is not None:
            _check_distribution(findings, parameter, parameter.distribution)
    names: list[tuple[m.Item, str, str]] = [(case, "name", case.name) for case in scenario.all(m.Case)]
    for cases in scenario.all(m.Cases):
        if _check_cases(findings, cases):
            names += [(cases, "seed", name) for name in case_names(cases)]
    _check_names(findings, names)


def _check_names(findings: Findings, named: list[tuple[m.Item, str, str]]) -> None:
    """Report names that are given twice; a `cases` statement whose names clash only once."""
    seen: dict[str, m.Item] = {}
    reported: set[int] = set()
    for item, field, name in named:
        other = seen.setdefault(name, item)
        if other is item or id(item) in reported:
            continue
        reported.add(id(item))
        help = "give one of them another name"
        if isinstance(item, m.Cases):
            help = "take another seed, or give the written case another name"
        findings.add(item, field, "FS030", f"there are two cases called '{name}'", help)


def _check_cases(findings: Findings, cases: m.Cases) -> bool:
    """Return whether the count and the seed are such that cases can be drawn."""
    sound = True
    for field, low, high in (("count", 1, MAX_CASES), ("seed", 0, _MAX_SEED)):
        value: m.Quantity = getattr(cases, field)
        if value.unit or value.value != value.value.to_integral_value():
            findings.add(cases, field, "FS010", f"`{written(value)}` is no whole number", "write one such as `20`")
            sound = False
        elif not low <= value.value <= high:
            message = f"`{written(value)}` is no {'number of cases' if field == 'count' else 'seed'} that can be drawn"
            findings.add(cases, field, "FS050", message, f"use {low} to {high}")
            sound = False
    return sound


# ---- distributions --------------------------------------------------------------------------------------------------


def _check_distribution(findings: Findings, parameter: m.Param, distribution: m.Distribution) -> None:
    kind = distribution.kind
    if parameter.range is None and parameter.options is None:
        help = "give it a range, `in 0 s..4 s step 0.1 s`, or options, `in [north, south]`"
        findings.add(distribution, "", "FS051", f"'{parameter.name}' has nothing to be drawn from", help)
    elif isinstance(distribution, m.Normal):
        _check_normal(findings, parameter, distribution)
    elif isinstance(distribution, m.Choice):
        _check_choice(findings, parameter, distribution)
    elif kind == "grid" and parameter.range is not None and parameter.range.step is None and parameter.type != "count":
        limits = parameter.range
        help = f"write it like `in {written(limits.low)}..{written(limits.high)} step {_tenth(limits)}`"
        findings.add(distribution, "", "FS051", "a grid needs steps, and this range has none", help)


def _tenth(limits: m.Range) -> str:
    width = limits.high.value - limits.low.value
    return written(m.Quantity(value=(width / 10 if width else width).normalize(), unit=limits.high.unit))


def _check_normal(findings: Findings, parameter: m.Param, normal: m.Normal) -> None:
    limits = parameter.range
    if limits is None:
        help = "options are drawn `as uniform`, `as choice(3, 1)` or `as grid`"
        findings.add(normal, "", "FS051", "a normal distribution needs a range, and this parameter has options", help)
        return
    needed = limits.low.dimension
    for field in ("mean", "deviation"):
        value: m.Quantity = getattr(normal, field)
        if value.dimension != needed:
            findings.wrong_dimension(normal, field, value, needed, code="FS051")
            return
    if not limits.low.si <= normal.mean.si <= limits.high.si:
        ends = f"{written(limits.low)}..{written(limits.high)}"
        message = f"the mean `{written(normal.mean)}` is outside the range, {ends}"
        findings.add(normal, "mean", "FS051", message, "use one inside it, or widen the range")
    if normal.deviation.si <= 0:
        message = f"a deviation of `{written(normal.deviation)}` draws nothing"
        findings.add(normal, "deviation", "FS051", message, "a standard deviation is more than zero")


def _check_choice(findings: Findings, parameter: m.Param, choice: m.Choice) -> None:
    options, weights = parameter.options, choice.weights
    if options is None:
        help = "write the values to choose from, `in [20 km/h, 30 km/h]`, or draw `as uniform`"
        findings.add(choice, "", "FS051", "a choice needs options, and this parameter has a range", help)
        return
    if len(options) != len(weights):
        message = f"{len(weights)} weights for {len(options)} options"
        findings.add(choice, "", "FS051", message, "give each option one, in their order")
    for k, weight in enumerate(weights):
        if weight.unit:
            findings.add(choice, f"weights.{k}", "FS051", f"`{written(weight)}` is no weight", "a weight has no unit")
        elif weight.value <= 0:
            help = "a weight is more than zero; leave out an option that is not to be drawn"
            findings.add(choice, f"weights.{k}", "FS051", f"`{written(weight)}` is no weight", help)


# ---- requirements ---------------------------------------------------------------------------------------------------


def check_requirements(findings: Findings, scenario: m.Scenario) -> None:
    """Check what is required, and that the written cases satisfy it (without any cases, the defaults)."""
    parameters = {parameter.name: parameter for parameter in scenario.all(m.Param)}
    sound = []
    for require in scenario.all(m.Require):
        good = [_check_part(findings, part, parameters) for part in parts(require.condition)]
        if all(good):
            sound.append(require)
    defaults = {name: parameter.default for name, parameter in parameters.items()}
    written_cases = scenario.all(m.Case)
    for require in sound:
        for case in written_cases:
            values = defaults | {given.name: given.value for given in case.values}
            if holds(require.condition, values) is False:
                message = f"in case '{case.name}' {violation(require, values)}"
                findings.add(case, "name", "FS053", message, "change the value, or what is required")
        if not written_cases and not scenario.all(m.Cases) and holds(require.condition, defaults) is False:
            message = f"by default {violation(require, defaults)}"
            findings.add(require, "", "FS053", message, "change a default, or what is required")


def _check_part(findings: Findings, part: m.Condition, parameters: dict[str, m.Param]) -> bool:
    """Check one part of a requirement; return whether it can be evaluated."""
    if isinstance(part, m.Not | m.Both | m.Either):
        return True
    if isinstance(part, m.Equals):
        return _check_equals(findings, part, parameters)
    if isinstance(part, m.Comparison) and isinstance(part.left, m.Ref):
        return _check_compared(findings, part, part.left, parameters)
    help = (
        "only parameters are compared here: `require gap < 2 s`; what happens in the world is for `when` and `expect`"
    )
    findings.add(part, "", "FS052", f"`{written(part)}` is not known before the run", help)
    return False


def _check_equals(findings: Findings, part: m.Equals, parameters: dict[str, m.Param]) -> bool:
    parameter = parameters.get(part.left.name)
    if parameter is None:
        return False  # `check_values` reports it
    if parameter.type not in WORD_TYPES:
        help = f"compare it with a value: `{parameter.name} <= {_default(parameter)}`"
        message = f"'{parameter.name}' is {NOUNS[dimension_of(parameter)]}, and never a word"
        findings.add(part, "left", "FS032", message, help)
        return False
    if parameter.options is not None and part.right not in parameter.options:
        message = f"'{part.right}' is not among the options of '{parameter.name}'"
        words = [option for option in parameter.options if isinstance(option, str)]
        findings.add(part, "right", "FS033", message, did_you_mean(part.right, words))
        return False
    return True


def _check_compared(findings: Findings, part: m.Comparison, left: m.Ref, parameters: dict[str, m.Param]) -> bool:
    sides = list(_compared(part, left, parameters))
    if any(parameter is None for _, _, parameter in sides):
        return False
    for field, name, parameter in sides:
        if parameter is not None and parameter.type in WORD_TYPES:
            help = f"write `{name} is {_default(parameter)}`"
            findings.add(part, field, "FS032", f"'{name}' is a word, which is neither less nor more", help)
            return False
    first = parameters[left.name]
    needed = dimension_of(first)
    if isinstance(part.right, m.Quantity):
        if part.right.dimension != needed and not (needed == "count" and not part.right.unit):
            findings.wrong_dimension(part, "right", part.right, needed)
            return False
    elif (other := dimension_of(parameters[part.right.name])) != needed:
        message = f"'{left.name}' is {NOUNS[needed]}, but '{part.right.name}' is {NOUNS[other]}"
        findings.add(part, "right", "FS032", message, "compare parameters of one type")
        return False
    return True


def _compared(
    part: m.Comparison, left: m.Ref, parameters: dict[str, m.Param]
) -> Iterator[tuple[str, str, m.Param | None]]:
    yield "left", left.name, parameters.get(left.name)
    if isinstance(part.right, m.Ref):
        yield "right", part.right.name, parameters.get(part.right.name)


def _default(parameter: m.Param) -> str:
    """Return a parameter's default as it is written."""
    return written(parameter.default) if isinstance(parameter.default, m.Quantity) else parameter.default


def dimension_of(parameter: m.Param) -> Dimension:
    """Return the dimension of a parameter whose values are quantities."""
    return next(d for d in NOUNS if d == parameter.type)
