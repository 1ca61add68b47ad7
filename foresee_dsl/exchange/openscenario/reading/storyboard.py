"""The storyboard as a list of events: which actors do what, from which condition or end of another event on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.exchange.naming import number, quantity
from foresee_dsl.exchange.openscenario.reading.entities import Entity
from foresee_dsl.exchange.openscenario.reading.places import Places
from foresee_dsl.exchange.openscenario.reading.source import Source
from foresee_dsl.exchange.outcome import NotExpressed
from foresee_dsl.language import model as m
from foresee_dsl.language.units import Dimension

Op = Literal["<", "<=", ">", ">="]
_RULES: Mapping[str, Op] = {
    "lessThan": "<",
    "lessOrEqual": "<=",
    "greaterThan": ">",
    "greaterOrEqual": ">=",
    "equalTo": ">=",  # of what grows: time; others are refused below
}
STANDS_MPS = 0.1
"""A slower entity stands (ours: the resolution of a change of speed that is complete)."""


@dataclass(frozen=True)
class Start:
    """When an event starts.

    Attributes:
        condition: None for at once. delay_s: so much later.
        after: (element's name, state) of the part of the storyboard that it waits for, or None.
    """

    condition: m.Condition | None = None
    delay_s: float = 0.0
    after: tuple[str, str] | None = None


@dataclass(frozen=True)
class ConditionReader:
    """Reads triggers; `entities` and `places` say what they name."""

    entities: Mapping[str, Entity]
    places: Places

    def start(self, trigger: Element | None) -> Start:
        """Return what a `<StartTrigger>` means; no trigger, or an empty one, is at once."""
        groups = trigger.findall("ConditionGroup") if trigger is not None else []
        starts = [self._group(group) for group in groups]
        if not starts:
            return Start()
        if len(starts) == 1:
            return starts[0]
        if any(s.after or s.delay_s for s in starts):
            raise NotExpressed("triggers of several groups with delays or states of the storyboard")
        parts = [s.condition for s in starts]
        return Start() if None in parts else Start(m.Either(conditions=tuple(p for p in parts if p is not None)))

    def _group(self, group: Element) -> Start:
        parts: list[m.Condition] = []
        after: tuple[str, str] | None = None
        delays: set[float] = set()
        for condition in group.iterfind("Condition"):
            state = condition.find("ByValueCondition/StoryboardElementStateCondition")
            delays.add(number(condition, "delay", 0.0))
            if state is not None:
                if after is not None:
                    raise NotExpressed("triggers on several states of the storyboard")
                after = state.get("storyboardElementRef", ""), state.get("state", "")
            elif (part := self._condition(condition)) is not None:
                parts.append(part)
        if len(delays) > 1:
            raise NotExpressed("triggers of conditions with different delays")
        joined = parts[0] if len(parts) == 1 else m.Both(conditions=tuple(parts)) if parts else None
        return Start(joined, max(delays, default=0.0), after)

    def _condition(self, condition: Element) -> m.Condition | None:
        """Return one condition; None for one that holds from the beginning."""
        if condition.get("conditionEdge") in ("falling", "risingOrFalling"):
            raise NotExpressed(f"conditions with the edge {condition.get('conditionEdge')}")
        value = condition.find("ByValueCondition")
        if value is not None:
            kind = next(iter(value), None)
            if kind is None or kind.tag != "SimulationTimeCondition":
                raise NotExpressed(f"conditions: {'none' if kind is None else kind.tag}")
            limit, op = number(kind, "value"), _rule(kind, equal=True)
            if limit <= 0 and op in (">", ">="):
                return None
            return m.Comparison(left=m.Measure(what="time"), op=op, right=quantity(limit, "time"))
        return self._of_entities(condition)

    def _of_entities(self, condition: Element) -> m.Condition:
        kind = next(iter(condition.find("ByEntityCondition/EntityCondition") or ()), None)
        if kind is None:
            raise NotExpressed("conditions: without content")
        who = condition.find("ByEntityCondition/TriggeringEntities")
        refs = [e.get("entityRef", "") for e in who.iterfind("EntityRef")] if who is not None else []
        parts = tuple(self._of_entity(kind, self._entity(ref)) for ref in refs)
        if not parts:
            raise NotExpressed("conditions: of no entity")
        if len(parts) == 1:
            return parts[0]
        every = who is not None and who.get("triggeringEntitiesRule") == "all"
        return m.Both(conditions=parts) if every else m.Either(conditions=parts)

    def _of_entity(self, kind: Element, entity: Entity) -> m.Condition:
        name, tag = entity.name, kind.tag
        if tag in ("SpeedCondition", "AccelerationCondition"):
            if kind.get("direction") not in (None, "longitudinal"):
                raise NotExpressed(f"conditions: {tag} ({kind.get('direction')})")
            what: Literal["speed", "acceleration"] = "speed" if tag == "SpeedCondition" else "acceleration"
            left = m.Measure(what=what, actor=name)
            return m.Comparison(left=left, op=_rule(kind), right=quantity(number(kind, "value"), what))
        if tag == "StandStillCondition":
            stands = m.Comparison(left=m.Measure(what="speed", actor=name), op="<", right=quantity(STANDS_MPS, "speed"))
            return m.Sustained(condition=stands, duration=quantity(number(kind, "duration"), "time"))
        if tag == "CollisionCondition":
            other = kind.find("EntityRef")
            if other is None:
                return m.Predicate(what="collision", actor=name)
            touches = m.Named(name=self._entity(other.get("entityRef", "")).name)
            return m.Within(actor=name, distance=quantity(0.0, "length"), of=touches)
        if tag in ("ReachPositionCondition", "DistanceCondition"):
            return self._near_place(kind, name)
        return self._between(kind, name)

    def _between(self, kind: Element, name: str) -> m.Condition:
        """Return a condition between two entities."""
        measures: Mapping[str, tuple[Literal["distance", "ttc", "headway"], Dimension]] = {
            "RelativeDistanceCondition": ("distance", "length"),
            "TimeToCollisionCondition": ("ttc", "time"),
            "TimeHeadwayCondition": ("headway", "time"),
        }
        if kind.tag not in measures:
            raise NotExpressed(f"conditions: {kind.tag}")
        target = kind.find("TimeToCollisionConditionTarget/EntityRef")
        ref = kind.get("entityRef") or (target.get("entityRef") if target is not None else None)
        if ref is None:
            raise NotExpressed(f"conditions: {kind.tag} (with a place)")
        if kind.get("relativeDistanceType") == "lateral":
            raise NotExpressed(f"conditions: {kind.tag} (lateral)")
        what, dimension = measures[kind.tag]
        value, other = number(kind, "value"), self._entity(ref)
        return m.Comparison(
            left=m.Measure(what=what, actor=name, other=other.name), op=_rule(kind), right=quantity(value, dimension)
        )

    def _near_place(self, kind: Element, name: str) -> m.Condition:
        position = kind.find("Position")
        if position is None:
            raise NotExpressed(f"conditions: {kind.tag} (without a place)")
        pose = self.places.pose(position)
        reach = kind.tag == "ReachPositionCondition"
        distance = number(kind, "tolerance" if reach else "value")
        at = m.Point(x=quantity(pose.x, "length"), y=quantity(pose.y, "length"))
        near = m.Within(actor=name, distance=quantity(max(distance, 0.0), "length"), of=at)
        return near if reach or _rule(kind) in ("<", "<=") else m.Not(condition=near)

    def _entity(self, ref: str) -> Entity:
        if ref not in self.entities:
            raise NotExpressed("conditions about entities that were left out")
        return self.entities[ref]


def _rule(kind: Element, *, equal: bool = False) -> Op:
    rule = kind.get("rule", "")
    if rule not in _RULES or (rule == "equalTo" and not equal):
        raise NotExpressed(f"conditions: the rule {rule or '(none)'}")
    return _RULES[rule]


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
    condition: m.Condition | None
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
                left_out["maneuvers of the entities that trigger them"] += 1
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
    joined = parts[0] if len(parts) == 1 else m.Both(conditions=parts) if parts else None
    return Start(joined, act.delay_s or event.delay_s, act.after or event.after)
