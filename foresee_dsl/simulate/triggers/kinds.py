"""Evaluates conditions in a run: one class per kind of condition, bound to the run and its actors.

A kind computes its outcome with the margin (`outcome`), its truth alone where that is cheaper (`truth`), the cost of an
evaluation, and how far a fact is from holding (`away`). Its class also rewrites the condition for a clip (`rebased`).
`condition_history` joins kinds by `and`, `or`, `not` and `for`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, Generic, TypeVar, assert_never

from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.kernels.conditions import UNSURE, beside_area
from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import mentioned, quantity_of, si_of, word_of
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.results.infraction import Rule
from foresee_dsl.simulate.results.metrics import point_distance
from foresee_dsl.simulate.rules.giving_way import YieldArea
from foresee_dsl.simulate.rules.watch import RuleWatch
from foresee_dsl.simulate.trigger_record import ClipMoment, Rewritten, seconds
from foresee_dsl.simulate.triggers.conditions import ConditionOutcome, Conditions
from foresee_dsl.simulate.triggers.measures import Cost, cost_of, measured

YIELDS_WITHIN_M = 30.0
"""An actor that lets another one pass at a place yields to it only if it is at most this far from the place, m. Ours,
as `simulate.waiting.AHEAD_M`."""
Truth = Callable[[], bool | None]
"""A function that returns whether a condition holds now; None if it cannot be evaluated."""
_C = TypeVar("_C", bound=m.Condition)


class ConditionKind(Generic[_C]):
    """A condition without parts, bound to one run.

    Attributes:
        cost: how expensive it is to evaluate its truth.
    """

    once_gone: ClassVar[bool | None] = None
    """Whether the condition holds when an actor in it has left; None if it has no outcome then."""
    without_memory: ClassVar[bool] = False
    """Whether it is a fact without a margin, and two instances agree at each frame: an `expect` evaluates its outcome
    only when its truth changes."""
    settles: ClassVar[bool] = False
    """Whether an `expect` need not evaluate it any more once a frame decides the result: its outcome has no margin, and
    no projection has to follow the actor."""

    def __init__(self, condition: _C, run: Conditions) -> None:
        self.condition, self.run = condition, run
        self.cost = cost_of(condition, run)

    @classmethod
    def rebased(cls, condition: _C, moment: ClipMoment, *, positive: bool) -> Rewritten:
        """Return the condition for a clip; `positive`: whether it is under an even number of `not`.

        A condition about the present moment, or about what happens at one frame, stays as it is.
        """
        if not mentioned(condition) & moment.gone:
            return condition
        # A part that never has an outcome never makes the whole condition true.
        return not positive if cls.once_gone is None else cls.once_gone

    def outcome(self) -> ConditionOutcome | None:
        """Return whether the condition holds now, and by which margin; None if it cannot be evaluated."""
        raise NotImplementedError

    def truth(self) -> bool | None:
        """Return whether the condition holds now; None if it cannot be evaluated."""
        outcome = self.outcome()
        return None if outcome is None else bool(outcome.held)

    def away(self) -> tuple[float, str] | None:
        """Return how far a fact is from holding, m, and why; None if the fact has no such distance."""
        return None

    def goal_margin(self) -> float | None:
        """Return the margin of the goal that a fact without a margin never holds, m; None if it has none."""
        return None

    def judged(self, held: bool, slack: float, bound: m.AnyValue, value: float) -> ConditionOutcome:
        """Return the outcome of a comparison with a bound; the margin has the bound's unit."""
        quantity = quantity_of(bound)
        return ConditionOutcome(held, slack, quantity.unit, self.condition, quantity.dimension, value)

    def inside(self, inside_m: float) -> ConditionOutcome | None:
        """Return the outcome of a condition that holds inside an area; `inside_m` is negative outside, NaN unknown."""
        if math.isnan(inside_m):
            return None
        return ConditionOutcome(inside_m >= 0, inside_m, "m", self.condition, "length")


class _MeasureCompared(ConditionKind[m.Comparison]):
    """`ego.speed < 3 m/s`: a comparison of a measure with a bound."""

    def __init__(self, condition: m.Comparison, run: Conditions) -> None:
        if not isinstance(condition.left, m.Measure):
            raise TypeError(f"`{condition.left!r}` is not a measure that a run can compute")
        super().__init__(condition, run)
        self._bound, self._right = si_of(condition.right), condition.right
        self._above, self._equal = condition.op[0] == ">", condition.op[-1] == "="
        self._measured = measured(condition.left, run)
        self.cost = self._measured.cost

    @classmethod
    def rebased(cls, condition: m.Comparison, moment: ClipMoment, *, positive: bool) -> Rewritten:
        if not isinstance(condition.left, m.Measure) or condition.left.what != "time":
            return super().rebased(condition, moment, positive=positive)
        left_s = si_of(condition.right) - moment.time_s
        if left_s < -1e-9 or (abs(left_s) <= 1e-9 and condition.op in (">=", "<")):
            return condition.op[0] == ">"
        return condition.model_copy(update={"right": seconds(left_s)})

    def _held(self, value: float) -> tuple[bool, float]:
        slack = value - self._bound if self._above else self._bound - value
        return slack >= 0 if self._equal else slack > 0, slack

    def outcome(self) -> ConditionOutcome | None:
        value = self._measured.value()
        return None if math.isnan(value) else self.judged(*self._held(value), self._right, value)

    def truth(self) -> bool | None:
        value = self._measured.until(self._bound)
        return None if math.isnan(value) else bool(self._held(value)[0])


class _Fact(ConditionKind[_C]):
    """A condition without a margin, which only states whether it holds."""

    def truth(self) -> bool | None:
        raise NotImplementedError

    def outcome(self) -> ConditionOutcome | None:
        held = self.truth()
        return None if held is None else ConditionOutcome(held, decides=self.condition)


class _Arrives(_Fact[m.Predicate]):
    """The condition `arrived(ego)`; an actor that has left counts as arrived."""

    once_gone = True
    without_memory = settles = True

    def __init__(self, condition: m.Predicate, run: Conditions) -> None:
        super().__init__(condition, run)
        self._name = condition.actor

    def truth(self) -> bool:
        return bool(self.run.arrived(self._name))

    def away(self) -> tuple[float, str] | None:
        actor, simulation = self.run.actor(self._name), self.run.simulation
        if actor is None:
            return None
        line, left_m = actor.placed.line, math.nan
        if isinstance(actor, PathActor):
            left_m = actor.follower.line.length_m - actor.along
        elif line is not None and actor is simulation.ego:
            left_m = simulation.scene.goal_s - simulation.progress.of(actor, simulation.frame)[0]
        elif line is not None:
            left_m = line.end_s - simulation.progress.front(actor, simulation.frame)
        return None if math.isnan(left_m) else (left_m, "to go")


class _Collides(_Fact[m.Predicate]):
    """The condition `collision(ego)`; an actor that has left touches nothing."""

    once_gone = False
    without_memory = settles = True

    def __init__(self, condition: m.Predicate, run: Conditions) -> None:
        super().__init__(condition, run)
        self._name = condition.actor

    def truth(self) -> bool:
        return bool(self.run.collides(self._name))

    def away(self) -> tuple[float, str] | None:
        actor = self.run.actor(self._name)
        if actor is None:
            return None
        others = self.run.simulation.others(actor)
        return min(((float(box_distance(actor.box, other.box)), other.id) for other in others), default=None)

    def goal_margin(self) -> float | None:
        away = self.away()
        return None if away is None else away[0]


class _InAnyJunction(ConditionKind[m.InJunction]):
    """The condition `ego in junction`."""

    def __init__(self, condition: m.InJunction, run: Conditions) -> None:
        super().__init__(condition, run)
        self._name = condition.actor

    def outcome(self) -> ConditionOutcome | None:
        actor = self.run.actor(self._name)
        away = math.nan if actor is None else self._away(actor)
        if math.isnan(away):
            return None
        # Inside there is no margin, because a depth inside a junction would mean nothing.
        return self.inside(-away) if away > 0 else ConditionOutcome(True, decides=self.condition)

    def _away(self, actor: SimulatedActor) -> float:
        return self.run.outlines.nearest(actor.box)


class _InJunction(_InAnyJunction):
    """The condition `ego in junction(j4)`."""

    def __init__(self, condition: m.InJunction, run: Conditions) -> None:
        super().__init__(condition, run)
        junction = self._junction = word_of(condition.junction or "")
        area, borders, bounds = run.outlines.of(junction)
        row = run.rows.get(condition.actor)
        self._beside: Callable[[], float] | None = None
        if row is not None and not area.is_empty:
            self._beside = partial(beside_area, run.states, run.sizes, row, borders, bounds)
        if row is not None:
            self.cost = Cost.AREA

    def _away(self, actor: SimulatedActor) -> float:
        return self.run.outlines.distance(actor.box, self._junction)

    def truth(self) -> bool | None:
        actor = self.run.actor(self._name)
        if actor is None or self._beside is None:
            return None
        side = self._beside()
        return not self._away(actor) > 0 if side == UNSURE else side < 0


class _Beside(ConditionKind[m.Ahead | m.Behind | m.SameLane | m.InLane]):
    """Conditions about an actor's position along and across a way: `a ahead of b`, `a behind b`, `a in lane of b`, `a
    in lane 1`.
    """

    def outcome(self) -> ConditionOutcome | None:
        condition = self.condition
        actor = self.run.actor(condition.actor)
        other = actor if isinstance(condition, m.InLane) else self.run.actor(condition.other)
        return None if actor is None or other is None else self.inside(self._inside(actor, other))

    def _inside(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        ways = self.run.ways
        match self.condition:
            case m.Ahead():
                return ways.ahead_m(actor, other)
            case m.Behind():
                return ways.behind_m(actor, other)
            case m.SameLane():
                return ways.same_lane_m(actor, other)
            case m.InLane(number=number, road=road):
                return ways.in_lane_m(actor, round(si_of(number)), None if road is None else word_of(road))
            case _:
                assert_never(self.condition)


class _Seen(_Fact[m.Sees | m.InSight]):
    """The conditions `ego sees walker`, by the ego's sensors, and `walker in sight of bus`, by a line of sight."""

    without_memory = True

    def __init__(self, condition: m.Sees | m.InSight, run: Conditions) -> None:
        super().__init__(condition, run)
        self._sensed = isinstance(condition, m.Sees)
        names = condition.actor, condition.other
        self._eye, self._seen = names if self._sensed else names[::-1]

    def truth(self) -> bool | None:
        eye, seen, run = self.run.actor(self._eye), self.run.actor(self._seen), self.run
        if eye is None or seen is None:
            return None
        if self._sensed:
            return None if run.sensing is None else run.sensing.reports(seen.id)
        return run.sightlines.clear(eye.id, seen.id)

    def away(self) -> tuple[float, str] | None:
        eye, seen = self.run.actor(self._eye), self.run.actor(self._seen)
        if eye is None or seen is None:
            return None
        why = "too far or missed" if self.run.sightlines.clear(eye.id, seen.id) else "hidden"
        first, second = (eye, seen) if self._sensed else (seen, eye)
        return float(box_distance(first.box, second.box)), why


class _Near(ConditionKind[m.Within]):
    """The condition `walker within 10 m of ego`."""

    def __init__(self, condition: m.Within, run: Conditions) -> None:
        super().__init__(condition, run)
        if isinstance(condition.of, m.OfActor):
            self.cost = Cost.EVERY_STEP

    @classmethod
    def rebased(cls, condition: m.Within, moment: ClipMoment, *, positive: bool) -> Rewritten:
        place = "" if isinstance(condition.of, m.Named) else written(condition.of, frozenset())
        point = moment.places.get(place)
        placed = condition if point is None else condition.model_copy(update={"of": point})
        return super().rebased(placed, moment, positive=positive)

    def outcome(self) -> ConditionOutcome | None:
        actor = self.run.actor(self.condition.actor)
        away = math.nan if actor is None else self._away(actor)
        if math.isnan(away):
            return None
        slack = si_of(self.condition.distance) - away
        return self.judged(slack >= 0, slack, self.condition.distance, away)

    def _away(self, actor: SimulatedActor) -> float:
        of, run = self.condition.of, self.run
        if isinstance(of, m.Named):
            name = word_of(of.name)
            if run.is_junction(name):
                return run.outlines.distance(actor.box, name)
            other = run.actor(name)
            return math.nan if other is None else run.gap(actor, other)
        if isinstance(of, m.OfActor):
            pose = run.ways.place(of)
            return math.nan if pose is None else point_distance(actor.box, pose[0], pose[1])
        x, y = (si_of(of.x), si_of(of.y)) if isinstance(of, m.Point) else run.simulation.scene.places[of]
        return point_distance(actor.box, x, y)


class _Signalled(_Fact[m.Shows]):
    """The conditions `ego.signal(j4) is red` and `signal(j4) is ns_go`."""

    without_memory = True

    def __init__(self, condition: m.Shows, run: Conditions) -> None:
        super().__init__(condition, run)
        self._actor, self._junction = condition.actor, word_of(condition.junction)
        self._state = word_of(condition.state)

    def truth(self) -> bool | None:
        signal, lights = self.run.signals.get(self._junction), self.run.simulation.world.signals
        if signal is None:
            return None
        if self._actor is None:
            stage, _ = lights.stage(signal.tls)
            return signal.stages[stage] == self._state
        actor = self.run.actor(self._actor)
        link = None if actor is None else self._link(actor, signal.tls)
        return None if link is None else lights.colour(*link) == self._state

    def _link(self, actor: SimulatedActor, tls: str) -> tuple[str, int] | None:
        """Return the signal and the link that apply to an actor, up to the frame at which it has left the junction."""
        if isinstance(actor, PathActor):
            stops = actor.placed.walk_stops
            return next(((name, link) for _, leaves, name, link in stops if name == tls and leaves > actor.along), None)
        for passage, _ in self.run.simulation.progress.ahead(actor, self.run.simulation.frame, math.inf):
            movement = passage.movement
            if passage.junction == self._junction:
                return (movement.tls, movement.link) if movement.tls is not None and movement.link >= 0 else None
        return None


class _RunsRed(_Fact[m.RunsRed]):
    """The condition `ego runs red at j4`: an event, which holds at one frame."""

    def __init__(self, condition: m.RunsRed, run: Conditions) -> None:
        super().__init__(condition, run)
        self._rules = _rules_of(condition.actor, run)
        self._junction = word_of(condition.junction or "")
        self.cost = Cost.EVERY_STEP

    def truth(self) -> bool | None:
        if self._rules is None:
            return None
        self._rules.look()
        junctions = [broken.place for broken in self._rules.now if broken.rule is Rule.RED]
        return self._junction in junctions if self._junction else bool(junctions)


class _Yields(_Fact[m.YieldsAtCrossing | m.YieldsAt]):
    """The conditions `ego yields to walker at crossing` and `ego yields to runner at j4`: an event, which holds at one
    frame.
    """

    def __init__(self, condition: m.YieldsAtCrossing | m.YieldsAt, run: Conditions) -> None:
        super().__init__(condition, run)
        self._rules, self._other = _rules_of(condition.actor, run), condition.other
        self._rule = Rule.CROSSING if isinstance(condition, m.YieldsAtCrossing) else Rule.PRIORITY
        self._junction = word_of(condition.junction or "")
        self._waited_for: set[YieldArea] = set()
        self.cost = Cost.EVERY_STEP

    def truth(self) -> bool | None:
        if self._rules is None:
            return None
        self._rules.look()
        taken = (b for b in self._rules.now if b.rule is self._rule and self._junction in ("", b.place))
        if any(broken.other == self._other for broken in taken):
            return False
        return self._passed(self._rules) or None

    def _passed(self, rules: RuleWatch) -> bool:
        """Return whether, at this frame, the other actor has passed a place that this actor has not reached yet."""
        passed = False
        for area in rules.near_areas(YIELDS_WITHIN_M):
            if area.rule is not self._rule or self._junction not in ("", area.junction):
                continue
            if rules.comes(area, self._other):
                self._waited_for.add(area)
            elif area in self._waited_for:
                self._waited_for.remove(area)
                passed = True
        return passed


def _rules_of(name: str, run: Conditions) -> RuleWatch | None:
    """Return the traffic rules that an actor has broken; None for an actor without a route."""
    actor = run.simulation.by_id.get(name)
    return None if actor is None or actor.placed.line is None else run.rules(actor)


def has_parts(condition: m.Condition) -> bool:
    """Return whether a condition joins others, so that it is not of one kind."""
    return isinstance(condition, m.Sustained | m.Not | m.Both | m.Either)


def kind_class(condition: m.Condition) -> type[ConditionKind[Any]]:
    """Return the class of a condition without parts."""
    kind: type[ConditionKind[Any]]
    match condition:
        case m.Comparison():
            kind = _MeasureCompared
        case m.Predicate():
            kind = _Arrives if condition.what == "arrived" else _Collides
        case m.InJunction():
            kind = _InAnyJunction if condition.junction is None else _InJunction
        case m.Ahead() | m.Behind() | m.SameLane() | m.InLane():
            kind = _Beside
        case m.Sees() | m.InSight():
            kind = _Seen
        case m.Within():
            kind = _Near
        case m.Shows():
            kind = _Signalled
        case m.RunsRed():
            kind = _RunsRed
        case m.YieldsAtCrossing() | m.YieldsAt():
            kind = _Yields
        case m.Equals():
            raise TypeError(
                "a condition about a parameter must be decided before a run, so it cannot be evaluated in it"
            )
        case m.Sustained() | m.Not() | m.Both() | m.Either():
            raise TypeError(f"{condition.kind} has parts: `condition_history.Watch` evaluates it")
        case _:
            assert_never(condition)
    return kind


def kind_of(condition: m.Condition, run: Conditions) -> ConditionKind[Any]:
    """Return a condition without parts, bound to a run."""
    return kind_class(condition)(condition, run)
