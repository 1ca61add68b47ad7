"""What happens in a storyboard as triggers of the language."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.exchange.naming import number, quantity
from foresee_dsl.exchange.openscenario.reading.entities import Entity
from foresee_dsl.exchange.openscenario.reading.storyboard import Event
from foresee_dsl.exchange.openscenario.reading.trajectories import SpeedProfile
from foresee_dsl.exchange.outcome import NotExpressed
from foresee_dsl.language import model as m

ROUTING = ("AssignRouteAction", "AcquirePositionAction", "FollowTrajectoryAction")
_FRAME_S = 0.05


@dataclass
class EntityState:
    """What is known of an entity while its actions are read.

    Attributes:
        speed_mps: what it drives as far as is known, m/s. lane: its lane's id, if its place names one.
        profile: the speeds of its trajectory; actions follow it once the trajectory begins.
    """

    entity: Entity
    speed_mps: float | None = None
    lane: int | None = None
    profile: SpeedProfile | None = None


@dataclass
class TriggerBuilder:
    """Makes triggers of events; what has no counterpart is counted in `left_out`."""

    states: Mapping[str, EntityState]
    left_out: Counter[str]
    _used: set[str] = field(default_factory=set)

    def whens(self, events: Sequence[Event]) -> tuple[m.When, ...]:
        """Return a trigger for each event in which anything is left."""
        found = []
        for event in events:
            actions = self._block(event)
            if actions:
                condition = event.condition or from_the_start()
                repeat: Literal["every"] | None = "every" if event.every and event.condition is not None else None
                found.append(m.When(repeat=repeat, condition=condition, actions=tuple(actions)))
        return tuple(found)

    def _block(self, event: Event) -> list[m.Action]:
        actions: list[m.Action] = [a for kind in event.actions for ref in event.refs for a in self._act(kind, ref)]
        for other in event.at_start:
            if other.condition is None:
                actions += self._block(other)
            else:
                self.left_out["events that wait for another's start and a condition"] += 1
        actions += self._afterwards(event.at_end)
        if event.delay_s > 0 and actions:
            actions = [m.Wait(duration=quantity(event.delay_s, "time")), m.Then(actions=tuple(actions))]
        return actions

    def _afterwards(self, events: Sequence[Event]) -> list[m.Action]:
        """Return the blocks of events that wait for another's end: those without a condition together, one with."""
        plain = [a for event in events if event.condition is None for a in self._block(event)]
        found: list[m.Action] = [m.Then(actions=tuple(plain))] if plain else []
        conditional = [event for event in events if event.condition is not None]
        if conditional and (block := self._block(conditional[0])):
            found.append(m.Then(condition=conditional[0].condition, actions=tuple(block)))
        if len(conditional) > 1:
            self.left_out["events that wait for the same end, with conditions of their own"] += len(conditional) - 1
        return found

    def _act(self, kind: Element, ref: str) -> Iterator[m.Action]:
        try:
            yield from self._action(kind, ref)
        except NotExpressed as err:
            self.left_out[str(err)] += 1

    def _action(self, kind: Element, ref: str) -> list[m.Action]:
        inner = next(iter(kind), None)
        if kind.tag != "PrivateAction" or inner is None:
            raise NotExpressed(f"actions: {inner.tag if inner is not None else kind.tag}")
        state = self.states.get(ref)
        if state is None:
            raise NotExpressed("actions of entities that were left out")
        what = next(iter(inner), None)
        tag = inner.tag if what is None else what.tag
        if tag in ROUTING:
            return self._follows(state) if tag == "FollowTrajectoryAction" else []
        if state.entity.name == "ego":
            raise NotExpressed(f"actions of the ego, whose driver decides: {tag}")
        if what is not None and tag == "SpeedAction":
            return [self._speed(what, state)]
        if what is not None and tag == "SpeedProfileAction":
            return self._profile(what, state)
        if what is not None and tag == "LaneChangeAction":
            return self._lane(what, state)
        raise NotExpressed(f"actions: {tag}")

    def _follows(self, state: EntityState) -> list[m.Action]:
        """Return the changes of speed along a trajectory, once."""
        if state.profile is None or state.entity.ref in self._used:
            return []
        self._used.add(state.entity.ref)
        return speed_changes(state.entity.name, state.profile)

    def _speed(self, action: Element, state: EntityState) -> m.Action:
        target = action.find("SpeedActionTarget/AbsoluteTargetSpeed")
        relative = action.find("SpeedActionTarget/RelativeTargetSpeed")
        was, to = state.speed_mps, number(target, "value") if target is not None else self._relative(relative)
        state.speed_mps = to = max(to, 0.0)
        return _changes(state.entity.name, to, _over(action.find("SpeedActionDynamics"), was, to))

    def _relative(self, target: Element | None) -> float:
        if target is None:
            raise NotExpressed("actions: SpeedAction (without a target)")
        other = self.states.get(target.get("entityRef", ""))
        if other is None or other.speed_mps is None or target.get("continuous") == "true":
            raise NotExpressed("actions: SpeedAction (relative to a speed that is not known)")
        value = number(target, "value")
        return other.speed_mps * value if target.get("speedTargetValueType") == "factor" else other.speed_mps + value

    def _profile(self, action: Element, state: EntityState) -> list[m.Action]:
        if action.get("entityRef"):
            raise NotExpressed("actions: SpeedProfileAction (relative)")
        found: list[m.Action] = []
        for entry in action.iterfind("SpeedProfileEntry"):
            to = max(number(entry, "speed"), 0.0)
            took = number(entry, "time", 0.0) if entry.get("time") else None
            change = _changes(state.entity.name, to, took)
            found.append(m.Then(actions=(change,)) if found else change)
            state.speed_mps = to
        if not found:
            raise NotExpressed("actions: SpeedProfileAction (empty)")
        return found

    def _lane(self, action: Element, state: EntityState) -> list[m.Action]:
        relative = action.find("LaneChangeTarget/RelativeTargetLane")
        absolute = action.find("LaneChangeTarget/AbsoluteTargetLane")
        if relative is not None and relative.get("entityRef") in (None, state.entity.ref):
            by = round(number(relative, "value"))
        elif absolute is not None and state.lane is not None:
            target = round(number(absolute, "value"))
            by = target - state.lane if state.lane < 0 else state.lane - target
            state.lane = target
        else:
            raise NotExpressed("actions: LaneChangeAction (relative to somebody, or from an unknown lane)")
        if not by:
            return []
        self.left_out["durations of lane changes (1 m/s sideways is driven)"] += 1
        change = m.ChangesLane(actor=state.entity.name, side="left" if by > 0 else "right")
        return [change, *(m.Then(actions=(change,)) for _ in range(abs(by) - 1))]


def speed_changes(name: str, profile: SpeedProfile) -> list[m.Action]:
    """Return changes of speed one after the other; times are rounded to the simulation's steps."""
    times = [round(t / _FRAME_S) for t in profile.time_s]
    found: list[m.Action] = []
    if times[0] > 0:
        found.append(m.Wait(duration=quantity(times[0] * _FRAME_S, "time")))
    for k in range(1, len(times)):
        steps = times[k] - times[k - 1]
        if steps <= 0:
            continue
        change = _changes(name, profile.speed_mps[k], steps * _FRAME_S)
        found.append(m.Then(actions=(change,)) if found else change)
    return found


def _changes(name: str, to: float, over_s: float | None) -> m.ChangesSpeed:
    over = quantity(over_s, "time") if over_s else None
    return m.ChangesSpeed(actor=name, to=quantity(to, "speed"), over=over)


def _over(dynamics: Element | None, was: float | None, to: float) -> float | None:
    """Return how long a change of speed takes, s; None for as fast as the model can."""
    if dynamics is None or dynamics.get("dynamicsShape") == "step":
        return None
    value, dimension = number(dynamics, "value", 0.0), dynamics.get("dynamicsDimension")
    if value <= 0 or dimension == "time":
        return value if value > 0 else None
    if was is None:
        return None
    if dimension == "rate":
        return abs(to - was) / value or None
    return 2 * value / (to + was) if to + was > 0 else None


def from_the_start() -> m.Condition:
    """Return the condition that holds from the beginning."""
    return m.Comparison(left=m.Measure(what="time"), op=">=", right=quantity(0.0, "time"))
