"""The record of a run's triggers and orders, which a clip that begins in the middle of the run needs.

Each trigger and each actor has a list of states in order of time. A state is valid from its `time_s` until the next
one; a state is added at the end of each frame in which it changed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Protocol, TypeVar, assert_never

from pydantic import TypeAdapter

from foresee_dsl.kernels.constants import STEP_S
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of
from foresee_dsl.language.units import ROUNDING_S

Place = tuple[int, ...]
"""Place of an action in a trigger: the indices of the actions from the trigger's block inwards."""


def frames_of(duration_s: float) -> int:
    """Return the number of steps for which the condition of a `for` with this duration must hold."""
    return max(0, math.ceil(duration_s / STEP_S - 1e-6))


def frames_since(time_s: float, now_s: float) -> int:
    """Return the number of frames from a time (included) to now (excluded)."""
    return math.floor((now_s - time_s) / STEP_S + 1e-6)


@dataclass(frozen=True, slots=True)
class HoldingTime:
    """The time for which the condition of a `for` has held without interruption.

    Under an odd number of `not`, a frame without an outcome counts as a frame at which the condition holds, because
    only a `for` that is false can change the result there.

    Attributes:
        since_s: time from which it holds, in the run or before it (`for 2 s since -1.30 s`).
        known: whether it is known not to have held just before; False if it was not evaluated then or had no outcome.
    """

    since_s: float
    known: bool


Runs = dict[int, HoldingTime]
"""For each `for` whose condition holds at present, how long it has held; the key is its index in `parts`."""


@dataclass(frozen=True)
class ClipMoment:
    """The moment of a run at which a clip begins.

    Attributes:
        time_s: its time in the run.
        gone: actors that have left.
        places: the points of places on routes, by the text of each place. Routes begin elsewhere in the clip, so the
            clip states these places as points.
    """

    time_s: float
    gone: frozenset[str]
    places: Mapping[str, m.Point]


Rewritten = m.Condition | bool
"""A condition rewritten for a clip, or its outcome if that is fixed from the clip's beginning on."""


def seconds(value: float) -> m.Quantity:
    """Return a time with two decimals, which suffice for multiples of the step, or with six for other times."""
    return m.Quantity.of(value, "time", 2 if abs(round(value, 2) - value) < 1e-7 else 6)


@dataclass(frozen=True, slots=True)
class BlockState:
    """A block of actions that has begun.

    Attributes:
        began_s: time at which it began. complete: indices of completed actions.
        waits: for each `then when` that evaluates its condition, the condition's runs.
        inner: blocks inside it that have begun and are not complete.
    """

    began_s: float
    complete: frozenset[int]
    waits: dict[int, Runs]
    inner: dict[int, BlockState]

    def is_complete(self, place: Place) -> bool:
        """Return whether an action inside the block is complete."""
        first, *rest = place
        if first in self.complete:
            return True
        return bool(rest) and first in self.inner and self.inner[first].is_complete(tuple(rest))


@dataclass(frozen=True, slots=True)
class TriggerState:
    """The state of a trigger from `time_s` on.

    Attributes:
        fired_s: time at which it last fired, None before. runs: the runs of its condition.
        held: whether an `every` or `next` must wait until its condition ceases to hold before it fires again.
        sequence: the progress of its actions while some are not complete; None if no action waits for another one.
    """

    time_s: float
    fired_s: float | None
    held: bool
    runs: Runs
    sequence: BlockState | None


@dataclass(frozen=True, slots=True)
class Order:
    """An action that was ordered, with the time of the order and, if it is known in advance, the time at which it ends,
    s.
    """

    action: m.Action
    since_s: float
    until_s: float | None = None


@dataclass(frozen=True, slots=True)
class ActorOrders:
    """The orders of triggers to one actor, from `time_s` on.

    Attributes:
        ignores: orders to ignore rules.
        speed: the speed order in force; None without one: a completed change of speed becomes `cruise`.
        cruise: the cruising speed of the last completed change of speed.
        keeps_mps: the speed that it keeps near the junction where it meets another actor; None before.
        lane: the last order to change lane. started_s: time at which a trigger first started it.
        stands_s: time from which it stands at the place where it was ordered to stop.
        path: the last path that it was ordered to follow, from its position at that time. joins: the edges that it
            joins at the path's end.
        sideways: the last order about its lateral position. line_m: the line that it keeps now.
    """

    time_s: float = 0.0
    ignores: tuple[m.Ignores, ...] = ()
    speed: Order | None = None
    cruise: m.Value | None = None
    keeps_mps: float | None = None
    lane: Order | None = None
    started_s: float | None = None
    stands_s: float | None = None
    sideways: Order | None = None
    line_m: float | None = None
    path: tuple[tuple[float, float], ...] = ()
    joins: tuple[str, ...] = ()

    def at(self, time_s: float) -> ActorOrders:
        """Return the orders in force at a later time, when a change of speed may be complete."""
        until_s = self.speed.until_s if self.speed else None
        if until_s is None or until_s > time_s + ROUNDING_S:
            return self
        action = self.speed.action if self.speed else None
        return replace(self, speed=None, cruise=action.to if isinstance(action, m.ChangesSpeed) else self.cruise)

    def after(self, action: m.Action, time_s: float) -> ActorOrders:
        """Return the orders in force after one more order."""
        now = replace(self.at(time_s), time_s=time_s)
        match action:
            case m.Ignores():
                after = replace(now, ignores=(*now.ignores, action))
            case m.ChangesLane():
                after = replace(now, lane=Order(action, time_s))
            case m.Starts():
                after = replace(now, started_s=time_s if now.started_s is None else now.started_s)
            case m.ChangesSpeed():
                length_s = 0.0 if action.over is None else si_of(action.over)
                after = replace(now, speed=Order(action, time_s, time_s + length_s), keeps_mps=None, stands_s=None)
            case m.ChangesLine() | m.KeepsBeside():
                after = replace(now, sideways=Order(action, time_s))
            case m.KeepsGap() | m.MatchesSpeed() | m.BrakesFor():
                until_s = None if action.duration is None else time_s + si_of(action.duration)
                after = replace(now, speed=Order(action, time_s, until_s), keeps_mps=None, stands_s=None)
            case m.Meets() | m.Stops() | m.StopsAt() | m.Synchronises() | m.Reverses():
                after = replace(now, speed=Order(action, time_s), keeps_mps=None, stands_s=None)
            case m.FollowsPath() | m.Leaves() | m.LeavesTrack():
                after = now
            case m.TurnsTo() | m.Limit() | m.Door() | m.Wait() | m.Then():
                after = now
            case _:
                assert_never(action)
        return after


@dataclass(frozen=True)
class DirectorRecord:
    """The states of a run's triggers and of the orders to its actors.

    Attributes:
        triggers: states by trigger, in the scenario's order.
        orders: states by actor, for actors with orders.
        places: x and y (m) of the places on routes in the triggers' conditions and actions, by their text.
        things: changes of speed limits and of doors (states of things, not of actors), in order of time.
    """

    triggers: tuple[tuple[TriggerState, ...], ...] = ()
    orders: Mapping[str, tuple[ActorOrders, ...]] = field(default_factory=dict)
    places: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    things: tuple[Order, ...] = ()

    def triggers_at(self, time_s: float) -> tuple[TriggerState, ...]:
        """Return the state of each trigger at a time."""
        return tuple(_at(states, time_s) for states in self.triggers)

    def orders_at(self, time_s: float) -> dict[str, ActorOrders]:
        """Return the orders to each actor up to a time."""
        by_actor = {actor: _at(states, time_s).at(time_s) for actor, states in self.orders.items()}
        return {actor: orders for actor, orders in by_actor.items() if orders.time_s <= time_s + ROUNDING_S}

    def fires_after(self, trigger: int, time_s: float) -> float | None:
        """Return when a trigger next fires after a time; None if it does not."""
        fired = (state.fired_s for state in self.triggers[trigger])
        return next((at for at in fired if at is not None and at > time_s + ROUNDING_S), None)

    def completes_after(self, trigger: int, place: Place, time_s: float) -> float | None:
        """Return when an action in progress at a time will be complete; None if its trigger fires again, or the run
        ends, before that."""
        states = self.triggers[trigger]
        fired_s = _at(states, time_s).fired_s
        for state in states:
            if state.time_s <= time_s + ROUNDING_S:
                continue
            if state.fired_s != fired_s:
                return None
            if state.sequence is None or state.sequence.is_complete(place):
                return state.time_s
        return None

    def as_json(self) -> bytes:
        """Return the record as JSON, as a trace's file holds it."""
        return _adapter().dump_json(self)

    @staticmethod
    def of_json(text: bytes) -> DirectorRecord:
        """Read a record from the JSON of `as_json`; raises `ValueError` for anything else."""
        return _adapter().validate_json(text)


class _Timed(Protocol):
    @property
    def time_s(self) -> float: ...


_State = TypeVar("_State", bound=_Timed)


def add(states: list[_State], state: _State) -> None:
    """Append a state; if the last state is of the same frame, replace it."""
    if states and states[-1].time_s >= state.time_s:
        states.pop()
    states.append(state)


def _at(states: Sequence[_State], time_s: float) -> _State:
    """Return the state at a time; before the first state, the first state."""
    return next((state for state in reversed(states) if state.time_s <= time_s + ROUNDING_S), states[0])


@cache
def _adapter() -> TypeAdapter[DirectorRecord]:
    return TypeAdapter(DirectorRecord)
