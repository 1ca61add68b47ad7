"""What a run was doing at one frame: where everyone is, which way they still have to go, what they were told."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from foresee_dsl.language.model import (
    Action,
    Actor,
    Both,
    ChangesLane,
    ChangesSpeed,
    Comparison,
    Condition,
    Either,
    Ignores,
    Meets,
    MeetsState,
    Not,
    Predicate,
    Quantity,
    Scenario,
    Starts,
    Stops,
    Value,
    When,
)
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

SpeedCommand = ChangesSpeed | Meets | Stops
"""Actions that set an actor's speed: each replaces the one before."""


def present(trace: Trace, frame: int) -> tuple[int, ...]:
    """Return the columns of the actors that are in the world at a frame; the ego is first."""
    return tuple(k for k in range(len(trace.actors)) if not math.isnan(trace.states[frame, k, X]))


def front(trace: Trace, actor: int, frame: int) -> tuple[float, float]:
    """Return the middle of an actor's front, m (the trace holds the middle of the footprint)."""
    state, ahead = trace.states[frame, actor], trace.actors[actor].front_m
    return float(state[X] + ahead * math.cos(state[HEADING])), float(state[Y] + ahead * math.sin(state[HEADING]))


def remaining_route(trace: Trace, actor: int, frame: int) -> tuple[str, ...]:
    """Return the edges that an actor has still to drive, the first being the one it is on.

    On a junction (or off the lanes) that is the edge it came from, as SUMO wants it. The ego's begins as far back as it
    does not come to the same edge twice: the line that it follows hangs on where it came from.
    """
    route = trace.actors[actor].route
    at = 0
    for edge in edges_driven(trace, actor, frame):
        ahead = [k for k in range(at, len(route)) if route[k] == edge]
        at = ahead[0] if ahead else at
    while actor == 0 and at and route[at - 1] not in route[at:]:
        at -= 1
    return route[at:]


def edges_driven(trace: Trace, actor: int, frame: int) -> list[str]:
    """Return the edges that an actor was on up to a frame, in order, each change once; junctions' begin with `:`."""
    edges: list[str] = []
    for lane in trace.lanes[: frame + 1, actor]:
        edge = trace.lane_ids[lane].rpartition("_")[0] if lane >= 0 else ""
        if edge and (not edges or edges[-1] != edge):
            edges.append(edge)
    return edges


def has_passed(trace: Trace, actor: int, junction: str, frame: int) -> bool:
    """Say whether an actor has been on a junction and left it again before a frame."""
    on = [_junction_of(edge) == junction for edge in edges_driven(trace, actor, frame)]
    return any(on) and not on[-1]


def _junction_of(edge: str) -> str:
    """`:j4_3` lies in junction `j4`."""
    return edge[1:].rpartition("_")[0] if edge.startswith(":") else ""


@dataclass(frozen=True)
class Told:
    """What triggers have told one actor by a moment.

    Attributes:
        ignores: what it ignores.
        command: what sets its speed, and since when, s; None where nothing did. A change of speed that is over does
            not set it any more: it has become `cruise`.
        keeps_mps: the speed that it keeps near the junction where it meets another, m/s; None before.
        lane: the last change of lane that it was asked for, and when, s.
        started_s: when a trigger started it.
    """

    ignores: tuple[Ignores, ...] = ()
    command: tuple[SpeedCommand, float] | None = None
    cruise: Value | None = None
    keeps_mps: float | None = None
    lane: tuple[ChangesLane, float] | None = None
    started_s: float | None = None

    def at(self, time_s: float) -> Told:
        """Return the same at a later time: a change of speed may be over."""
        action, since_s = self.command or (None, 0.0)
        if not isinstance(action, ChangesSpeed):
            return self
        length_s = action.over.si if isinstance(action.over, Quantity) else 0.0
        return replace(self, command=None, cruise=action.to) if since_s + length_s <= time_s + 1e-6 else self

    def after(self, action: Action, time_s: float) -> Told:
        """Return what is in force when one more action has been told."""
        now = self.at(time_s)
        if isinstance(action, Ignores):
            return replace(now, ignores=(*now.ignores, action))
        if isinstance(action, ChangesLane):
            return replace(now, lane=(action, time_s))
        if isinstance(action, Starts):
            return replace(now, started_s=time_s if now.started_s is None else now.started_s)
        return replace(now, command=(action, time_s), keeps_mps=None)

    def meeting(self, trace: Trace, actor: str, now_s: float) -> Told:
        """Return the same with what has come of a meeting: the actor keeps its speed, or it is over."""
        action, since_s = self.command or (None, 0.0)
        found = self
        for event in trace.events:
            if isinstance(action, Meets) and event.actor == actor and since_s <= event.time_s <= now_s + 1e-6:
                if event.what == "keeps_speed":
                    found = replace(found, keeps_mps=event.detail["speed_mps"])
                elif event.what == "met":
                    found = replace(found, command=None, keeps_mps=None)
        return found


@dataclass(frozen=True)
class Script:
    """The triggers of a scenario at a moment: what those that fired told each actor, and those that have not fired."""

    told: Mapping[str, Told]
    pending: tuple[When, ...]

    def of(self, actor: str) -> Told:
        """Return what an actor was told."""
        return self.told.get(actor, Told())

    def waits(self, actor: str) -> bool:
        """Say whether an actor stands until one of the pending triggers starts it."""
        return any(isinstance(a, Starts) and a.actor == actor for when in self.pending for a in when.actions)


def script_at(scenario: Scenario, trace: Trace, frame: int) -> Script:
    """Fold the triggers that fired up to and including a frame into the state of the script."""
    now_s = float(trace.time_s[frame])
    fired = {e.detail.get("index"): e.time_s for e in trace.events if e.what == "trigger" and e.time_s <= now_s + 1e-6}
    whens = scenario.all(When)
    told = {
        actor.name: Told(command=(_meets(actor.name, item), 0.0))
        for actor in scenario.all(Actor)
        for item in actor.body
        if isinstance(item, MeetsState)
    }
    for number in sorted((k for k in range(len(whens)) if k in fired), key=lambda k: (fired[k], k)):
        for action in whens[number].actions:
            told[action.actor] = told.get(action.actor, Told()).after(action, fired[number])
    told = {actor: found.at(now_s).meeting(trace, actor, now_s) for actor, found in told.items()}
    waiting = (_without_started(when, told) for k, when in enumerate(whens) if k not in fired)
    return Script(told, tuple(when for when in waiting if when is not None))


def _meets(actor: str, state: MeetsState) -> Meets:
    return Meets(actor=actor, other=state.other, junction=state.junction, gap=state.gap, order=state.order)


def _without_started(when: When, told: Mapping[str, Told]) -> When | None:
    """Return a pending trigger without starts of actors that another one has started: they would wait for it."""

    def started(action: Action) -> bool:
        return isinstance(action, Starts) and told.get(action.actor, Told()).started_s is not None

    actions = tuple(action for action in when.actions if not started(action))
    return when.model_copy(update={"actions": actions}) if actions else None


def shifted(when: When, *, by_s: float, gone: frozenset[str]) -> When | None:
    """Return a pending trigger as a window that begins `by_s` seconds into the run has to say it.

    Times are counted from the window's beginning. Actions of actors that are gone are dropped; None comes back where
    nothing is left, or where the condition asks about one of them.
    """
    actions = tuple(a for a in when.actions if a.actor not in gone and getattr(a, "other", None) not in gone)
    if not actions or mentioned(when.condition) & gone:
        return None
    return When(condition=_shifted(when.condition, by_s), actions=actions)


def mentioned(condition: Condition) -> frozenset[str]:
    """Return every name (of an actor or a junction) in a condition."""
    if isinstance(condition, Both | Either):
        return frozenset[str]().union(*(mentioned(part) for part in condition.conditions))
    if isinstance(condition, Not):
        return mentioned(condition.condition)
    if isinstance(condition, Predicate):
        return frozenset({condition.actor})
    return frozenset({condition.left.actor or "", condition.left.other or ""}) - {""}


def _shifted(condition: Condition, by_s: float) -> Condition:
    if isinstance(condition, Both | Either):
        return condition.model_copy(update={"conditions": tuple(_shifted(c, by_s) for c in condition.conditions)})
    if isinstance(condition, Not):
        return Not(condition=_shifted(condition.condition, by_s))
    if isinstance(condition, Comparison) and condition.left.what == "time" and isinstance(condition.right, Quantity):
        return condition.model_copy(update={"right": Quantity.of(condition.right.si - by_s, "time", 2)})
    return condition


def authored(scenario: Scenario) -> dict[str, Actor]:
    """Return the actors that the scenario names, by name (not those of its background traffic)."""
    return {actor.name: actor for actor in scenario.all(Actor)}
