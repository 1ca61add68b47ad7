"""Checks of parameters: their ranges and options, the values that cases give them, and the requirements of values."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from typing import get_args

from foresee_dsl.errors import subject
from foresee_dsl.helps import Help, HelpText, one_of, remove, rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import case_values, needed_by, plain, references
from foresee_dsl.language.arithmetic.results import not_by_zero
from foresee_dsl.language.checks.drawn import check_drawn
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import closest, did_you_mean, of_type
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.sampling import holds, violation
from foresee_dsl.language.syntax.nodes import RESERVED
from foresee_dsl.language.traversal import parts
from foresee_dsl.language.units import NOUNS

_TURNS = get_args(m.Turn)
_SIDES = ("left", "right")
_MODEL = re.compile(r"[a-z][a-z0-9_]*\.[a-z][a-z0-9_]*")
_ON_STEP = 1e-6
"""Largest distance of a value from a whole number of steps, in steps (ours: far above rounding errors, far below a
step)."""


def check_parameters(collector: Collector, scenario: m.Scenario) -> None:
    """Check the parameters and cases of a scenario."""
    parameters = scenario.all(m.Param)
    collector.unique(parameters, "parameters")
    for parameter in parameters:
        _check_parameter(collector, parameter)
    check_drawn(collector, scenario)
    by_name = {parameter.name: parameter for parameter in parameters}
    for case in scenario.all(m.Case):
        before, names = len(collector), {assignment.name: None for assignment in case.values}
        collector.unique(case.values, f"values in case '{case.name}'")
        for assignment in case.values:
            declared = by_name.get(assignment.name)
            if declared is None:
                left = [name for name in by_name if name not in names]
                help = did_you_mean(assignment.name, left)
                other = closest(assignment.name, [name for name in names if name in by_name])
                if closest(assignment.name, left) is None and other is not None:
                    help = f"'{other}' already has a value in this case: " + remove("remove it")
                collector.add(assignment, "name", "FS031", "unknown parameter '" + subject(assignment.name) + "'", help)
            else:
                _check_assignment(collector, declared, assignment, by_name)
        if len(collector) == before:
            _check_worked_out(collector, scenario, case, by_name)


def _check_assignment(
    collector: Collector, parameter: m.Param, assignment: m.Assignment, parameters: dict[str, m.Param]
) -> None:
    """Check a value that a case gives; for a calculated value, check its dimension."""
    value = assignment.value
    types = {name: declared.type for name, declared in parameters.items()}
    needed = needed_by(assignment, types)
    if isinstance(value, str) and needed:
        other = parameters[value]
        if other.type != parameter.type and not {other.type, parameter.type} <= {"ratio", "count"}:
            message = f"'{value}' is of type {other.type}, but '{parameter.name}' of type {parameter.type}"
            collector.add(assignment, "value", "FS032", message, of_type(parameter.type, types))
    elif isinstance(value, m.EXPRESSIONS):
        from foresee_dsl.language.checks.expressions import check_expression, unknown_in

        if parameter.dimension is None:
            message = f"'{parameter.name}' is of type {parameter.type}, not a number"
            help = "write it like the default, " + write(value_text(parameter.default))
            collector.add(assignment, "value", "FS034", message, help)
        elif not unknown_in(value, types):
            check_expression(collector, assignment, "value", value, parameter.dimension, types)
    else:
        _check_value(collector, parameter, assignment, "value", value)


def _check_worked_out(collector: Collector, scenario: m.Scenario, case: m.Case, parameters: dict[str, m.Param]) -> None:
    """Check that calculated values in cases lie in their parameters' ranges."""
    types = {name: parameter.type for name, parameter in parameters.items()}
    computed = [
        assigned for assigned in case.values if needed_by(assigned, types) or isinstance(assigned.value, m.EXPRESSIONS)
    ]
    assigned = {assignment.name for assignment in case.values}
    following = [
        parameter
        for name, parameter in parameters.items()
        if name not in assigned
        and isinstance(parameter.default, m.Calculated)
        and any(references(parameter.default))
        and parameter.default.dimension in (parameter.type, "ratio")
    ]
    if not computed and not following:
        return
    try:
        values = case_values(scenario, case)
    except ExpressionError as error:
        item = error.item
        help: HelpText = not_by_zero(error.item, {p.name: p.default for p in parameters.values()})
        if isinstance(item, m.Assignment):
            help = "write a value: " + write(f"{item.name} = {value_text(plain(parameters[item.name].default))}")
            item = item if any(item is assignment for assignment in case.values) else case
        collector.add(item, "", "FS063", f"in case '{case.name}', {error.message}", help)
        return
    for assignment in computed:
        _check_value(collector, parameters[assignment.name], assignment, "value", values[assignment.name])
    for parameter in following:
        _check_value(collector, parameter, case, "name", values[parameter.name])


def _check_parameter(collector: Collector, parameter: m.Param) -> None:
    if parameter.name in RESERVED:
        message = "'" + subject(parameter.name) + "' is a word of the language"
        collector.add(parameter, "name", "FS049", message, rename("give the parameter another name", everywhere=True))
    limits, sound = parameter.range, True
    if limits is not None:
        ends = [(end, value) for end in ("low", "high", "step") if (value := getattr(limits, end)) is not None]
        sound = all(_check_type(collector, parameter, limits, end, value) for end, value in ends)
        if sound and limits.low.si > limits.high.si:
            help = "write " + write(f"{written(limits.high)}..{written(limits.low)}")
            collector.add(limits, "", "FS039", "this range ends before it begins", help)
            sound = False
        elif sound and limits.step is not None and limits.step.si <= 0:
            collector.add(limits, "step", "FS050", "a step must be more than zero", "use a positive step, or no step")
            sound = False
    for k, option in enumerate(parameter.options or ()):
        sound &= _check_type(collector, parameter, parameter, f"options.{k}", option)
        if any(_same_option(option, other) for other in (parameter.options or ())[:k]):
            twice = f"the option `{value_text(option)}` is listed twice"
            collector.add(parameter, f"options.{k}", "FS013", twice, remove("keep one of the two"))
    if sound:
        _check_value(collector, parameter, parameter, "default", parameter.default)


def _same_option(option: m.ParamValue, other: m.ParamValue) -> bool:
    """Return whether two options are equal in every case; those that need other parameters may differ in some."""
    if any(isinstance(value, m.Calculated) and any(references(value)) for value in (option, other)):
        return False
    return same_value(option, other)


def _check_value(collector: Collector, parameter: m.Param, item: m.Item, field: str, value: m.ParamValue) -> None:
    """Check a value that a parameter takes: its type, then its range or options."""
    if not _check_type(collector, parameter, item, field, value):
        return
    if isinstance(value, str):
        if parameter.options is not None and value not in parameter.options:
            message = f"'{value}' is not among the options of '{parameter.name}'"
            words = [option for option in parameter.options if isinstance(option, str)]
            help = did_you_mean(value, words)
            if closest(value, words) and len(words) > 1:  # one of the options may be what is misspelt
                help += f" The options are {', '.join(words)}"
            collector.add(item, field, "FS033", message, help)
        return
    if parameter.options is not None and not any(same_value(value, option) for option in parameter.options):
        message = f"`{written(value)}` is not among the options of '{parameter.name}'"
        options = one_of(written(option) for option in parameter.options if isinstance(option, m.Quantity))
        collector.add(item, field, "FS033", message, "options are " + options)
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
        help = "use a value inside it, such as " + write(near) + ", or widen the range"
        collector.add(item, field, "FS033", message, help)
    elif limits.step is not None and limits.step.si > 0:
        steps = (value.si - low) / limits.step.si
        if abs(steps - round(steps)) > _ON_STEP * max(1.0, abs(steps)):
            message = f"`{written(value)}` is not on a step of '{parameter.name}': {ends} step {written(limits.step)}"
            near = _on_step(limits, min(round(steps), math.floor((high - low) / limits.step.si + _ON_STEP)))
            help = "round it to the step, " + write(near) + ", or make the step smaller"
            collector.add(item, field, "FS033", message, help)


def _on_step(limits: m.Range, k: int) -> str:
    """Return the text, in the language, of the value on the k-th step of a range."""
    from foresee_dsl.language.arithmetic.evaluate import evaluate

    steps = m.Product(left=m.Quantity(value=Decimal(k)), op="*", right=limits.step or limits.low)
    try:
        return written(evaluate(m.Sum(left=limits.low, op="+", right=steps)))
    except ExpressionError:  # the step is of another dimension, which is reported at its place
        return written(limits.low)


def _check_type(collector: Collector, parameter: m.Param, item: m.Item, field: str, value: m.ParamValue) -> bool:
    """Report a value that does not fit the parameter's type; return whether it does."""
    if isinstance(value, m.Quantity):
        return _check_quantity(collector, parameter, item, field, value)
    type_ = parameter.type
    if parameter.dimension is not None:
        message = f"'{parameter.name}' is of type {type_}, but `{value}` is a word"
        collector.add(item, field, "FS034", message, "write " + collector.example(parameter.dimension))
    elif type_ == "side" and value not in _SIDES:
        collector.add(item, field, "FS034", f"unknown side '{value}'", did_you_mean(value, _SIDES))
    elif type_ == "turn" and value not in _TURNS:
        collector.add(item, field, "FS034", f"unknown turn '{value}'", did_you_mean(value, _TURNS))
    elif type_ == "model" and _MODEL.fullmatch(value) is None:
        help = "models are called class.variant, such as " + write("car.compact")
        collector.add(item, field, "FS034", f"`{value}` is not the name of a model", help)
    else:
        return True
    return False


def _check_quantity(collector: Collector, parameter: m.Param, item: m.Item, field: str, value: m.Quantity) -> bool:
    type_, needed = parameter.type, parameter.dimension
    if needed is None:
        help: dict[str, Help] = {
            "arm": "write the name of a road, such as " + write("south"),
            "turn": "turns are " + one_of(_TURNS),
            "junction": "write the name of a junction, such as " + write("j4"),
            "stage": "write the name of a stage, such as " + write("ns_go"),
            "side": "write " + write("left") + " or " + write("right"),
        }
        message = f"'{parameter.name}' is of type {type_}, not a number"
        a_model = "write the name of a model, such as " + write("car.compact")
        collector.add(item, field, "FS034", message, help.get(type_, a_model))
        return False
    if value.dimension != needed and not (needed == "count" and not value.unit):
        collector.wrong_dimension(item, field, value, needed, code="FS034")
        return False
    if needed == "count" and (value.value < 0 or value.value != value.value.to_integral_value()):
        message = f"`{written(value)}` is not a whole number"
        collector.add(item, field, "FS034", message, "write one such as " + write("2"))
        return False
    return True


# ---- requirements ---------------------------------------------------------------------------------------------------


def check_requirements(collector: Collector, scenario: m.Scenario) -> None:
    """Check every `require`, and that every written case satisfies it; without cases, that the defaults do."""
    parameters = {parameter.name: parameter for parameter in scenario.all(m.Param)}
    sound = []
    for require in scenario.all(m.Require):
        good = [_check_part(collector, part, parameters) for part in parts(require.condition)]
        if all(good):
            sound.append(require)
    defaults = {name: parameter.default for name, parameter in parameters.items()}
    written_cases = scenario.all(m.Case)
    for require in sound:
        for case in written_cases:
            try:
                values = case_values(scenario, case)
            except ExpressionError:
                continue  # the error in the requirement was reported already
            if holds(require.condition, values) is False:
                message = f"in case '{case.name}', {violation(require, values)}"
                collector.add(case, "name", "FS053", message, "change the value, or the requirement")
        if not written_cases and not scenario.all(m.Cases) and holds(require.condition, defaults) is False:
            message = f"with the defaults, {violation(require, defaults)}"
            collector.add(require, "", "FS053", message, "change a default, or the requirement")


def _check_part(collector: Collector, part: m.Condition, parameters: dict[str, m.Param]) -> bool:
    """Check one part of a requirement; return whether it can be evaluated."""
    if isinstance(part, m.Not | m.Both | m.Either):
        return True
    if isinstance(part, m.Equals):
        return _check_equals(collector, part, parameters)
    if isinstance(part, m.Comparison) and isinstance(part.left, m.Ref) and not isinstance(part.right, m.EXPRESSIONS):
        return _check_compared(collector, part, part.left, part.right, parameters)
    if isinstance(part, m.Comparison) and not isinstance(part.left, m.Measure):
        from foresee_dsl.language.checks.expressions import compare_sides, unknown_in

        types = {name: parameter.type for name, parameter in parameters.items()}
        unknown = unknown_in(part.left, types) or unknown_in(part.right, types)  # `check_values` reports them
        return not unknown and compare_sides(collector, part, types)
    others = "; for what happens during the run use " + write("when") + " or " + write("expect")
    help = "compare parameters only: " + write("require gap < 2 s") + others
    collector.add(part, "", "FS052", f"`{written(part)}` is not known before the run", help)
    return False


def _check_equals(collector: Collector, part: m.Equals, parameters: dict[str, m.Param]) -> bool:
    parameter = parameters.get(part.left.name)
    if parameter is None:
        return False  # `check_values` reports it
    if parameter.dimension is not None:
        help = "compare it with a value: " + write(f"{parameter.name} <= {value_text(parameter.default)}")
        message = f"'{parameter.name}' is {NOUNS[parameter.dimension]}, not a word"
        collector.add(part, "left", "FS032", message, help)
        return False
    if parameter.options is not None and part.right not in parameter.options:
        message = f"'{part.right}' is not among the options of '{parameter.name}'"
        words = [option for option in parameter.options if isinstance(option, str)]
        collector.add(part, "right", "FS033", message, did_you_mean(part.right, words))
        return False
    return True


def _check_compared(
    collector: Collector, part: m.Comparison, left: m.Ref, right: m.Quantity | m.Ref, parameters: dict[str, m.Param]
) -> bool:
    sides = [(field, side.name) for field, side in (("left", left), ("right", right)) if isinstance(side, m.Ref)]
    for _, name in sides:
        if name in parameters and parameters[name].dimension is None:
            help = "write " + write(f"{name} is {value_text(parameters[name].default)}")
            message = f"'{name}' is a word, which cannot be less or more than another"
            collector.add(part, "", "FS032", message, help)
            return False
    if any(name not in parameters for _, name in sides):
        return False  # `check_values` reports it
    needed, *others = [d for _, name in sides if (d := parameters[name].dimension) is not None]
    if isinstance(right, m.Quantity):
        if right.dimension != needed and not (needed == "count" and not right.unit):
            collector.wrong_dimension(part, "right", right, needed)
            return False
    elif others != [needed]:
        message = f"'{left.name}' is {NOUNS[needed]}, but '{right.name}' is {NOUNS[others[0]]}"
        collector.add(part, "right", "FS032", message, "compare parameters of one type")
        return False
    return True
