"""The parts of statements as text: values, names, places, conditions."""

from __future__ import annotations

import re
from collections.abc import Iterable

from foresee_dsl.language import model as m
from foresee_dsl.language.model.values import NAME_PATTERN

_NAME = re.compile(NAME_PATTERN)
_DOTTED = re.compile(rf"{NAME_PATTERN}\.{NAME_PATTERN}")


def value(item: m.Value) -> str:
    """Return `50 km/h`, `0.31` or a parameter's name, with the author's digits."""
    if isinstance(item, m.Ref):
        return item.name
    return f"{item.value:f} {item.unit}" if item.unit else f"{item.value:f}"


def identifier(item: str | m.Ref, parameters: frozenset[str] = frozenset()) -> str:
    """Return a name, or a string when it is no name, or would be taken for one of the scenario's parameters."""
    if isinstance(item, m.Ref):
        return item.name
    return item if _NAME.fullmatch(item) and item not in parameters else string(item)


def word(item: m.ParamValue) -> str:
    """Return a parameter's value: a quantity, a name, a model or a string."""
    if isinstance(item, m.Quantity):
        return value(item)
    return item if _NAME.fullmatch(item) or _DOTTED.fullmatch(item) else string(item)


def string(text: str) -> str:
    """Return a text in quotes; the model has made sure that it holds none."""
    return f'"{text}"'


def listing(texts: Iterable[str]) -> str:
    """Return `[a, b]`."""
    return f"[{', '.join(texts)}]"


def point(at: m.Point) -> str:
    """Return `(1 m, 2 m)`."""
    return f"({value(at.x)}, {value(at.y)})"


def place(at: m.Point | m.AlongEdge | m.AlongRoute | m.PastJunction, parameters: frozenset[str]) -> str:
    """Return a place such as `40 m past j4 on ego.route offset -1 m`."""
    if isinstance(at, m.Point):
        return point(at)
    if isinstance(at, m.AlongEdge):
        text = f"{value(at.at)} along {identifier(at.edge, parameters)}"
    elif isinstance(at, m.AlongRoute):
        text = f"{value(at.at)} along {at.actor}.route"
    else:
        text = f"{value(at.at)} {at.side} {identifier(at.junction, parameters)} on {at.actor}.route"
    return f"{text} offset {value(at.offset)}" if at.offset is not None else text


def optional(keyword: str, item: m.Value | None) -> str:
    """Return ` from 1 s`, or nothing."""
    return f" {keyword} {value(item)}" if item is not None else ""


def label(name: str | None) -> str:
    """Return `late: `, or nothing."""
    return f"{name}: " if name is not None else ""


def at(junction: str | m.Ref | None, parameters: frozenset[str]) -> str:
    """Return ` at j4`, or nothing."""
    return f" at {identifier(junction, parameters)}" if junction is not None else ""


def condition(item: m.Condition, parameters: frozenset[str] = frozenset()) -> str:
    """Return a condition with no more brackets than it needs."""
    match item:
        case m.Sustained():
            inner = _inner(item.condition, (m.Not, m.Both, m.Either, m.Sustained), parameters)
            text = f"{inner} for {value(item.duration)}{optional('since', item.since)}"
        case m.Not():
            text = f"not {_inner(item.condition, (m.Both, m.Either), parameters)}"
        case m.Both():
            text = " and ".join(_inner(part, (m.Both, m.Either), parameters) for part in item.conditions)
        case m.Either():
            text = " or ".join(_inner(part, (m.Either,), parameters) for part in item.conditions)
        case _:
            text = _fact(item, parameters)
    return text


_Fact = m.Comparison | m.Equals | m.Predicate | m.InJunction | m.Within | m.Shows


def _fact(item: _Fact, parameters: frozenset[str]) -> str:
    match item:
        case m.Comparison():
            left = measure(item.left, parameters) if isinstance(item.left, m.Measure) else value(item.left)
            text = f"{left} {item.op} {value(item.right)}"
        case m.Equals():
            text = f"{value(item.left)} is {word(item.right)}"
        case m.Predicate():
            text = f"{item.what}({item.actor})"
        case m.InJunction():
            which = f" {_not_going_on(item.junction, parameters)}" if item.junction is not None else ""
            text = f"{item.actor} in junction{which}"
        case m.Within():
            of = identifier(item.of.name, parameters) if isinstance(item.of, m.Named) else place(item.of, parameters)
            text = f"{item.actor} within {value(item.distance)} of {of}"
        case m.Shows():
            whose = f"{item.actor}." if item.actor is not None else ""
            text = f"{whose}signal({identifier(item.junction, parameters)}) is {identifier(item.state, parameters)}"
    return text


def _inner(item: m.Condition, in_brackets: tuple[type[m.Item], ...], parameters: frozenset[str]) -> str:
    text = condition(item, parameters)
    return f"({text})" if isinstance(item, in_brackets) else text


def _not_going_on(item: str | m.Ref, parameters: frozenset[str]) -> str:
    """Return an id that may be left out: in quotes where the condition would seem to go on without it."""
    return string(item) if item in ("and", "or", "for") else identifier(item, parameters)


def measure(item: m.Measure, parameters: frozenset[str] = frozenset()) -> str:
    """Return `time`, `ego.speed`, `ego.eta(j4)`, `distance(a, b)` and the like."""
    if item.what == "time":
        return "time"
    if item.what in ("speed", "acceleration"):
        return f"{item.actor}.{item.what}"
    other = identifier(item.other if item.other is not None else "", parameters)
    if item.what == "eta":
        return f"{item.actor}.eta({other})"
    return f"{item.what}({item.actor}, {other})"
