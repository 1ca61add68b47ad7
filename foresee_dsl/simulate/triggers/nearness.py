"""How near a fact without a number came to holding: a distance, and what was in the way."""

from __future__ import annotations

import math

from foresee_dsl.kernels.conditions import box_distance
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.triggers.conditions import Sightlines


def nearness(fact: m.Condition, simulation: Simulation, lines: Sightlines) -> tuple[float, str] | None:
    """Return how far off a fact is at the frame that a simulation is at, m, and why; None where that has no distance.

    Of `sees` and `in sight of` it is how far away the other is and whether it is hidden, of `collision` how far the
    nearest actor is, and of `arrived` how far there is to go.
    """
    actor = simulation.by_id.get(getattr(fact, "actor", None) or "")
    if actor is None or not actor.present:
        return None
    match fact:
        case m.Sees() | m.InSight():
            other = simulation.by_id.get(fact.other)
            if other is None or not other.present:
                return None
            eye, seen = (actor, other) if isinstance(fact, m.Sees) else (other, actor)
            why = "too far or missed" if lines.clear(eye.id, seen.id) else "hidden"
            return box_distance(actor.box, other.box), why
        case m.Predicate(what="collision"):
            near = ((box_distance(actor.box, other.box), other.id) for other in simulation.others(actor))
            return min(near, default=None)
        case m.Predicate(what="arrived"):
            left_m = _left_m(actor, simulation)
            return None if math.isnan(left_m) else (left_m, "to go")
    return None


def _left_m(actor: Actor, simulation: Simulation) -> float:
    """Return how far an actor is from its goal along its way, m; NaN where it has none."""
    if isinstance(actor, PathActor):
        return actor.follower.line.length_m - actor.along
    line = actor.placed.line
    if line is None:
        return math.nan
    if actor is simulation.ego:
        return simulation.scene.goal_s - simulation.progress.of(actor, simulation.frame)[0]
    return line.end_s - simulation.progress.front(actor, simulation.frame)
