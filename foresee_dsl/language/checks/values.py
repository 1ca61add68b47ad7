"""Values wherever they stand: references to parameters, dimensions, and numbers that make no sense."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from foresee_dsl.language import model as m
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.messages.words import NOUNS
from foresee_dsl.language.model import ParamType
from foresee_dsl.language.model.actors import WIDEST_LINE_M
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import fields_of, walk
from foresee_dsl.language.units import Dimension

_WORD_OF_FIELD: Mapping[str, ParamType] = {
    **{word: word for word in ("model", "junction", "turn", "side", "stage")},
    "edge": "arm",
    "edges": "arm",
}
_WORD_OF_OTHERS: Mapping[tuple[type[m.Item], str], ParamType] = {
    (m.Route, "start"): "arm",
    (m.Shows, "state"): "stage",
    (m.Measure, "other"): "junction",
    (m.Named, "name"): "junction",
}
"""Fields whose name does not tell which type of parameter may stand for their word."""

_LIMITS: MappingProxyType[tuple[type[m.Item], str], tuple[float, float, str]] = MappingProxyType(
    {(m.Weather, name): (0.0, 1.0, "FS043") for name in ("rain", "fog", "wetness", "sun")}
    | {
        (m.Steers, "value"): (-1.0, 1.0, "FS043"),
        (m.Timing, "factor"): (0.01, 10.0, "FS043"),  # ours: the operator's own range is 0.6 to 1.4
        (m.Road, "lanes"): (1, 8, "FS050"),  # ours: the widest motorway halves have eight lanes
        (m.Road, "back"): (0, 8, "FS050"),
        (m.RiskyPoints, "count"): (1, 1000, "FS050"),
        (m.Children, "count"): (0, 1000, "FS050"),
        (m.Repeat, "times"): (1, 100_000, "FS050"),  # ours: beyond the study's size (34,416 runs) by far
        (m.FirstSeed, "seed"): (0, 2**31 - 1, "FS050"),
        (m.ClipAround, "before"): (0.5, 60.0, "FS050"),
        (m.ClipAround, "after"): (0.5, 60.0, "FS050"),
        (m.Budget, "time"): (1.0, 1e9, "FS050"),
        (m.Traffic, "count"): (0, 500, "FS050"),  # ours: more is a traffic study, not a test case
        (m.Delay, "time"): (0.0, 1e9, "FS050"),
        (m.Line, "left"): (-WIDEST_LINE_M, WIDEST_LINE_M, "FS050"),
        (m.Walked, "along"): (0.0, 1e9, "FS050"),
        (m.Recorded, "time"): (0.05, 10.0, "FS050"),  # one step of the simulation, to a whole clip
        (m.CruiseSpeed, "speed"): (0.0, 1e9, "FS050"),
        (m.StartSpeed, "speed"): (0.0, 1e9, "FS050"),
        (m.State, "speed"): (0.0, 1e9, "FS050"),
        (m.Stage, "duration"): (0.1, 1e9, "FS050"),
        (m.End, "after"): (0.05, 1e9, "FS050"),  # one step of the simulation
        (m.Expect, "within"): (0.0, 1e9, "FS050"),
        (m.Sustained, "since"): (-1e9, 0.0, "FS050"),
        (m.VehicleModel, "length"): (0.01, 100.0, "FS050"),
        (m.VehicleModel, "width"): (0.01, 100.0, "FS050"),
        (m.VehicleModel, "height"): (0.01, 100.0, "FS050"),
        (m.VehicleModel, "front_overhang"): (0.0, 100.0, "FS050"),
        (m.VehicleModel, "rear_overhang"): (0.0, 100.0, "FS050"),
        (m.VehicleModel, "cruise_speed"): (0.01, 1e9, "FS050"),
        (m.Road, "lane_width"): (1.0, 10.0, "FS050"),  # ours: a cycle lane to a bus stop
        (m.Road, "speed"): (0.1, 1e9, "FS050"),
        (m.Road, "parking"): (1.0, 10.0, "FS050"),  # ours: a bicycle's stand to a lorry's bay across
        (m.Road, "sidewalk"): (0.0, 50.0, "FS050"),
        (m.Road, "median"): (0.0, 50.0, "FS050"),
    }
)
"""The smallest and largest SI value of a field."""


def check_values(findings: Findings, model: m.Definition) -> None:
    """Check every value of a definition."""
    body = model.body if isinstance(model, m.Scenario) else ()
    parameters = {item.name: item for item in body if isinstance(item, m.Param)}
    required = {id(part) for item in body if isinstance(item, m.Require) for part in walk(item)}
    for item in walk(model):
        if isinstance(item, m.Comparison | m.Equals) and isinstance(item.left, m.Ref) and id(item) not in required:
            _not_about_the_world(findings, item)
            continue
        if isinstance(item, m.Comparison) and isinstance(item.left, m.Measure):
            _check_comparison(findings, item, item.left)
        for field, value in fields_of(item):
            if isinstance(value, m.Ref):
                _check_reference(findings, parameters, item, field, value)
            elif isinstance(value, m.Quantity):
                _check_limits(findings, item, field, value)


def _not_about_the_world(findings: Findings, item: m.Comparison | m.Equals) -> None:
    """Triggers and expectations are about the running world, in which a parameter never changes."""
    name = item.left.name if isinstance(item.left, m.Ref) else ""
    help = f"compare something of the world, such as `ego.speed`; or write `require {written(item)}` in the scenario"
    findings.add(item, "left", "FS052", f"'{name}' is nothing that happens in the world", help)


def _check_comparison(findings: Findings, item: m.Comparison, measure: m.Measure) -> None:
    needed = m.MEASURED[measure.what]
    if isinstance(item.right, m.Quantity) and item.right.dimension != needed:
        findings.wrong_dimension(item, "right", item.right, needed)


def _check_limits(findings: Findings, item: m.Item, field: str, value: m.Quantity) -> None:
    limits = _LIMITS.get((type(item), field))
    if limits is None:
        return
    low, high, code = limits
    if low <= value.si <= high:
        return
    dimension = form_of(type(item), field).dimension or "ratio"
    if value.si < low:
        help = f"use at least {low:g}" if dimension in ("ratio", "count") else "use a larger value"
    else:
        help = f"use at most {high:g}" if dimension in ("ratio", "count") else "use a smaller value"
    size = "small" if value.si < low else "large"
    findings.add(item, field, code, f"`{written(value)}` is too {size} for `{field}`", help)


def _check_reference(
    findings: Findings, parameters: Mapping[str, m.Param], item: m.Item, field: str, reference: m.Ref
) -> None:
    parameter = parameters.get(reference.name)
    if parameter is None:
        help = did_you_mean(reference.name, parameters)
        if not parameters and word_of(type(item), field) == "model":
            help = "models are called class.variant, such as `car.compact`"
        if not help and (dimension := form_of(type(item), field).dimension) is not None:
            help = f"write {findings.example(dimension)}"
        findings.add(item, field, "FS031", f"unknown parameter '{reference.name}'", help)
        return
    word = word_of(type(item), field.partition(".")[0])
    if word is not None:
        if parameter.type != word:
            help = f"a parameter of type `{word}` is needed here"
            message = f"'{reference.name}' is of type {parameter.type}, which cannot stand here"
            findings.add(item, field, "FS032", message, help)
        return
    needed: Dimension | None = form_of(type(item), field).dimension
    if isinstance(item, m.Comparison):
        if not isinstance(item.left, m.Measure):
            return  # a requirement: `check_parameters` looks at both sides
        needed = m.MEASURED[item.left.what]
    if needed is None or parameter.type == needed or (needed == "ratio" and parameter.type == "count"):
        return
    message = f"'{reference.name}' is of type {parameter.type}, but {NOUNS[needed]} is needed here"
    findings.add(item, field, "FS032", message, f"use a parameter of type `{needed}`")


def word_of(kind: type[m.Item], field: str) -> ParamType | None:
    """Return which type of parameter may stand for the word in a field; None for a field that holds no word."""
    return _WORD_OF_OTHERS.get((kind, field)) or _WORD_OF_FIELD.get(field)
