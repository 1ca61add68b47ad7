"""Evaluates conditions against the running world; their definitions are those of `language.model.conditions`.

What cannot be said, because an actor is not there or does not come to the junction, has no outcome and does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.kernels.boxes import box_distance, overlaps
from foresee_dsl.language.model import (
    Comparison,
    Condition,
    Equals,
    InJunction,
    Measure,
    Named,
    Point,
    Predicate,
    Quantity,
    Ref,
    Shows,
    Within,
)
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.results.junction_outlines import Outlines, point_distance
from foresee_dsl.simulate.results.metrics import SLOWEST_MPS, eta, ttc
from foresee_dsl.simulate.triggers.robustness import Outcome


class Conditions:
    """Answers what can be said of a single frame about a simulation; `watch` makes whole conditions of it.

    Args:
        simulation: at the frame that is asked about.
        signals: the bundle's, by junction.
    """

    def __init__(self, simulation: Simulation, signals: Mapping[str, Signal]) -> None:
        self._simulation, self._signals = simulation, signals
        self._outlines = Outlines(simulation.network)
        self.ego_hit: bool | None = None
        """Whether the ego touches anything at this frame, where that is known already."""
        self._measures: dict[str, Callable[[Measure], float]] = {
            "time": lambda _: simulation.time_s,
            "speed": self._speed,
            "acceleration": self._acceleration,
            "eta": self._eta,
            "distance": self._distance,
            "ttc": self._ttc,
            "headway": self._headway,
        }
        self._facts: dict[type, Callable[..., Outcome | None]] = {
            Comparison: self._compare,
            Predicate: self._predicate,
            InJunction: self._in_junction,
            Within: self._within,
            Shows: self._shows,
        }

    @property
    def frame(self) -> int:
        """The frame that the simulation is at."""
        return self._simulation.frame

    @property
    def time_s(self) -> float:
        """Its time."""
        return self._simulation.time_s

    def outcome(self, condition: Condition) -> Outcome | None:
        """Return whether an innermost condition holds now and by how much; None where it cannot be said.

        Raises:
            TypeError: it is one of a `require`, about parameters.
        """
        if isinstance(condition, Equals):
            raise TypeError("a condition about a parameter says nothing about a run")
        return self._facts[type(condition)](condition)

    def value(self, measure: Measure) -> float:
        """Return a measure's value now, NaN where there is none."""
        return self._measures[measure.what](measure)

    def arrived(self, name: str) -> bool:
        """Whether an actor has reached its goal: the ego's point, a path's end, the end of a route."""
        actor = self._simulation.by_id.get(name)
        if actor is None:
            return False
        if actor is self._simulation.ego:
            return self._simulation.progress.of(actor, self._simulation.frame)[0] >= self._simulation.scene.goal_s
        if isinstance(actor, PathActor):
            return actor.follower.arrived
        return not actor.present

    # --- facts -----------------------------------------------------------------------------------------------------

    def _compare(self, comparison: Comparison) -> Outcome | None:
        if isinstance(comparison.left, Ref):
            raise TypeError(f"the parameter {comparison.left.name} says nothing about a run")
        left, right = self.value(comparison.left), si_of(comparison.right)
        if math.isnan(left):
            return None
        slack = left - right if comparison.op[0] == ">" else right - left
        return _judged(comparison, slack >= 0 if comparison.op[-1] == "=" else slack > 0, slack, comparison.right)

    def _predicate(self, predicate: Predicate) -> Outcome:
        if predicate.what == "arrived":
            return Outcome(self.arrived(predicate.actor), decides=predicate)
        if predicate.actor == "ego" and self.ego_hit is not None:
            return Outcome(self.ego_hit, decides=predicate)
        actor = self._actor(predicate.actor)
        hit = actor is not None and any(overlaps(actor.box, other.box) for other in self._simulation.others(actor))
        return Outcome(hit, decides=predicate)

    def _in_junction(self, condition: InJunction) -> Outcome | None:
        actor = self._actor(condition.actor)
        if actor is None:
            return None
        if condition.junction is None:
            away = self._outlines.nearest(actor.box)
        else:
            away = self._outlines.distance(actor.box, word_of(condition.junction))
        if math.isnan(away):
            return None
        if away > 0:
            return Outcome(False, -away, "m", condition, "length")
        return Outcome(True, decides=condition)  # how deep it is inside means nothing

    def _within(self, condition: Within) -> Outcome | None:
        actor = self._actor(condition.actor)
        away = math.nan if actor is None else self._away(actor, condition)
        if math.isnan(away):
            return None
        slack = si_of(condition.distance) - away
        return _judged(condition, slack >= 0, slack, condition.distance)

    def _away(self, actor: Actor, condition: Within) -> float:
        of = condition.of
        if isinstance(of, Named):
            name = word_of(of.name)
            if name not in self._simulation.by_id and name in self._simulation.network.junctions:
                return self._outlines.distance(actor.box, name)
            other = self._actor(name)
            return math.nan if other is None else box_distance(actor.box, other.box)
        x, y = (si_of(of.x), si_of(of.y)) if isinstance(of, Point) else self._simulation.scene.places[of]
        return point_distance(actor.box, x, y)

    def _shows(self, condition: Shows) -> Outcome | None:
        junction, state = word_of(condition.junction), word_of(condition.state)
        signal = self._signals.get(junction)
        if signal is None:
            return None
        if condition.actor is None:
            stage, _ = self._simulation.world.signals.stage(signal.tls)
            return Outcome(signal.stages[stage] == state, decides=condition)
        actor = self._actor(condition.actor)
        link = None if actor is None else self._link(actor, junction, signal.tls)
        if link is None:
            return None
        return Outcome(self._simulation.world.signals.colour(*link) == state, decides=condition)

    def _link(self, actor: Actor, junction: str, tls: str) -> tuple[str, int] | None:
        """Return which signal, and which of its links, an actor has to look at until it has left a junction."""
        if isinstance(actor, PathActor):
            stops = actor.placed.walk_stops
            return next(((name, link) for _, leaves, name, link in stops if name == tls and leaves > actor.along), None)
        for passage, _ in self._simulation.progress.ahead(actor, self._simulation.frame, math.inf):
            movement = passage.movement
            if passage.junction == junction:
                return (movement.tls, movement.link) if movement.tls is not None and movement.link >= 0 else None
        return None

    # --- measures --------------------------------------------------------------------------------------------------

    def _actor(self, name: str | None) -> Actor | None:
        actor = self._simulation.by_id.get(name or "")
        return actor if actor is not None and actor.present else None

    def _speed(self, measure: Measure) -> float:
        actor = self._actor(measure.actor)
        return math.nan if actor is None else actor.speed

    def _acceleration(self, measure: Measure) -> float:
        actor = self._actor(measure.actor)
        return math.nan if actor is None else actor.acceleration

    def _eta(self, measure: Measure) -> float:
        actor = self._actor(measure.actor)
        if actor is None:
            return math.nan
        room = self._simulation.progress.to_junction(actor, word_of(measure.other or ""), self._simulation.frame)
        return math.inf if math.isnan(room) else eta(room, actor.speed)

    def _distance(self, measure: Measure) -> float:
        actor, name = self._actor(measure.actor), word_of(measure.other or "")
        if actor is None:
            return math.nan
        if name not in self._simulation.by_id and name in self._simulation.network.junctions:
            return self._simulation.progress.to_junction(actor, name, self._simulation.frame)
        other = self._actor(name)  # one of the traffic may have found no room
        return math.nan if other is None else box_distance(actor.box, other.box)

    def _ttc(self, measure: Measure) -> float:
        actor, other = self._actor(measure.actor), self._actor(word_of(measure.other or ""))
        return math.nan if actor is None or other is None else ttc(actor.mover, other.mover)

    def _headway(self, measure: Measure) -> float:
        actor, other = self._actor(measure.actor), self._actor(word_of(measure.other or ""))
        if actor is None or other is None:
            return math.nan
        return box_distance(actor.box, other.box) / max(actor.speed, SLOWEST_MPS)


def _judged(condition: Condition, held: bool, slack: float, bound: Quantity | Ref) -> Outcome:
    """Return the outcome of a comparison with a bound, in whose unit it is told."""
    if isinstance(bound, Ref):  # `si_of` has refused it
        raise TypeError(bound.name)
    return Outcome(held, slack, bound.unit, condition, bound.dimension)
