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


def condition(item: m.Condition) -> str:
    """Return a condition with no more brackets than it needs."""
    if isinstance(item, m.Comparison):
        return f"{measure(item.left)} {item.op} {value(item.right)}"
    if isinstance(item, m.Predicate):
        return f"{item.what}({item.actor})"
    if isinstance(item, m.Not):
        return f"not {_inner(item.condition, (m.Both, m.Either))}"
    if isinstance(item, m.Both):
        return " and ".join(_inner(part, (m.Both, m.Either)) for part in item.conditions)
    return " or ".join(_inner(part, (m.Either,)) for part in item.conditions)


def _inner(item: m.Condition, in_brackets: tuple[type[m.Item], ...]) -> str:
    return f"({condition(item)})" if isinstance(item, in_brackets) else condition(item)


def measure(item: m.Measure) -> str:
    """Return `time`, `ego.speed`, `ego.eta(j4)`, `distance(a, b)` or `ttc(a, b)`."""
    if item.what == "time":
        return "time"
    if item.what == "speed":
        return f"{item.actor}.speed"
    other = identifier(item.other or "")
    if item.what == "eta":
        return f"{item.actor}.eta({other})"
    return f"{item.what}({item.actor}, {other})"
