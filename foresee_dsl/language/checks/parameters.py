"""Parameters: their ranges, how they are drawn, the cases that fix them, and what is required of them."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from typing import get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import case_values, needed_by, plain, references
from foresee_dsl.language.arithmetic.results import not_by_zero
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import closest, did_you_mean, of_type
from foresee_dsl.language.messages.words import NOUNS
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.sampling.draws import MAX_CASES, case_names, holds, violation
from foresee_dsl.language.syntax.nodes import RESERVED
from foresee_dsl.language.traversal import parts
from foresee_dsl.language.units import Dimension
from foresee_dsl.limits import most, raised_by

_TURNS = get_args(m.Turn)
_SIDES = ("left", "right")
_MODEL = re.compile(r"[a-z][a-z0-9_]*\.[a-z][a-z0-9_]*")
_ON_STEP = 1e-6
"""How far from a whole number of steps a value may be (ours: far above rounding, far below any step)."""


def check_parameters(findings: Findings, scenario: m.Scenario) -> None:
    """Check the parameters and cases of a scenario."""
    parameters = scenario.all(m.Param)
    findings.unique(((p, "name", p.name) for p in parameters), "parameters")
    for parameter in parameters:
        _check_parameter(findings, parameter)
    for parameter in parameters:
        if parameter.distribution is not None:
            _check_distribution(findings, parameter, parameter.distribution)
    _check_case_names(findings, scenario)
    by_name = {parameter.name: parameter for parameter in parameters}
    for case in scenario.all(m.Case):
        before, given = len(findings), {assignment.name: None for assignment in case.values}
        findings.unique(((a, "name", a.name) for a in case.values), f"values in case '{case.name}'")
        for assignment in case.values:
            known = by_name.get(assignment.name)
            if known is None:
                help = did_you_mean(assignment.name, [name for name in by_name if name not in given])
                other = closest(assignment.name, [name for name in given if name in by_name])
                if "did you mean" not in help and other is not None:
                    help = f"'{other}' is given beside it: remove it"
                findings.add(assignment, "name", "FS031", f"unknown parameter '{assignment.name}'", help)
            else:
                _check_assignment(findings, known, assignment, by_name)
        if len(findings) == before:
            _check_worked_out(findings, scenario, case, by_name)
    check_requirements(findings, scenario)


def _check_assignment(
    findings: Findings, parameter: m.Param, assignment: m.Assignment, parameters: dict[str, m.Param]
) -> None:
    """Check a value that a case gives; of one that is worked out of others, its dimension."""
    value = assignment.value
    types = {name: known.type for name, known in parameters.items()}
    needed = needed_by(assignment, types)
    if isinstance(value, str) and needed:
        other = parameters[value]
        if other.type != parameter.type and not {other.type, parameter.type} <= {"ratio", "count"}:
            message = f"'{value}' is of type {other.type}, but '{parameter.name}' of type {parameter.type}"
            findings.add(assignment, "value", "FS032", message, of_type(parameter.type, types))
    elif isinstance(value, m.EXPRESSIONS):
        from foresee_dsl.language.checks.expressions import check_expression, unknown_in

        if parameter.type in WORD_TYPES:
            message = f"'{parameter.name}' is of type {parameter.type}, not a number"
            findings.add(
                assignment, "value", "FS034", message, f"write it like the default, `{value_text(parameter.default)}`"
            )
        elif not unknown_in(value, types):
            check_expression(findings, assignment, "value", value, dimension_of(parameter), types)
    else:
        _check_value(findings, parameter, assignment, "value", value)


def _check_worked_out(findings: Findings, scenario: m.Scenario, case: m.Case, parameters: dict[str, m.Param]) -> None:
    """Check what the values that are worked out of others come to: they lie in their parameters' ranges."""
    types = {name: known.type for name, known in parameters.items()}
    computed = [given for given in case.values if needed_by(given, types) or isinstance(given.value, m.EXPRESSIONS)]
    given = {assignment.name for assignment in case.values}
    following = [
        known
        for name, known in parameters.items()
        if name not in given
        and isinstance(known.default, m.Calculated)
        and any(references(known.default))
        and known.default.dimension in (known.type, "ratio")
    ]
    if not computed and not following:
        return
    try:
        values = case_values(scenario, case)
    except ExpressionError as error:
        item, help = error.item, not_by_zero(error.item, {p.name: p.default for p in parameters.values()})
        if isinstance(item, m.Assignment):
            help = f"write a value: `{item.name} = {value_text(plain(parameters[item.name].default))}`"
            item = item if any(item is assignment for assignment in case.values) else case
        findings.add(item, "", c.NO_RESULT, f"in case '{case.name}' {error.message}", help)
        return
    for assignment in computed:
        _check_value(findings, parameters[assignment.name], assignment, "value", values[assignment.name])
    for known in following:
        _check_value(findings, known, case, "name", values[known.name])


def _check_parameter(findings: Findings, parameter: m.Param) -> None:
    if parameter.name in RESERVED:
        message = f"'{parameter.name}' is a word of the language"
        findings.add(parameter, "name", "FS049", message, "give the parameter another name")
    limits, sound = parameter.range, True
    if limits is not None:
        ends = [(end, value) for end in ("low", "high", "step") if (value := getattr(limits, end)) is not None]
        sound = all(_check_type(findings, parameter, limits, end, value) for end, value in ends)
        if sound and limits.low.si > limits.high.si:
            help = f"write `{written(limits.high)}..{written(limits.low)}`"
            findings.add(limits, "", "FS039", "this range ends before it begins", help)
            sound = False
        elif sound and limits.step is not None and limits.step.si <= 0:
            findings.add(limits, "step", "FS050", "a step is more than zero", "use a positive step, or none")
            sound = False
    for k, option in enumerate(parameter.options or ()):
        sound &= _check_type(findings, parameter, parameter, f"options.{k}", option)
    if sound:
        _check_value(findings, parameter, parameter, "default", parameter.default)


def _check_value(findings: Findings, parameter: m.Param, item: m.Item, field: str, value: m.ParamValue) -> None:
    """Check a value that a parameter takes: its type, then its range or options."""
    if not _check_type(findings, parameter, item, field, value):
        return
    if isinstance(value, str):
        if parameter.options is not None and value not in parameter.options:
            message = f"'{value}' is not among the options of '{parameter.name}'"
            words = [option for option in parameter.options if isinstance(option, str)]
            findings.add(item, field, "FS033", message, did_you_mean(value, words))
        return
    if parameter.options is not None and not any(same_value(value, option) for option in parameter.options):
        message = f"`{written(value)}` is not among the options of '{parameter.name}'"
        known = ", ".join(written(option) for option in parameter.options if isinstance(option, m.Quantity))
        findings.add(item, field, "FS033", message, f"options are {known}")
        return
    limits = parameter.range
    if limits is None or limits.low.si > limits.high.si:
        return
    low, high = limits.low.si, limits.high.si
    slack = _ON_STEP * max(abs(low), abs(high), 1.0)
    ends = f"{written(limits.low)}..{written(limits.high)}"
    if not low - slack <= value.si <= high + slack:
        message = f"`{written(value)}` is outside the range of '{parameter.name}', {ends}"
        near = written(limits.low if value.si < low else limits.high)
        findings.add(item, field, "FS033", message, f"use a value inside it, such as `{near}`, or widen the range")
    elif limits.step is not None and limits.step.si > 0:
        steps = (value.si - low) / limits.step.si
        if abs(steps - round(steps)) > _ON_STEP * max(1.0, abs(steps)):
            message = f"`{written(value)}` is not on a step of '{parameter.name}': {ends} step {written(limits.step)}"
            near = _on_step(limits, min(round(steps), math.floor((high - low) / limits.step.si + _ON_STEP)))
            help = f"round it to the step, `{near}`, or make the step smaller"
            findings.add(item, field, "FS033", message, help)


def _on_step(limits: m.Range, k: int) -> str:
    """Return the value on the k-th step of a range, as it is written."""
    from foresee_dsl.language.arithmetic.evaluate import evaluate

    steps = m.Product(left=m.Quantity(value=Decimal(k)), op="*", right=limits.step or limits.low)
    try:
        return written(evaluate(m.Sum(left=limits.low, op="+", right=steps)))
    except ExpressionError:  # the step is of another dimension, which is reported at its place
        return written(limits.low)


def _check_type(findings: Findings, parameter: m.Param, item: m.Item, field: str, value: m.ParamValue) -> bool:
    """Report a value that does not fit the parameter's type; return whether it does."""
    if isinstance(value, m.Quantity):
        return _check_quantity(findings, parameter, item, field, value)
    type_ = parameter.type
    if type_ not in WORD_TYPES:
        message = f"'{parameter.name}' is of type {type_}, but `{value}` is a word"
        findings.add(item, field, "FS034", message, f"write {findings.example(dimension_of(parameter))}")
    elif type_ == "side" and value not in _SIDES:
        findings.add(item, field, "FS034", f"unknown side '{value}'", did_you_mean(value, _SIDES))
    elif type_ == "turn" and value not in _TURNS:
        findings.add(item, field, "FS034", f"unknown turn '{value}'", did_you_mean(value, _TURNS))
    elif type_ == "model" and _MODEL.fullmatch(value) is None:
        help = "models are called class.variant, such as `car.compact`"
        findings.add(item, field, "FS034", f"`{value}` is no name of a model", help)
    else:
        return True
    return False


def _check_quantity(findings: Findings, parameter: m.Param, item: m.Item, field: str, value: m.Quantity) -> bool:
    type_ = parameter.type
    if type_ in WORD_TYPES:
        help = {
            "arm": "write the name of a road, such as `south`",
            "turn": f"turns are {', '.join(_TURNS)}",
            "junction": "write the name of a junction, such as `j4`",
            "stage": "write the name of a stage, such as `ns_go`",
            "side": "write `left` or `right`",
        }
        message = f"'{parameter.name}' is of type {type_}, not a number"
        findings.add(item, field, "FS034", message, help.get(type_, "write the name of a model, such as `car.compact`"))
        return False
    needed = dimension_of(parameter)
    if value.dimension != needed and not (needed == "count" and not value.unit):
        findings.wrong_dimension(item, field, value, needed, code="FS034")
        return False
    if needed == "count" and (value.value < 0 or value.value != value.value.to_integral_value()):
        findings.add(item, field, "FS034", f"`{written(value)}` is no whole number", "write one such as `2`")
        return False
    return True


WORD_TYPES = tuple(name for name in get_args(m.ParamType) if name not in get_args(Dimension))
"""Types of parameters whose values are words."""
_MAX_SEED = 10**9
"""The largest seed: the largest number of the language."""


def _check_case_names(findings: Findings, scenario: m.Scenario) -> None:
    """Report names of cases that are given twice; a `cases` statement whose names clash only once."""
    named: list[tuple[m.Item, str, str]] = [(case, "name", case.name) for case in scenario.all(m.Case)]
    drawn_cases = 0
    for cases in scenario.all(m.Cases):
        if _check_cases(findings, cases):
            drawn_cases += int(cases.count.value)
            if drawn_cases > most("cases"):
                message = f"with these the scenario has more than {most('cases'):,.0f} drawn cases"
                findings.add(cases, "count", "FS050", message, f"ask for less; {raised_by('cases', drawn_cases)}")
                return
            named += [(cases, "seed", name) for name in case_names(cases)]
    seen: dict[str, m.Item] = {}
    reported: set[int] = set()
    for item, field, name in named:
        if seen.setdefault(name, item) is item or id(item) in reported:
            continue
        reported.add(id(item))
        drawn = isinstance(item, m.Cases)
        help = "take another seed, or give the written case another name" if drawn else "give one of them another name"
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
            findings.add(cases, field, "FS050", message, f"use `{low}` to `{high}`")
            sound = False
    return sound


# ---- distributions --------------------------------------------------------------------------------------------------


def _check_distribution(findings: Findings, parameter: m.Param, distribution: m.Distribution) -> None:
    kind = distribution.kind
    if parameter.range is None and parameter.options is None:
        default = parameter.default
        if isinstance(default, m.Quantity):
            twice = m.Quantity(value=default.value * 2 or Decimal(1), unit=default.unit)
            low = m.Quantity(value=Decimal(0) * default.value, unit=default.unit)
            help = (
                f"give it a range: `{_head(parameter)} in {written(low)}..{written(twice)} as {written(distribution)}`"
            )
        else:
            help = f"give it options: `{_head(parameter)} in [{default}] as {written(distribution)}`"
        findings.add(distribution, "", "FS051", f"'{parameter.name}' has nothing to be drawn from", help)
    elif isinstance(distribution, m.Normal):
        _check_normal(findings, parameter, distribution)
    elif isinstance(distribution, m.Choice):
        _check_choice(findings, parameter, distribution)
    elif kind == "grid" and parameter.range is not None and parameter.range.step is None and parameter.type != "count":
        low, high = parameter.range.low, parameter.range.high
        steps = f"{written(low)}..{written(high)} step {written(_tenth(parameter.range))}"
        help = f"write it like `{_head(parameter)} in {steps} as grid`"
        findings.add(distribution, "", "FS051", "a grid needs steps, and this range has none", help)


def _check_normal(findings: Findings, parameter: m.Param, normal: m.Normal) -> None:
    limits = parameter.range
    if limits is None:
        weights = ", ".join("1" for _ in parameter.options or ())
        help = f"options are drawn as `uniform`, `choice({weights})` or `grid`"
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
        near = written(limits.low if normal.mean.si < limits.low.si else limits.high)
        findings.add(normal, "mean", "FS051", message, f"use one inside it, such as `{near}`, or widen the range")
    if normal.deviation.si <= 0:
        message = f"a deviation of `{written(normal.deviation)}` draws nothing"
        findings.add(
            normal,
            "deviation",
            "FS051",
            message,
            f"a standard deviation is more than zero, such as `{written(_tenth(limits))}`",
        )


def _check_choice(findings: Findings, parameter: m.Param, choice: m.Choice) -> None:
    options, weights = parameter.options, choice.weights
    if options is None:
        help = "write the values to choose from, in brackets behind `in`, or draw as `uniform`"
        findings.add(choice, "", "FS051", "a choice needs options, and this parameter has a range", help)
        return
    if len(options) != len(weights):
        message = f"{len(weights)} weights for {len(options)} options"
        more = [m.Quantity(value=Decimal(1))] * max(len(options) - len(weights), 0)
        given = ", ".join(written(weight) for weight in [*weights[: len(options)], *more])
        findings.add(choice, "", "FS051", message, f"give each option one, in their order: `choice({given})`")
    for k, weight in enumerate(weights):
        if weight.unit:
            findings.add(
                choice,
                f"weights.{k}",
                "FS051",
                f"`{written(weight)}` is no weight",
                f"a weight has no unit: `{written(m.Quantity(value=weight.value))}`",
            )
        elif weight.value <= 0:
            help = "a weight is more than zero, such as `1`; leave out an option that is not to be drawn"
            findings.add(choice, f"weights.{k}", "FS051", f"`{written(weight)}` is no weight", help)


def _head(parameter: m.Param) -> str:
    """Return a parameter as it is written, up to its default."""
    return f"param {parameter.name}: {parameter.type} = {value_text(parameter.default)}"


def _tenth(limits: m.Range) -> m.Quantity:
    """Return a tenth of a range, in the unit of its end."""
    width = limits.high.value - limits.low.value
    return m.Quantity(value=(width / 10 if width else width).normalize(), unit=limits.high.unit)


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
            try:
                values = case_values(scenario, case)
            except ExpressionError:
                continue  # which was reported
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
    if isinstance(part, m.Comparison) and isinstance(part.left, m.Ref) and not isinstance(part.right, m.EXPRESSIONS):
        return _check_compared(findings, part, part.left, part.right, parameters)
    if isinstance(part, m.Comparison) and not isinstance(part.left, m.Measure):
        from foresee_dsl.language.checks.expressions import compare_sides, unknown_in

        types = {name: parameter.type for name, parameter in parameters.items()}
        unknown = unknown_in(part.left, types) or unknown_in(part.right, types)  # `check_values` reports them
        return not unknown and compare_sides(findings, part, types)
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
        help = f"compare it with a value: `{parameter.name} <= {value_text(parameter.default)}`"
        message = f"'{parameter.name}' is {NOUNS[dimension_of(parameter)]}, and never a word"
        findings.add(part, "left", "FS032", message, help)
        return False
    if parameter.options is not None and part.right not in parameter.options:
        message = f"'{part.right}' is not among the options of '{parameter.name}'"
        words = [option for option in parameter.options if isinstance(option, str)]
        findings.add(part, "right", "FS033", message, did_you_mean(part.right, words))
        return False
    return True


def _check_compared(
    findings: Findings, part: m.Comparison, left: m.Ref, right: m.Quantity | m.Ref, parameters: dict[str, m.Param]
) -> bool:
    sides = [(field, side.name) for field, side in (("left", left), ("right", right)) if isinstance(side, m.Ref)]
    if any(name not in parameters for _, name in sides):
        return False
    for field, name in sides:
        if parameters[name].type in WORD_TYPES:
            help = f"write `{name} is {value_text(parameters[name].default)}`"
            findings.add(part, field, "FS032", f"'{name}' is a word, which is neither less nor more", help)
            return False
    first = parameters[left.name]
    needed = dimension_of(first)
    if isinstance(right, m.Quantity):
        if right.dimension != needed and not (needed == "count" and not right.unit):
            findings.wrong_dimension(part, "right", right, needed)
            return False
    elif (other := dimension_of(parameters[right.name])) != needed:
        message = f"'{left.name}' is {NOUNS[needed]}, but '{right.name}' is {NOUNS[other]}"
        findings.add(part, "right", "FS032", message, "compare parameters of one type")
        return False
    return True


def dimension_of(parameter: m.Param) -> Dimension:
    """Return the dimension of a parameter whose values are quantities."""
    return next(d for d in NOUNS if d == parameter.type)
