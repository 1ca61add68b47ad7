"""Hypothesis strategies for every class of the model, read off its annotations."""

from __future__ import annotations

import types
from collections.abc import Callable
from decimal import Decimal
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from hypothesis import assume
from hypothesis import strategies as st
from lark.lexer import PatternStr
from pydantic.fields import FieldInfo

from foresee_dsl.language import model as m
from foresee_dsl.language.checking import walk
from foresee_dsl.language.grammar import parser
from foresee_dsl.language.units import UNITS, Dimension

TURNS = {"straight", "left", "right", "back"}
KEYWORDS = sorted(
    t.pattern.value for t in parser().terminals if isinstance(t.pattern, PatternStr) and t.pattern.value.isidentifier()
)

# Few different names, most of them keywords: so that they clash with the grammar and with each other.
names = st.sampled_from([*KEYWORDS, "a", "b_2", "runner", "j4", "m", "s", "time"])
free_names = names.filter(lambda name: name not in TURNS)
model_names = st.builds("{}.{}".format, names, names)
texts = st.text(st.characters(exclude_characters='"\n\r', exclude_categories=["Cs"]), max_size=12)
ids = names | st.text(st.characters(exclude_characters='"\n\r\\', exclude_categories=["Cs"]), min_size=1, max_size=8)
files = texts.filter(bool)
numbers = st.decimals(-1000, 1000, places=2) | st.integers(-9, 999).map(Decimal) | st.just(Decimal("12.340"))


def quantities(dimension: Dimension | None = None) -> st.SearchStrategy[m.Quantity]:
    if dimension == "count":
        return st.integers(0, 99).map(lambda n: m.Quantity(value=Decimal(n)))
    units = [w for w, unit in UNITS.items() if dimension is None or unit.dimension == dimension]
    if dimension in (None, "ratio"):
        units.append("")
    return st.builds(m.Quantity, value=numbers, unit=st.sampled_from(units))


REFERENCES = st.builds(m.Ref, name=free_names)

KNOWN: list[tuple[Any, st.SearchStrategy[Any]]] = [
    (m.Name, names),
    (m.Id, ids),
    (m.ModelName, model_names),
    (m.Text, texts),
    (m.FilePath, files),
    (m.Pin, st.from_regex(r"\Asha256:[0-9a-f]{12}\Z")),
    (m.ParamValue, quantities() | names | model_names | texts),
    *[
        (alias, quantities(dimension) | REFERENCES)
        for alias, dimension in (
            (m.Time, "time"),
            (m.Length, "length"),
            (m.Speed, "speed"),
            (m.Acceleration, "acceleration"),
            (m.Angle, "angle"),
            (m.AngularRate, "angular_rate"),
            (m.Mass, "mass"),
            (m.Ratio, "ratio"),
            (m.Count, "count"),
        )
    ],
]


def _measures() -> st.SearchStrategy[m.Measure]:
    return st.one_of(
        st.just(m.Measure(what="time")),
        st.builds(m.Measure, what=st.just("speed"), actor=names),
        st.builds(m.Measure, what=st.just("eta"), actor=names, other=ids),
        st.builds(m.Measure, what=st.just("distance"), actor=names, other=ids),
        st.builds(m.Measure, what=st.just("ttc"), actor=names, other=names),
    )


def _conditions() -> st.SearchStrategy[Any]:
    leaf = of(m.Comparison) | of(m.Predicate)
    return st.recursive(
        leaf,
        lambda inner: st.one_of(
            st.builds(m.Not, condition=inner),
            st.builds(m.Both, conditions=st.lists(inner, min_size=2, max_size=3).map(tuple)),
            st.builds(m.Either, conditions=st.lists(inner, min_size=2, max_size=3).map(tuple)),
        ),
        max_leaves=5,
    )


def _params() -> st.SearchStrategy[m.Param]:
    limits = st.fixed_dictionaries({}, optional={"range": of(m.Range)}) | st.fixed_dictionaries(
        {"options": st.lists(names | model_names | texts, max_size=3).map(tuple)}
    )
    return st.builds(
        lambda name, type_, default, more: m.Param(name=name, type=type_, default=default, **more),
        free_names,
        of(m.ParamType),
        quantities() | names | model_names | texts,
        limits,
    )


SPECIAL: dict[Any, Any] = {
    m.Measure: _measures,
    m.Param: _params,
    m.Weather: lambda: _builds(m.Weather).filter(
        lambda w: any(getattr(w, n) for n in ("rain", "fog", "wetness", "sun"))
    ),
    m.Quantity: quantities,
    m.Ref: lambda: REFERENCES,
    m.When: lambda: st.builds(m.When, condition=_conditions(), actions=of(_hints(m.When)["actions"], 1)),
    m.Expect: lambda: st.builds(
        m.Expect, mode=of(_hints(m.Expect)["mode"]), within=of(_hints(m.Expect)["within"]), condition=_conditions()
    ),
}


def of(hint: Any, least: int = 0) -> st.SearchStrategy[Any]:
    """A strategy for the values of an annotation."""
    if hint in SPECIAL:
        return SPECIAL[hint]()
    for known, strategy in KNOWN:
        if hint is known or hint == known:
            return strategy
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        for info in hint.__metadata__:
            if isinstance(info, FieldInfo):
                least = max([least, *[part.min_length for part in info.metadata if hasattr(part, "min_length")]])
        return of(arguments[0], least)
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (Union, types.UnionType):
        return st.one_of([of(a) for a in arguments])
    if origin is tuple:
        return st.lists(of(arguments[0]), min_size=least, max_size=3).map(tuple)
    if hint is type(None):
        return st.none()
    if hint is bool:
        return st.booleans()
    if hint is str:
        return texts
    return _builds(hint)


def _builds(kind: type[m.Item]) -> st.SearchStrategy[Any]:
    given = _Fields()
    for name, hint in _hints(kind).items():
        info = kind.model_fields[name]
        least = max([0, *[part.min_length for part in info.metadata if hasattr(part, "min_length")]])
        if name != "kind" or not isinstance(info.default, str):
            given[name] = of(hint, least)
    return _items(kind, given)


class _Fields(dict[str, Any]):
    """Strategies by field, with a short name in Hypothesis's reports."""

    def __repr__(self) -> str:
        return "..."


@st.composite
def _items(draw: st.DrawFn, kind: type[m.Item], fields: dict[str, Any]) -> m.Item:
    return kind(**{name: draw(strategy) for name, strategy in fields.items()})


def _hints(kind: type[m.Item]) -> dict[str, Any]:
    hints = get_type_hints(kind, include_extras=True)
    return {name: hint for name, hint in hints.items() if name in kind.model_fields}


def _declared(scenario: m.Scenario) -> m.Scenario:
    """The same with a parameter for every reference that stands where an id or a turn may stand."""
    known = {item.name for item in scenario.all(m.Param)}
    fields = ("start", "edge", "junction", "turn")
    words = [getattr(item, field) for item in walk(scenario) for field in fields if _has(item, field)]
    missing = sorted({word.name for word in words if isinstance(word, m.Ref)} - known)
    new = [m.Param(name=name, type="arm", default="south") for name in missing]
    return m.Scenario(name=scenario.name, body=(*new, *scenario.body))


def _kinds(union: Any) -> tuple[type[m.Item], ...]:
    return get_args(get_args(union)[0])


_PIN = "sha256:0123456789ab"
_HOSTS: dict[str, tuple[tuple[type[m.Item], ...], Callable[[Any], m.Definition]]] = {
    "scenario": (_kinds(m.ScenarioItem), lambda items: m.Scenario(name="a", body=items)),
    "actor": (_kinds(m.ActorItem), lambda items: m.Scenario(name="a", body=(m.Ego(model="car.a", body=items),))),
    "trigger": (
        _kinds(m.Action),
        lambda items: m.Scenario(
            name="a", body=(m.When(condition=m.Predicate(what="arrived", actor="ego"), actions=items),)
        ),
    ),
    "clip": (_kinds(m.ClipItem), lambda items: m.Clip(name="a", parent="a", pin=_PIN, body=items)),
    "mutant": (_kinds(m.MutantItem), lambda items: m.Mutant(name="a", parent="a", pin=_PIN, body=items)),
    "network": (_kinds(m.NetworkItem), lambda items: m.Network(name="a", body=items)),
    "models": ((m.Doc, m.VehicleModel), lambda items: m.Catalogue(name="a", body=items)),
}
STATEMENTS = [(host, kind) for host, (kinds, _) in _HOSTS.items() for kind in kinds]
"""Every statement, with the block that it stands in."""


def _is_possible(model: m.Definition) -> bool:
    """Whether a file can say it: in a clip there are no parameters, so no word refers to one."""
    words = [getattr(item, f) for item in walk(model) for f in ("start", "edge", "junction", "turn") if _has(item, f)]
    return isinstance(model, m.Scenario) or not any(isinstance(word, m.Ref) for word in words)


def _has(item: m.Item, field: str) -> bool:
    return field in type(item).model_fields and isinstance(item, (m.Route, m.AlongEdge, m.PastJunction, m.Leg))


@st.composite
def definitions(draw: st.DrawFn, host: str, kind: type[m.Item]) -> m.Definition:
    """A definition with some statements of one kind, among others."""
    kinds, make = _HOSTS[host]
    own = draw(st.lists(of(kind), min_size=1, max_size=3))
    others = draw(st.lists(st.one_of([of(other) for other in kinds]), max_size=2))
    model = make((*own, *others))
    if isinstance(model, m.Scenario):
        model = _declared(model)
    assume(_is_possible(model))
    return model
