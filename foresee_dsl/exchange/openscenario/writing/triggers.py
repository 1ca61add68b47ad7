"""Conditions of the language as start triggers of OpenSCENARIO, as far as it has them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.exchange.openscenario.writing.library import Xosc, figure, osc, world
from foresee_dsl.exchange.outcome import NotExpressed
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of

_NEGATED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
_RULES = {"<": "lessThan", "<=": "lessOrEqual", ">": "greaterThan", ">=": "greaterOrEqual"}
_MOST_GROUPS = 16
"""A condition that would need more alternatives is timed instead (ours)."""

Make = Callable[[str], Xosc]
"""Makes one `<Condition>` with a name."""


@dataclass(frozen=True)
class Conditions:
    """Translates conditions about actors; `places` as in `Scene.places`."""

    actors: Collection[str]
    places: Mapping[m.Place, XY]

    def groups(self, condition: m.Condition) -> list[list[Make]]:
        """Return alternatives, each a list of conditions that hold together.

        Raises:
            NotExpressed: OpenSCENARIO has no such condition.
        """
        found = self._groups(condition, negated=False)
        if len(found) > _MOST_GROUPS:
            raise NotExpressed("conditions with many alternatives")
        return found

    def _groups(self, condition: m.Condition, *, negated: bool) -> list[list[Make]]:
        if isinstance(condition, m.Not):
            return self._groups(condition.condition, negated=not negated)
        if isinstance(condition, m.Both | m.Either):
            parts = [self._groups(part, negated=negated) for part in condition.conditions]
            if isinstance(condition, m.Either) != negated:
                return [group for part in parts for group in part]
            return [list(itertools.chain(*choice)) for choice in itertools.islice(itertools.product(*parts), 100)]
        if isinstance(condition, m.Comparison):
            return [[self._comparison(condition, negated=negated)]]
        if isinstance(condition, m.Within):
            return [[self._within(condition, negated=negated)]]
        raise NotExpressed(f"conditions: {condition.kind}")

    def _comparison(self, condition: m.Comparison, *, negated: bool) -> Make:
        left = condition.left
        if not isinstance(left, m.Measure):
            raise NotExpressed("conditions: parameters")
        value = figure(si_of(condition.right))
        rule = getattr(osc.Rule, _RULES[_NEGATED[condition.op] if negated else condition.op])
        if left.what == "time":
            return _by_value(osc.SimulationTimeCondition(value, rule))
        actor = left.actor or ""
        if left.what == "speed":
            return self._by_entity(actor, osc.SpeedCondition(value, rule))
        if left.what == "acceleration":
            along = osc.DirectionalDimension.longitudinal
            return self._by_entity(actor, osc.AccelerationCondition(value, rule, along))
        other = str(left.other)
        if other not in self.actors or left.what == "eta":
            raise NotExpressed(f"conditions: {left.what} to a junction")
        around = osc.RelativeDistanceType.euclidianDistance
        if left.what == "distance":
            made = osc.RelativeDistanceCondition(value, rule, around, other)
        elif left.what == "ttc":
            made = osc.TimeToCollisionCondition(value, rule, False, True, other, distance_type=around)
        else:
            made = osc.TimeHeadwayCondition(other, value, rule, False, True, around)
        return self._by_entity(actor, made)

    def _within(self, condition: m.Within, *, negated: bool) -> Make:
        value = figure(si_of(condition.distance))
        rule = osc.Rule.greaterThan if negated else osc.Rule.lessOrEqual
        around = osc.RelativeDistanceType.euclidianDistance
        if isinstance(condition.of, m.Named):
            other = str(condition.of.name)
            if other not in self.actors:
                raise NotExpressed("conditions: within a distance of a junction")
            return self._by_entity(condition.actor, osc.RelativeDistanceCondition(value, rule, around, other))
        at = condition.of
        x, y = (si_of(at.x), si_of(at.y)) if isinstance(at, m.Point) else self.places[at]
        return self._by_entity(condition.actor, osc.DistanceCondition(value, rule, world(x, y), False, True, around))

    def _by_entity(self, actor: str, condition: Xosc) -> Make:
        if actor not in self.actors:
            raise NotExpressed("conditions about actors that are not there")
        return lambda name: osc.EntityTrigger(name, 0, osc.ConditionEdge.none, condition, actor)


def completed(event: str) -> Make:
    """Return the condition that an event is over."""
    kind, state = osc.StoryboardElementType.event, osc.StoryboardElementState.completeState
    return _by_value(osc.StoryboardElementStateCondition(kind, event, state))


def at(time_s: float) -> Make:
    """Return the condition that a time has come."""
    return _by_value(osc.SimulationTimeCondition(figure(time_s), osc.Rule.greaterOrEqual))


def trigger(groups: list[list[Make]], name: str) -> Xosc:
    """Return a start trigger of alternatives."""
    made = osc.Trigger()
    for k, group in enumerate(groups):
        one = osc.ConditionGroup()
        for n, make in enumerate(group):
            one.add_condition(make(f"{name}_{k + 1}_{n + 1}"))
        made.add_conditiongroup(one)
    return made


def _by_value(condition: Xosc) -> Make:
    return lambda name: osc.ValueTrigger(name, 0, osc.ConditionEdge.none, condition)
