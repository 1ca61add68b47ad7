"""Evaluates conditions against the running world, and by how much they hold.

Their definitions are those of `language.model.conditions`. Where a condition cannot be evaluated, because an actor is
not there or does not come to the junction, it has no outcome and does not hold.

By how much it holds is the robustness of signal temporal logic, kept within one dimension: the margin of a comparison
is how far its measure is from the bound, positive where it holds. `and`, `always` and `for` take the smallest, `or` and
`eventually` the largest, `not` turns the sign (Donze and Maler, "Robust Satisfaction of Temporal Logic over Real-Valued
Signals", FORMATS 2010). Metres and seconds cannot be compared: across dimensions the margin is that of what decides
whether the condition holds, of the first where several do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol, assert_never

import numpy as np

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.kernels.boxes import overlaps
from foresee_dsl.kernels.conditions import gap, time_to_touch
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import quantity_of, si_of, word_of
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.results.metrics import SLOWEST_MPS, eta, outlines_of, point_distance
from foresee_dsl.simulate.triggers.ways import Ways

_Between = Literal["eta", "distance", "ttc", "headway", "lateral", "overlap", "relative_speed"]


class Eyes(Protocol):
    """What sees: the ego's sensors."""

    def reports(self, actor: str) -> bool:
        """Say whether they report an actor now."""
        ...


class Sightlines(Protocol):
    """Bare lines of sight."""

    def clear(self, eye: str, actor: str) -> bool:
        """Say whether nothing hides an actor from another."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """Whether a condition holds at a frame, and by how much.

    Attributes:
        held: it does.
        margin: in the SI unit of `unit`, positive where the condition holds; NaN where there is no number.
        unit: the unit word of what decides, as its author wrote it; "" where there is no number.
        decides: the part that decides.
        dimension: of the margin; margins of one dimension can be compared.
        value: what was compared with the bound, in the same SI unit; NaN where nothing is compared.
    """

    held: bool
    margin: float = math.nan
    unit: str = ""
    decides: m.Condition | None = None
    dimension: str = ""
    value: float = math.nan

    def negated(self) -> Outcome:
        """Return the outcome of the opposite."""
        return replace(self, held=not self.held, margin=-self.margin)


class Conditions:
    """Evaluates conditions at the frame that a simulation is at; `condition_history` follows them over time."""

    def __init__(
        self,
        simulation: Simulation,
        signals: Mapping[str, Signal],
        *,
        eyes: Eyes | None = None,
        sightlines: Sightlines | None = None,
    ) -> None:
        """Evaluate conditions of one run. `eyes`: the ego's sensors; `sightlines`: None, like `eyes`, where nothing is
        seen."""
        self.simulation, self._signals = simulation, signals
        self.eyes, self.sightlines = eyes, sightlines
        self.outlines = outlines_of(simulation.network)
        self.states = simulation.state_table.states
        self.sizes = np.array([(actor.length, actor.width) for actor in simulation.actors]).reshape(-1, 2)
        """[A, 7] the states of all actors, and [A, 2] their lengths and widths, m, for kernels."""
        self.rows = {actor.id: row for row, actor in enumerate(simulation.actors)}
        self.ways = Ways(simulation)
        self.ego_hit: bool | None = None
        """Whether the ego touches anything at this frame, where that is known already."""

    @property
    def frame(self) -> int:
        """The frame that the simulation is at."""
        return self.simulation.frame

    @property
    def time_s(self) -> float:
        """Its time."""
        return self.simulation.time_s

    def outcome(self, condition: m.Condition) -> Outcome | None:
        """Return whether a condition without parts holds now and by how much; None where it cannot be evaluated."""
        match condition:
            case m.Comparison():
                return self._compare(condition)
            case m.Predicate():
                return self._predicate(condition)
            case m.InJunction():
                return self._in_junction(condition)
            case m.Ahead() | m.Behind() | m.SameLane() | m.InLane() | m.Sees() | m.InSight():
                return self._related(condition)
            case m.Within():
                return self._within(condition)
            case m.Shows():
                return self._shows(condition)
            case m.Equals():
                raise TypeError("a condition about a parameter says nothing about a run")
            case m.Sustained() | m.Not() | m.Both() | m.Either():
                raise TypeError(f"{condition.kind} has parts: `condition_history.Watch` evaluates it")
            case _:
                assert_never(condition)

    def value(self, measure: m.Measure) -> float:
        """Return a measure's value now, NaN where there is none."""
        if measure.what == "time":
            return self.simulation.time_s
        actor = self._actor(measure.actor)
        if actor is None:
            return math.nan
        match measure.what:
            case "speed":
                return actor.speed
            case "acceleration":
                return actor.acceleration
            case "offset":
                lane = self.ways.lane(actor)
                return math.nan if lane is None else lane[1]
            case "eta" | "distance" | "ttc" | "headway" | "lateral" | "overlap" | "relative_speed":
                return self._to(measure.what, actor, word_of(measure.other or ""))
            case _:
                assert_never(measure.what)

    def _to(self, what: _Between, actor: Actor, name: str) -> float:
        """Return what is measured from an actor to another, or to a junction; NaN where that is not there."""
        if what == "eta" or (what == "distance" and self.is_junction(name)):
            left_m = self.simulation.progress.to_junction(actor, name, self.simulation.frame)
            if what == "distance":
                return left_m
            return math.inf if math.isnan(left_m) else eta(left_m, actor.speed)
        other = self._actor(name)
        if other is None:  # one of the traffic may have found no room
            return math.nan
        match what:
            case "distance":
                value = self._gap(actor, other)
            case "ttc":
                value = float(time_to_touch(self.states, self.sizes, self.rows[actor.id], self.rows[other.id]))
            case "headway":
                value = self._gap(actor, other) / max(actor.speed, SLOWEST_MPS)
            case "lateral":
                value = self.ways.lateral_m(actor, other)
            case "overlap":
                value = self.ways.overlap_m(actor, other)
            case "relative_speed":
                value = actor.speed - other.speed * math.cos(other.heading - actor.heading)
            case _:
                assert_never(what)
        return value

    def arrived(self, name: str) -> bool:
        """Whether an actor has reached its goal: the ego's point, a path's end, the end of a route."""
        actor = self.simulation.by_id.get(name)
        if actor is None:
            return False
        if actor is self.simulation.ego:
            return self.simulation.progress.of(actor, self.simulation.frame)[0] >= self.simulation.scene.goal_s
        if isinstance(actor, PathActor):
            return actor.follower.arrived
        if isinstance(actor, GuidedVehicle) and actor.arrived:
            return True
        return not actor.present

    def collides(self, name: str) -> bool:
        """Whether an actor touches another."""
        if name == "ego" and self.ego_hit is not None:
            return self.ego_hit
        actor = self._actor(name)
        return actor is not None and any(overlaps(actor.box, other.box) for other in self.simulation.others(actor))

    # --- conditions without parts ------------------------------------------------------------------------------------

    def _compare(self, comparison: m.Comparison) -> Outcome | None:
        if not isinstance(comparison.left, m.Measure):
            raise TypeError(f"`{comparison.left!r}` says nothing about a run")
        left, right = self.value(comparison.left), si_of(comparison.right)
        if math.isnan(left):
            return None
        slack = left - right if comparison.op[0] == ">" else right - left
        return _judged(comparison, slack >= 0 if comparison.op[-1] == "=" else slack > 0, slack, comparison.right, left)

    def _predicate(self, predicate: m.Predicate) -> Outcome:
        held = self.arrived if predicate.what == "arrived" else self.collides
        return Outcome(held(predicate.actor), decides=predicate)

    def _in_junction(self, condition: m.InJunction) -> Outcome | None:
        actor = self._actor(condition.actor)
        if actor is None:
            return None
        if condition.junction is None:
            away = self.outlines.nearest(actor.box)
        else:
            away = self.outlines.distance(actor.box, word_of(condition.junction))
        if math.isnan(away):
            return None
        if away > 0:
            return Outcome(False, -away, "m", condition, "length")
        return Outcome(True, decides=condition)  # how deep it is inside means nothing

    def _related(self, condition: m.Ahead | m.Behind | m.SameLane | m.InLane | m.Sees | m.InSight) -> Outcome | None:
        """Where an actor is relative to another, or to the lanes; whether it is seen."""
        actor = self._actor(condition.actor)
        other = actor if isinstance(condition, m.InLane) else self._actor(condition.other)
        if actor is None or other is None:
            return None
        match condition:
            case m.Ahead():
                inside = self.ways.ahead_m(actor, other)
            case m.Behind():
                inside = self.ways.behind_m(actor, other)
            case m.SameLane():
                inside = self.ways.same_lane_m(actor, other)
            case m.InLane():
                road = None if condition.road is None else word_of(condition.road)
                inside = self.ways.in_lane_m(actor, round(si_of(condition.number)), road)
            case m.Sees():
                return None if self.eyes is None else Outcome(self.eyes.reports(other.id), decides=condition)
            case m.InSight():
                lines = self.sightlines
                return None if lines is None else Outcome(lines.clear(other.id, actor.id), decides=condition)
            case _:
                assert_never(condition)
        return None if math.isnan(inside) else Outcome(inside >= 0, inside, "m", condition, "length")

    def _within(self, condition: m.Within) -> Outcome | None:
        actor = self._actor(condition.actor)
        away = math.nan if actor is None else self._away(actor, condition)
        if math.isnan(away):
            return None
        slack = si_of(condition.distance) - away
        return _judged(condition, slack >= 0, slack, condition.distance, away)

    def _away(self, actor: Actor, condition: m.Within) -> float:
        of = condition.of
        if isinstance(of, m.Named):
            name = word_of(of.name)
            if self.is_junction(name):
                return self.outlines.distance(actor.box, name)
            other = self._actor(name)
            return math.nan if other is None else self._gap(actor, other)
        if isinstance(of, m.OfActor):
            pose = self.ways.place(of)
            return math.nan if pose is None else point_distance(actor.box, pose[0], pose[1])
        x, y = (si_of(of.x), si_of(of.y)) if isinstance(of, m.Point) else self.simulation.scene.places[of]
        return point_distance(actor.box, x, y)

    def _shows(self, condition: m.Shows) -> Outcome | None:
        junction, state = word_of(condition.junction), word_of(condition.state)
        signal = self._signals.get(junction)
        if signal is None:
            return None
        if condition.actor is None:
            stage, _ = self.simulation.world.signals.stage(signal.tls)
            return Outcome(signal.stages[stage] == state, decides=condition)
        actor = self._actor(condition.actor)
        link = None if actor is None else self._link(actor, junction, signal.tls)
        if link is None:
            return None
        return Outcome(self.simulation.world.signals.colour(*link) == state, decides=condition)

    def _link(self, actor: Actor, junction: str, tls: str) -> tuple[str, int] | None:
        """Return which signal, and which of its links, an actor has to look at until it has left a junction."""
        if isinstance(actor, PathActor):
            stops = actor.placed.walk_stops
            return next(((name, link) for _, leaves, name, link in stops if name == tls and leaves > actor.along), None)
        for passage, _ in self.simulation.progress.ahead(actor, self.simulation.frame, math.inf):
            movement = passage.movement
            if passage.junction == junction:
                return (movement.tls, movement.link) if movement.tls is not None and movement.link >= 0 else None
        return None

    def _gap(self, actor: Actor, other: Actor) -> float:
        return float(gap(self.states, self.sizes, self.rows[actor.id], self.rows[other.id]))

    def _actor(self, name: str | None) -> Actor | None:
        actor = self.simulation.by_id.get(name or "")
        return actor if actor is not None and actor.present else None

    def is_junction(self, name: str) -> bool:
        """Whether a name is a junction's; an actor of the same name comes first."""
        return name not in self.simulation.by_id and self.simulation.network.is_junction(name)


def _judged(condition: m.Condition, held: bool, slack: float, bound: m.AnyValue, value: float) -> Outcome:
    """Return the outcome of a comparison with a bound, in whose unit the margin is."""
    quantity = quantity_of(bound)
    return Outcome(held, slack, quantity.unit, condition, quantity.dimension, value)


def every(outcomes: Iterable[Outcome | None], *, unknown: bool = False) -> Outcome | None:
    """Return the outcome of `and`: one that does not hold decides; else none where one of them has none, or with
    `unknown`."""
    return _joined(tuple(outcomes), enough=False, unknown=unknown)


def some(outcomes: Iterable[Outcome | None]) -> Outcome | None:
    """Return the outcome of `or`. One that holds decides; otherwise it has none where one has none."""
    return _joined(tuple(outcomes), enough=True, unknown=False)


def _joined(outcomes: tuple[Outcome | None, ...], *, enough: bool, unknown: bool) -> Outcome | None:
    """Join outcomes of which one with `held == enough` is enough to decide.

    The margin is that of a part that decides: of those in the dimension of the first, the nearest to the opposite for
    `and`, the furthest from it for `or`.
    """
    known = [outcome for outcome in outcomes if outcome is not None]
    deciding = [outcome for outcome in known if outcome.held == enough]
    if not deciding:
        if unknown or len(known) < len(outcomes):
            return None
        deciding = known
    numbers = [outcome for outcome in deciding if not math.isnan(outcome.margin)]
    if not numbers:
        return deciding[0]
    alike = [outcome for outcome in numbers if outcome.dimension == numbers[0].dimension]
    return (max if enough else min)(alike, key=lambda outcome: outcome.margin)
