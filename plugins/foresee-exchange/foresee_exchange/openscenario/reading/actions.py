"""Actions and events of a storyboard as triggers of the language."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import all_actions
from foresee_exchange.naming import number, quantity
from foresee_exchange.openscenario.losses import Losses, NotExpressed
from foresee_exchange.openscenario.reading.conditions import Step
from foresee_exchange.openscenario.reading.entities import EntityState
from foresee_exchange.openscenario.reading.lane_changes import over_the_middle
from foresee_exchange.openscenario.reading.places import Places, lane_beside
from foresee_exchange.openscenario.reading.relations import (
    RELATED,
    lateral_of,
    longitudinal_of,
    offset_of,
    synchrony_of,
)
from foresee_exchange.openscenario.reading.storyboard import Event
from foresee_exchange.openscenario.reading.ways.trajectories import SpeedProfile

ROUTING = ("AssignRouteAction", "AcquirePositionAction", "FollowTrajectoryAction")
FRAME_S = 0.05
_AS_FAST_MPS = 0.01
"""Speeds that differ by less than this count as equal, m/s (ours: 1 cm in a typical change of 1 s)."""
_GROUPS = ("LongitudinalAction", "LateralAction", "RoutingAction", "ControllerAction", "AppearanceAction")
_HOLDERS = (*_GROUPS, "InfrastructureAction", "EntityAction", "TrafficAction", "TrailerAction")
"""Elements that enclose the actual action."""
_AT_ONCE = (
    "VisibilityAction",
    "TeleportAction",
    "LightStateAction",
    "AssignControllerAction",
    "ActivateControllerAction",
)


@dataclass
class TriggerBuilder:
    """Builds triggers from events; `only_end` lists variables that are used only to end the storyboard."""

    states: Mapping[str, EntityState]
    losses: Losses
    places: Places
    network: RoadNetwork
    only_end: Set[str] = frozenset()
    _used: set[str] = field(default_factory=set)

    def whens(self, events: Sequence[Event]) -> Iterator[m.When]:
        """Yield a trigger for each event of which at least one action can be imported."""
        for event in events:
            if event.lost:
                self.losses.lose(event.lost, event.title)
            elif event.never:
                self.losses.leave("events whose conditions never hold", event.title)
            elif not event.hangs and _does_anything(actions := self._block(event)):
                head, *rest = event.steps or (Step(),)
                condition = head.condition or from_the_start()
                actions = wrapped([Step(None, head.delay_s), *rest], actions)
                repeat: Literal["every"] | None = "every" if event.every and event.steps else None
                yield m.When(repeat=repeat, condition=condition, actions=tuple(actions))

    def _block(self, event: Event) -> list[m.Action]:
        actions: list[m.Action] = []
        for kind in event.actions:
            refs = event.refs if kind.tag == "PrivateAction" else event.refs[:1] or ("",)
            for ref in refs:
                actions += self._act(kind, ref, event)
        return [*actions, *self._afterwards(event)]

    def _afterwards(self, event: Event) -> list[m.Action]:
        """Return the blocks of the events that wait for the end of this event: first one block for all events without
        further conditions, then the block of one event with conditions; further ones are reported as lost."""
        plain = [a for other in event.at_end if not other.steps for a in self._block(other)]
        blocks: list[m.Action] = [m.Then(actions=tuple(plain))] if plain else []
        waiting = [other for other in event.at_end if other.steps]
        if waiting and _does_anything(block := self._block(waiting[0])):
            inner = wrapped(waiting[0].steps, block)
            blocks.append(
                inner[0] if len(inner) == 1 and isinstance(inner[0], m.Then) else m.Then(actions=tuple(inner))
            )
        for other in waiting[1:]:
            self.losses.lose("events that wait for the same end, with conditions of their own", other.title)
        return blocks

    def _act(self, kind: Element, ref: str, event: Event) -> list[m.Action]:
        """Return an action of one entity; for a lost action, a wait of its duration if other events wait for it."""
        inner = next(iter(kind), None)
        what = next(iter(inner), None) if inner is not None and inner.tag in _GROUPS else None
        what = inner if inner is not None and inner.tag == "SynchronizeAction" else what
        tag = action_name(kind)
        state = self.states.get(ref)
        try:
            if kind.tag == "PrivateAction" and state is not None and state.entity.name == "ego":
                if tag not in ROUTING:
                    self.losses.leave(f"actions of the ego, whose driver decides: {tag}", event.title)
                return self._time_of(what, state, event)
            if kind.tag == "GlobalAction" and inner is not None and inner.find("DeleteEntityAction") is not None:
                return self._leaves(inner.get("entityRef", ""))
            if inner is not None and tag in ("ParameterAction", "VariableAction"):
                changed = inner.get("parameterRef") or inner.get("variableRef") or ""
                if changed in self.only_end:
                    self.losses.leave(f"actions: {tag} (which set a value that only ends the storyboard)", event.title)
                    return []
            if kind.tag != "PrivateAction" or inner is None:
                raise NotExpressed(f"actions: {tag}")
            if state is None:
                raise NotExpressed("actions of entities that were left out")
            return self._private(tag, what, state, event)
        except NotExpressed as err:
            self.losses.lose(str(err), event.title if state is None else f"{event.title}, {state.entity.ref}")
            return self._time_of(what, state, event)

    def _leaves(self, ref: str) -> list[m.Action]:
        gone = self.states.get(ref)
        if gone is None:
            raise NotExpressed("actions of entities that were left out")
        if gone.entity.name == "ego":
            raise NotExpressed("actions: DeleteEntityAction (of the ego)")
        return [m.Leaves(actor=gone.entity.name)]

    def _time_of(self, what: Element | None, state: EntityState | None, event: Event) -> list[m.Action]:
        """Return a wait as long as an action that is not taken over, if other events wait for its end."""
        if not event.at_end or what is None or what.tag in _AT_ONCE:
            return []
        dynamics = what.find(f"{what.tag}Dynamics")
        target = what.find("SpeedActionTarget/AbsoluteTargetSpeed")
        was = state.speed_mps if state is not None else None
        to = number(target, "value") if target is not None else None
        duration_s = _over(dynamics, was, to) if dynamics is not None else None
        if duration_s is None:
            for other in event.at_end:
                self.losses.lose("events that wait for the end of an action that is not taken over", other.title)
            event.at_end.clear()
            return []
        return [m.Wait(duration=quantity(duration_s, "time"))] if duration_s > 0 else []

    def _private(self, tag: str, what: Element | None, state: EntityState, event: Event) -> list[m.Action]:
        if tag in ROUTING:
            if what is not state.way:
                raise NotExpressed(f"actions: {tag} (a second way of the same actor)")
            return self._follows(state) if tag == "FollowTrajectoryAction" else []
        if what is not None and tag == "SpeedAction":
            return self._speed(what, state, at_once=not event.steps and not event.hangs)
        if what is not None and tag == "SpeedProfileAction":
            return self._profile(what, state)
        if what is not None and tag == "LaneChangeAction":
            return self._lane(what, state, waited_for=bool(event.at_end))
        if what is not None and tag in RELATED:
            return self._related(tag, what, state)
        raise NotExpressed(f"actions: {tag}")

    def _related(self, tag: str, action: Element, state: EntityState) -> list[m.Action]:
        """Return an action that keeps an actor at a lateral position, or at a distance from another actor."""
        if tag == "LaneOffsetAction":
            return [offset_of(action, state, self.states, self.places)]
        if tag == "LateralDistanceAction":
            return [lateral_of(action, state, self.states, self.places, self.losses)]
        if tag == "LongitudinalDistanceAction":
            return [longitudinal_of(action, state, self.states, self.places, self.losses)]
        return [synchrony_of(action, state, self.states, self.places, self.losses)]

    def _follows(self, state: EntityState) -> list[m.Action]:
        """Return the speed changes along a trajectory, the first time that they are requested."""
        if state.profile is None or state.entity.ref in self._used:
            return []
        self._used.add(state.entity.ref)
        return speed_changes(state, state.profile)

    def _speed(self, action: Element, state: EntityState, *, at_once: bool) -> list[m.Action]:
        """Return a change of speed; none if it happens at once and the actor already has that speed."""
        relative = action.find("SpeedActionTarget/RelativeTargetSpeed")
        if relative is not None and relative.get("continuous") == "true":
            return [self._matches(relative, state)]
        was, to = state.speed_mps, self.target_speed(action)
        state.speed_mps = to
        dynamics = action.find("SpeedActionDynamics")
        duration_s = _over(dynamics, was, to)
        return [] if at_once and duration_s == 0 and was == to else [_changes(state, was, to, duration_s)]

    def _matches(self, relative: Element, state: EntityState) -> m.MatchesSpeed:
        """Return the action of an actor that keeps the speed of another."""
        other = self.states.get(relative.get("entityRef", ""))
        if other is None:
            raise NotExpressed("actions: SpeedAction (relative to an entity that was left out)")
        value, factor = number(relative, "value"), relative.get("speedTargetValueType") == "factor"
        state.speed_mps = None
        return m.MatchesSpeed(
            actor=state.entity.name,
            other=other.entity.name,
            factor=quantity(max(value, 0.0), "ratio") if factor else None,
            more=None if factor or not value else quantity(value, "speed"),
        )

    def target_speed(self, action: Element) -> float:
        """Return the target speed of a `<SpeedAction>`, m/s; `NotExpressed` if it is unknown before the run."""
        target = action.find("SpeedActionTarget/AbsoluteTargetSpeed")
        if target is not None:
            return max(number(target, "value"), 0.0)
        relative = action.find("SpeedActionTarget/RelativeTargetSpeed")
        if relative is None:
            raise NotExpressed("actions: SpeedAction (without a target)")
        other = self._other_speed(relative, "SpeedAction")
        value = number(relative, "value")
        return max(other * value if relative.get("speedTargetValueType") == "factor" else other + value, 0.0)

    def _other_speed(self, target: Element, tag: str) -> float:
        other = self.states.get(target.get("entityRef", ""))
        if other is None or other.speed_mps is None:
            raise NotExpressed(f"actions: {tag} (relative to a speed that is not known)")
        if other.entity.name == "ego":
            self.losses.note("speeds relative to the ego's are relative to its speed at the beginning")
        return other.speed_mps

    def _profile(self, action: Element, state: EntityState) -> list[m.Action]:
        base = self._other_speed(action, "SpeedProfileAction") if action.get("entityRef") else 0.0
        changes: list[m.Action] = []
        for entry in action.iterfind("SpeedProfileEntry"):
            to = max(base + number(entry, "speed"), 0.0)
            duration_s = number(entry, "time", 0.0) if entry.get("time") else None
            change = _changes(state, state.speed_mps, to, duration_s)
            changes.append(m.Then(actions=(change,)) if changes else change)
            state.speed_mps = to
        if not changes:
            raise NotExpressed("actions: SpeedProfileAction (empty)")
        return changes

    def _lane(self, action: Element, state: EntityState, *, waited_for: bool) -> list[m.Action]:
        relative = action.find("LaneChangeTarget/RelativeTargetLane")
        absolute = action.find("LaneChangeTarget/AbsoluteTargetLane")
        side = 1 if state.ahead else -1
        if relative is not None and relative.get("entityRef") in (None, state.entity.ref):
            by = round(number(relative, "value"))
            target = None if state.lane is None else lane_beside(state.lane, by * side)
        else:
            target = self._target_lane(relative, absolute)
            if state.lane is None:
                raise NotExpressed("actions: LaneChangeAction (from a lane that is not known)")
            by = side * _between(state.lane, target)
        if not by:
            return []
        if not state.on_lanes or (state.lane is not None and target is not None and target * state.lane < 0):
            if target is None:
                raise NotExpressed("actions: LaneChangeAction (of an actor that follows no lane)")
            dynamics = action.find("LaneChangeActionDynamics")
            value = abs(number(dynamics, "value", 0.0)) if dynamics is not None else 0.0
            dimension = dynamics.get("dynamicsDimension") if dynamics is not None and value else None
            duration_s, length_m = (
                (value if dimension == "time" else None),
                (value if dimension == "distance" else None),
            )
            path_actions = over_the_middle(
                state, target, duration_s, length_m, self.places, self.network, self.losses, waited_for=waited_for
            )
            state.lane = target
            return path_actions
        state.lane = target
        self.losses.left_out["durations of lane changes (1 m/s sideways is driven)"] += 1
        change = m.ChangesLane(actor=state.entity.name, side="left" if by > 0 else "right")
        return [change, *(m.Then(actions=(change,)) for _ in range(abs(by) - 1))]

    def _target_lane(self, relative: Element | None, absolute: Element | None) -> int:
        if absolute is not None:
            return round(number(absolute, "value"))
        if relative is None:
            raise NotExpressed("actions: LaneChangeAction (without a target)")
        other = self.states.get(relative.get("entityRef", ""))
        if other is None or other.lane is None:
            raise NotExpressed("actions: LaneChangeAction (relative to an entity whose lane is not known)")
        if other.entity.name == "ego":
            self.losses.note("lane changes relative to the ego count from its lane at the beginning")
        return lane_beside(other.lane, round(number(relative, "value")) * (1 if other.ahead else -1))


def action_name(kind: Element) -> str:
    """Return an action's name for the report: `LaneOffsetAction`, `TrafficSignalStateAction`."""
    inner = next(iter(kind), None)
    if inner is None:
        return kind.tag
    if kind.tag == "UserDefinedAction":
        named = inner.get("type") or (inner.text or "").strip()[:60]
        return f"UserDefinedAction{f' ({named})' if named else ''}"
    within = next(iter(inner), None) if inner.tag in _HOLDERS else None
    if within is None:
        return inner.tag
    deeper = next(iter(within), None) if within.tag == "TrafficSignalAction" else None
    return within.tag if deeper is None else deeper.tag


def wrapped(steps: Sequence[Step], actions: list[m.Action]) -> list[m.Action]:
    """Return actions that begin after some steps, one after the other."""
    for step in reversed(steps):
        if step.delay_s > 0:
            actions = waited(step.delay_s, actions)
        if step.condition is not None:
            actions = [m.Then(condition=step.condition, actions=tuple(actions))]
    return actions


def waited(delay_s: float, actions: list[m.Action]) -> list[m.Action]:
    """Return actions that begin `delay_s` later."""
    return [m.Wait(duration=quantity(delay_s, "time")), m.Then(actions=tuple(actions))]


def _does_anything(actions: Sequence[m.Action]) -> bool:
    return any(not isinstance(action, m.Wait | m.Then) for action in all_actions(actions))


def _between(lane: int, target: int) -> int:
    """Return how many lanes to the left another lane lies, in the road's direction; there is no lane 0."""
    by = target - lane
    return by if lane * target > 0 else by - (1 if by > 0 else -1)


def speed_changes(state: EntityState, profile: SpeedProfile) -> list[m.Action]:
    """Return speed changes one after the other, with times rounded to the simulation's steps.

    If the actor's speed differs from the profile's first speed, it changes at once.
    """
    times = [round(t / FRAME_S) for t in profile.time_s]
    actions: list[m.Action] = []
    if times[0] > 0:
        actions.append(m.Wait(duration=quantity(times[0] * FRAME_S, "time")))
    if state.speed_mps is not None and abs(state.speed_mps - profile.speed_mps[0]) > _AS_FAST_MPS:
        first = _changes(state, state.speed_mps, profile.speed_mps[0], 0.0)
        actions.append(m.Then(actions=(first,)) if actions else first)
        times[0] = min(times[0] + 1, times[1])
    for k in range(1, len(times)):
        steps = times[k] - times[k - 1]
        if steps <= 0:
            continue
        state.changes(profile.speed_mps[k - 1], profile.speed_mps[k], steps * FRAME_S, within_limits=False)
        change = _changes(state, profile.speed_mps[k - 1], profile.speed_mps[k], steps * FRAME_S)
        actions.append(m.Then(actions=(change,)) if actions else change)
    return actions


def _changes(state: EntityState, was: float | None, to: float, over_s: float | None) -> m.ChangesSpeed:
    """Return a change of speed; an immediate change takes one step of our simulation, which a generated model can
    do."""
    step = over_s == 0 and not state.entity.bundled and not state.on_lanes
    if step:
        over_s, was = FRAME_S, state.most_mps if to < state.most_mps else 0.0
    state.most_mps = max(state.most_mps, was or 0.0, to)
    if over_s and was is not None:
        state.changes(was, to, over_s, within_limits=not step)
    over = quantity(over_s, "time") if over_s else None
    return m.ChangesSpeed(actor=state.entity.name, to=quantity(to, "speed"), over=over)


def _over(dynamics: Element | None, was: float | None, to: float | None) -> float | None:
    """Return the duration of a change, s: 0 for a step; None for as fast as possible, or if it is unknown."""
    if dynamics is None:
        return None
    value, dimension = abs(number(dynamics, "value", 0.0)), dynamics.get("dynamicsDimension")
    if dynamics.get("dynamicsShape") == "step" or value <= 0:
        return 0.0
    if dimension == "time":
        return value
    if was is None or to is None:
        return None
    if dimension == "rate":
        return abs(to - was) / value
    return 2 * value / (to + was) if to + was > 0 else None


def from_the_start() -> m.Condition:
    """Return the condition that holds from the beginning."""
    return m.Comparison(left=m.Measure(what="time"), op=">=", right=quantity(0.0, "time"))
