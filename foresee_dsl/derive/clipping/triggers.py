"""The triggers of a clip: those of its parent that may still fire, and the rest of sequences that have begun.

The progress of the triggers, and their orders to each actor, are read from the run's record (`Trace.director`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from foresee_dsl.compile.placement.doors import door_side
from foresee_dsl.derive.clipping.conditions import both, point_of, quantity, rebased
from foresee_dsl.derive.clipping.snapshot import present
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written as text_of
from foresee_dsl.language.traversal import all_actions, fields_of, si_of
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace
from foresee_dsl.simulate.trigger_record import (
    ActorOrders,
    BlockState,
    ClipMoment,
    DirectorRecord,
    Place,
    Runs,
    TriggerState,
    seconds,
)

Resumed = (
    m.ChangesSpeed
    | m.Stops
    | m.BrakesFor
    | m.StopsAt
    | m.KeepsGap
    | m.MatchesSpeed
    | m.KeepsBeside
    | m.ChangesLine
    | m.Synchronises
    | m.Reverses
)
"""Orders that can be unfinished at the clip's beginning; the clip then states the rest of the order."""
_Timed = m.ChangesSpeed | m.ChangesLine | m.KeepsGap | m.MatchesSpeed | m.KeepsBeside | m.BrakesFor


@dataclass(frozen=True)
class Triggers:
    """The triggers of a run at the beginning of a clip.

    Attributes:
        trace: the run. frame: the frame at which the clip begins.
        moment: that frame, for rewriting conditions.
        whens: the scenario's triggers. states: the progress of each trigger. orders: the present orders to each actor.
        timed: actors with a `timing`, which do not adapt their speed to the actors that they meet.
    """

    trace: Trace
    frame: int
    moment: ClipMoment
    whens: tuple[m.When, ...]
    states: tuple[TriggerState, ...]
    orders: Mapping[str, ActorOrders]
    timed: frozenset[str]

    def orders_of(self, actor: str) -> ActorOrders:
        """Return the present orders to an actor."""
        return self.orders.get(actor, ActorOrders())

    def pending(self) -> tuple[m.When, ...]:
        """Return the triggers that may still fire."""
        triggers: list[m.When] = []
        for when, state in zip(self.whens, self.states, strict=True):
            again = when.repeat in ("every", "next")
            if state.fired_s is not None and not again:
                continue
            held = state.held if again else None
            condition = rebased(when.condition, self.moment, state.runs, held=held)
            actions = self.future(when.actions)
            if actions and not isinstance(condition, bool):
                repeat = ("next" if state.held else "every") if again else when.repeat
                triggers.append(m.When(repeat=repeat, name=when.name, condition=condition, actions=actions))
        return tuple(triggers)

    def under_way(self) -> tuple[tuple[m.When, ...], frozenset[tuple[str, str]]]:
        """Return triggers that continue the sequences that have begun, and the orders that these triggers resume.

        Each order is given as (actor, `speed`), (actor, `lane`) or (actor, `sideways`).
        """
        continuing: list[m.When] = []
        taken: set[tuple[str, str]] = set()
        for index, (when, state) in enumerate(zip(self.whens, self.states, strict=True)):
            if state.sequence is None:
                continue
            rest = _Rest(self, index)
            actions = rest.block(when.actions, state.sequence, ())
            while len(actions) == 1 and isinstance(only := actions[0], m.Then) and only.condition is None:
                actions = only.actions
            # Only a rest that has further steps becomes a trigger here. If it has none, its orders are resumed for each
            # actor separately.
            if any(isinstance(action, m.Then) for action in actions):
                continuing.append(at_once(*actions))
                taken |= rest.taken
        return tuple(continuing), frozenset(taken)

    def held_back(self, whens: Iterable[m.When]) -> tuple[m.When, ...]:
        """Return a trigger that never fires, for the actors that none of `whens` will start.

        It makes these actors wait: an actor that no trigger starts would move off by itself.
        """
        still = {*_starts(whens), *self.moment.gone}
        left = [name for name in _starts(self.whens) if name not in still and self.orders_of(name).started_s is None]
        never = m.Comparison(left=m.Measure(what="time"), op="<", right=seconds(0.0))
        return (m.When(condition=never, actions=tuple(m.Starts(actor=name) for name in left)),) if left else ()

    def future(self, actions: Iterable[m.Action], until: m.Condition | bool = True) -> tuple[m.Action, ...]:
        """Return, for the clip, actions that have not begun; `until`: a further condition for each step.

        Actions of actors that have left are left out; so are starts of actors that have started, which would otherwise
        wait for them. A `then` whose condition can never hold is left out with everything after it."""
        remaining: list[m.Action] = []
        for action in actions:
            if not isinstance(action, m.Then):
                remaining += [] if self._is_over(action) else [self.placed(action)]
                continue
            wanted = True if action.condition is None else rebased(action.condition, self.moment)
            condition = both(wanted, until)
            if condition is False:
                break
            inner = self.future(action.actions, until)
            remaining.append(_then(condition, inner))
        return trimmed(remaining)

    def _is_over(self, action: m.Action) -> bool:
        if isinstance(action, m.WithoutActor):
            return False
        gone = self.moment.gone
        started = isinstance(action, m.Starts) and self.orders_of(action.actor).started_s is not None
        return started or action.actor in gone or getattr(action, "other", None) in gone

    def things(self) -> tuple[m.When, ...]:
        """Return the trigger that restores the changed speed limits and the open doors."""
        record = self.trace.director or DirectorRecord()
        last: dict[tuple[object, ...], m.Action] = {}
        for order in record.things:
            if order.since_s > self.moment.time_s + 1e-6:
                break
            match order.action:
                case m.Limit() as limit:
                    key: tuple[object, ...] = limit.road, limit.lane
                case m.Door() as door:
                    key = "door", door.actor, door_side(door)
                case _:
                    continue
            last.pop(key, None)
            if not isinstance(order.action, m.Door) or (
                order.action.what == "opens" and order.action.actor not in self.moment.gone
            ):
                last[key] = order.action
        return (at_once(*last.values()),) if last else ()

    def placed(self, action: m.Action, *, now: bool = False) -> m.Action:
        """Return an action in which places on routes are written as points, because routes begin elsewhere in the clip.

        `now`: whether the action has begun.
        """
        points_of_fields: dict[str, m.Point] = {}
        current = self.orders_of(getattr(action, "actor", "")).speed
        if current is not None and type(current.action) is type(action) and now:
            action = current.action  # it already has points for places relative to actors
        for field, value in fields_of(action):
            if isinstance(value, m.AlongRoute | m.PastJunction):
                point = self.moment.places.get(text_of(value, frozenset()))
                points_of_fields |= {} if point is None else {field: point}
        if isinstance(action, m.FollowsPath):
            points = tuple(
                self.moment.places.get(text_of(place, frozenset()), place)
                if isinstance(place, m.AlongRoute | m.PastJunction)
                else place
                for place in action.points
            )
            return action.model_copy(update={"points": points})
        return action.model_copy(update=points_of_fields) if points_of_fields else action

    def rest_of(self, action: Resumed, since_s: float) -> Resumed | None:
        """Return the rest of an order that began at `since_s`; None if it is over."""
        left: Resumed | None
        match action:
            case m.StopsAt():
                left = self._rest_of_halt(action)
            case m.Stops():
                left = self._rest_of_stop(action, since_s)
            case m.ChangesSpeed() | m.ChangesLine():
                left = self._until(action, "over", since_s)
            case m.KeepsGap() | m.MatchesSpeed() | m.KeepsBeside() | m.BrakesFor():
                left = self._until(action, "duration", since_s)
            case m.Reverses():
                left = self._rest_of_way_back(action, since_s)
            case m.Synchronises():
                placed = self.placed(action, now=True)
                left = placed if isinstance(placed, m.Synchronises) else None
        return left

    def _rest_of_way_back(self, action: m.Reverses, since_s: float) -> m.Reverses | None:
        """Return the rest of an order to reverse; None if the actor drives forwards again."""
        along = self.trace.along[self.trace.frame_at(since_s) : self.frame + 1, self.trace.index(action.actor)]
        began, now = bool((~np.isnan(along)).any()), float(along[-1])
        if not began:
            return action
        if math.isnan(now):
            return None
        left = quantity(si_of(action.length) - now, "length")
        return action.model_copy(update={"length": left}) if left.si > 0 else None

    def _until(self, action: _Timed, field: str, since_s: float) -> _Timed | None:
        """Return an order with the rest of its time; an order without a time lasts for ever, but a change of line does
        not.
        """
        length = getattr(action, field)
        if not isinstance(length, m.Quantity):
            return None if isinstance(action, m.ChangesLine) else action
        left_s = since_s + length.si - self.moment.time_s
        return action.model_copy(update={field: seconds(left_s)}) if left_s > 1e-6 else None

    def _rest_of_stop(self, stop: m.Stops, since_s: float) -> m.Stops | None:
        """Return the rest of a stop; None if it is over.

        The time of a stop counts from the moment at which the actor stands, which the recorded speeds show.
        """
        if not isinstance(stop.duration, m.Quantity):
            return stop
        trace, began = self.trace, self.trace.frame_at(since_s)
        speeds = trace.states[began : self.frame + 1, trace.index(stop.actor), SPEED]
        stands = np.flatnonzero(speeds < STANDS_MPS)
        stood_s = float(trace.time_s[self.frame] - trace.time_s[began + stands[0]]) if stands.size else 0.0
        left_s = stop.duration.si - stood_s
        return m.Stops(actor=stop.actor, duration=seconds(left_s)) if left_s > 1e-6 else None

    def _rest_of_halt(self, halt: m.StopsAt) -> m.StopsAt | None:
        """Return the rest of a stop at a place; None if it is over."""
        placed, stands_s = self.placed(halt, now=True), self.orders_of(halt.actor).stands_s
        if not isinstance(placed, m.StopsAt) or not isinstance(placed.duration, m.Quantity) or stands_s is None:
            return placed if isinstance(placed, m.StopsAt) else None
        left_s = placed.duration.si - (self.moment.time_s - stands_s)
        return placed.model_copy(update={"duration": seconds(left_s)}) if left_s > 1e-6 else None

    def still_to_change(self, actor: str, since_s: float) -> bool:
        """Return whether an actor is still on the lane on which it got the order to change, so that SUMO has not begun
        the change.
        """
        lanes = self.trace.lanes[self.trace.frame_at(since_s) : self.frame + 1, self.trace.index(actor)]
        return bool(lanes.size and lanes[0] >= 0 and (lanes == lanes[0]).all())


def triggers_at(scenario: m.Scenario, trace: Trace, frame: int, *, later: frozenset[str] = frozenset()) -> Triggers:
    """Return the triggers of a run at a frame; `later`: the actors that are not there yet.

    Raises:
        ValueError: the trace has no record of its triggers, or is of another scenario.
    """
    record, whens, now_s = trace.director, scenario.all(m.When), float(trace.time_s[frame])
    if record is None:
        raise ValueError(
            "the trace has no record of its triggers, because an earlier version wrote it; run the test case again"
        )
    if len(record.triggers) != len(whens):
        raise ValueError(
            f"the trace is of another scenario: it has {len(record.triggers)} triggers, this one has {len(whens)}"
        )
    here = present(trace, frame)
    gone = frozenset(info.id for k, info in enumerate(trace.actors) if k not in here) - later
    timed = (a.name for a in scenario.all(m.Actor) if any(isinstance(item, m.Timing) for item in a.body))
    return Triggers(
        trace=trace,
        frame=frame,
        moment=ClipMoment(now_s, gone, {text: point_of(place) for text, place in record.places.items()}),
        whens=whens,
        states=record.triggers_at(now_s),
        orders=record.orders_at(now_s),
        timed=frozenset(timed),
    )


def at_once(*actions: m.Action) -> m.When:
    """Return a trigger that fires at the first frame."""
    return m.When(condition=m.Comparison(left=m.Measure(what="time"), op=">=", right=seconds(0.0)), actions=actions)


class _Rest:
    """Builds the rest of a trigger's sequence."""

    def __init__(self, triggers: Triggers, index: int) -> None:
        self._triggers, self._index = triggers, index
        self._now_s = triggers.moment.time_s
        record = triggers.trace.director or DirectorRecord()
        self._completes_after = record.completes_after
        again_s = record.fires_after(index, self._now_s)
        # When the trigger fires again, the sequence starts anew, so the remaining steps may begin only before that.
        self._until: m.Condition | bool = (
            m.Comparison(left=m.Measure(what="time"), op="<", right=seconds(again_s - self._now_s))
            if again_s is not None
            else True
        )
        self.taken: set[tuple[str, str]] = set()

    def block(self, actions: tuple[m.Action, ...], state: BlockState, place: Place) -> tuple[m.Action, ...]:
        """Return the rest of a block that has begun."""
        remaining: list[m.Action] = []
        for k, action in enumerate(actions):
            if k in state.complete:
                continue
            if not isinstance(action, m.Then):
                remaining += self._action(action, state.began_s, (*place, k))
            elif k in state.inner:
                inner = self.block(action.actions, state.inner[k], (*place, k))
                # If the inner block has no further steps, its orders need no block of their own, because the next step
                # waits for them either way.
                follows = any(isinstance(step, m.Then) for step in inner)
                remaining += [m.Then(actions=inner)] if follows else inner
            else:
                condition = self._condition(action, state.waits.get(k))
                if condition is False:
                    break
                remaining.append(_then(condition, self._triggers.future(action.actions, self._until)))
        return trimmed(remaining)

    def _condition(self, then: m.Then, runs: Runs | None) -> m.Condition | bool:
        """Return the condition for which a step that has not begun waits."""
        wanted: m.Condition | bool = True
        if then.condition is not None:
            wanted = rebased(then.condition, self._triggers.moment, runs)
        return both(wanted, self._until)

    def _action(self, action: m.Action, since_s: float, place: Place) -> list[m.Action]:
        """Return the rest of an incomplete action; if the action cannot be stated in a clip, a wait for the time until
        it ends.
        """
        if isinstance(action, m.Wait):
            end_s = since_s + si_of(action.duration)
            return [m.Wait(duration=seconds(max(0.0, end_s - self._now_s)))]
        left = self._order(action, since_s)
        if left is not None:
            self.taken.add((left.actor, _sets(left)))
            return [left]
        # The action continues without an order (a lane change or a crossing in progress); the run tells when it ends.
        completes_s = self._completes_after(self._index, place, self._now_s)
        after_run_s = float(self._triggers.trace.time_s[-1]) + STEP_S
        return [m.Wait(duration=seconds((after_run_s if completes_s is None else completes_s) - self._now_s))]

    def _order(self, action: m.Action, since_s: float) -> Resumed | m.Meets | m.ChangesLane | None:
        """Return the order to give again in the clip; None if the order cannot be repeated, or is over."""
        if isinstance(action, Resumed):
            return self._triggers.rest_of(action, since_s)
        match action:
            case m.ChangesLane():
                return action if self._triggers.still_to_change(action.actor, since_s) else None
            case m.Meets():
                orders = self._triggers.orders_of(action.actor)
                meets = orders.speed is not None and orders.speed.action == action and orders.keeps_mps is None
                return action if meets and action.actor not in self._triggers.timed else None
            case (
                m.Ignores()
                | m.Starts()
                | m.FollowsPath()
                | m.Leaves()
                | m.LeavesTrack()
                | m.TurnsTo()
                | m.Limit()
                | m.Door()
                | m.Wait()
                | m.Then()
            ):
                return None
            case _:
                assert_never(action)


def _sets(action: Resumed | m.Meets | m.ChangesLane) -> str:
    """Return the kind of an order (`speed`, `lane` or `sideways`); the next order of the same kind replaces it."""
    if isinstance(action, m.ChangesLane):
        return "lane"
    return "sideways" if isinstance(action, m.ChangesLine | m.KeepsBeside) else "speed"


def _then(condition: m.Condition | bool, inner: tuple[m.Action, ...]) -> m.Then:
    """Return a step. A step without actions gets a wait of 0 s, because later steps still wait for it."""
    wait = (m.Wait(duration=seconds(0.0)),)
    return m.Then(condition=None if isinstance(condition, bool) else condition, actions=inner or wait)


def _starts(whens: Iterable[m.When]) -> dict[str, None]:
    """Return the actors that triggers start, in their order."""
    return dict.fromkeys(a.actor for when in whens for a in all_actions(when.actions) if isinstance(a, m.Starts))


def trimmed(actions: list[m.Action]) -> tuple[m.Action, ...]:
    """Return the actions without steps at the end that only wait, and without waits after the last step."""
    while actions and isinstance(last := actions[-1], m.Then) and all(isinstance(a, m.Wait) for a in last.actions):
        actions.pop()
    thens = [k for k, action in enumerate(actions) if isinstance(action, m.Then)]
    last_then = thens[-1] if thens else -1
    return tuple(a for k, a in enumerate(actions) if k < last_then or not isinstance(a, m.Wait))
