"""Parameters, their ranges, the cases that fix them, and the places that use them."""

from __future__ import annotations

import re
from typing import get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.checks.drawing import WORD_TYPES, check_drawing, check_requirements, dimension_of
from foresee_dsl.language.meaning import same_value
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import written
from foresee_dsl.language.syntax.nodes import RESERVED

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
    check_drawing(findings, scenario)
    by_name = {parameter.name: parameter for parameter in parameters}
    for case in scenario.all(m.Case):
        findings.unique(((a, "name", a.name) for a in case.values), f"values in case '{case.name}'")
        for assignment in case.values:
            known = by_name.get(assignment.name)
            if known is None:
                help = did_you_mean(assignment.name, by_name)
                findings.add(assignment, "name", "FS031", f"unknown parameter '{assignment.name}'", help)
            else:
                _check_value(findings, known, assignment, "value", assignment.value)
    check_requirements(findings, scenario)


def _check_parameter(findings: Findings, parameter: m.Param) -> None:
    if parameter.name in RESERVED:
        message = f"'{parameter.name}' is a word of the language"
        findings.add(parameter, "name", "FS049", message, "give the parameter another name")
    limits, sound = parameter.range, True
    if limits is not None:
        sound = all(_fits_type(findings, parameter, limits, end) for end in ("low", "high", "step"))
        if sound and limits.low.si > limits.high.si:
            findings.add(limits, "", "FS039", "this range ends before it begins", _turned_round(limits))
            sound = False
        elif sound and limits.step is not None and limits.step.si <= 0:
            findings.add(limits, "step", "FS050", "a step is more than zero", "use a positive step, or none")
            sound = False
    for k, option in enumerate(parameter.options or ()):
        sound &= _check_type(findings, parameter, parameter, f"options.{k}", option)
    if sound:
        _check_value(findings, parameter, parameter, "default", parameter.default)


def _turned_round(limits: m.Range) -> str:
    return f"write `{written(limits.high)}..{written(limits.low)}`"


def _fits_type(findings: Findings, parameter: m.Param, limits: m.Range, end: str) -> bool:
    value: m.Quantity | None = getattr(limits, end)
    return value is None or _check_type(findings, parameter, limits, end, value)


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
    if limits is None:
        return
    low, high = limits.low.si, limits.high.si
    slack = _ON_STEP * max(abs(low), abs(high), 1.0)
    ends = f"{written(limits.low)}..{written(limits.high)}"
    if low > high:
        return
    if not low - slack <= value.si <= high + slack:
        message = f"`{written(value)}` is outside the range of '{parameter.name}', {ends}"
        findings.add(item, field, "FS033", message, "use a value inside it, or widen the range")
    elif limits.step is not None and limits.step.si > 0:
        steps = (value.si - low) / limits.step.si
        if abs(steps - round(steps)) > _ON_STEP * max(1.0, abs(steps)):
            message = f"`{written(value)}` is not on a step of '{parameter.name}': {ends} step {written(limits.step)}"
            findings.add(item, field, "FS033", message, "round it to the step, or make the step smaller")


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
            "arm": "write the name of a road",
            "turn": f"turns are {', '.join(_TURNS)}",
            "junction": "write the name of a junction",
            "stage": "write the name of a stage",
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
