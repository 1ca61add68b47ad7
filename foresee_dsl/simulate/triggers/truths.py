"""Whether a condition holds, without by how much: small functions that are made once a run.

A trigger asks in every step whether its condition holds, and needs no margin. The parts that cost least are looked at
first, and the rest only where they leave it open. `Conditions.outcome` says the same of each part with its margin.

A look along a SUMO vehicle's line begins where the last one ended, so what depends on that is looked at in every step,
whatever the others say.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import NamedTuple

from foresee_dsl.kernels.conditions import UNSURE, beside_area, gap_within, time_to_touch
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import parts, si_of, word_of
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.results.metrics import SLOWEST_MPS, eta
from foresee_dsl.simulate.trace import ACCELERATION, SPEED
from foresee_dsl.simulate.triggers.conditions import Conditions

Truth = Callable[[], bool | None]
"""Says whether a condition holds now; None where it cannot be evaluated."""
Reads = Callable[[], float]
"""Returns a measure's value now, NaN where there is none."""


class _Cost(IntEnum):
    """What a look at a condition costs; the parts of an `and` or `or` are looked at in this order.

    `EVERY_STEP`: it is looked at in every step, whatever the other parts say. Of the others, `NUMBER` reads one number
    of the state table, `PAIR` computes with two footprints, `AREA` with a footprint and an outline or a way, and
    `MARGIN` is evaluated by `Conditions`, with its margin.
    """

    EVERY_STEP = 0
    NUMBER = 1
    PAIR = 2
    AREA = 3
    MARGIN = 4


class _Made(NamedTuple):
    """A condition as a function, and what it costs."""

    truth: Truth
    cost: _Cost


def truth_of(condition: m.Condition, conditions: Conditions) -> Truth | None:
    """Return a function that says whether a condition holds at the frame that `conditions` is at; None for one with a
    `for`, which has to be followed from frame to frame."""
    if any(isinstance(part, m.Sustained) for part in parts(condition)):
        return None
    return _made(condition, conditions).truth


def _made(condition: m.Condition, conditions: Conditions) -> _Made:
    match condition:
        case m.Not():
            inner = _made(condition.condition, conditions)
            return _Made(partial(_opposite, inner.truth), inner.cost)
        case m.Both() | m.Either():
            found = sorted((_made(part, conditions) for part in condition.conditions), key=lambda one: one.cost)
            every_step = tuple(one.truth for one in found if one.cost == _Cost.EVERY_STEP)
            rest = tuple(one.truth for one in found if one.cost != _Cost.EVERY_STEP)
            cost = _Cost.EVERY_STEP if every_step else max(one.cost for one in found)
            return _Made(partial(_joined, every_step, rest, isinstance(condition, m.Either)), cost)
        case m.Comparison() if isinstance(condition.left, m.Measure):
            bound = si_of(condition.right)
            reads, cost = _reads(condition.left, bound, conditions)
            holds = {">": _more, ">=": _at_least, "<": _less, "<=": _at_most}[condition.op]
            return _Made(partial(holds, reads, bound), cost)
        case m.Predicate():
            held = conditions.arrived if condition.what == "arrived" else conditions.collides
            return _Made(partial(_fact, held, condition.actor), _cost_of(condition, conditions))
        case m.InJunction() if condition.junction is not None:
            actor = conditions.simulation.by_id.get(condition.actor)
            if actor is not None:
                return _Made(_in_junction(actor, word_of(condition.junction), conditions), _Cost.AREA)
    return _Made(partial(_outcome, condition, conditions), _cost_of(condition, conditions))


def _reads(measure: m.Measure, bound: float, conditions: Conditions) -> tuple[Reads, _Cost]:
    """Return a function that returns a measure's value, or infinity where that is surely above the bound, and what it
    costs."""
    simulation = conditions.simulation
    actor, name = simulation.by_id.get(measure.actor or ""), word_of(measure.other or "")
    other = simulation.by_id.get(name)
    if measure.what == "time":
        return (lambda: simulation.time_s), _Cost.NUMBER
    if actor is None:
        return (lambda: math.nan), _Cost.NUMBER
    if measure.what in ("speed", "acceleration"):
        return partial(_number, actor, conditions, SPEED if measure.what == "speed" else ACCELERATION), _Cost.NUMBER
    if measure.what in ("eta", "distance") and conditions.is_junction(name):
        to = _eta if measure.what == "eta" else _to_junction
        return partial(to, actor, name, simulation), _Cost.AREA if _looks_anywhere(
            actor, conditions
        ) else _Cost.EVERY_STEP
    if other is not None and measure.what in ("distance", "ttc", "headway"):
        return _pair(measure, bound, (actor, other), conditions), _Cost.PAIR
    return partial(conditions.value, measure), _cost_of(measure, conditions)


def _pair(measure: m.Measure, bound: float, pair: tuple[Actor, Actor], conditions: Conditions) -> Reads:
    one, other = (conditions.rows[actor.id] for actor in pair)
    table = conditions.states, conditions.sizes, one, other
    if measure.what == "ttc":
        return partial(_ttc, *pair, partial(time_to_touch, *table))
    gap_m = partial(gap_within, *table)
    if measure.what == "headway":
        return partial(_headway, *pair, gap_m, bound)
    return partial(_gap, *pair, gap_m, bound)


def _number(actor: Actor, conditions: Conditions, column: int) -> float:
    return conditions.states.item(conditions.rows[actor.id], column) if actor.present else math.nan


def _to_junction(actor: Actor, junction: str, simulation: Simulation) -> float:
    return simulation.progress.to_junction(actor, junction, simulation.frame) if actor.present else math.nan


def _eta(actor: Actor, junction: str, simulation: Simulation) -> float:
    if not actor.present:
        return math.nan
    left_m = simulation.progress.to_junction(actor, junction, simulation.frame)
    return math.inf if math.isnan(left_m) else eta(left_m, actor.speed)


def _ttc(actor: Actor, other: Actor, ttc: Reads) -> float:
    return ttc() if actor.present and other.present else math.nan


def _gap(actor: Actor, other: Actor, gap_m: Callable[[float], float], bound: float) -> float:
    return gap_m(bound) if actor.present and other.present else math.nan


def _headway(actor: Actor, other: Actor, gap_m: Callable[[float], float], bound: float) -> float:
    if not (actor.present and other.present):
        return math.nan
    speed_mps = max(actor.speed, SLOWEST_MPS)
    return gap_m(bound * speed_mps) / speed_mps


def _looks_anywhere(actor: Actor, conditions: Conditions) -> bool:
    """Whether it makes no difference when the place of an actor on its line was looked up before: that of the ego is
    looked up in every frame, that of an actor on a path is known."""
    return actor is conditions.simulation.ego or isinstance(actor, PathActor)


def _cost_of(item: m.Condition | m.Measure, conditions: Conditions) -> _Cost:
    """Return what a condition or measure costs that is evaluated with its margin."""
    if isinstance(item, m.Within) and isinstance(item.of, m.OfActor):
        return _Cost.EVERY_STEP
    by_id = conditions.simulation.by_id
    actors = (by_id.get(name) for name in (getattr(item, "actor", None), getattr(item, "other", None)) if name)
    if all(actor is None or _looks_anywhere(actor, conditions) for actor in actors):
        return _Cost.MARGIN
    return _Cost.EVERY_STEP


def _in_junction(actor: Actor, junction: str, conditions: Conditions) -> Truth:
    area, borders, bounds = conditions.outlines.of(junction)
    beside = partial(beside_area, conditions.states, conditions.sizes, conditions.rows[actor.id], borders, bounds)

    def inside() -> bool | None:
        if not actor.present:
            return None
        side = beside()
        if side == UNSURE:
            return not conditions.outlines.distance(actor.box, junction) > 0
        return side < 0

    return (lambda: None) if area.is_empty else inside


def _outcome(condition: m.Condition, conditions: Conditions) -> bool | None:
    outcome = conditions.outcome(condition)
    return None if outcome is None else bool(outcome.held)


def _fact(holds: Callable[[str], bool], actor: str) -> bool:
    return bool(holds(actor))


def _opposite(truth: Truth) -> bool | None:
    held = truth()
    return None if held is None else not held


def _joined(every_step: tuple[Truth, ...], rest: tuple[Truth, ...], enough: bool) -> bool | None:
    """Join the parts of an `or` (`enough`: True) or an `and` (False): one part that is `enough` decides.

    `every_step`: parts that are looked at in every step. `rest`: those that are looked at until one decides.
    """
    decided, unknown = False, False
    for truth in every_step:
        held = truth()
        decided, unknown = decided or held is enough, unknown or held is None
    if decided:
        return enough
    for truth in rest:
        held = truth()
        if held is enough:
            return enough
        unknown = unknown or held is None
    return None if unknown else not enough


def _less(reads: Reads, bound: float) -> bool | None:
    value = reads()
    return None if math.isnan(value) else bool(bound - value > 0)


def _at_most(reads: Reads, bound: float) -> bool | None:
    value = reads()
    return None if math.isnan(value) else bool(bound - value >= 0)


def _more(reads: Reads, bound: float) -> bool | None:
    value = reads()
    return None if math.isnan(value) else bool(value - bound > 0)


def _at_least(reads: Reads, bound: float) -> bool | None:
    value = reads()
    return None if math.isnan(value) else bool(value - bound >= 0)
