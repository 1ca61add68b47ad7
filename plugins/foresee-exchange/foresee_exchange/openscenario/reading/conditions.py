"""Triggers of OpenSCENARIO as conditions of the language, and the steps in which an event waits for them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import shapely

from foresee_dsl.compile.bundle import ActorKind
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language import model as m
from foresee_dsl.language.units import Dimension
from foresee_dsl.simulate.trace import STEP_S
from foresee_exchange.naming import number, quantity
from foresee_exchange.openscenario.losses import Losses, NotExpressed
from foresee_exchange.openscenario.reading.beginnings import Beginning, holds_at_start
from foresee_exchange.openscenario.reading.entities import Entity
from foresee_exchange.openscenario.reading.places import Places, point_of

Op = Literal["<", "<=", ">", ">="]
_RULES: Mapping[str, Op] = {"lessThan": "<", "lessOrEqual": "<=", "greaterThan": ">", "greaterOrEqual": ">="}
_SIGN_CHANGED: Mapping[Op, Op] = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
"""The comparison that results when both sides change their sign."""
_SAME = {"speed": 0.1, "acceleration": 0.1, "length": 0.5, "time": 0.05}
"""Tolerance of `equalTo` in SI units (ours: a frame of time; the accuracy of speed changes)."""
_BESIDE_M = 5.0
"""Lateral distance from the route up to which a covered distance is noticed, m (ours: slightly more than a lane)."""
_NO_COLLISION_S = 3600.0
"""A time to collision of at least this value, s, means that there is no collision (ours: longer than any run)."""
_BY_TYPE: Mapping[str, tuple[ActorKind, ...]] = {
    "vehicle": ("car", "van", "truck", "bus", "motorcycle", "bicycle"),
    "pedestrian": ("pedestrian",),
    "miscellaneous": ("obstacle",),
}


class NeverStarts(Exception):  # noqa: N818 - not an error: events that wait for it never happen
    """A condition that never holds."""


@dataclass(frozen=True)
class Step:
    """A step in which an event waits: for a condition (None: no condition), then for a time.

    Attributes:
        edge: for a condition with an edge, a condition that holds only when that one begins to hold; it replaces
            `condition` if that may already hold when the wait begins.
    """

    condition: m.Condition | None = None
    delay_s: float = 0.0
    edge: m.Condition | None = None


@dataclass(frozen=True)
class Start:
    """The point at which something starts: when a part of the storyboard (type, name) has reached a state, if `after`
    has one, and the steps have then happened in their order.
    """

    steps: tuple[Step, ...] = ()
    after: tuple[str, str, str] | None = None


@dataclass(frozen=True)
class RemainingWay:
    """The remaining way of an actor from its start: length, m, and the points of a path (empty for a route)."""

    length_m: float
    points: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class ConditionReader:
    """Translates triggers into conditions of the language.

    Attributes:
        entities, places: those that triggers may name. ways: remaining ways of actors, by their new names.
        values: values of parameters and variables. changing: names of the parameters and variables that actions change.
            beginnings: beginnings of actors, by their new names.
    """

    entities: Mapping[str, Entity]
    places: Places
    losses: Losses
    ways: Mapping[str, RemainingWay] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)
    changing: Set[str] = frozenset()
    beginnings: Mapping[str, Beginning] = field(default_factory=dict)

    def start(self, trigger: Element | None) -> Start:
        """Return the start that a `<StartTrigger>` describes; no trigger, or an empty one, means at once.

        Raises:
            NotExpressed: it has no counterpart in the language. NeverStarts: it never holds.
        """
        groups = trigger.findall("ConditionGroup") if trigger is not None else []
        starts = []
        for group in groups:
            try:
                starts.append(self._group(group))
            except NeverStarts:
                continue
        if groups and not starts:
            raise NeverStarts
        if len(starts) <= 1:
            return starts[0] if starts else Start()
        if any(start == Start() for start in starts):
            return Start()
        parts: list[m.Condition] = []
        edges: list[m.Condition] = []
        for start in starts:
            step = start.steps[0] if len(start.steps) == 1 else Step()
            if start.after is not None or step.condition is None or step.delay_s:
                raise NotExpressed("triggers of several groups with delays, falling edges or states of the storyboard")
            parts.append(step.condition)
            edges.append(step.edge or step.condition)
        either = m.Either(conditions=tuple(parts))
        return Start((Step(either, edge=m.Either(conditions=tuple(edges)) if edges != parts else None),))

    def sharpened(self, steps: Sequence[Step], *, from_the_start: bool) -> tuple[Step, ...]:
        """Return steps in which a rising edge is explicit if the condition may already hold when the wait begins.

        `from_the_start`: the first step waits from the beginning of the run.
        """
        sharp_steps = []
        for k, step in enumerate(steps):
            condition = step.condition
            begins = k == 0 and from_the_start
            if step.edge is not None and not (begins and self._false_at_start(condition)):
                condition = step.edge
            sharp_steps.append(Step(condition, step.delay_s))
        return tuple(sharp_steps)

    def _false_at_start(self, condition: m.Condition | None) -> bool:
        return condition is not None and holds_at_start(condition, self.beginnings) is False

    def _group(self, group: Element) -> Start:
        """Return the `Start` that a group of conditions describes; all of its conditions must hold at once."""
        parts: list[tuple[m.Condition, str]] = []
        after: tuple[str, str, str] | None = None
        after_delay, delays = 0.0, set[float]()
        for condition in group.iterfind("Condition"):
            delay = max(number(condition, "delay", 0.0), 0.0)
            state = condition.find("ByValueCondition/StoryboardElementStateCondition")
            if state is not None:
                if after is not None:
                    raise NotExpressed("triggers on several states of the storyboard")
                kind, ref = state.get("storyboardElementType", ""), state.get("storyboardElementRef", "")
                after, after_delay = (kind, ref, state.get("state", "")), delay
                continue
            part = self._condition(condition, delay)
            if part is None:
                continue
            if condition.find("ByValueCondition/SimulationTimeCondition") is None:
                delays.add(delay)
            covered = condition.find("ByEntityCondition/EntityCondition/TraveledDistanceCondition")
            never_before = (
                covered is not None and number(covered, "value") > 0
            )  # a covered distance is reached once, after the start
            edge = condition.get("conditionEdge", "none")
            parts.append((part, "none" if never_before and edge == "rising" else edge))
        if len(delays) > 1:
            raise NotExpressed("triggers of conditions with different delays")
        steps: list[Step] = [Step(None, after_delay)] if after_delay else []
        if parts:
            steps += _steps(parts, max(delays, default=0.0))
        return Start(tuple(steps), after)

    def _condition(self, condition: Element, delay: float) -> m.Condition | None:
        """Return one condition; None if it always holds. `delay` is added to a condition on the simulation time."""
        value = condition.find("ByValueCondition")
        if value is None:
            return self._of_entities(condition)
        kind = next(iter(value), None)
        if kind is None:
            raise NotExpressed("conditions: none")
        if kind.tag in ("ParameterCondition", "VariableCondition"):
            self._decide(kind)
            return None
        if kind.tag != "SimulationTimeCondition":
            raise NotExpressed(f"conditions: {kind.tag}{_called(kind)}")
        limit, rule = number(kind, "value") + delay, kind.get("rule", "")
        # The simulation time reaches the value once, and increases further.
        op: Op = ">=" if rule == "equalTo" else _op(rule)
        if limit <= 0 and op in (">", ">="):
            if op == ">=" and condition.get("conditionEdge", "none") != "none":
                self.losses.note("a time of 0 s with an edge is the beginning, as ASAM's examples mean it")
            return None
        if limit <= 0:
            raise NeverStarts
        return m.Comparison(left=m.Measure(what="time"), op=op, right=quantity(limit, "time"))

    def _decide(self, kind: Element) -> None:
        """Evaluate a condition on a parameter or variable whose value never changes."""
        name = kind.get("parameterRef") or kind.get("variableRef") or ""
        if name not in self.values:
            raise NotExpressed(f"conditions: {kind.tag} (of '{name}', which is not declared)")
        if name in self.changing:
            raise NotExpressed(f"conditions: {kind.tag} (of '{name}', which actions change)")
        if not _compares(self.values[name], kind.get("rule", ""), kind.get("value", "")):
            raise NeverStarts

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
            return _compared(m.Measure(what=what, actor=name), kind.get("rule", ""), number(kind, "value"), what)
        if tag == "StandStillCondition":
            stands = m.Comparison(left=m.Measure(what="speed", actor=name), op="<", right=quantity(STANDS_MPS, "speed"))
            duration = number(kind, "duration")
            return m.Sustained(condition=stands, duration=quantity(duration, "time")) if duration > 0 else stands
        if tag == "CollisionCondition":
            return self._touches(kind, name)
        if tag == "TraveledDistanceCondition":
            return self._covered(entity, number(kind, "value"))
        if tag in ("ReachPositionCondition", "DistanceCondition"):
            return self._near_place(kind, entity)
        return self._between(kind, entity)

    def _touches(self, kind: Element, name: str) -> m.Condition:
        other, of_type = kind.find("EntityRef"), kind.find("ByType")
        if other is not None:
            named = [self._entity(other.get("entityRef", "")).name]
        elif of_type is not None:
            kinds = _BY_TYPE.get(of_type.get("type", ""), ())
            named = [e.name for e in self.entities.values() if e.kind in kinds and e.name != name]
            if not named:
                raise NeverStarts
        else:
            return m.Predicate(what="collision", actor=name)
        touching = tuple(
            m.Within(actor=name, distance=quantity(0.0, "length"), of=m.Named(name=other)) for other in named
        )
        return touching[0] if len(touching) == 1 else m.Either(conditions=touching)

    def _covered(self, entity: Entity, distance: float) -> m.Condition:
        """Return the condition that an actor's front has reached a distance along its way, or is just beyond it."""
        way = self.ways.get(entity.name)
        at = distance + _BESIDE_M - 1.0
        if way is None or not 0 <= distance < way.length_m:
            raise NotExpressed("conditions: TraveledDistanceCondition (of an actor whose way is not known so far)")
        if not way.points:
            place = m.AlongRoute(actor=entity.name, at=quantity(min(at, way.length_m), "length"))
            return m.Within(actor=entity.name, distance=quantity(_BESIDE_M, "length"), of=place)
        there = shapely.LineString(way.points).interpolate(distance + entity.spec.length_m / 2)
        return m.Within(actor=entity.name, distance=quantity(0.2, "length"), of=point_of(Pose(there.x, there.y, 0.0)))

    def _between(self, kind: Element, entity: Entity) -> m.Condition:
        """Return a condition between two entities."""
        measures: Mapping[str, tuple[Literal["ttc", "ttc_along", "headway", "relative_speed"], Dimension]] = {
            "RelativeSpeedCondition": ("relative_speed", "speed"),
            "TimeToCollisionCondition": ("ttc", "time"),
            "TimeHeadwayCondition": ("headway", "time"),
        }
        if kind.tag not in (*measures, "RelativeDistanceCondition"):
            raise NotExpressed(f"conditions: {kind.tag}")
        target = kind.find("TimeToCollisionConditionTarget/EntityRef")
        ref = kind.get("entityRef") or (target.get("entityRef") if target is not None else None)
        if ref is None:
            raise NotExpressed(f"conditions: {kind.tag} (with a place)")
        value, rule, other = number(kind, "value"), kind.get("rule", ""), self._entity(ref)
        if kind.tag == "RelativeDistanceCondition":
            return self._apart(kind, entity, other, value, rule)
        if kind.tag == "RelativeSpeedCondition" and kind.get("direction") not in (None, "longitudinal"):
            raise NotExpressed(f"conditions: {kind.tag} ({kind.get('direction')})")
        what, dimension = measures[kind.tag]
        # Distances between reference points in OpenSCENARIO, between footprints here.
        if kind.get("freespace") == "false":
            self.losses.note("times between two actors are measured between their footprints")
        if what == "ttc" and kind.get("relativeDistanceType") == "longitudinal":
            what = "ttc_along"
        measure = m.Measure(what=what, actor=entity.name, other=other.name)
        comparison = _compared(measure, rule, value, dimension)
        if what in ("ttc", "ttc_along") and rule not in ("lessThan", "lessOrEqual", "equalTo"):
            # Without a collision ahead, the standard's condition never holds, whatever its rule.
            there_is_one = m.Comparison(left=measure, op="<", right=quantity(_NO_COLLISION_S, "time"))
            return m.Both(conditions=(comparison, there_is_one))
        if what != "headway":
            return comparison
        # There is no headway to an actor behind, so the condition must not hold then.
        if rule in ("lessThan", "lessOrEqual"):
            ahead: m.Condition = m.Not(condition=m.Behind(actor=other.name, other=entity.name))
        else:
            ahead = m.Ahead(actor=other.name, other=entity.name)
        return m.Both(conditions=(comparison, ahead))

    def _apart(self, kind: Element, entity: Entity, other: Entity, value: float, rule: str) -> m.Condition:
        """Return a comparison of the distance between two actors; distances between reference points are converted to
        distances between bumpers (or sides)."""
        which = kind.get("relativeDistanceType")
        first, second = entity.spec, other.spec
        inside = (first.width_m + second.width_m if which == "lateral" else first.length_m + second.length_m) / 2
        if kind.get("freespace") == "true":
            inside = 0.0
        if which == "longitudinal":
            return _along_the_way(m.Measure(what="overlap", actor=entity.name, other=other.name), rule, inside - value)
        value = max(value - inside, 0.0)
        if which != "lateral" and value <= 0 and rule in ("lessThan", "lessOrEqual"):
            return m.Within(actor=entity.name, distance=quantity(0.0, "length"), of=m.Named(name=other.name))
        what: Literal["lateral", "distance"] = "lateral" if which == "lateral" else "distance"
        return _compared(m.Measure(what=what, actor=entity.name, other=other.name), rule, value, "length")

    def _near_place(self, kind: Element, entity: Entity) -> m.Condition:
        position = kind.find("Position")
        if position is None:
            raise NotExpressed(f"conditions: {kind.tag} (without a place)")
        reach = kind.tag == "ReachPositionCondition"
        distance = max(number(kind, "tolerance" if reach else "value"), 0.0)
        to_points = reach or kind.get("freespace") != "true"
        if kind.get("relativeDistanceType") == "lateral":
            raise NotExpressed(f"conditions: {kind.tag} (lateral)")
        moving = self.places.by_mover(position)
        if moving is not None and not (moving.ahead_m or moving.left_m):
            rule = "lessOrEqual" if reach else kind.get("rule", "")
            return self._apart(kind, entity, self._entity(moving.entity), distance, rule)
        of: m.Point | m.AheadOf
        if moving is not None:
            other = self._entity(moving.entity)
            at = moving.ahead_m - _to_front(other)
            if to_points:
                distance, further = _of_reference_point(distance, entity)
                at += further * (1 if self._same_way(entity, other) else -1)
            offset = quantity(moving.left_m, "length") if moving.left_m else None
            of = m.AheadOf(actor=other.name, at=quantity(at, "length"), offset=offset)
        else:
            pose = self.places.pose(position)
            if to_points:
                distance, further = _of_reference_point(distance, entity)
                pose = pose.ahead(further)
            of = point_of(pose)
        near = m.Within(actor=entity.name, distance=quantity(distance, "length"), of=of)
        return near if reach or _op(kind.get("rule", "")) in ("<", "<=") else m.Not(condition=near)

    def _same_way(self, entity: Entity, other: Entity) -> bool:
        """Return whether two actors begin with about the same direction."""
        first, second = self.beginnings.get(entity.name), self.beginnings.get(other.name)
        return first is None or second is None or math.cos(first.middle.heading_rad - second.middle.heading_rad) >= 0

    def _entity(self, ref: str) -> Entity:
        if ref not in self.entities:
            raise NotExpressed("conditions about entities that were left out")
        return self.entities[ref]


def _steps(parts: Sequence[tuple[m.Condition, str]], wait_s: float) -> list[Step]:
    """Return the steps of conditions that must hold together, each with its edge.

    If several conditions have edges, they must change at the same moment, as the standard requires.
    """
    if len(parts) > 1:
        return [Step(_both([_edge(part, edge) for part, edge in parts]), wait_s)]
    ((part, edge),) = parts
    if edge == "falling":
        return [Step(part), Step(m.Not(condition=part), wait_s)]
    if edge == "risingOrFalling":
        return [Step(_edge(part, edge), wait_s)]
    return [Step(part, wait_s, _edge(part, edge) if edge == "rising" else None)]


def _edge(part: m.Condition, edge: str) -> m.Condition:
    """Return a condition that holds only at the moment at which `part` begins (or ceases) to hold: `part` holds now,
    but did not hold a frame earlier (or the reverse). With the edge `none`, return `part` itself."""
    if edge == "none":
        return part
    if edge == "risingOrFalling":
        return m.Either(conditions=(_edge(part, "rising"), _edge(part, "falling")))
    held = part if edge == "rising" else m.Not(condition=part)
    before = m.Sustained(condition=held, duration=quantity(STEP_S, "time"))
    return _both([held, m.Not(condition=before)])


def _both(parts: Sequence[m.Condition]) -> m.Condition:
    """Return the conjunction of conditions, without nested conjunctions."""
    flat = [condition for part in parts for condition in (part.conditions if isinstance(part, m.Both) else (part,))]
    return m.Both(conditions=tuple(dict.fromkeys(flat)))


def _to_front(entity: Entity) -> float:
    """Return how far the front of an entity lies ahead of its reference point, m; for one without wheels, the centre
    replaces the front."""
    return entity.centre_m + (entity.spec.length_m / 2 if entity.kind in WHEELS else 0.0)


def _of_reference_point(distance: float, entity: Entity) -> tuple[float, float]:
    """Return the distance for a footprint that corresponds to the distance of a reference point from a place, and by
    how much the place must move on, both m."""
    front = entity.centre_m + entity.spec.length_m / 2
    if distance > front:
        return distance - front, 0.0
    near = min(distance, 1.0)
    return near, front - distance + near


def _along_the_way(overlap: m.Measure, rule: str, value: float) -> m.Condition:
    """Return a comparison of the distance along the way, which is the negative of the overlap along it."""
    if rule in ("equalTo", "notEqualTo"):
        low, high = (quantity(value + by, "length") for by in (-_SAME["length"], _SAME["length"]))
        parts = (m.Comparison(left=overlap, op=">=", right=low), m.Comparison(left=overlap, op="<=", right=high))
        equal = m.Both(conditions=parts)
        return equal if rule == "equalTo" else m.Not(condition=equal)
    return m.Comparison(left=overlap, op=_SIGN_CHANGED[_op(rule)], right=quantity(value, "length"))


def _compared(left: m.Measure, rule: str, value: float, dimension: Dimension) -> m.Condition:
    """Return a comparison; `equalTo` becomes a range as narrow as a run can resolve."""
    if rule not in ("equalTo", "notEqualTo"):
        return m.Comparison(left=left, op=_op(rule), right=quantity(value, dimension))
    slack = _SAME[dimension]
    low = m.Comparison(left=left, op=">=", right=quantity(value - slack, dimension))
    high = m.Comparison(left=left, op="<=", right=quantity(value + slack, dimension))
    parts: tuple[m.Condition, ...] = (low, high) if value - slack > 0 or dimension == "acceleration" else (high,)
    equal: m.Condition = m.Both(conditions=parts) if len(parts) > 1 else high
    return equal if rule == "equalTo" else m.Not(condition=equal)


def _op(rule: str) -> Op:
    if rule not in _RULES:
        raise NotExpressed(f"conditions: the rule {rule or '(none)'}")
    return _RULES[rule]


def _called(kind: Element) -> str:
    """Return the name in a condition, in quotes, for conditions that only the file's author can explain."""
    name = kind.get("name")
    return f" '{name}'" if name else ""


def _compares(value: str, rule: str, with_: str) -> bool:
    """Return the result of comparing a parameter's value with another value: as numbers if both are numbers."""
    try:
        off = float(value) - float(with_)
    except ValueError:
        if rule not in ("equalTo", "notEqualTo"):
            raise NotExpressed(f"conditions: ParameterCondition (the rule {rule} for words)") from None
        return (value == with_) == (rule == "equalTo")
    holds = {
        "equalTo": off == 0, "notEqualTo": off != 0, "lessThan": off < 0, "lessOrEqual": off <= 0,
        "greaterThan": off > 0, "greaterOrEqual": off >= 0,
    }  # fmt: skip
    if rule not in holds:
        raise NotExpressed(f"conditions: the rule {rule or '(none)'}")
    return holds[rule]
