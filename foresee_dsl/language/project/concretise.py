"""Turns a logical scenario into a concrete one: parameters become the values of one case."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar, cast

from pydantic import ValidationError

from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic import ExpressionError
from foresee_dsl.language.arithmetic.cases import case_values, references
from foresee_dsl.language.document import Document
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import value_text
from foresee_dsl.language.sampling import case_names, draw
from foresee_dsl.language.traversal import PLAIN, changed_fields
from foresee_dsl.language.units import UNITS

_ItemT = TypeVar("_ItemT", bound=m.Item)
SETTLED = (m.Param, m.Require, m.Case, m.Cases)
"""Statements that a concrete scenario does not have: parameters, requirements and cases."""


def cases(document: Document) -> tuple[str, ...]:
    """Return the names of a scenario's cases, in the author's order.

    These are the written ones and those that `cases ... from seed` draws. Empty for a scenario without cases (which is
    one test case itself) and for every other kind of file.
    """
    model = document.model
    body = model.body if isinstance(model, m.Scenario) else ()
    listed = [item for item in body if isinstance(item, m.Case | m.Cases)]
    return tuple(name for item in listed for name in ([item.name] if isinstance(item, m.Case) else case_names(item)))


def concretise(scenario: m.Scenario, case: str | None, *, document: Document | None = None) -> m.Scenario:
    """Return a scenario in which the value of a case replaces every reference; a parameter that the case does not set
    has its default.

    Without a case (None), all parameters have their defaults. The result has no `SETTLED` statements: parameters,
    requirements and cases. Items without references come back as the same objects. `document` gives the errors their
    places.
    """
    collector = Collector(document)
    values = _values(scenario, case, collector)
    body = tuple(_substituted(item, values, case, collector) for item in scenario.body if not isinstance(item, SETTLED))
    collector.raise_if_any()
    return m.Scenario(name=scenario.name, body=body)


def complaint(error: ValidationError) -> str:
    """Return a validation error's first message in the words of this language."""
    first = error.errors()[0]
    if first["type"] == "value_error":
        return str(first["msg"]).removeprefix("Value error, ")
    if first["type"] == "literal_error":
        return f"needs {first.get('ctx', {}).get('expected', 'another word')}"
    if first["type"] == "string_pattern_mismatch":
        return "needs a name of another form (a model is written `class.variant`)"
    return "needs a value of another kind"


def _values(scenario: m.Scenario, case: str | None, collector: Collector) -> dict[str, m.ParamValue]:
    if case is None:
        return case_values(scenario, None)
    by_name = {written_case.name: written_case for written_case in scenario.all(m.Case)}
    drawn = next((item for item in scenario.all(m.Cases) if case in case_names(item)), None)
    if drawn is not None:
        by_name |= {written_case.name: written_case for written_case in draw(scenario, drawn)}
    if case not in by_name:
        message = f"scenario '{scenario.name}' has no case '{case}'"
        help = did_you_mean(case, by_name) or "it has no cases: leave out " + write("::case")
        collector.add(None, "", "FS100", message, help)
        collector.raise_if_any()
    try:
        values = case_values(scenario, by_name[case])
    except ExpressionError as error:
        collector.add(error.item, "", "FS063", f"in case '{case}', {error.message}", "write another value")
        collector.raise_if_any()
        raise
    params = {param.name: param for param in scenario.all(m.Param)}
    for assignment in by_name[case].values:
        param = params.get(assignment.name)
        if param is None:
            message = f"scenario '{scenario.name}' has no parameter '{assignment.name}'"
            collector.add(assignment, "name", "FS031", message, did_you_mean(assignment.name, values))
            continue
        if not same_kind(values[assignment.name], param.default):
            message = f"parameter '{param.name}' is of type {param.type}, but {value_text(assignment.value)} is not"
            help = f"write it like the default, {value_text(param.default)}"
            collector.add(assignment, "value", "FS032", message, help)
    return values


def same_kind(first: m.ParamValue, second: m.ParamValue) -> bool:
    """Return whether both are words, or quantities of one dimension."""
    if isinstance(first, m.Quantity) and isinstance(second, m.Quantity):
        return first.dimension == second.dimension
    return isinstance(first, str) and isinstance(second, str)


def settled_network(network: m.Network) -> m.Network:
    """Return a network with its calculations replaced by their values; the same object if it has none."""
    collector = Collector(None)
    settled = _substituted(network, {}, None, collector)
    collector.raise_if_any()
    return settled


def _substituted(item: _ItemT, values: Mapping[str, m.ParamValue], case: str | None, collector: Collector) -> _ItemT:
    def replace(owner: m.Item, name: str, part: m.Ref | m.Expression) -> m.ParamValue | m.Ref | m.Expression:
        for ref in references(part):
            if ref.name not in values:
                unknown(owner, name, ref)
                return part
        if isinstance(part, m.Ref):
            return values[part.name]
        from foresee_dsl.language.arithmetic.evaluate import evaluate

        try:
            return evaluate(part, values)
        except ExpressionError as error:
            where = f"in case '{case}', " if case is not None else ""
            collector.add(
                error.item, "", "FS063", f"{where}{error.message}", "exclude such values with a " + write("require")
            )
            return part

    def unknown(owner: m.Item, name: str, ref: m.Ref) -> None:
        message = f"'{ref.name}' is not a parameter of this scenario"
        units = f"write a number with a unit ({', '.join(list(UNITS)[:6])}, ...), or declare it with " + write("param")
        collector.add(owner, name, "FS031", message, did_you_mean(ref.name, values) or units)

    def refused(owner: m.Item, name: str, part: m.Ref | m.Expression, error: ValidationError) -> None:
        what = f"parameter '{part.name}'" if isinstance(part, m.Ref) else f"`{value_text(part)}`"
        text = value_text(replace(owner, name, part))
        collector.add(owner, name, "FS032", f"{what} ({text}) does not fit here: {complaint(error)}")

    return cast(_ItemT, _walk(item, replace, refused))


_Replace = Callable[[m.Item, str, "m.Ref | m.Expression"], "m.ParamValue | m.Ref | m.Expression"]
_Refused = Callable[[m.Item, str, "m.Ref | m.Expression", ValidationError], None]


_WORKED_OUT = (m.Ref, *m.EXPRESSIONS)


def _walk(item: m.Item, replace: _Replace, refused: _Refused) -> m.Item:
    """Return an item with its references replaced; the same object if it has none."""
    refs: dict[str, m.Ref | m.Expression] = {}

    def replaced(name: str, part: object) -> object:
        if type(part) in PLAIN:
            return part
        if isinstance(part, _WORKED_OUT):
            refs[name] = part
            return replace(item, name, part)
        return _walk(part, replace, refused) if isinstance(part, m.Item) else part

    changed = changed_fields(item, replaced)
    if not changed:
        return item
    try:
        return type(item).model_validate(vars(item) | changed)
    except ValidationError as error:
        place = next((str(part) for part in error.errors()[0]["loc"] if str(part) in refs), next(iter(refs), ""))
        if place:
            refused(item, place, refs[place], error)
        return item
