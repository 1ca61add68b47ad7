"""Export of actors' behaviour to OpenSCENARIO: routes, paths, speeds and triggers, as far as it can express them."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.compile.roads.polyline import XY, direction
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.language import model as m
from foresee_dsl.language.logic import TURNED
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.trace import Trace, X, Y
from foresee_exchange.openscenario.losses import NotExpressed
from foresee_exchange.openscenario.writing.keeping import SpeedOrder, notes_of
from foresee_exchange.openscenario.writing.library import (
    Xosc,
    at_once,
    event,
    figure,
    maneuver_group,
    osc,
    reference_position,
    world,
)
from foresee_exchange.openscenario.writing.relations import Related, related_action

_RULES = {"<": "lessThan", "<=": "lessOrEqual", ">": "greaterThan", ">=": "greaterOrEqual"}
_MOST_GROUPS = 16
"""Maximum number of alternatives of a condition; with more, the recorded time is used instead (ours)."""

Make = Callable[[str], Xosc]
"""Function that returns a `<Condition>` with the given name."""


@dataclass(frozen=True)
class Conditions:
    """Translates conditions on actors; `places` as in `Scene.places`."""

    actors: Collection[str]
    places: Mapping[m.Place, XY]

    def groups(self, condition: m.Condition) -> list[list[Make]]:
        """Return alternatives, each a list of conditions that must hold together; `NotExpressed` if OpenSCENARIO cannot
        express them."""
        alternatives = self._groups(condition, negated=False)
        if len(alternatives) > _MOST_GROUPS:
            raise NotExpressed("conditions with many alternatives")
        return alternatives

    def _groups(self, condition: m.Condition, *, negated: bool) -> list[list[Make]]:
        if isinstance(condition, m.Not):
            return self._groups(condition.condition, negated=not negated)
        if isinstance(condition, m.Both | m.Either):
            parts = [self._groups(part, negated=negated) for part in condition.conditions]
            if isinstance(condition, m.Either) != negated:
                return [group for part in parts for group in part]
            return [list(itertools.chain(*choice)) for choice in itertools.islice(itertools.product(*parts), 100)]
        if isinstance(condition, m.Comparison):
            return [[self._comparison(condition, negated=negated)]]
        if isinstance(condition, m.Within):
            return [[self._within(condition, negated=negated)]]
        raise NotExpressed(f"conditions: {condition.kind}")

    def _comparison(self, condition: m.Comparison, *, negated: bool) -> Make:
        left = condition.left
        if not isinstance(left, m.Measure):
            raise NotExpressed("conditions: parameters")
        value = figure(si_of(condition.right))
        rule = getattr(osc.Rule, _RULES[TURNED[condition.op] if negated else condition.op])
        if left.what == "time":
            return _by_value(osc.SimulationTimeCondition(value, rule))
        actor = left.actor or ""
        if left.what == "speed":
            return self._by_entity(actor, osc.SpeedCondition(value, rule))
        if left.what == "acceleration":
            along = osc.DirectionalDimension.longitudinal
            return self._by_entity(actor, osc.AccelerationCondition(value, rule, along))
        if left.what in ("offset", "lateral", "overlap", "relative_speed"):
            raise NotExpressed(f"conditions: {left.what}")
        other = str(left.other)
        if other not in self.actors or left.what == "eta":
            raise NotExpressed(f"conditions: {left.what} to a junction")
        around = osc.RelativeDistanceType.euclidianDistance
        if left.what == "distance":
            xosc = osc.RelativeDistanceCondition(value, rule, around, other)
        elif left.what == "ttc":
            xosc = osc.TimeToCollisionCondition(value, rule, False, True, other, distance_type=around)
        elif left.what == "ttc_along":
            xosc = osc.TimeToCollisionCondition(
                value,
                rule,
                False,
                True,
                other,
                distance_type=osc.RelativeDistanceType.longitudinal,
                coordinate_system=osc.CoordinateSystem.road,
            )
        else:
            xosc = osc.TimeHeadwayCondition(other, value, rule, False, True, around)
        return self._by_entity(actor, xosc)

    def _within(self, condition: m.Within, *, negated: bool) -> Make:
        value = figure(si_of(condition.distance))
        rule = osc.Rule.greaterThan if negated else osc.Rule.lessOrEqual
        around = osc.RelativeDistanceType.euclidianDistance
        if isinstance(condition.of, m.Named):
            other = str(condition.of.name)
            if other not in self.actors:
                raise NotExpressed("conditions: within a distance of a junction")
            return self._by_entity(condition.actor, osc.RelativeDistanceCondition(value, rule, around, other))
        at = condition.of
        if isinstance(at, m.OfActor):
            raise NotExpressed("conditions: a place that moves with an actor")
        x, y = (si_of(at.x), si_of(at.y)) if isinstance(at, m.Point) else self.places[at]
        return self._by_entity(condition.actor, osc.DistanceCondition(value, rule, world(x, y), False, True, around))

    def _by_entity(self, actor: str, condition: Xosc) -> Make:
        if actor not in self.actors:
            raise NotExpressed("conditions about actors that are not there")
        return lambda name: osc.EntityTrigger(name, 0, osc.ConditionEdge.none, condition, actor)


def completed(event: str) -> Make:
    """Return the condition that an event has ended."""
    kind, state = osc.StoryboardElementType.event, osc.StoryboardElementState.completeState
    return _by_value(osc.StoryboardElementStateCondition(kind, event, state))


def at(time_s: float) -> Make:
    """Return the condition that a time has been reached."""
    return _by_value(osc.SimulationTimeCondition(figure(time_s), osc.Rule.greaterOrEqual))


def trigger(groups: list[list[Make]], name: str) -> Xosc:
    """Return a start trigger that fires when one of these groups of conditions holds."""
    start_trigger = osc.Trigger()
    for k, group in enumerate(groups):
        condition_group = osc.ConditionGroup()
        for n, make in enumerate(group):
            condition_group.add_condition(make(f"{name}_{k + 1}_{n + 1}"))
        start_trigger.add_conditiongroup(condition_group)
    return start_trigger


def _by_value(condition: Xosc) -> Make:
    return lambda name: osc.ValueTrigger(name, 0, osc.ConditionEdge.none, condition)


_STOPS_MPS2 = 3.0
"""Braking of an actor that is told to stop, m/s^2 (the language's definition)."""
_LANE_CHANGE_S = 3.3
"""Duration of a lane change, s: a lane of 3.3 m at 1 m/s sideways, as in our simulation."""
_EVERY = 1000
"""Number of executions of a repeatable event; the schema requires a number."""
_LOOSE_M = 0.05
_ENDS = (m.ChangesSpeed, m.ChangesLane, m.Starts)
"""Actions whose end has the same meaning in a storyboard as in the language."""

Where = tuple[int, ...]


def groups(bundle: SumoBundle, trace: Trace, left_out: Counter[str]) -> tuple[list[Xosc], list[str]]:
    """Return a maneuver group per actor with actions, and a note on each actor that a player will move differently from
    the run.

    A trigger or step that cannot be expressed starts at its time in the run; if it did not happen, it is left out.
    """
    board = _Board(bundle, trace, left_out)
    for actor in bundle.scene.actors:
        board.begin(actor)
    for index, when in enumerate(bundle.scene.whens):
        board.when(index, when.condition, when.actions, every=when.repeat in ("every", "next"))
    maneuvers = [maneuver_group(actor, events) for actor, events in board.events.items()]
    forks = {actor.id: junction for actor in bundle.scene.actors if (junction := _fork(actor, bundle, trace))}
    return maneuvers, list(notes_of(bundle.scene.actors, trace, board.orders, board.led, board.turned, forks))


def _fork(actor: PlacedActor, bundle: SumoBundle, trace: Trace) -> str:
    """Return the first junction that an actor drove over where its lane leads to two lanes of its next road; "" for
    none. A waypoint names a road, not a lane."""
    line, names = actor.line, [info.id for info in trace.actors]
    if actor.control != "sumo" or line is None or actor.id not in names:
        return ""
    places = trace.states[:, names.index(actor.id)][:, [X, Y]]
    places = places[~np.isnan(places[:, 0])]
    driven_m = line.project(float(places[-1, 0]), float(places[-1, 1]))[0] if len(places) else 0.0
    started_m = line.project(float(places[0, 0]), float(places[0, 1]))[0] if len(places) else 0.0
    for passage in line.passages:
        own = passage.movement
        ways = (way for kind in own.kinds for way in bundle.network.movements_from(own.from_edge, kind))
        forks = any(
            (way.from_lane, way.to_edge) == (own.from_lane, own.to_edge) and way.to_lane != own.to_lane for way in ways
        )
        if forks and started_m < passage.exit_s and driven_m > passage.entry_s:
            return passage.junction
    return ""


@dataclass
class _Board:
    bundle: SumoBundle
    trace: Trace
    left_out: Counter[str]
    events: dict[str, list[Xosc]] = field(default_factory=dict)
    orders: dict[str, list[SpeedOrder]] = field(default_factory=dict)
    led: dict[str, str] = field(default_factory=dict)
    turned: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._placed = {actor.id: actor for actor in self.bundle.scene.actors}
        places = {place: xy for place, xy in self.bundle.scene.places.items() if not isinstance(place, m.AtStop)}
        self._conditions = Conditions(self._placed.keys(), places)
        self._happened: dict[tuple[int, Where], float] = {}
        for happened in self.trace.events:
            if happened.what in ("trigger", "then"):
                key = int(happened.detail["index"]), tuple(happened.detail.get("where", ()))
                self._happened.setdefault(key, happened.time_s)

    def begin(self, actor: PlacedActor) -> None:
        """Write an actor's own behaviour: its way, and the speed that it takes up."""
        waiting = actor.waits or actor.delay_s > 0
        for what, items in (("rules that actors ignore", actor.ignores), ("meetings", actor.meets)):
            self.left_out[what] += len(items)
        self.left_out["`passes in lane`"] += actor.passes
        self.left_out["`style`"] += bool(actor.style)
        self.left_out["steering perturbations"] += actor.steering is not None
        self.left_out["`brakes`, and `line` for a time"] += actor.brakes is not None or actor.strays is not None
        self.left_out["`line` and `timing`"] += abs(actor.line_m) > 0 or actor.timing != 1.0
        if actor.control in ("ego", "sumo") and actor.line is not None:
            goal = self.bundle.scene.goal_s if actor.control == "ego" else actor.line.end_s
            route = osc.AssignRouteAction(_route(actor, actor.line, goal))
            self._add(actor.id, f"{actor.id}_route", [route], [[at(0.0)]])
            if actor.control == "ego":
                return  # the driver decides everything else
        if actor.control == "path" and len(actor.path) >= 2 and not actor.waits:
            self._add(actor.id, f"{actor.id}_path", [_follow(actor)], [[at(actor.delay_s)]])
        moves = actor.control in ("sumo", "path") and not actor.waits
        if moves and (waiting or abs(actor.cruise_mps - actor.speed_mps) > _LOOSE_M):
            self._add(actor.id, f"{actor.id}_cruise", [self._to(actor, actor.cruise_mps)], [[at(actor.delay_s)]])
            self._order(actor, actor.delay_s, actor.cruise_mps)

    def when(self, index: int, condition: m.Condition, actions: tuple[m.Action, ...], *, every: bool) -> None:
        """Write the actions of a trigger."""
        starts = self._start(condition, [], index, ())
        if starts is not None:
            self._block(actions, starts, index, (), every=every)

    def _start(self, condition: m.Condition, done: list[Make], index: int, where: Where) -> list[list[Make]] | None:
        """Return the alternatives of a condition, each joined with the end of the events `done`; if they cannot be
        expressed, the time at which the condition held in the run."""
        try:
            return [[*done, *group] for group in self._conditions.groups(condition)]
        except NotExpressed as err:
            return self._timed(str(err), index, where)

    def _timed(self, why: str, index: int, where: Where) -> list[list[Make]] | None:
        time_s = self._happened.get((index, where))
        if time_s is None:
            self.left_out["triggers and steps that did not happen in the run"] += 1
            return None
        self.left_out[f"{why} (timed as in the run)"] += 1
        return [[at(time_s)]]

    def _block(
        self, actions: tuple[m.Action, ...], starts: list[list[Make]], index: int, where: Where, *, every: bool
    ) -> None:
        """Write a block of actions, and the steps that wait for them."""
        name = "_".join(str(n) for n in ("when", index + 1, *(k + 1 for k in where)))
        by_actor: dict[str, list[Xosc]] = {}
        exact = True
        for action in actions:
            if isinstance(action, m.Then):
                continue
            exact = exact and isinstance(action, _ENDS)
            if isinstance(action, m.WithoutActor) and not isinstance(action, m.Wait):
                self.left_out[f"actions: {action.kind}"] += 1
            if not isinstance(action, m.WithoutActor) and (xosc := self._action(action)) is not None:
                self._remember(action, self._happened.get((index, where)))
                by_actor.setdefault(action.actor, []).append(xosc)
        for actor, xosc in by_actor.items():
            self._add(actor, f"{name}_{actor}", xosc, starts, every=every)
        done = [completed(f"{name}_{actor}") for actor in by_actor]
        for k, action in enumerate(actions):
            if not isinstance(action, m.Then):
                continue
            step_starts = self._after(action, done if exact else [], index, (*where, k))
            exact = False  # later steps also wait for the steps inside this step
            if step_starts is not None:
                self._block(action.actions, step_starts, index, (*where, k), every=False)

    def _after(self, then: m.Then, done: list[Make], index: int, where: Where) -> list[list[Make]] | None:
        """Return when a step starts: after all events before it, and once its condition holds."""
        if not done:
            return self._timed("steps that wait for others", index, where)
        return [done] if then.condition is None else self._start(then.condition, done, index, where)

    def _action(self, action: m.Action) -> Xosc:
        if isinstance(action, m.WithoutActor) or action.actor not in self._placed:
            return None
        actor, xosc = self._placed[action.actor], None
        if isinstance(action, m.ChangesSpeed):
            over = None if action.over is None else si_of(action.over)
            xosc = self._to(actor, si_of(action.to), over)
        elif isinstance(action, m.Stops):
            self.left_out["driving on after a stop"] += action.duration is not None
            xosc = osc.AbsoluteSpeedAction(0, _rate(_STOPS_MPS2))
        elif isinstance(action, m.BrakesFor):
            self.left_out["driving on after braking"] += action.duration is not None
            xosc = osc.AbsoluteSpeedAction(0, _rate(si_of(action.braking)))
        elif isinstance(action, m.ChangesLane):
            dynamics = osc.TransitionDynamics(osc.DynamicsShapes.sinusoidal, osc.DynamicsDimension.time, _LANE_CHANGE_S)
            by = 1 if word_of(action.side) == "left" else -1
            xosc = osc.RelativeLaneChangeAction(by, action.actor, dynamics)
        elif isinstance(action, Related):
            xosc = related_action(action, self.bundle.scene, self.left_out)
        elif isinstance(action, m.Starts):
            self._set_off(actor, action)
            xosc = self._to(actor, actor.cruise_mps)
        self.left_out[f"actions: {action.kind}"] += xosc is None
        return xosc

    def _remember(self, action: m.Action, time_s: float | None) -> None:
        """Record how an action of the run affects its actor's motion."""
        if time_s is None or isinstance(action, m.WithoutActor | m.Then):
            return
        actor = self._placed[action.actor]
        if isinstance(action, m.ChangesSpeed):
            self._order(actor, time_s, si_of(action.to), None if action.over is None else si_of(action.over))
        elif isinstance(action, m.Stops):
            self.orders.setdefault(actor.id, []).append(SpeedOrder(time_s, 0.0, rate_mps2=_STOPS_MPS2))
        elif isinstance(action, m.ChangesLane):
            self.turned.setdefault(actor.id, []).append(time_s)
        elif isinstance(action, m.Starts):
            self._order(actor, time_s, actor.cruise_mps)
        elif isinstance(action, Related):
            self.led[actor.id] = " ".join(print_item(action).split()).partition(" ")[2]

    def _order(self, actor: PlacedActor, time_s: float, to_mps: float, over_s: float | None = None) -> None:
        rate = None if over_s else actor.model.acceleration_mps2 or None
        self.orders.setdefault(actor.id, []).append(SpeedOrder(time_s, to_mps, over_s, rate))

    def _set_off(self, actor: PlacedActor, action: m.Starts) -> None:
        """Let an actor on a path follow it from the start; it stands until the action, so the event may begin at 0
        s."""
        if actor.control == "path" and len(actor.path) >= 2:
            name = f"{action.actor}_path"
            if not any(written_event.name == name for written_event in self.events.get(actor.id, [])):
                self._add(actor.id, name, [_follow(actor)], [[at(0.0)]])
        self.left_out["delays after a trigger"] += actor.delay_s > 0

    def _to(self, actor: PlacedActor, speed_mps: float, over_s: float | None = None) -> Xosc:
        if over_s:
            dynamics = osc.TransitionDynamics(osc.DynamicsShapes.linear, osc.DynamicsDimension.time, figure(over_s))
        else:
            dynamics = _rate(actor.model.acceleration_mps2) if actor.model.acceleration_mps2 > 0 else at_once()
        return osc.AbsoluteSpeedAction(figure(speed_mps), dynamics)

    def _add(
        self, actor: str, name: str, actions: list[Xosc], starts: list[list[Make]], *, every: bool = False
    ) -> None:
        named = {f"{name}_{k + 1}": action for k, action in enumerate(actions)}
        new_event = event(name, named, trigger(starts, name), _EVERY if every else 1)
        self.events.setdefault(actor, []).append(new_event)


def _rate(by_mps2: float) -> Xosc:
    return osc.TransitionDynamics(osc.DynamicsShapes.linear, osc.DynamicsDimension.rate, figure(by_mps2))


_BESIDE_M = 3.0
"""Distance of a waypoint before and after a junction, m. Ours: at the very edge of a junction, and on its overlapping
inner roads, esmini 3.6 finds the wrong road and aborts: `Invalid waypoint roadId`."""


def _route(actor: PlacedActor, line: RouteLine, goal_s: float) -> Xosc:
    """Return a route with a waypoint at the start, before and behind each junction, and at the end."""
    start_s = line.project(actor.x, actor.y, line.origin_s)[0]
    route = osc.Route(f"{actor.id}_way")
    for s in waypoints(line, min(start_s, goal_s - 1), goal_s):
        x, y, heading = line.at(s)
        route.add_waypoint(world(x, y, heading), osc.RouteStrategy.shortest)
    return route


def waypoints(line: RouteLine, start_s: float, goal_s: float) -> list[float]:
    """Return positions of a route's waypoints along the line, m: outside of junctions.

    A start or end inside a junction is replaced by the nearest place outside.
    """
    inside = [(p.entry_s, p.exit_s) for p in line.passages]
    ends = [line.origin_s, *(s for pair in inside for s in pair), line.end_s]
    positions = []
    for begin, end in zip(ends[::2], ends[1::2], strict=True):  # the stretches between junctions
        by = min(_BESIDE_M, (end - begin) / 2)
        first, last = max(begin + by, start_s), min(end - by, goal_s)
        if first <= last:
            positions += [first] if last - first < _APART_M else [first, last]
    return positions if len(positions) > 1 else [start_s, goal_s]


_APART_M = 1.0
"""Waypoints nearer than this to each other are merged, m (ours)."""


def _follow(actor: PlacedActor) -> Xosc:
    """Return the action that follows an actor's path at its current speed."""
    points = [(actor.x, actor.y), *_still_ahead(actor)]
    poses = []
    for k, (x, y) in enumerate(points):
        heading = actor.heading_rad if k == 0 else direction(points[k - 1], (x, y))
        poses.append(reference_position(x, y, heading, actor.model))
    trajectory = osc.Trajectory(f"{actor.id}_line", False)
    trajectory.add_shape(osc.Polyline([], poses))
    return osc.FollowTrajectoryAction(trajectory, osc.FollowingMode.position)


def _still_ahead(actor: PlacedActor) -> list[tuple[float, float]]:
    """Return the points of a path ahead of an actor."""
    covered, ahead = 0.0, []
    for a, b in zip(actor.path, actor.path[1:], strict=False):
        covered += math.dist(a, b)
        if covered > actor.along_m + _LOOSE_M:
            ahead.append(b)
    return ahead or [actor.path[-1]]
