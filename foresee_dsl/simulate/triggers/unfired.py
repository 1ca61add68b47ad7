"""Finds the triggers and steps of a run that never began, and how near they came to it; computed from the trace after
the run.

A condition of several parts joined with `and` is explained part by part. Each part that never held is shown at the
moment when it was nearest to holding. If every part held at some time, the moment at which most parts held is shown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.language import model as m
from foresee_dsl.language.lints.certain import Limits, never
from foresee_dsl.language.model.scenario import DEFAULT_END_S
from foresee_dsl.language.printer import written
from foresee_dsl.language.traversal import parts, si_of
from foresee_dsl.language.units import UNITS
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.actors.moved_actors import EgoVehicle, PathActor
from foresee_dsl.simulate.actors.progress import Progress
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor, StateTable
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.results.verdict import Nearest, UnfiredTrigger
from foresee_dsl.simulate.sensing import STANDARD, Sensing, SensorSettings
from foresee_dsl.simulate.signals import colour_shown, state_at
from foresee_dsl.simulate.trace import STEP_S, Trace, X
from foresee_dsl.simulate.trigger_record import Place
from foresee_dsl.simulate.triggers.condition_history import Watch
from foresee_dsl.simulate.triggers.conditions import ConditionOutcome, Conditions
from foresee_dsl.simulate.triggers.kinds import ConditionKind, has_parts, kind_of
from foresee_dsl.simulate.world import World


@Part.JUDGING.measured
def unfired(
    scenario: m.Scenario, compiled: Callable[[], SumoBundle], trace: Trace, sensors: SensorSettings = STANDARD
) -> tuple[UnfiredTrigger, ...]:
    """Return the triggers and steps of a run that waited but never began, in the file's order.

    Triggers that could not fire at any frame, such as one that keeps an actor waiting in a clip, are left out; so are
    the steps of a trigger that never fired.

    Args:
        scenario: the concrete scenario of the run. compiled: function that compiles the scenario; it is called only if
            a trigger or step never began.
        trace: the run. sensors: settings of the ego's sensors in it.
    """
    waiting = tuple(_waiting(scenario, trace))
    if not waiting:
        return ()
    bundle = compiled()
    replay = ConditionReplay(bundle, trace)
    sees = any(isinstance(part, m.Sees) for condition, _ in waiting for part in parts(condition))
    sensing = Sensing(replay, mission_of(bundle), int(trace.meta.get("seed", 0)), sensors) if sees else None
    conditions = Conditions(replay, bundle.signals, sensing)
    followed = [_Followed(condition, trigger, conditions) for condition, trigger in waiting]
    for frame in range(trace.frames):
        replay.go_to(frame)
        for each in followed:
            each.look()
    return tuple(each.result() for each in followed)


def _waiting(scenario: m.Scenario, trace: Trace) -> Iterator[tuple[m.Condition, UnfiredTrigger]]:
    """Yield the condition of each trigger or step that waited but never began, and its record without what was near."""
    whens, record = scenario.all(m.When), trace.director
    if record is None or len(record.triggers) != len(whens):
        return
    end = scenario.first(m.End)
    limits = Limits(si_of(end.after) if end is not None else DEFAULT_END_S)
    came = {(e.detail["index"], tuple(e.detail["where"])) for e in trace.events if e.what == "then"}
    steps = {(e.detail["index"], tuple(e.detail["where"])): e.time_s for e in trace.events if e.what == "waits"}
    for index, (when, states) in enumerate(zip(whens, record.triggers, strict=True)):
        trigger = UnfiredTrigger(written(when.condition), when.name or "", index, (), 0.0, ())
        if all(state.fired_s is None for state in states):
            if not never(when.condition, limits):
                yield when.condition, trigger
            continue
        for (of, where), since_s in steps.items():
            step = _step(when.actions, where) if of == index and (of, where) not in came else None
            if step is not None and step.condition is not None and not never(step.condition, limits):
                text = written(step.condition)
                yield step.condition, replace(trigger, text=text, where=where, since_s=since_s)


def _step(actions: Sequence[m.Action], where: Place) -> m.Then | None:
    first, *rest = where
    action = actions[first] if first < len(actions) else None
    if not isinstance(action, m.Then):
        return None
    return _step(action.actions, tuple(rest)) if rest else action


class _Followed:
    """Evaluates a condition that never held, at each frame of its run."""

    def __init__(self, condition: m.Condition, trigger: UnfiredTrigger, conditions: Conditions) -> None:
        self._trigger, self._conditions = trigger, conditions
        joined = condition.conditions if isinstance(condition, m.Both) else (condition,)
        self._parts = [_Part(part, conditions) for part in joined]
        self._most: tuple[int, tuple[Nearest, ...]] = (-1, ())

    def look(self) -> None:
        """Evaluate the replay's current frame."""
        if self._conditions.time_s < self._trigger.since_s - STEP_S / 2:
            return
        held = [part.look() for part in self._parts]
        if len(self._parts) > 1 and sum(held) > self._most[0]:
            left = tuple(part.now() for part, holds in zip(self._parts, held, strict=True) if not holds)
            self._most = (sum(held), left)

    def result(self) -> UnfiredTrigger:
        """Return how near the condition came to holding."""
        short = tuple(part.nearest for part in self._parts if not part.ever)
        nearest = short or tuple(replace(part, held=True) for part in self._most[1])
        return replace(self._trigger, nearest=nearest, together=not short)


@dataclass
class _Part:
    """One part of a condition: whether it held at any frame, and how near it came to holding."""

    condition: m.Condition
    conditions: Conditions
    ever: bool = False
    watch: Watch = field(init=False)
    kind: ConditionKind[Any] | None = None
    inner: Watch | None = None
    best: ConditionOutcome | None = None
    nearest: Nearest = field(init=False)
    began_s: float | None = None

    def __post_init__(self) -> None:
        self.watch = Watch(self.condition, self.conditions)
        if not has_parts(self.condition):
            self.kind = kind_of(self.condition, self.conditions)
        if isinstance(self.condition, m.Sustained):
            self.inner = Watch(self.condition.condition, self.conditions)
        self.nearest = Nearest(written(self.condition))

    def look(self) -> bool:
        """Evaluate the current frame; return whether the part holds."""
        outcome = self.watch.look()
        if self.inner is not None:
            self._look_inside(self.inner)
        if outcome is None:
            return False
        self.ever = self.ever or outcome.held
        if not outcome.held and (near := self._away()) is not None:
            if self.nearest.short is None or near[0] < self.nearest.short:
                self.nearest = self._by_distance(*near)
        elif self.nearest.held_s is None and not outcome.held and self._nearer(outcome):
            self.best, self.nearest = outcome, self.now()
        return outcome.held

    def now(self) -> Nearest:
        """Return how near the part is to holding at this frame."""
        outcome, text = self.watch.look(), written(self.condition)
        if outcome is not None and outcome.decides is not None and isinstance(self.condition, m.Either):
            text = written(outcome.decides)
        if outcome is None:
            return Nearest(text)
        if (near := self._away()) is not None:
            return self._by_distance(*near)
        time_s, unit = round(self.conditions.time_s, 2), outcome.unit
        if not math.isfinite(outcome.margin):
            return Nearest(text, time_s, unit=unit)
        per = UNITS[unit].to_si if unit else 1.0
        value = self._value(outcome)
        rounded = None if value is None else round(value / per, 6)
        return Nearest(text, time_s, rounded, round(abs(outcome.margin) / per, 6), unit)

    def _away(self) -> tuple[float, str] | None:
        """Return how far a fact is from holding, m, and why; None if the fact has no such distance."""
        return None if self.kind is None else self.kind.away()

    def _by_distance(self, away_m: float, why: str) -> Nearest:
        away_m, text = round(away_m, 6), written(self.condition)
        return Nearest(text, round(self.conditions.time_s, 2), away_m, away_m, "m", note=why)

    def _nearer(self, outcome: ConditionOutcome) -> bool:
        if self.best is None or math.isnan(self.best.margin):
            return self.best is None or not math.isnan(outcome.margin)
        return outcome.dimension == self.best.dimension and outcome.margin > self.best.margin

    def _value(self, outcome: ConditionOutcome) -> float | None:
        """Return the measured value of the deciding comparison at this frame, in SI units; None for a fact."""
        decides = outcome.decides
        if isinstance(self.condition, m.Sustained) or not isinstance(decides, m.Comparison | m.Within):
            return None
        outcome_now = kind_of(decides, self.conditions).outcome()
        return None if outcome_now is None or math.isnan(outcome_now.value) else outcome_now.value

    def _look_inside(self, inner: Watch) -> None:
        """Update the longest time for which the condition of a `for` has held."""
        now_s = self.conditions.time_s
        if not inner.holds():
            self.began_s = None
            return
        self.began_s = now_s if self.began_s is None else self.began_s
        held_s = round(now_s - self.began_s, 2)
        if self.nearest.held_s is None or held_s > self.nearest.held_s:
            self.nearest = Nearest(written(self.condition), round(now_s, 2), held_s=held_s)


# ---- a recorded run as a simulation, frame by frame, without SUMO ---------------------------------------------------


class _RecordedSignals:
    """The recorded stages and colours of the signals at the current frame of a replay."""

    def __init__(self, bundle: SumoBundle, trace: Trace) -> None:
        self._trace, self.frame = trace, 0
        columns = {junction: k for k, junction in enumerate(trace.signals)}
        self._columns = {s.tls: (s, columns[s.junction]) for s in bundle.signals.values() if s.junction in columns}

    def stage(self, tls: str) -> tuple[int, float]:
        """Return the stage of a signal (index) and the time since it began, s."""
        column = self._columns[tls][1]
        return int(self._trace.stages[self.frame, column]), float(self._trace.elapsed[self.frame, column])

    def state(self, tls: str) -> str:
        """Return the state string of a signal."""
        signal, column = self._columns[tls]
        return state_at(signal, self._trace, column, self.frame)

    def colour(self, tls: str, link: int) -> SignalColour:
        """Return the colour of one link of a signal."""
        return colour_shown(self.state(tls), link)


class _NoWorld:
    """Stands in for SUMO's world in a replay, which needs only the world's signals."""

    def __init__(self, signals: _RecordedSignals) -> None:
        self.signals = signals


class ConditionReplay(Simulation):
    """A recorded run as a simulation: its actors at the frame of the last `go_to`. It cannot be stepped."""

    def __init__(self, bundle: SumoBundle, trace: Trace) -> None:
        """Begin at the first frame; `bundle`: the compiled test case of the run."""
        self._trace, self._signals = trace, _RecordedSignals(bundle, trace)
        self.world = cast(World, _NoWorld(self._signals))
        self.network, self.scene = bundle.network, bundle.scene
        edge = bundle.scene.ego.route[0]
        self.ego = EgoVehicle(bundle.scene.ego, bundle.scene.friction)
        self.actors = [self.ego, *(self._recorded(actor, edge) for actor in bundle.scene.actors[1:])]
        self.by_id = {actor.id: actor for actor in self.actors}
        self.progress = Progress(self.network, self.actors)
        self.state_table = StateTable(self.actors)
        self.go_to(0)

    def go_to(self, frame: int) -> None:
        """Set the states of all actors to those of a frame."""
        trace = self._trace
        self.frame = self._signals.frame = frame
        self.time_s = round(frame * STEP_S, 6)
        for k, actor in enumerate(self.actors):
            state = trace.states[frame, k]
            if np.isnan(state[X]):
                actor.present = False
                continue
            actor.present = True
            self.state_table.states[k] = state
            lane = int(trace.lanes[frame, k])
            actor.lane = trace.lane_ids[lane] if lane >= 0 else ""
            if isinstance(actor, PathActor):
                actor.along = actor.follower.along_m = float(trace.along[frame, k])

    def _recorded(self, actor: PlacedActor, edge: str) -> SimulatedActor:
        if actor.control == "path":
            return PathActor(actor, self.world, edge, self.scene.friction)
        return SimulatedActor(actor)
