"""Computes the parameters' values in a test case, including those that are calculated from other parameters. Most
scenarios need only this module of the package."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.traversal import walk
from foresee_dsl.language.units import dimension_of


def references(value: m.Item) -> Iterator[m.Ref]:
    """Return the parameters that a value names, in the order in which they are written."""
    return (part for part in walk(value) if isinstance(part, m.Ref))


def case_values(scenario: m.Scenario, case: m.Case | None) -> dict[str, m.ParamValue]:
    """Return the value of every parameter in a case, in the order of the file; without a case (None), the defaults.

    Raises:
        ExpressionError: a calculated value has no result; its `item` is the assignment at fault, or a part of it.
    """
    params = scenario.all(m.Param)
    defaults = {param.name: plain(param.default) for param in params}
    if case is None:
        return defaults
    types = {param.name: param.type for param in params}
    assignments = {assignment.name: assignment for assignment in case.values}
    for param in params:
        if param.name not in assignments and isinstance(param.default, m.Calculated) and any(references(param.default)):
            default = param.default.expression
            value = default.name if isinstance(default, m.Ref) else default
            assignments[param.name] = m.Assignment(name=param.name, value=value)
    results: dict[str, m.ParamValue] = {}

    def value_of(name: str, asking: tuple[str, ...]) -> m.ParamValue:
        if name in results or name not in assignments:
            return results.get(name, defaults[name])
        assignment = assignments[name]
        needed = needed_by(assignment, types)
        for other in needed:
            if other.name in (*asking, name):
                chain = " -> ".join((*asking, name, other.name)[(*asking, name).index(other.name) :])
                raise ExpressionError(assignment, f"'{other.name}' depends on itself: {chain}")
        inner = {ref.name: value_of(ref.name, (*asking, name)) for ref in needed if ref.name in defaults}
        value = assignment.value
        if isinstance(value, m.EXPRESSIONS):
            from foresee_dsl.language.arithmetic.evaluate import evaluate

            value = evaluate(value, inner)
        elif isinstance(value, str) and needed:
            value = inner[value]
        results[name] = value
        return value

    return {name: value_of(name, ()) for name in defaults} | {
        name: assignment.value
        for name, assignment in assignments.items()
        if name not in defaults and not isinstance(assignment.value, m.EXPRESSIONS)
    }


def plain(value: m.ParamValue) -> m.ParamValue:
    """Return a parameter's value without its expression."""
    return value.plain if isinstance(value, m.Calculated) else value


def needed_by(assignment: m.Assignment, types: Mapping[str, m.ParamType]) -> tuple[m.Ref, ...]:
    """Return the parameters that an assignment's value depends on; `types` holds the type of every parameter.

    A bare word in the place of a number is a parameter if a parameter has this name (`gap = other_gap`).
    """
    value = assignment.value
    if isinstance(value, str):
        number = dimension_of(types.get(assignment.name)) is not None
        return (m.Ref(name=value),) if number and value in types else ()
    return tuple(references(value))
