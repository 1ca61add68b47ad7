"""Triggers and what they set off: actors start, stop, change speed or lane, ignore rules, or meet another actor.

Everything that takes effect is noted as an event, with all that is needed to say it again in a clip: `trigger`,
`rearmed` (the condition of an `every` has ceased to hold), `holds` (with a `watch.Run`) and `lapses` (of what a `for`
is about), `place` (where a place on somebody's route is), the steps of a sequence (see `sequences`), and what each
actor does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from itertools import count
from typing import Any

from foresee_dsl.compile.placement.starts import lane_kind
from foresee_dsl.language.model import (
    Action,
    ChangesLane,
    ChangesSpeed,
    Condition,
    Ignores,
    Meets,
    MeetsState,
    Starts,
    Stops,
    Then,
    Wait,
    When,
)
from foresee_dsl.language.printing.phrases import place as text_of
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.speed_orders import BOUND_FROM_M, Command, Meeting, Ramp, Stop
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.triggers.condition_history import Run, Watch
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.sequences import Doing, Sequence, Where

IN_LANE_M = 0.2
"""Who is this near to a lane's middle is in it. Ours: the slack that drivers keep in a lane is larger."""


class Director:
    """Watches the triggers of a scene and carries out what they set off.

    Args:
        simulation: the actors, at the first frame. recorder: takes the events.
    """

    def __init__(self, simulation: Simulation, conditions: Conditions, recorder: Recorder) -> None:
        self._simulation, self._conditions, self._recorder = simulation, conditions, recorder
        self._commands: dict[str, Command] = {}
        self._latest: dict[str, Command] = {}
        self._new: list[str] = []
        self._starts: dict[str, float] = {}
        self._bound: list[tuple[Actor, str, str]] = []
        self._bound_on: set[tuple[str, str, str]] = set()
        self._do: dict[type, Callable[..., Doing]] = {
            Meets: self._meets,
            Ignores: self._ignores,
            Starts: self._start,
            ChangesSpeed: self._change_speed,
            ChangesLane: self._change_lane,
            Stops: self._stop,
        }
        self._begin()
        self._triggers = [_Trigger(index, when, self) for index, when in enumerate(simulation.scene.whens)]

    def step(self) -> None:
        """Look at the frame that the simulation is at; what follows takes effect in the next step."""
        if not (self._triggers or self._commands or self._starts or self._bound):
            return
        time_s = self._simulation.time_s
        self._new.clear()
        for trigger in self._triggers:
            trigger.look()
        for name in [name for name, at in self._starts.items() if time_s >= at - STEP_S / 100]:
            del self._starts[name]
            self._simulation.order_speed(self._simulation.by_id[name], self._simulation.cruise_mps[name])
        self._keep_bounds()
        self._update(list(self._commands))
        # What is complete now lets the next step begin now; an order that it gives may be complete at once.
        for _ in count():
            self._new.clear()
            for trigger in self._triggers:
                trigger.advance()
            if not self._new:
                return
            self._update(self._new)

    def _update(self, names: list[str]) -> None:
        for name in list(dict.fromkeys(names)):
            command = self._commands.get(name)
            if command is not None and not command.update(self._simulation.time_s):
                del self._commands[name]

    # --- what triggers need ----------------------------------------------------------------------------------------

    def event(self, what: str, detail: dict[str, Any]) -> None:
        """Note something about a trigger."""
        self._recorder.event(self._simulation.time_s, "", what, detail)

    def watch(self, condition: Condition, index: int, where: Where) -> Watch:
        """Begin to watch a condition of a trigger (or of one of its steps)."""

        def note(part: int, run: Run | None) -> None:
            detail = {"index": index, "where": list(where), "part": part}
            self.event("lapses" if run is None else "holds", detail if run is None else detail | asdict(run))

        return Watch(condition, self._conditions, note)

    def act(self, action: Action) -> Doing:
        """Begin an action; what comes back says whether it is complete."""
        if isinstance(action, Wait):
            until = self._simulation.time_s + si_of(action.duration)
            return lambda: self._simulation.time_s >= until - STEP_S / 100
        if isinstance(action, Then):
            raise TypeError("a block is no action of its own: `Sequence` goes through it")
        actor = self._simulation.by_id.get(action.actor)
        if actor is None or not actor.present:  # one of the traffic may have found no room
            return _at_once
        doing = self._do[type(action)](actor, action)
        return lambda: not actor.present or doing()

    def _begin(self) -> None:
        for actor in self._simulation.actors[1:]:
            placed = actor.placed
            if placed.control == "static":
                continue
            if placed.waits:
                self._simulation.order_speed(actor, 0.0)
            elif placed.delay_s > 0:
                self._simulation.order_speed(actor, 0.0)
                self._starts[actor.id] = placed.delay_s
            for what, junction in placed.ignores:
                self._ignore(actor, what, junction)
            for meets in placed.meets:
                self._meet(actor, meets)
        for text, (x, y) in self._places().items():
            self.event("place", {"text": text, "x": x, "y": y})

    def _places(self) -> dict[str, tuple[float, float]]:
        """Where the places of the triggers' conditions are: on a route they hang on where somebody starts."""
        return {text_of(place, frozenset()): at for place, at in self._simulation.scene.places.items()}

    def _order(self, actor: Actor, command: Command) -> Doing:
        """Give an order; it is over when it is done, or when another one replaces it."""
        self._commands[actor.id] = self._latest[actor.id] = command
        self._new.append(actor.id)
        return lambda: self._latest[actor.id] is not command or command.complete()

    # --- actions ---------------------------------------------------------------------------------------------------

    def _meets(self, actor: Actor, action: Meets) -> Doing:
        return self._meet(actor, action)

    def _meet(self, actor: Actor, meets: Meets | MeetsState) -> Doing:
        detail = {
            "other": meets.other,
            "junction": word_of(meets.junction),
            "gap_s": si_of(meets.gap),
            "order": meets.order,
        }
        self._recorder.event(self._simulation.time_s, actor.id, "meets", detail)
        meeting = Meeting(self._simulation, self._recorder, actor, meets)
        if actor.placed.timing == 1.0:
            return self._order(actor, meeting)
        # It would make up for its `timing`: it drives on as it would have driven now, times the factor.
        if not meeting.over():
            self._commands.pop(actor.id, None)
            self._simulation.cruise_mps[actor.id] = meeting.asked() * actor.placed.timing
            self._simulation.order_speed(actor, self._simulation.cruise_mps[actor.id])
        self._latest[actor.id] = meeting
        return lambda: self._latest[actor.id] is not meeting or meeting.complete()

    def _ignores(self, actor: Actor, action: Ignores) -> Doing:
        self._ignore(actor, action.what, None if action.junction is None else word_of(action.junction))
        return _at_once

    def _ignore(self, actor: Actor, what: str, junction: str | None) -> None:
        self._recorder.event(self._simulation.time_s, actor.id, "ignores", {"what": what, "junction": junction})
        if junction is None:
            self._simulation.ignore(actor, what)
        else:
            self._bound.append((actor, what, junction))

    def _start(self, actor: Actor, _: Starts) -> Doing:
        self._recorder.event(self._simulation.time_s, actor.id, "starts", {"delay_s": actor.placed.delay_s})
        at = self._starts[actor.id] = self._simulation.time_s + actor.placed.delay_s
        return lambda: self._simulation.time_s >= at - STEP_S / 100

    def _change_speed(self, actor: Actor, action: ChangesSpeed) -> Doing:
        to, over = si_of(action.to), None if action.over is None else si_of(action.over)
        detail = {"to_mps": to, "over_s": over, "from_mps": actor.speed}
        self._recorder.event(self._simulation.time_s, actor.id, "changes_speed", detail)
        return self._order(actor, Ramp(self._simulation, actor, to * actor.placed.timing, over or 0.0))

    def _change_lane(self, actor: Actor, action: ChangesLane) -> Doing:
        side = word_of(action.side)
        self._recorder.event(self._simulation.time_s, actor.id, "changes_lane", {"side": side})
        if actor.id not in self._simulation.world:
            return _at_once
        self._simulation.world.change_lane(actor.id, 1 if side == "left" else -1)
        edge, _, index = actor.lane.rpartition("_")
        target = f"{edge}_{int(index or -1) + (1 if side == 'left' else -1)}"
        return lambda: self._in_lane(actor, target)

    def _in_lane(self, actor: Actor, target: str) -> bool:
        """Whether an actor has come to a lane, or cannot: there is none, or it has driven on to another road."""
        lane = self._simulation.network.lanes.get(target)
        if lane is None or lane_kind(actor.placed.model) not in lane.kinds:
            return True
        if actor.lane.rpartition("_")[0] != lane.edge:
            return True
        return actor.lane == target and abs(lane.line.project(*actor.front)[1]) <= IN_LANE_M

    def _stop(self, actor: Actor, action: Stops) -> Doing:
        duration = None if action.duration is None else si_of(action.duration)
        self._recorder.event(self._simulation.time_s, actor.id, "stops", {"duration_s": duration})
        return self._order(actor, Stop(self._simulation, actor, duration))

    def _keep_bounds(self) -> None:
        """Let actors ignore a rule while they are near the junction that was named, and only there."""
        for actor, what, junction in self._bound:
            if not actor.present:
                continue
            key = (actor.id, what, junction)
            near = self._near(actor, junction)
            if near != (key in self._bound_on):
                (self._bound_on.add if near else self._bound_on.discard)(key)
                self._simulation.ignore(actor, what, on=near)

    def _near(self, actor: Actor, junction: str) -> bool:
        progress, frame = self._simulation.progress, self._simulation.frame
        span = progress.span(actor, junction)
        if span is None:
            return False
        rear = progress.front(actor, frame) - actor.length
        return rear <= span[1] and progress.to_junction(actor, junction, frame) <= BOUND_FROM_M


class _Trigger:
    """One `when`: its condition, and how far what it set off has come.

    When an `every` fires while its own sequence still runs, the sequence starts anew: what the old one has set off goes
    on until something replaces it, but the rest of its steps do not come any more. While its condition cannot be said,
    nothing changes.
    """

    def __init__(self, index: int, when: When, director: Director) -> None:
        self._index, self._when, self._director = index, when, director
        self._watch: Watch | None = director.watch(when.condition, index, ())
        self._held = when.repeat == "next"  # it fires when its condition holds and did not hold before
        self._follows = any(isinstance(action, Then) for action in when.actions)
        self._sequence: Sequence | None = None

    def look(self) -> None:
        if self._watch is None:
            return
        outcome = self._watch.look()
        if outcome is None:  # too early to say, or never: it neither begins to hold nor ceases to
            return
        fires, ceased = outcome.held and not self._held, self._held and not outcome.held
        self._held = outcome.held
        if ceased:
            self._director.event("rearmed", {"index": self._index})
        if fires:
            if self._when.repeat in (None, "once"):
                self._watch = None
            self._director.event("trigger", {"index": self._index})
            sequence = Sequence(self._when.actions, self)
            self._sequence = sequence if self._follows else None

    def advance(self) -> None:
        if self._sequence is not None:
            self._sequence.advance()
            if self._sequence.complete:
                self._sequence = None

    # --- the stage of its sequence ---------------------------------------------------------------------------------

    def begin(self, action: Action) -> Doing:
        return self._director.act(action)

    def watch(self, condition: Condition, where: Where) -> Watch:
        return self._director.watch(condition, self._index, where)

    def note(self, what: str, where: Where) -> None:
        self._director.event(what, {"index": self._index, "where": list(where)})


def _at_once() -> bool:
    """An action that is complete when it has begun."""
    return True
