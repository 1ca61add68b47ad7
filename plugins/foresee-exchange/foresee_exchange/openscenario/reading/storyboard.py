"""The storyboard as a list of events: the actors, their actions, and the steps or the event whose end starts them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of
from foresee_exchange.naming import number
from foresee_exchange.openscenario.losses import Losses, NotExpressed
from foresee_exchange.openscenario.reading.conditions import ConditionReader, NeverStarts, Step
from foresee_exchange.openscenario.reading.source import Source

_AT_START = ("startTransition", "runningState")
_AT_END = ("endTransition", "completeState")
_OUTER = ("story", "act", "maneuverGroup", "maneuver")


@dataclass(eq=False)
class Event:
    """One event of the storyboard.

    Attributes:
        name: its name. refs: the entities that act. actions: their actions.
        parts: (type, name) of the event, its actions, and the elements that contain it.
        trigger: its start trigger. act: the act that contains it. every: whether it may start again.
        steps: the steps before it, from the beginning or from the end of the event that it waits for.
        at_end: events that wait for its end. lost: why it cannot be taken over. never: whether it never starts.
    """

    name: str
    refs: tuple[str, ...]
    actions: tuple[Element, ...]
    parts: frozenset[tuple[str, str]] = frozenset()
    trigger: Element | None = None
    act: Element | None = None
    every: bool = False
    steps: tuple[Step, ...] = ()
    at_end: list[Event] = field(default_factory=list)
    hangs: bool = False
    lost: str = ""
    never: bool = False

    @property
    def title(self) -> str:
        """Return the name of the event in comments."""
        return f"event '{self.name}' of {', '.join(self.refs) or 'no entity'}" if self.name else "at the beginning"


def read_events(source: Source, losses: Losses) -> list[Event]:
    """Return all events, in the order of the file."""
    events = []
    acts = source.root.findall("Storyboard/Story/Act")
    selections = {
        selection.get("name", ""): tuple(e.get("entityRef", "") for e in selection.iterfind("Members/EntityRef"))
        for selection in source.root.iterfind("Entities/EntitySelection")
    }
    for story in source.root.iterfind("Storyboard/Story"):
        for act in story.iterfind("Act"):
            if _stops_early(act):
                report = losses.lose if len(acts) > 1 else losses.leave  # the only act ends with the run
                report("acts that stop before the end", f"act '{act.get('name', '')}'")
            for group in act.iterfind("ManeuverGroup"):
                named = [e.get("entityRef", "") for e in group.iterfind("Actors/EntityRef")]
                refs = tuple(ref for name in named for ref in selections.get(name, (name,)))
                actors = group.find("Actors")
                if actors is not None and actors.get("selectTriggeringEntities") == "true":
                    losses.lose("maneuvers of the entities that trigger them", f"group '{group.get('name', '')}'")
                for maneuver in _maneuvers(source, group):
                    outer = zip(_OUTER, (story, act, group, maneuver), strict=True)
                    parts = {(kind, element.get("name", "")) for kind, element in outer}
                    events += [_event(element, refs, parts, act) for element in maneuver.iterfind("Event")]
    return events


def _stops_early(act: Element) -> bool:
    """Return whether an act has a stop trigger that may fire before the end of the run."""
    for condition in act.iterfind("StopTrigger/ConditionGroup/Condition"):
        if condition.find("ByValueCondition/SimulationTimeCondition") is None:
            return True
    return act.find("StopTrigger/ConditionGroup") is not None


def _maneuvers(source: Source, group: Element) -> Iterator[Element]:
    yield from group.iterfind("Maneuver")
    for reference in group.iterfind("CatalogReference"):
        yield source.entry(reference)


def _event(element: Element, refs: tuple[str, ...], parts: set[tuple[str, str]], act: Element) -> Event:
    actions, name = element.findall("Action"), element.get("name", "")
    own = {("event", name), *(("action", action.get("name", "")) for action in actions)}
    return Event(
        name=name,
        refs=refs,
        actions=tuple(kind for action in actions for kind in action),
        parts=frozenset(parts | own),
        trigger=element.find("StartTrigger"),
        act=act,
        every=number(element, "maximumExecutionCount", 1) > 1,
    )


def changing(events: Sequence[Event]) -> frozenset[str]:
    """Return the parameters and variables that actions change, also those of maneuvers in catalogues."""
    actions = (e for event in events for kind in event.actions for e in (kind, *kind.iter()))
    return frozenset(
        e.get("parameterRef") or e.get("variableRef") or ""
        for e in actions
        if e.tag in ("ParameterAction", "VariableAction")
    )


def used_names(events: Sequence[Event]) -> frozenset[str]:
    """Return the parameters and variables that the triggers of events and their acts use."""
    triggers = [event.trigger for event in events if event.trigger is not None]
    triggers += [t for event in events if event.act is not None for t in event.act.iterfind("StartTrigger")]
    conditions = (e for t in triggers for tag in ("ParameterCondition", "VariableCondition") for e in t.iter(tag))
    return frozenset(e.get("parameterRef") or e.get("variableRef") or "" for e in conditions)


def arrange(events: Sequence[Event], reader: ConditionReader) -> None:
    """Determine when each event starts, and attach each event that waits for the end of another to that event.

    Problems are written into the events: `lost`, `never`.
    """
    order = _Order(events, reader)
    for event in events:
        try:
            base, event.steps = order.start_of(event)
        except NotExpressed as err:
            event.lost = str(err)
        except NeverStarts:
            event.never = True
        except RecursionError:
            event.lost = "events that wait for each other"
        else:
            if base is not None:
                event.hangs = True
                base.at_end.append(event)


def begins_at(event: Event, events: Sequence[Event], reader: ConditionReader) -> float | None:
    """Return the time at which an event starts, s; None if it is unknown before the run."""
    try:
        base, steps = _Order(events, reader).start_of(event)
    except (NotExpressed, NeverStarts, RecursionError):
        return None
    if base is not None or len(steps) > 1:
        return None
    if not steps:
        return 0.0
    condition, delay_s = steps[0].condition, steps[0].delay_s
    if condition is None:
        return delay_s
    if not isinstance(condition, m.Comparison) or not isinstance(condition.left, m.Measure):
        return None
    waits = condition.left.what == "time" and condition.op in (">", ">=")
    return si_of(condition.right) + delay_s if waits else None


def at_once(events: Sequence[Event], reader: ConditionReader) -> list[Event]:
    """Return the events that start with the run."""
    order = _Order(events, reader)
    immediate = []
    for event in events:
        try:
            if order.start_of(event) == (None, ()):
                immediate.append(event)
        except (NotExpressed, NeverStarts, RecursionError):
            continue
    return immediate


Begin = tuple[Event | None, tuple[Step, ...]]
"""The event whose end must come first, and the steps after it."""


class _Order:
    """The start of each event, resolved on demand."""

    def __init__(self, events: Sequence[Event], reader: ConditionReader) -> None:
        self._events, self._reader = events, reader
        self._begins: dict[int, Begin] = {}
        self._working: set[int] = set()

    def start_of(self, event: Event) -> Begin:
        if event.lost:
            raise NotExpressed("events that wait for what is lost")
        if event.never:
            raise NeverStarts
        if id(event) in self._begins:
            return self._begins[id(event)]
        if id(event) in self._working:
            raise NotExpressed("events that wait for each other")
        self._working.add(id(event))
        try:
            base, steps = self._begin(event)
            begin = base, self._reader.sharpened(steps, from_the_start=base is None)
            self._begins[id(event)] = begin
        finally:
            self._working.discard(id(event))
        return begin

    def _begin(self, event: Event) -> Begin:
        own = self._reader.start(event.trigger)
        act = self._act_begin(event.act)
        if own.after is None or self._is_own_start(event, own.after):
            return act[0], act[1] + own.steps
        base, steps = self._after(own.after, event)
        inside = base is not None and base.act is event.act
        if not inside and (act[0] is not None or act[1]) and not self._same_act(event, own.after):
            raise NotExpressed("triggers of acts and their events that both wait")
        return base, steps + own.steps

    def _act_begin(self, act: Element | None) -> Begin:
        if act is None:
            return None, ()
        start = self._reader.start(act.find("StartTrigger"))
        if start.after is None:
            return None, start.steps
        base, steps = self._after(start.after, None, act)
        return base, steps + start.steps

    @staticmethod
    def _is_own_start(event: Event, after: tuple[str, str, str]) -> bool:
        """Return whether an event waits for the start of an element that contains it, which is the act's start."""
        kind, ref, state = after
        name = ref.rpartition("::")[2]
        begins = state in (*_AT_START, "standbyState")
        return begins and any(part == name and (k == kind or not kind) and k in _OUTER for k, part in event.parts)

    def _same_act(self, event: Event, after: tuple[str, str, str]) -> bool:
        return any(other.act is event.act for other in self._meant(after))

    def _meant(self, after: tuple[str, str, str]) -> list[Event]:
        """Return the events of a part of the storyboard; its name may follow those of the containing parts (`::`)."""
        kind, ref, _ = after
        *outer, name = ref.split("::")
        typed = [e for e in self._events if (kind, name) in e.parts]
        candidates = typed or [e for e in self._events if any(part == name for _, part in e.parts)]
        within = [e for e in candidates if all(any(part == o for _, part in e.parts) for o in outer)]
        return within or candidates

    def _after(self, after: tuple[str, str, str], event: Event | None, act: Element | None = None) -> Begin:
        kind, _, state = after
        meant = self._meant(after)
        if not meant or state not in (*_AT_START, *_AT_END):
            what = state if meant else "parts of the storyboard that do not exist"
            raise NotExpressed(f"events that wait for {what or 'a state'}")
        if state in _AT_START:
            if kind in _OUTER:
                return self._act_begin(meant[0].act) if meant[0].act is not act else (None, ())
            return self.start_of(meant[0])
        if event in meant:
            raise NotExpressed("events that wait for their own end")
        last = self._last(meant)
        self.start_of(last)
        return last, ()

    def _last(self, events: list[Event]) -> Event:
        """Return the event whose end is the end of all of them: the last of a chain."""
        ends = [e for e in events if not any(self._waits_for(other, e) for other in events if other is not e)]
        if len(events) > 1 and len(ends) != 1:
            raise NotExpressed("events that wait for the end of several others")
        return ends[0] if ends else events[0]

    def _waits_for(self, event: Event, other: Event) -> bool:
        try:
            base, _ = self.start_of(event)
        except (NotExpressed, NeverStarts):
            return False
        return base is other
