"""The storyboard as a list of events: who does what, once which condition holds or which other event is over."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from foresee_dsl.exchange.foreign_xml import number
from foresee_dsl.exchange.openscenario.reading.conditions import ConditionReader, Start
from foresee_dsl.exchange.openscenario.reading.source import Source
from foresee_dsl.exchange.outcome import NotExpressed
from foresee_dsl.language.model import Both, Condition

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by foreign_xml

_AT_START = ("startTransition", "runningState")
_AT_END = ("endTransition", "completeState")


@dataclass
class Event:
    """One event of the storyboard.

    Attributes:
        names: its own and its actions' names, by which others wait for it.
        refs: the entities that act. actions: what they do.
        condition, delay_s: when it starts. every: it may start again.
        at_end, at_start: events that start when it ends or starts.
    """

    names: tuple[str, ...]
    refs: tuple[str, ...]
    actions: tuple[Element, ...]
    condition: Condition | None
    delay_s: float
    every: bool = False
    at_end: list[Event] = field(default_factory=list)
    at_start: list[Event] = field(default_factory=list)


def read_events(source: Source, reader: ConditionReader, left_out: Counter[str]) -> list[Event]:
    """Return the events that start by themselves, each with those that wait for it; others are counted."""
    found: list[tuple[Event, tuple[str, str] | None]] = []
    for group, act, maneuver in _maneuvers(source, left_out):
        refs = tuple(e.get("entityRef", "") for e in group.iterfind("Actors/EntityRef"))
        for element in maneuver.iterfind("Event"):
            try:
                found.append(_event(element, act, refs, reader))
            except NotExpressed as err:
                left_out[str(err)] += 1
                left_out["events that wait for such a thing"] += 1
    by_name = {name: event for event, _ in found for name in event.names}
    first = []
    for event, after in found:
        if after is None:
            first.append(event)
            continue
        ref, state = after
        before = by_name.get(ref.rpartition("::")[2])
        if before is None or before is event or state not in (*_AT_START, *_AT_END):
            left_out[f"events that wait for {state or 'a state'} of other parts of the storyboard"] += 1
        else:
            (before.at_end if state in _AT_END else before.at_start).append(event)
    return first


def _maneuvers(source: Source, left_out: Counter[str]) -> Iterator[tuple[Element, Element, Element]]:
    """Yield maneuver groups with their act and each of their maneuvers."""
    for act in source.root.iterfind("Storyboard/Story/Act"):
        if act.find("StopTrigger/ConditionGroup") is not None:
            left_out["acts that stop before the end"] += 1
        for group in act.iterfind("ManeuverGroup"):
            actors = group.find("Actors")
            if actors is not None and actors.get("selectTriggeringEntities") == "true":
                left_out["maneuvers of whoever triggers them"] += 1
            for maneuver in group.iterfind("Maneuver"):
                yield group, act, maneuver
            for reference in group.iterfind("CatalogReference"):
                yield group, act, source.entry(reference)


def _event(
    element: Element, act: Element, refs: tuple[str, ...], reader: ConditionReader
) -> tuple[Event, tuple[str, str] | None]:
    start = _joined(reader.start(act.find("StartTrigger")), reader.start(element.find("StartTrigger")))
    actions = element.findall("Action")
    event = Event(
        names=tuple(e.get("name", "") for e in (element, *actions)),
        refs=refs,
        actions=tuple(kind for action in actions for kind in action),
        condition=start.condition,
        delay_s=start.delay_s,
        every=number(element, "maximumExecutionCount", 1) > 1,
    )
    return event, start.after


def _joined(act: Start, event: Start) -> Start:
    """Return when an event starts in an act that starts by itself."""
    if (act.after and event.after) or (act.delay_s and event.delay_s):
        raise NotExpressed("triggers of acts and their events that both wait")
    parts = tuple(c for c in (act.condition, event.condition) if c is not None)
    joined = parts[0] if len(parts) == 1 else Both(conditions=parts) if parts else None
    return Start(joined, act.delay_s or event.delay_s, act.after or event.after)
