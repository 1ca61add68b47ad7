"""Checks of all values of a file: references to parameters, dimensions, and numbers out of bounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress

from foresee_dsl.errors import subject
from foresee_dsl.helps import HelpText, meant_code, meant_word, write
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values
from foresee_dsl.language.arithmetic.results import limit, out_of_bounds, unfit, uses
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import closest, did_you_mean, of_type
from foresee_dsl.language.model import ParamType
from foresee_dsl.language.model.pattern import form_of, word_before
from foresee_dsl.language.printer import written
from foresee_dsl.language.sampling import TooFewError, draw
from foresee_dsl.language.traversal import fields_of, walk
from foresee_dsl.language.units import NOUNS, Dimension

_WORD_OF_FIELD: Mapping[str, ParamType] = {
    **{word: word for word in ("model", "junction", "turn", "side", "stage")},
    "edge": "arm",
    "edges": "arm",
}
_WORD_OF_OTHERS: Mapping[tuple[type[m.Item], str], ParamType] = {
    (m.Route, "start"): "arm",
    (m.InLane, "road"): "arm",
    (m.Shows, "state"): "stage",
    (m.Measure, "other"): "junction",
    (m.Named, "name"): "junction",
}
"""The type of parameter that may stand in place of a word, for fields whose name does not determine the type."""


_ONLY_VALUES = {m.Clip: "a clip", m.Mutant: "a mutant", m.Catalogue: "a catalogue of models", m.Campaign: "a campaign"}
"""Names, for messages, of the kinds of files that hold values but no calculations."""


def check_values(collector: Collector, model: m.Definition) -> None:
    """Check every value of a definition."""
    body = model.body if isinstance(model, m.Scenario) else ()
    parameters = {item.name: item for item in body if isinstance(item, m.Param)}
    types = {name: parameter.type for name, parameter in parameters.items()}
    required = {id(part) for item in body if isinstance(item, m.Require) for part in walk(item)}
    only_values = _ONLY_VALUES.get(type(model), "")
    for item in walk(model):
        compares = isinstance(item, m.Comparison | m.Equals) and id(item) not in required
        if compares and isinstance(item, m.Comparison | m.Equals) and not isinstance(item.left, m.Measure):
            _not_about_the_world(collector, item, parameters)
            continue
        if isinstance(item, m.Comparison) and isinstance(item.left, m.Measure) and isinstance(item.right, m.Quantity):
            needed = m.MEASURED[item.left.what]
            if item.right.dimension != needed:
                collector.wrong_dimension(item, "right", item.right, needed)
        if isinstance(item, m.KeepsGap):
            _check_gap(collector, item, types)
        for field, value in fields_of(item):
            if isinstance(value, m.Ref):
                _check_reference(collector, parameters, item, field, value)
            elif isinstance(value, m.Quantity):
                _check_limits(collector, item, field, value, in_clip=isinstance(model, m.Clip))
            elif not isinstance(value, m.Expression) or isinstance(item, m.EXPRESSIONS):
                continue
            elif only_values:
                from foresee_dsl.language.checks.expressions import refuse

                refuse(collector, only_values, item, field, value)
            elif id(item) not in required and not isinstance(item, m.Assignment):  # `check_parameters` checks these
                from foresee_dsl.language.checks.expressions import check_expression

                check_expression(collector, item, field, value, _needed(item, field), types)
    if isinstance(model, m.Scenario) and not collector:
        _check_results(collector, model)


def _check_gap(collector: Collector, item: m.KeepsGap, types: Mapping[str, str]) -> None:
    """Report a gap that is neither a time nor a length."""
    gap = item.gap
    if isinstance(gap, m.Quantity) and gap.dimension not in ("time", "length"):
        collector.wrong_dimension(item, "gap", gap, "time")
    elif isinstance(gap, m.Ref) and types.get(gap.name, "time") not in ("time", "length"):
        message = f"'{gap.name}' is of type {types[gap.name]}, but a gap is a time or a length"
        collector.add(item, "gap", "FS032", message, of_type("time", types, collector.example("time")))


def _needed(item: m.Item, field: str) -> Dimension | None:
    """Return the dimension that the value in a field must have; None if any will do."""
    if isinstance(item, m.Comparison) and isinstance(item.left, m.Measure):
        return m.MEASURED[item.left.what]
    return form_of(type(item), field.partition(".")[0]).dimension


def _check_results(collector: Collector, scenario: m.Scenario) -> None:
    """Report values that do not fit their place in some case (written or drawn); without cases, with the defaults."""
    places = list(uses(scenario.body))
    if not places:
        return
    written_cases = scenario.all(m.Case)
    cases = [(case.name, case_values(scenario, case)) for case in (*written_cases, *_drawn(scenario))]
    if not written_cases and not scenario.all(m.Cases):
        cases = [("", case_values(scenario, None))]
    for error in unfit(places, cases):
        collector.add(*error)


def _drawn(scenario: m.Scenario) -> Iterator[m.Case]:
    """Yield the drawn cases. A statement with too few valid draws yields none, because it is reported elsewhere."""
    for cases in scenario.all(m.Cases):
        with suppress(TooFewError):
            yield from draw(scenario, cases)


_A_MODEL = {
    name.partition(".")[0]: meant_code(name)
    for name in ("car.compact", "van.delivery", "truck.rigid", "bus.city", "motorcycle.street", "bicycle.city",
                 "pedestrian.adult", "obstacle.crate")
}  # fmt: skip
"""An example model of each class, for the help when the author wrote only the class."""


def _not_about_the_world(
    collector: Collector, item: m.Comparison | m.Equals, parameters: Mapping[str, m.Param]
) -> None:
    """Report a parameter in the place of a measured quantity, because it never changes during the run; or a word that
    is neither."""
    name = written(item.left)
    if isinstance(item.left, m.Ref) and name not in parameters:
        help: HelpText = "compare something that is measured in the run, such as " + write("ego.speed")
        help = meant_word("time", name) if closest(name, ("time",)) else help
        collector.add(item, "left", "FS004", "unknown word '" + subject(name) + "'", help)
        return
    requirement = write(f"require {written(item)}") + " in the scenario"
    help = "compare something that is measured in the run, such as " + write("ego.speed") + "; or write " + requirement
    collector.add(item, "left", "FS052", f"'{name}' does not change during the run", help)


def _check_limits(collector: Collector, item: m.Item, field: str, value: m.Quantity, *, in_clip: bool) -> None:
    form = form_of(type(item), field)
    bounds = form.bounds
    if bounds is None or bounds.low <= value.si <= bounds.high:
        return
    if in_clip and isinstance(item, m.Line) and field == "start":
        return  # an actor on a track may have begun to move to its line before the clip
    size = "small" if value.si < bounds.low else "large"
    message = f"`{written(value)}` is too {size} for `{word_before(type(item), field)}`"
    collector.add(item, field, out_of_bounds(item, field), message, limit(bounds, value))


def _check_reference(
    collector: Collector, parameters: Mapping[str, m.Param], item: m.Item, field: str, reference: m.Ref
) -> None:
    parameter = parameters.get(reference.name)
    if parameter is None:
        sides = (item.left, item.right) if isinstance(item, m.Comparison) else ()
        compared = [parameters.get(side.name) for side in sides if isinstance(side, m.Ref)]
        if any(other is not None and other.dimension is None for other in compared):
            return  # a word, which cannot be compared: `check_requirements` reports that
        help = did_you_mean(reference.name, parameters)
        if word_of(type(item), field) == "model" and closest(reference.name, parameters) is None:
            help = _A_MODEL.get(reference.name, "models are called class.variant, such as " + write("car.compact"))
        if not help and (dimension := form_of(type(item), field).dimension) is not None:
            help = "write " + collector.example(dimension)
        collector.add(item, field, "FS031", "unknown parameter '" + subject(reference.name) + "'", help)
        return
    word = word_of(type(item), field.partition(".")[0])
    if word is not None:
        if parameter.type != word:
            help = of_type(word, {name: declared.type for name, declared in parameters.items()})
            message = f"'{reference.name}' is of type {parameter.type}, which does not fit here"
            collector.add(item, field, "FS032", message, help)
        return
    needed: Dimension | None = form_of(type(item), field).dimension
    if isinstance(item, m.Comparison):
        if not isinstance(item.left, m.Measure):
            return  # a requirement: `check_parameters` looks at both sides
        needed = m.MEASURED[item.left.what]
    if needed is None or parameter.type == needed or (needed == "ratio" and parameter.type == "count"):
        return
    message = f"'{reference.name}' is of type {parameter.type}, but {NOUNS[needed]} is needed here"
    types = {name: declared.type for name, declared in parameters.items()}
    collector.add(item, field, "FS032", message, of_type(needed, types, collector.example(needed)))


def word_of(kind: type[m.Item], field: str) -> ParamType | None:
    """Return the type of parameter that may replace the word in a field; None for a field without a word."""
    return _WORD_OF_OTHERS.get((kind, field)) or _WORD_OF_FIELD.get(field)
