"""Checks of `require` statements: whether they can be evaluated, and whether the written cases satisfy them."""

from __future__ import annotations

from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import case_values
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.sampling import holds, violation
from foresee_dsl.language.traversal import parts
from foresee_dsl.language.units import NOUNS


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
    if any(name not in parameters for _, name in sides):
        return False
    for field, name in sides:
        if parameters[name].dimension is None:
            help = "write " + write(f"{name} is {value_text(parameters[name].default)}")
            message = f"'{name}' is a word, which cannot be less or more than another"
            collector.add(part, field, "FS032", message, help)
            return False
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
