"""The triggers of a run at one frame: what they have told each actor, how far they have come, what is left of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from foresee_dsl.derive.clipping.conditions import Moment, both, restated, seconds
from foresee_dsl.derive.clipping.snapshot import present
from foresee_dsl.language.model import (
    Action,
    Actor,
    ChangesLane,
    ChangesSpeed,
    Comparison,
    Condition,
    Ignores,
    Measure,
    Meets,
    MeetsState,
    Point,
    Quantity,
    Scenario,
    Starts,
    Stops,
    Then,
    Timing,
    Value,
    Wait,
    When,
)
from foresee_dsl.language.traversal import all_actions
from foresee_dsl.simulate.trace import Event, Trace
from foresee_dsl.simulate.triggers.condition_history import Run

SpeedCommand = ChangesSpeed | Meets | Stops
"""Actions that set an actor's speed: each replaces the one before."""
Where = tuple[int, ...]
"""An action of a trigger: the numbers of the actions from its block inwards; `()` is the trigger's own block."""
PLACE_DIGITS = 4
"""As `derive.clip.DIGITS`."""


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
        if isinstance(action, Wait | Then):
            return now
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


@dataclass
class Progress:
    """How far one trigger has come by a moment.

    Attributes:
        fired: it has, at least once.
        held: an `every` or `next` waits until its condition ceases to hold before it fires again.
        began: when each block began, s. complete: actions that are.
        waits: `then when`s that look at their condition.
        runs: since when what each `for` is about holds, by block and by the `for`'s place in the condition.
        again_s: when it fires the next time; None where it does not.
        ends: when actions that are not complete will be, s.
    """

    held: bool = False
    fired: bool = False
    began: dict[Where, float] = field(default_factory=dict)
    complete: set[Where] = field(default_factory=set)
    waits: set[Where] = field(default_factory=set)
    runs: dict[Where, dict[int, Run]] = field(default_factory=dict)
    again_s: float | None = None
    ends: dict[Where, float] = field(default_factory=dict)

    def take(self, event: Event) -> None:
        """Go on by an event of the trigger."""
        where = tuple(event.detail.get("where", ()))
        if event.what == "trigger":
            self.fired = self.held = True
            self.began, self.complete, self.waits = {(): event.time_s}, set(), set()
            self.runs = {(): self.runs.get((), {})}
        elif event.what == "rearmed":
            self.held = False
        elif event.what == "then":
            self.began[where] = event.time_s
        elif event.what == "complete":
            self.complete.add(where)
        elif event.what == "waits":
            self.waits.add(where)
        elif event.what == "holds":
            self.runs.setdefault(where, {})[event.detail["part"]] = Run(event.detail["since_s"], event.detail["known"])
        elif event.what == "lapses":
            self.runs.get(where, {}).pop(event.detail["part"], None)

    def look_ahead(self, event: Event) -> None:
        """Take a later event: what is going on ends, unless the trigger fires before that."""
        if self.again_s is not None:
            return
        if event.what == "trigger":
            self.again_s = event.time_s
        elif event.what == "complete":
            self.ends.setdefault(tuple(event.detail["where"]), event.time_s)


@dataclass(frozen=True)
class Script:
    """The triggers of a scenario at a moment.

    Attributes:
        moment: which.
        told: what they have told each actor.
        pending: those that may still fire, as the window has to say them.
        progress: of each trigger of the scenario, in its order.
        whens: the scenario's.
        timed: actors with a `timing`, who do not adapt to whom they meet.
    """

    moment: Moment
    told: Mapping[str, Told]
    pending: tuple[When, ...]
    progress: tuple[Progress, ...]
    whens: tuple[When, ...]
    timed: frozenset[str] = frozenset()

    def of(self, actor: str) -> Told:
        """Return what an actor was told."""
        return self.told.get(actor, Told())

    def future(self, actions: Iterable[Action], until: Condition | bool = True) -> tuple[Action, ...]:
        """Return actions that have not begun as the window has to say them; `until`: what each step waits for besides.

        Those of actors that are gone are left out, and starts of actors that have been started: they would wait for it.
        What comes `then` once a condition holds that never will is left out with all that comes after it.
        """
        found: list[Action] = []
        for action in actions:
            if not isinstance(action, Then):
                found += [action] if isinstance(action, Wait) or not self._is_over(action) else []
                continue
            said = True if action.condition is None else restated(action.condition, self.moment)
            condition = both(said, until)
            if condition is False:
                break
            inner = self.future(action.actions, until) or (Wait(duration=seconds(0.0)),)
            found.append(Then(condition=None if condition is True else condition, actions=inner))
        return trimmed(found)

    def _is_over(self, action: Action) -> bool:
        if isinstance(action, Wait | Then):
            return False
        gone = self.moment.gone
        started = isinstance(action, Starts) and self.of(action.actor).started_s is not None
        return started or action.actor in gone or getattr(action, "other", None) in gone


def script_at(scenario: Scenario, trace: Trace, frame: int) -> Script:
    """Fold what the triggers did up to and including a frame into the state of the script."""
    now_s = float(trace.time_s[frame])
    whens = scenario.all(When)
    here = present(trace, frame)
    gone = frozenset(info.id for k, info in enumerate(trace.actors) if k not in here)
    progress = tuple(Progress(held=when.repeat == "next") for when in whens)
    told = {
        actor.name: Told(command=(_meets(actor.name, item), 0.0))
        for actor in scenario.all(Actor)
        for item in actor.body
        if isinstance(item, MeetsState)
    }
    for event in sorted(trace.events, key=lambda event: event.time_s):  # stable: in one frame as they happened
        index = event.detail.get("index")
        if not isinstance(index, int) or not 0 <= index < len(whens) or event.actor:
            continue
        if event.time_s > now_s + 1e-6:
            progress[index].look_ahead(event)
            continue
        progress[index].take(event)
        if event.what in ("trigger", "then"):
            for action in block(whens[index].actions, tuple(event.detail.get("where", ()))):
                if not isinstance(action, Wait | Then):
                    told[action.actor] = told.get(action.actor, Told()).after(action, event.time_s)
    told = {actor: found.at(now_s).meeting(trace, actor, now_s) for actor, found in told.items()}
    timed = frozenset(a.name for a in scenario.all(Actor) if any(isinstance(item, Timing) for item in a.body))
    script = Script(Moment(now_s, gone, _places(trace)), told, (), progress, whens, timed)
    return replace(script, pending=tuple(_pending(script)))


def held_back(script: Script, whens: Iterable[When]) -> tuple[When, ...]:
    """Return a trigger that never fires, for the actors that nobody will start any more.

    Without it they would not wait: who is started by no trigger moves off by itself.
    """
    still = {a.actor for when in whens for a in all_actions(when.actions) if isinstance(a, Starts)}
    names = [a.actor for when in script.whens for a in all_actions(when.actions) if isinstance(a, Starts)]
    left = [
        name
        for name in dict.fromkeys(names)
        if name not in still | script.moment.gone and script.of(name).started_s is None
    ]
    never = Comparison(left=Measure(what="time"), op="<", right=seconds(0.0))
    return (When(condition=never, actions=tuple(Starts(actor=name) for name in left)),) if left else ()


def block(actions: tuple[Action, ...], where: Where) -> tuple[Action, ...]:
    """Return the actions of a block inside a trigger's."""
    for k in where:
        action = actions[k]
        if not isinstance(action, Then):
            raise ValueError(f"the trace is of another scenario: {action.kind} is no block")
        actions = action.actions
    return actions


def _places(trace: Trace) -> dict[str, Point]:
    places = (event.detail for event in trace.events if event.what == "place")
    return {place["text"]: Point(x=_metres(place["x"]), y=_metres(place["y"])) for place in places}


def _metres(value: float) -> Quantity:
    return Quantity.of(value, "length", PLACE_DIGITS)


def _meets(actor: str, state: MeetsState) -> Meets:
    return Meets(actor=actor, other=state.other, junction=state.junction, gap=state.gap, order=state.order)


def _pending(script: Script) -> Iterator[When]:
    """Yield the triggers that may still fire."""
    for when, progress in zip(script.whens, script.progress, strict=True):
        again = when.repeat in ("every", "next")
        if progress.fired and not again:
            continue
        held = progress.held if again else None
        condition = restated(when.condition, script.moment, progress.runs.get((), {}), held=held)
        actions = script.future(when.actions)
        if actions and not isinstance(condition, bool):
            repeat = ("next" if progress.held else "every") if again else when.repeat
            yield When(repeat=repeat, name=when.name, condition=condition, actions=actions)


def trimmed(actions: list[Action]) -> tuple[Action, ...]:
    """Leave out the steps at the end in which nothing happens, and waiting that nothing waits for."""
    while actions and isinstance(last := actions[-1], Then) and all(isinstance(a, Wait) for a in last.actions):
        actions.pop()
    thens = [k for k, action in enumerate(actions) if isinstance(action, Then)]
    last_then = thens[-1] if thens else -1
    return tuple(a for k, a in enumerate(actions) if k < last_then or not isinstance(a, Wait))
