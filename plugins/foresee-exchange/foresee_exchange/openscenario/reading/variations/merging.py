"""Merging of scenarios that differ only in their values into one with parameters and cases."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from pydantic import BaseModel

from foresee_dsl.language import model as m
from foresee_exchange.naming import distinct_name, sentence
from foresee_exchange.openscenario.reading.variations.distributions import Drawn, Values

Slot = tuple[str | int, ...]
"""Place of a quantity in a model: field names and tuple indices, from the outside in."""
_EXACT = 2e-4
"""Tolerance, in a value's own unit, for a value computed from parameters (ours: written values are rounded to 1e-4)."""
_DIGITS = 8
"""Decimals of a factor: for parameters up to 1,000 the value is accurate to 1e-5 (ours)."""
_WORDS = ("straight", "left", "right", "back", "green", "amber", "red")
"""Words that the language does not allow as names of parameters."""


@dataclass(frozen=True)
class Part:
    """One of several similar scenarios: the parameter values with which it was read, and its comments."""

    values: Values
    scenario: m.Scenario
    remarks: Mapping[int, Sequence[str]]


def quantities(node: object, at: Slot = ()) -> Iterator[tuple[Slot, m.Quantity]]:
    """Yield the quantities of a model, each with its place."""
    if isinstance(node, m.Quantity):
        yield at, node
    elif isinstance(node, BaseModel):
        for name in type(node).model_fields:
            yield from quantities(getattr(node, name), (*at, name))
    elif isinstance(node, tuple):
        for k, item in enumerate(node):
            yield from quantities(item, (*at, k))


def replaced(node: Any, values: Mapping[Slot, object], at: Slot = ()) -> Any:  # noqa: ANN401 - any node of a model
    """Return a model with other values at some places."""
    if at in values:
        return values[at]
    if isinstance(node, m.Quantity):
        return node
    if isinstance(node, BaseModel):
        fields = {name: getattr(node, name) for name in type(node).model_fields}
        new = {name: replaced(value, values, (*at, name)) for name, value in fields.items()}
        return node.model_copy(update={name: value for name, value in new.items() if value is not fields[name]})
    if isinstance(node, tuple):
        items = tuple(replaced(item, values, (*at, k)) for k, item in enumerate(node))
        return node if all(a is b for a, b in zip(items, node, strict=True)) else items
    return node


def shape_of(scenario: m.Scenario) -> str:
    """Return a key that is equal for scenarios that differ only in their values."""
    zero = {at: m.Quantity(value=Decimal(0), unit=q.unit) for at, q in quantities(scenario)}
    return repr(replaced(scenario, zero))


def merged(parts: Sequence[Part], doc: str, drawn: Mapping[str, Drawn], runs: int, seed: int) -> Part:
    """Return scenarios of one shape as one with parameters.

    If the values follow from the file's parameters by sums and factors, the result has those parameters. Its cases are
    then drawn as in the file (`runs` cases from `seed`, with the distributions `drawn`), or are all combinations of
    values, if `parts` are. Otherwise each part becomes a written case.
    """
    scenario = parts[0].scenario
    table = [dict(quantities(part.scenario)) for part in parts]
    differ = [at for at in table[0] if len({row[at] for row in table}) > 1]
    if doc:
        scenario = scenario.model_copy(update={"body": (m.Doc(text=sentence(doc)), *scenario.body[1:])})
    if not differ or len(parts) == 1:
        return Part({}, scenario, parts[0].remarks)
    taken = {actor.name for actor in scenario.actors} | set(_WORDS)
    calculated = _calculated(parts, table, differ, drawn, taken)
    if calculated is not None and (drawn or _is_grid(parts)):
        params, values = calculated
        count = runs if drawn else len(parts)
        last: list[m.ScenarioItem] = [m.Cases(count=_plain(count), seed=_plain(seed))]
        return _with(scenario, parts[0].remarks, params, values, last, [])
    params, values, names = _written(scenario, table, differ, taken)
    cases: list[m.ScenarioItem] = []
    notes: list[str] = []
    for k, (part, row) in enumerate(zip(parts, table, strict=True)):
        assignments = tuple(m.Assignment(name=name, value=row[at]) for at, name in names.items())
        cases.append(m.Case(name=f"set_{k + 1:03d}", values=assignments))
        notes.append(sentence(", ".join(f"{name} = {value}" for name, value in part.values.items())))
    return _with(scenario, parts[0].remarks, params, values, cases, notes)


def _with(
    scenario: m.Scenario,
    remarks: Mapping[int, Sequence[str]],
    params: Sequence[m.ScenarioItem],
    values: Mapping[Slot, object],
    last: Sequence[m.ScenarioItem],
    notes: Sequence[str],
) -> Part:
    """Return a scenario with parameters after its `use` statements, values in their places, and cases at its end."""
    new = replaced(scenario, values)
    at = 1 + max(k for k, item in enumerate(new.body) if isinstance(item, m.UseNetwork | m.UseModels))
    body = (*new.body[:at], *params, *new.body[at:], *last)
    moved = {k + len(params) * (k >= at): list(text) for k, text in remarks.items()}
    moved |= {len(body) - len(last) + k: [note] for k, note in enumerate(notes) if note}
    return Part({}, new.model_copy(update={"body": body}), moved)


def _written(
    scenario: m.Scenario, table: Sequence[Mapping[Slot, m.Quantity]], differ: Sequence[Slot], taken: set[str]
) -> tuple[list[m.ScenarioItem], dict[Slot, object], dict[Slot, str]]:
    """Return a parameter for each value that differs (one parameter for several values that are always equal), the
    references that replace the values, and the name of each parameter by the first place of its value."""
    params: list[m.ScenarioItem] = []
    values: dict[Slot, object] = {}
    names: dict[Slot, str] = {}
    name_of_column: dict[tuple[m.Quantity, ...], str] = {}
    for at in differ:
        column = tuple(row[at] for row in table)
        if column not in name_of_column:
            name = distinct_name(_called(scenario, at), "value", taken)
            taken.add(name)
            name_of_column[column], names[at] = name, name
            params.append(m.Param.model_validate({"name": name, "type": column[0].dimension, "default": column[0]}))
        values[at] = m.Ref(name=name_of_column[column])
    return params, values, names


def _called(scenario: m.Scenario, at: Slot) -> str:
    """Return a name for a value: its actor (or the kind of its statement) and its field."""
    item = scenario.body[int(at[1])] if len(at) > 1 else scenario
    whose = getattr(item, "name", None) or getattr(item, "kind", "")
    nodes: list[object] = [scenario]
    for step in at:
        nodes.append(nodes[-1][step] if isinstance(step, int) else getattr(nodes[-1], step))  # type: ignore[index]
    actor = next((a for n in reversed(nodes[2:]) if isinstance(a := getattr(n, "actor", None), str)), None)
    field = next(step for step in reversed(at) if isinstance(step, str))
    return f"{actor or whose}_{field}" if actor else f"{whose}_{field}"


def _is_grid(parts: Sequence[Part]) -> bool:
    """Return whether the parts are all combinations of their parameters' values."""
    names = dict.fromkeys(itertools.chain.from_iterable(part.values for part in parts))
    options = [{part.values.get(name) for part in parts} for name in names]
    return int(np.prod([len(values) for values in options])) == len(parts)


def _calculated(
    parts: Sequence[Part],
    table: Sequence[Mapping[Slot, m.Quantity]],
    differ: Sequence[Slot],
    drawn: Mapping[str, Drawn],
    taken: set[str],
) -> tuple[list[m.ScenarioItem], dict[Slot, object]] | None:
    """Return the file's parameters, and the values as weighted sums of them; None if they are not such sums."""
    all_names = dict.fromkeys(itertools.chain.from_iterable(part.values for part in parts))
    names = [name for name in all_names if len({part.values.get(name) for part in parts}) > 1]
    try:
        numbers = np.array([[float(part.values[name]) for name in names] for part in parts])
    except (KeyError, ValueError):
        return None
    if len(parts) < len(names) + 1:
        return None
    design = np.column_stack((np.ones(len(parts)), numbers))
    called: dict[str, str] = {}
    for name in names:
        called[name] = distinct_name(name, "value", {*taken, *called.values()})
    values: dict[Slot, object] = {}
    for at in differ:
        column = np.array([float(row[at].value) for row in table])
        factors = np.linalg.lstsq(design, column, rcond=None)[0]
        factors = np.where(np.abs(factors * np.abs(design).max(axis=0)) < _EXACT / 4, 0.0, factors)
        if np.abs(design @ factors - column).max() > _EXACT:
            return None
        values[at] = _sum(factors, [called[name] for name in names], table[0][at].unit)
    params: list[m.ScenarioItem] = []
    for k, name in enumerate(names):
        param = _param(called[name], [part.values[name] for part in parts], numbers[:, k], drawn.get(name))
        if param is None:
            return None
        params.append(param)
    return params, values


def _sum(factors: np.ndarray[Any, Any], names: Sequence[str], unit: str) -> object:
    """Return `base + name * factor + ...` without zero terms."""
    total: m.Quantity | m.Sum | m.Product | None = None
    for factor, name in zip(factors, [None, *names], strict=True):
        if not factor:
            continue
        value = m.Quantity(value=_decimal(abs(factor) if total is not None else factor), unit=unit)
        term = value if name is None else m.Product(left=m.Ref(name=name), op="*", right=value)
        total = term if total is None else m.Sum(left=total, op="+" if factor > 0 else "-", right=term)
    return total if total is not None else m.Quantity(value=Decimal(0), unit=unit)


def _param(name: str, written: Sequence[str], numbers: np.ndarray[Any, Any], drawn: Drawn | None) -> m.Param | None:
    """Return a parameter with its distribution; None if the language does not have that distribution."""
    options = dict(sorted(zip(map(float, written), written, strict=True)))
    if drawn is None:
        gaps = np.diff(list(options))
        if len(gaps) > 1 and np.ptp(gaps) < 1e-9:
            low, high = min(options), max(options)
            steps = m.Range(low=_plain(low), high=_plain(high), step=_plain(float(gaps[0])))
            return m.Param(name=name, type="ratio", default=_plain(numbers[0]), range=steps, distribution=m.Grid())
        listed = tuple(_plain(value) for value in options)
        return m.Param(name=name, type="ratio", default=_plain(numbers[0]), options=listed, distribution=m.Grid())
    if drawn.kind == "choice":
        listed = tuple(_plain(float(value)) for value in drawn.options)
        weights = m.Choice(weights=tuple(_plain(weight) for weight in drawn.weights))
        return m.Param(name=name, type="ratio", default=listed[0], options=listed, distribution=weights)
    if drawn.kind not in ("uniform", "normal"):
        return None
    how = (
        m.Uniform() if drawn.kind == "uniform" else m.Normal(mean=_plain(drawn.mean), deviation=_plain(drawn.deviation))
    )
    middle = min(max(drawn.mean, drawn.low), drawn.high) if drawn.kind == "normal" else (drawn.low + drawn.high) / 2
    ends = m.Range(low=_plain(drawn.low), high=_plain(drawn.high))
    return m.Param(name=name, type="ratio", default=_plain(middle), range=ends, distribution=how)


def _plain(value: float) -> m.Quantity:
    return m.Quantity(value=_decimal(value), unit="")


def _decimal(value: float) -> Decimal:
    decimal = round(Decimal(repr(float(value))), _DIGITS).normalize()
    return decimal.quantize(Decimal(1)) if int(decimal.as_tuple().exponent) > 0 else decimal
