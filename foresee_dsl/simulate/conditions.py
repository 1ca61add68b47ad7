"""Evaluates conditions against the running world; their definitions are those of `language.model.conditions`."""

from __future__ import annotations

import math
from collections.abc import Callable

from foresee_dsl.language.model import Both, Comparison, Condition, Either, Measure, Not, Predicate, Ref
from foresee_dsl.simulate.actors import Walker
from foresee_dsl.simulate.cast import Cast
from foresee_dsl.simulate.collision import box_distance, overlaps
from foresee_dsl.simulate.metrics import eta, ttc
from foresee_dsl.simulate.state import Mobile

Outcome = tuple[bool, float] | None
"""Whether a condition holds and by how much (NaN where there is no number); None where it cannot be said, because an
actor is not there or does not come to the junction."""


class Conditions:
    """Answers conditions about a cast at the frame that it is at."""

    def __init__(self, cast: Cast) -> None:
        """Watch a cast."""
        self._cast = cast
        self._measures: dict[str, Callable[[Measure], float]] = {
            "time": lambda _: cast.time_s,
            "speed": self._speed,
            "eta": self._eta,
            "distance": self._distance,
            "ttc": self._ttc,
        }

    def holds(self, condition: Condition) -> bool:
        """Whether a condition holds now; False where it cannot be said."""
        outcome = self.outcome(condition)
        return outcome is not None and outcome[0]

    def outcome(self, condition: Condition) -> Outcome:
        """Return whether a condition holds now and by how much, in its own unit."""
        match condition:
            case Comparison():
                return self._compare(condition)
            case Predicate(what="collision"):
                return self._touches(condition.actor), math.nan
            case Predicate():
                return self.arrived(condition.actor), math.nan
            case Not():
                inner = self.outcome(condition.condition)
                return None if inner is None else (not inner[0], -inner[1])
            case Both():
                return self._join(condition.conditions, all, min)
            case Either():
                return self._join(condition.conditions, any, max)

    def value(self, measure: Measure) -> float:
        """Return a measure's value now, NaN where there is none."""
        return self._measures[measure.what](measure)

    def arrived(self, name: str) -> bool:
        """Whether an actor has reached its goal: the ego's point, a path's end, the end of a route."""
        actor = self._cast.by_id[name]
        if actor is self._cast.ego:
            return self._cast.progress.of(actor, self._cast.frame)[0] >= self._cast.scene.goal_s
        if isinstance(actor, Walker):
            return actor.follower.arrived
        return not actor.present

    def _compare(self, comparison: Comparison) -> Outcome:
        right = comparison.right
        if isinstance(right, Ref):  # a concrete scenario has none left
            raise TypeError(f"the parameter {right.name} has no value")
        left = self.value(comparison.left)
        if math.isnan(left):
            return None
        slack = left - right.si if comparison.op[0] == ">" else right.si - left
        return (slack >= 0 if comparison.op[-1] == "=" else slack > 0), slack

    def _join(
        self,
        conditions: tuple[Condition, ...],
        decide: Callable[[list[bool]], bool],
        bound: Callable[[list[float]], float],
    ) -> Outcome:
        outcomes = [self.outcome(c) for c in conditions]
        known = [o for o in outcomes if o is not None]
        if len(known) < len(outcomes):  # what cannot be said does not hold
            known.extend([(False, math.nan)] * (len(outcomes) - len(known)))
        margins = [margin for _, margin in known]
        margin = math.nan if any(math.isnan(m) for m in margins) else bound(margins)
        return decide([held for held, _ in known]), margin

    def _actor(self, name: str | None) -> Mobile | None:
        actor = self._cast.by_id.get(name or "")
        return actor if actor is not None and actor.present else None

    def _speed(self, measure: Measure) -> float:
        actor = self._actor(measure.actor)
        return math.nan if actor is None else actor.speed

    def _eta(self, measure: Measure) -> float:
        actor = self._actor(measure.actor)
        if actor is None:
            return math.nan
        room = self._cast.progress.to_junction(actor, measure.other or "", self._cast.frame)
        return math.inf if math.isnan(room) else eta(room, actor.speed)

    def _distance(self, measure: Measure) -> float:
        actor = self._actor(measure.actor)
        if actor is None:
            return math.nan
        if measure.other not in self._cast.by_id:
            return self._cast.progress.to_junction(actor, measure.other or "", self._cast.frame)
        other = self._actor(measure.other)
        return math.nan if other is None else box_distance(actor.box, other.box)

    def _ttc(self, measure: Measure) -> float:
        actor, other = self._actor(measure.actor), self._actor(measure.other)
        return math.nan if actor is None or other is None else ttc(actor.mover, other.mover)

    def _touches(self, name: str) -> bool:
        actor = self._actor(name)
        return actor is not None and any(overlaps(actor.box, other.box) for other in self._cast.others(actor))
