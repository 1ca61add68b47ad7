"""Scenarios that differ only in their values become one with parameters and cases."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from pydantic import BaseModel

from foresee_dsl.exchange.naming import distinct_name, sentence
from foresee_dsl.exchange.openscenario.reading.variations.distributions import Drawn, Values
from foresee_dsl.language import model as m

Slot = tuple[str | int, ...]
"""Where a quantity stands in a model: fields and places in tuples, from the outside."""
_EXACT = 2e-4
"""A value that parameters give so exactly, in its own unit, is theirs (ours: what is written is rounded to 1e-4)."""
_DIGITS = 8
"""Decimals of a factor: with parameters up to 1,000 the value is right to 1e-5 (ours)."""
_WORDS = ("straight", "left", "right", "back", "green", "amber", "red")
"""Names that the language does not allow for parameters."""


@dataclass(frozen=True)
class Part:
    """One scenario of several alike: the values of the file's parameters that it was made with, and its comments."""

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
    """Return what scenarios have in common that differ only in their values."""
    zero = {at: m.Quantity(value=Decimal(0), unit=q.unit) for at, q in quantities(scenario)}
    return repr(replaced(scenario, zero))


def merged(parts: Sequence[Part], doc: str, drawn: Mapping[str, Drawn], runs: int, seed: int) -> Part:
    """Return scenarios of one shape as one with parameters.

    Where its values follow from the parameters of the file by sums and factors, it has those parameters, and its cases
    are drawn as the file says (`drawn`; `runs` of them from `seed`), or are every combination, where that is what
    `parts` are. Else each part is a written case.
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
        given = tuple(m.Assignment(name=name, value=row[at]) for at, name in names.items())
        cases.append(m.Case(name=f"set_{k + 1:03d}", values=given))
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
    """Return a scenario with parameters after what it uses, values in their places, and cases at its end."""
    new = replaced(scenario, values)
    at = 1 + max(k for k, item in enumerate(new.body) if isinstance(item, m.UseNetwork | m.UseModels))
    body = (*new.body[:at], *params, *new.body[at:], *last)
    moved = {k + len(params) * (k >= at): list(text) for k, text in remarks.items()}
    moved |= {len(body) - len(last) + k: [note] for k, note in enumerate(notes) if note}
    return Part({}, new.model_copy(update={"body": body}), moved)


def _written(
    scenario: m.Scenario, table: Sequence[Mapping[Slot, m.Quantity]], differ: Sequence[Slot], taken: set[str]
) -> tuple[list[m.ScenarioItem], dict[Slot, object], dict[Slot, str]]:
    """Return a parameter for each value that differs (one for several that are always equal), what stands for them, and
    the first place of each."""
    params: list[m.ScenarioItem] = []
    values: dict[Slot, object] = {}
    names: dict[Slot, str] = {}
    known: dict[tuple[m.Quantity, ...], str] = {}
    for at in differ:
        column = tuple(row[at] for row in table)
        if column not in known:
            name = distinct_name(_called(scenario, at), "value", taken)
            taken.add(name)
            known[column], names[at] = name, name
            params.append(m.Param.model_validate({"name": name, "type": column[0].dimension, "default": column[0]}))
        values[at] = m.Ref(name=known[column])
    return params, values, names


def _called(scenario: m.Scenario, at: Slot) -> str:
    """Return a name for a value: that of its actor, or `when`, and of the field that it stands in."""
    item = scenario.body[int(at[1])] if len(at) > 1 else scenario
    whose = getattr(item, "name", None) or getattr(item, "kind", "")
    nodes: list[object] = [scenario]
    for step in at:
        nodes.append(nodes[-1][step] if isinstance(step, int) else getattr(nodes[-1], step))  # type: ignore[index]
    actor = next((a for n in reversed(nodes[2:]) if isinstance(a := getattr(n, "actor", None), str)), None)
    field = next(step for step in reversed(at) if isinstance(step, str))
    return f"{actor or whose}_{field}" if actor else f"{whose}_{field}"


def _is_grid(parts: Sequence[Part]) -> bool:
    """Whether the parts are every combination of the values that their parameters have."""
    names = dict.fromkeys(itertools.chain.from_iterable(part.values for part in parts))
    options = [{part.values.get(name) for part in parts} for name in names]
    return int(np.prod([len(found) for found in options])) == len(parts)


def _calculated(
    parts: Sequence[Part],
    table: Sequence[Mapping[Slot, m.Quantity]],
    differ: Sequence[Slot],
    drawn: Mapping[str, Drawn],
    taken: set[str],
) -> tuple[list[m.ScenarioItem], dict[Slot, object]] | None:
    """Return the file's parameters, and the values as sums of them with factors; None where they are not such sums."""
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
        made = _param(called[name], [part.values[name] for part in parts], numbers[:, k], drawn.get(name))
        if made is None:
            return None
        params.append(made)
    return params, values


def _sum(factors: np.ndarray[Any, Any], names: Sequence[str], unit: str) -> object:
    """Return `base + name * factor + ...`, without what is zero."""
    found: m.Quantity | m.Sum | m.Product | None = None
    for factor, name in zip(factors, [None, *names], strict=True):
        if not factor:
            continue
        value = m.Quantity(value=_decimal(abs(factor) if found is not None else factor), unit=unit)
        term = value if name is None else m.Product(left=m.Ref(name=name), op="*", right=value)
        found = term if found is None else m.Sum(left=found, op="+" if factor > 0 else "-", right=term)
    return found if found is not None else m.Quantity(value=Decimal(0), unit=unit)


def _param(name: str, written: Sequence[str], numbers: np.ndarray[Any, Any], drawn: Drawn | None) -> m.Param | None:
    """Return the parameter, with how it is drawn; None for a distribution that the language does not have."""
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
    found = round(Decimal(repr(float(value))), _DIGITS).normalize()
    return found.quantize(Decimal(1)) if int(found.as_tuple().exponent) > 0 else found
