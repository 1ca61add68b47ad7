"""What the director of a run records of itself, for clips that begin in the middle of the run.

Each trigger and each actor has its states in the order of time. A state holds from its `time_s` on until the next one;
one is added at the end of a frame at which something has changed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Protocol, TypeVar, assert_never

from pydantic import TypeAdapter

from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of

Place = tuple[int, ...]
"""Where an action is in a trigger: the numbers of the actions from the trigger's block inwards."""
_ROUNDING_S = 1e-6


@dataclass(frozen=True, slots=True)
class Run:
    """Since when what a `for` is about holds without a break.

    Under an odd number of `not`, a frame without an outcome counts as holding: only a false `for` matters there.

    Attributes:
        since_s: in the run, or before it (`for 2 s since -1.30 s`).
        known: that it did not hold just before; False where it was not evaluated then, or had no outcome.
    """

    since_s: float
    known: bool


Runs = dict[int, Run]
"""The runs of a condition, by the place of each `for` among the condition's `parts`; only of those that hold."""


@dataclass(frozen=True, slots=True)
class BlockState:
    """A block of actions that has begun.

    Attributes:
        began_s: when. complete: the numbers of the actions that are.
        waits: of each `then when` that looks at its condition, the runs.
        inner: the blocks inside it that have begun and are not complete.
    """

    began_s: float
    complete: frozenset[int]
    waits: dict[int, Runs]
    inner: dict[int, BlockState]

    def is_complete(self, place: Place) -> bool:
        """Say whether an action that is inside the block is complete."""
        first, *rest = place
        if first in self.complete:
            return True
        return bool(rest) and first in self.inner and self.inner[first].is_complete(tuple(rest))


@dataclass(frozen=True, slots=True)
class TriggerState:
    """How far a trigger has come, from `time_s` on.

    Attributes:
        fired_s: when it fired the last time; None where it has not. runs: of its condition.
        held: an `every` or `next` waits until its condition ceases to hold before it fires again.
        sequence: what it set off, while some of that is not complete; None where nothing waits for anything.
    """

    time_s: float
    fired_s: float | None
    held: bool
    runs: Runs
    sequence: BlockState | None


@dataclass(frozen=True, slots=True)
class Order:
    """An action that an actor was told, when, and until when it lasts where that is known from the start, s."""

    action: m.Action
    since_s: float
    until_s: float | None = None


@dataclass(frozen=True, slots=True)
class ActorOrders:
    """What triggers have told one actor, from `time_s` on.

    Attributes:
        ignores: the rules that it was told to ignore.
        speed: what sets its speed, None where nothing does: a change of speed that is over has become `cruise`.
        cruise: what it drives since then where nothing hinders it.
        keeps_mps: the speed that it keeps near the junction where it meets another; None before.
        lane: the last change of lane that it was asked for. started_s: when a trigger started it first.
        stands_s: since when it stands at the place where it was told to stop.
        path: the path that it was told to follow last, from where it was. joins: the edges that it drives over then.
        sideways: what it was told last about where across its lane it keeps. line_m: what it keeps now.
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
        """Return the same at a later time: a change of speed may be over."""
        until_s = self.speed.until_s if self.speed else None
        if until_s is None or until_s > time_s + _ROUNDING_S:
            return self
        action = self.speed.action if self.speed else None
        return replace(self, speed=None, cruise=action.to if isinstance(action, m.ChangesSpeed) else self.cruise)

    def after(self, action: m.Action, time_s: float) -> ActorOrders:
        """Return what is in force when one more action has been told."""
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
            case m.FollowsPath() | m.Leaves() | m.TurnsTo() | m.Limit() | m.Door() | m.Wait() | m.Then():
                after = now
            case _:
                assert_never(action)
        return after


@dataclass(frozen=True)
class DirectorRecord:
    """The states of a run's triggers and of what its actors were told.

    Attributes:
        triggers: by trigger, in the scenario's order.
        orders: by actor; those that were never told anything are left out.
        places: where the places on routes of the triggers' conditions and actions are, m, by their text.
        things: the speed limits that were changed and the doors that were opened or shut, in the order of time.
    """

    triggers: tuple[tuple[TriggerState, ...], ...] = ()
    orders: Mapping[str, tuple[ActorOrders, ...]] = field(default_factory=dict)
    places: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    things: tuple[Order, ...] = ()

    def triggers_at(self, time_s: float) -> tuple[TriggerState, ...]:
        """Return how far each trigger has come at a time."""
        return tuple(_at(states, time_s) for states in self.triggers)

    def orders_at(self, time_s: float) -> dict[str, ActorOrders]:
        """Return what each actor has been told by a time."""
        found = {actor: _at(states, time_s).at(time_s) for actor, states in self.orders.items()}
        return {actor: orders for actor, orders in found.items() if orders.time_s <= time_s + _ROUNDING_S}

    def fires_after(self, trigger: int, time_s: float) -> float | None:
        """Return when a trigger fires the next time after a time; None where it does not."""
        fired = (state.fired_s for state in self.triggers[trigger])
        return next((at for at in fired if at is not None and at > time_s + _ROUNDING_S), None)

    def completes_after(self, trigger: int, place: Place, time_s: float) -> float | None:
        """Return when an action that is under way at a time will be complete; None where its trigger fires again, or
        the run ends, before that."""
        states = self.triggers[trigger]
        fired_s = _at(states, time_s).fired_s
        for state in states:
            if state.time_s <= time_s + _ROUNDING_S:
                continue
            if state.fired_s != fired_s:
                return None
            if state.sequence is None or state.sequence.is_complete(place):
                return state.time_s
        return None

    def as_json(self) -> bytes:
        """Return it as it is in a trace's file."""
        return _adapter().dump_json(self)

    @staticmethod
    def of_json(text: bytes) -> DirectorRecord:
        """Read what `as_json` wrote; a `ValueError` where it is something else."""
        return _adapter().validate_json(text)


class _Timed(Protocol):
    @property
    def time_s(self) -> float: ...


_State = TypeVar("_State", bound=_Timed)


def add(states: list[_State], state: _State) -> None:
    """Add a state to those before it; it replaces one of the same frame."""
    if states and states[-1].time_s >= state.time_s:
        states.pop()
    states.append(state)


def _at(states: Sequence[_State], time_s: float) -> _State:
    """Return the state at a time; the first one before that."""
    return next((state for state in reversed(states) if state.time_s <= time_s + _ROUNDING_S), states[0])


@cache
def _adapter() -> TypeAdapter[DirectorRecord]:
    return TypeAdapter(DirectorRecord)
