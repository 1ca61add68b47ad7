"""From a logical scenario to a concrete one: parameters become the values of one case."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar, cast

from pydantic import ValidationError

from foresee_dsl.language import model as m
from foresee_dsl.language.codes import names as c
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.document import Document
from foresee_dsl.language.sampling.draws import case_names, draw
from foresee_dsl.language.units import UNITS

_ItemT = TypeVar("_ItemT", bound=m.Item)
SETTLED = (m.Param, m.Require, m.Case, m.Cases)
"""What a concrete scenario has no longer."""


def cases(document: Document) -> tuple[str, ...]:
    """Return the names of a scenario's cases, in the author's order.

    The written ones, and those that `cases ... from seed` draws. Empty for a scenario without cases (it is one test
    case itself) and for every other kind of file.
    """
    model = document.model
    names: list[str] = []
    for item in model.body if isinstance(model, m.Scenario) else ():
        if isinstance(item, m.Case):
            names.append(item.name)
        elif isinstance(item, m.Cases):
            names += case_names(item)
    return tuple(names)


def concretise(scenario: m.Scenario, case: str | None, *, document: Document | None = None) -> m.Scenario:
    """Replace every reference by the case's value, or else by the parameter's default.

    Args:
        scenario: as written. Items without references come back as the same objects.
        case: the case's name; None takes the defaults.
        document: gives the errors their places.

    Returns:
        The scenario without `SETTLED` statements: parameters, requirements and cases.

    Raises:
        InputError: no such case, a case or a reference that names no parameter, or a value that does not fit where
            its parameter is used.
    """
    findings = Findings(document)
    values = _values(scenario, case, findings)
    body = tuple(_substituted(item, values, findings) for item in scenario.body if not isinstance(item, SETTLED))
    findings.raise_if_any()
    return m.Scenario(name=scenario.name, body=body)


def value_text(value: m.ParamValue) -> str:
    """Return a value as it is written in a file."""
    if isinstance(value, str):
        return value
    return f"{value.value:f} {value.unit}".rstrip()


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


def _values(scenario: m.Scenario, case: str | None, findings: Findings) -> dict[str, m.ParamValue]:
    values = {param.name: param.default for param in scenario.all(m.Param)}
    if case is None:
        return values
    known = {found.name: found for found in scenario.all(m.Case)}
    drawn = next((item for item in scenario.all(m.Cases) if case in case_names(item)), None)
    if drawn is not None:
        known |= {found.name: found for found in draw(scenario, drawn)}
    if case not in known:
        message = f"no case '{case}' in scenario '{scenario.name}'"
        findings.add(
            None, "", c.UNKNOWN_CASE, message, did_you_mean(case, known) or "it has no cases: leave out `::case`"
        )
        findings.raise_if_any()
    for assignment in known[case].values:
        _assign(assignment, scenario, values, findings)
    return values


def _assign(
    assignment: m.Assignment, scenario: m.Scenario, values: dict[str, m.ParamValue], findings: Findings
) -> None:
    param = next((p for p in scenario.all(m.Param) if p.name == assignment.name), None)
    if param is None:
        message = f"no parameter '{assignment.name}' in scenario '{scenario.name}'"
        findings.add(assignment, "name", c.UNKNOWN_PARAMETER, message, did_you_mean(assignment.name, values))
        return
    values[assignment.name] = assignment.value
    if not same_kind(assignment.value, param.default):
        message = f"parameter '{param.name}' is {param.type}, but {value_text(assignment.value)} is not"
        findings.add(assignment, "value", c.MISFIT, message, f"write it like the default, {value_text(param.default)}")


def same_kind(one: m.ParamValue, other: m.ParamValue) -> bool:
    """Return whether both are words, or quantities of one dimension."""
    if isinstance(one, m.Quantity) and isinstance(other, m.Quantity):
        return one.dimension == other.dimension
    return isinstance(one, str) and isinstance(other, str)


def _substituted(item: _ItemT, values: Mapping[str, m.ParamValue], findings: Findings) -> _ItemT:
    def replace(owner: m.Item, name: str, ref: m.Ref) -> m.ParamValue | m.Ref:
        if ref.name in values:
            return values[ref.name]
        message = f"'{ref.name}' is no parameter of this scenario"
        findings.add(owner, name, c.UNKNOWN_PARAMETER, message, did_you_mean(ref.name, values) or units_hint())
        return ref

    def refused(owner: m.Item, name: str, ref: m.Ref, error: ValidationError) -> None:
        shown = value_text(values[ref.name]) if ref.name in values else ref.name
        findings.add(owner, name, c.MISFIT, f"parameter '{ref.name}' ({shown}) does not fit here: {complaint(error)}")

    return cast(_ItemT, _walk(item, replace, refused))


def units_hint() -> str:
    """Return what may stand where a value is expected and no parameter exists."""
    return f"write a number with a unit ({', '.join(list(UNITS)[:6])}, ...), or declare it with `param`"


_Replace = Callable[[m.Item, str, m.Ref], "m.ParamValue | m.Ref"]
_Refused = Callable[[m.Item, str, m.Ref, ValidationError], None]


def _walk(item: m.Item, replace: _Replace, refused: _Refused) -> m.Item:
    """Rebuild an item with its references replaced; the very same object where there are none."""
    changed: dict[str, object] = {}
    refs: dict[str, m.Ref] = {}
    for name in type(item).model_fields:
        before = getattr(item, name)
        after: object = before
        if isinstance(before, m.Ref):
            after, refs[name] = replace(item, name, before), before
        elif isinstance(before, m.Item):
            after = _walk(before, replace, refused)
        elif isinstance(before, tuple):
            refs.update((name, part) for part in before if isinstance(part, m.Ref))
            parts = tuple(_part(item, name, part, replace, refused) for part in before)
            after = parts if any(a is not b for a, b in zip(parts, before, strict=True)) else before
        if after is not before:
            changed[name] = after
    if not changed:
        return item
    fields = {name: getattr(item, name) for name in type(item).model_fields}
    try:
        return type(item).model_validate(fields | changed)
    except ValidationError as error:
        place = next((str(part) for part in error.errors()[0]["loc"] if str(part) in refs), next(iter(refs), ""))
        if place:
            refused(item, place, refs[place], error)
        return item


def _part(owner: m.Item, name: str, part: object, replace: _Replace, refused: _Refused) -> object:
    if isinstance(part, m.Ref):
        return replace(owner, name, part)
    return _walk(part, replace, refused) if isinstance(part, m.Item) else part
