"""Puts differences into words: labels of statements, values as the language prints them, groups."""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import Decimal
from typing import get_args

from foresee_dsl.language import model as m
from foresee_dsl.language.diff.parts import Group
from foresee_dsl.language.printer import Layout, layout, listing, print_item, written
from foresee_dsl.language.traversal import is_condition
from foresee_dsl.language.units import UNITS

_WORD = re.compile(r"[a-z_]+")
_ONE_WORD = (m.Route, m.Weather, m.Expect, m.End, m.Param)
"""Statements whose label has only the first word of their pattern, although further fixed words follow it in the
text."""

_FIELD_WORDS = {"start": "from", "duration": "for", "lane_width": "lane width"}
_WRITTEN = (m.Quantity, m.Ref, *m.EXPRESSIONS, m.Range, m.Measure, *get_args(get_args(m.Place)[0]))
"""Values and places that are shown as they are written; other parts of statements are shown field by field."""
_FIELDWISE = (m.Weather, m.SignalState, m.Change)
"""Statements of one line, without a name, that are compared setting by setting."""


def shape(item: m.Item) -> Layout | None:
    """Return the layout of an item as a statement; None for a part of a statement (a place, a condition)."""
    return None if isinstance(item, m.Phrase) else layout(item)


def is_statement(value: object) -> bool:
    """Return whether a value is a whole statement."""
    return isinstance(value, m.Item) and shape(value) is not None


def name_of(item: m.Item) -> str | None:
    """Return the name or label of a statement; None if it has none."""
    name = getattr(item, "name", None)
    return name if isinstance(name, str) else None


def by_settings(item: m.Item) -> bool:
    """Return whether a statement is compared setting by setting, not as one line."""
    layout = shape(item)
    block = layout is not None and layout.inside is not None
    return block or name_of(item) is not None or isinstance(item, _FIELDWISE)


def label(item: m.Item) -> str:
    """Return the words that address a statement in its block: `runner`, `param gap`, `start at`, `when time > 1 s`."""
    match item:
        case m.Change():
            words = f"change {item.actor}.{item.property}"
        case m.SignalState():
            words = f"signal {text(item.junction)}"
        case m.Network():
            words = "network"
        case m.Ego() | m.Actor() | m.Traffic() | m.Assignment():
            words = item.name
        case _ if (name := name_of(item)) is not None:
            words = f"{_head(item).split(maxsplit=1)[0]} {name}"
        case _ if any(is_condition(getattr(item, field)) for field in type(item).model_fields):
            words = _head(item)
        case _:
            words = keyword(item)
    return words


def keyword(item: m.Item) -> str:
    """Return the first words of a statement, before its values; for an action including the actor."""
    if isinstance(item, _ONE_WORD):
        return item.pattern.split()[0]
    head = _head(item)
    actor = item.junction if isinstance(item, m.TurnsTo) else getattr(item, "actor", None)
    begins = [actor] if isinstance(actor, str) and head.startswith(f"{actor} ") else []
    values = set(_strings(item))
    for word in head.split()[len(begins) :]:
        if not _WORD.fullmatch(word) or word in values:
            break
        begins.append(word)
    return " ".join(begins) or str(getattr(item, "kind", ""))


def tail(item: m.Item) -> str:
    """Return a statement as the language prints it, without its label; a block in full."""
    printed = print_item(item)
    words = label(item)
    if "\n" in printed or not printed.startswith(f"{words} "):
        return "" if printed == words else printed
    return printed[len(words) + 1 :]


def is_value(item: m.Item) -> bool:
    """Return whether an item is one value: compared and shown as a whole."""
    return isinstance(item, m.Quantity | m.Ref | m.Expression | m.Range | m.Leg)


def text(value: object) -> str:
    """Return any value as the language prints it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return listing(text(part) for part in value)
    if not isinstance(value, m.Item):
        return str(value)
    if is_statement(value):
        return print_item(value)
    if is_condition(value) or isinstance(value, _WRITTEN):
        return written(value)
    fields = [(n, getattr(value, n)) for n in type(value).model_fields if n != "kind"]
    words = " ".join(f"{n} {text(v)}" for n, v in fields if v is not None)
    return " ".join(filter(None, (str(getattr(value, "kind", "")), words)))


def setting(item: m.Item, field: str) -> str:
    """Return one field of a statement as it is printed: with its word, such as `lanes 2`, or only the value."""
    layout = shape(item)
    for key, inner in (layout.inside or ()) if layout is not None else ():
        if key == (field,) and isinstance(inner, str):
            return inner.removeprefix(f"{field} ")
    return text(getattr(item, field))


def field_path(owner: str, item: m.Item, field: str) -> str:
    """Return the path of a statement's field; for the only value of a statement, the path of the statement."""
    alone = not set(type(item).model_fields) - {"kind", "name", field}
    return owner if alone else join(owner, _FIELD_WORDS.get(field, field))


def join(owner: str, words: str) -> str:
    """Return the path of a part inside an owner: `runner.speed`, `when time > 1 s: lead stops`."""
    if not owner or not words:
        return owner or words
    apart = owner.startswith(("when ", "then ", "expect ")) or (" " in owner and " " in words)
    return f"{owner}: {words}" if apart else f"{owner}.{words}"


def note(was: object, now: object) -> str:
    """Return what a reviewer would compute from a change: the difference if only one number changed, or the elements
    that were added to and removed from a long list; otherwise ""."""
    before, after = list(_leaves(was)), list(_leaves(now))
    apart = [(a, b) for a, b in zip(before, after, strict=False) if a != b]
    if len(before) == len(after) and len(apart) == 1:
        return _delta(*apart[0])
    if not (isinstance(was, tuple) and isinstance(now, tuple) and len(was) + len(now) > _READ_AT_A_GLANCE):
        return ""
    old, new = [text(part) for part in was], [text(part) for part in now]
    came = [f"+{part}" for part in new if part not in old]
    went = [f"-{part}" for part in old if part not in new]
    return ", ".join((*came, *went)) or "another order"


_READ_AT_A_GLANCE = 6
"""Two lists that together have at most this many elements get no note, because a reader sees their difference at a
glance; longer lists get a note such as `+c, -a` (ours)."""


def _delta(was: object, now: object) -> str:
    if not (isinstance(was, m.Quantity) and isinstance(now, m.Quantity) and was.dimension == now.dimension):
        return ""
    if was.unit == now.unit:
        change = now.value - was.value
    else:
        factor = UNITS[now.unit].to_si if now.unit else 1.0
        change = Decimal(f"{(now.si - was.si) / factor:.6g}")
    return f"{change:+f} {now.unit}".rstrip()


def _leaves(value: object) -> Iterator[object]:
    if isinstance(value, m.Item) and not isinstance(value, m.Quantity):
        for field in type(value).model_fields:
            yield from _leaves(getattr(value, field))
    elif isinstance(value, tuple):
        yield len(value)
        for part in value:
            yield from _leaves(part)
    else:
        yield value


def group_of(item: m.Item) -> Group:
    """Return the group of a statement of a definition's body; statements that are not listed belong to the stimulus."""
    if isinstance(item, m.Network | m.UseNetwork | m.Junction | m.Road | m.Building):
        return "network"
    if isinstance(item, m.Ego | m.Goal):
        return "ego"
    if isinstance(item, m.Weather | m.Slippery | m.SignalState | m.UseModels | m.VehicleModel):
        return "environment"
    if isinstance(item, m.Expect | m.End | m.Window):
        return "expectation"
    if isinstance(item, m.Change):
        return _CHANGED.get(item.actor, "stimulus")
    held = getattr(item, "item", None)  # `add STATEMENT`, `change STATEMENT`
    return group_of(held) if isinstance(held, m.Item) else "stimulus"


_CHANGED: dict[str, Group] = {"ego": "ego", "weather": "environment", "expect": "expectation", "end": "expectation"}


def _head(item: m.Item) -> str:
    layout = shape(item)
    return layout.head if layout is not None else str(getattr(item, "kind", ""))


def _strings(value: object) -> Iterator[str]:
    """Yield every word among an item's values."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, m.Item):
        for field in type(value).model_fields:
            if field != "kind":
                yield from _strings(getattr(value, field))
    elif isinstance(value, tuple):
        for part in value:
            yield from _strings(part)
