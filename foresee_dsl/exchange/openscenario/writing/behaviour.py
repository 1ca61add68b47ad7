"""What actors do as OpenSCENARIO: routes, paths, speeds, and what triggers set off, as far as it has words for it."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.exchange.openscenario.reading.places import NotExpressed
from foresee_dsl.exchange.openscenario.writing.library import at_once, figure, library, reference_point, world
from foresee_dsl.exchange.openscenario.writing.triggers import Conditions, Make, at, completed, trigger
from foresee_dsl.language.model import Action, ChangesLane, ChangesSpeed, Condition, Starts, Stops, Then, Wait
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.trace import Trace

_STOPS_MPS2 = 3.0
"""How hard who is told to stop brakes (the language's definition)."""
_LANE_CHANGE_S = 3.3
"""A lane of 3.3 m with 1 m/s sideways, as our simulation drives it."""
_EVERY = 1000
"""An event that may happen again and again happens so often at most; the schema asks for a number."""
_LOOSE_M = 0.05
_ENDS = (ChangesSpeed, ChangesLane, Starts)
"""Actions whose end the storyboard tells as the language does."""

Where = tuple[int, ...]


def groups(bundle: SumoBundle, trace: Trace, left_out: Counter[str]) -> list[Any]:
    """Return a maneuver group for each actor that does anything.

    A trigger or step that cannot be expressed is timed as it happened in the run; one that did not happen is left out.

    Args:
        bundle: the test case. trace: its run. left_out: is counted up.
    """
    board = _Board(bundle, trace, left_out)
    for actor in bundle.scene.actors:
        board.begin(actor)
    for index, when in enumerate(bundle.scene.whens):
        board.when(index, when.condition, when.actions, every=when.repeat in ("every", "next"))
    return board.groups()


@dataclass
class _Board:
    bundle: SumoBundle
    trace: Trace
    left_out: Counter[str]
    _events: dict[str, list[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._placed = {actor.id: actor for actor in self.bundle.scene.actors}
        self._conditions = Conditions(self._placed.keys(), self.bundle.scene.places)
        self._happened: dict[tuple[int, Where], float] = {}
        for event in self.trace.events:
            if event.what in ("trigger", "then"):
                key = int(event.detail["index"]), tuple(event.detail.get("where", ()))
                self._happened.setdefault(key, event.time_s)

    def begin(self, actor: PlacedActor) -> None:
        """Write what an actor does by itself: its way, and the speed that it takes up."""
        osc = library()
        waiting = actor.waits or actor.delay_s > 0
        for what, found in (("rules that actors ignore", actor.ignores), ("meetings", actor.meets)):
            self.left_out[what] += len(found)
        self.left_out["steering perturbations"] += actor.steering is not None
        self.left_out["`line` and `timing`"] += abs(actor.line_m) > 0 or actor.timing != 1.0
        if actor.control in ("ego", "sumo") and actor.line is not None:
            goal = self.bundle.scene.goal_s if actor.control == "ego" else actor.line.end_s
            route = osc.AssignRouteAction(_route(actor, actor.line, goal))
            self._add(actor.id, f"{actor.id}_route", [route], [[at(0.0)]])
            if actor.control == "ego":
                return  # the rest is the driver's
        if actor.control == "path" and len(actor.path) >= 2 and not actor.waits:
            self._add(actor.id, f"{actor.id}_path", [_follow(actor)], [[at(actor.delay_s)]])
        moves = actor.control in ("sumo", "path") and not actor.waits
        if moves and (waiting or abs(actor.cruise_mps - actor.speed_mps) > _LOOSE_M):
            self._add(actor.id, f"{actor.id}_cruise", [self._to(actor, actor.cruise_mps)], [[at(actor.delay_s)]])

    def when(self, index: int, condition: Condition, actions: tuple[Action, ...], *, every: bool) -> None:
        """Write what a trigger sets off."""
        starts = self._start(condition, index, ())
        if starts is not None:
            self._block(actions, starts, index, (), every=every)

    def groups(self) -> list[Any]:
        """Return what was written, an actor after the other."""
        osc = library()
        found = []
        for actor, events in self._events.items():
            maneuver = osc.Maneuver(f"{actor}_maneuver")
            for event in events:
                maneuver.add_event(event)
            group = osc.ManeuverGroup(f"{actor}_group")
            group.add_actor(actor)
            group.add_maneuver(maneuver)
            found.append(group)
        return found

    def _start(self, condition: Condition | None, index: int, where: Where) -> list[list[Make]] | None:
        """Return a condition's alternatives, or the time at which it held in the run."""
        try:
            if condition is None:
                raise NotExpressed("steps that wait for others")
            return self._conditions.groups(condition)
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
        self, actions: tuple[Action, ...], starts: list[list[Make]], index: int, where: Where, *, every: bool
    ) -> None:
        """Write a block of actions, and the steps that wait for them."""
        name = "_".join(str(n) for n in ("when", index + 1, *(k + 1 for k in where)))
        by_actor: dict[str, list[Any]] = {}
        exact = True
        for action in actions:
            if isinstance(action, Then):
                continue
            exact = exact and isinstance(action, _ENDS)
            if not isinstance(action, Wait) and (made := self._action(action)) is not None:
                by_actor.setdefault(action.actor, []).append(made)
        for actor, made in by_actor.items():
            self._add(actor, f"{name}_{actor}", made, starts, every=every)
        done = [completed(f"{name}_{actor}") for actor in by_actor]
        for k, action in enumerate(actions):
            if not isinstance(action, Then):
                continue
            found = self._after(action, done if exact else [], index, (*where, k))
            exact = False  # further steps wait for this one's steps, too
            if found is not None:
                self._block(action.actions, found, index, (*where, k), every=False)

    def _after(self, then: Then, done: list[Make], index: int, where: Where) -> list[list[Make]] | None:
        """Return when a step starts: after all events before it, and once its condition holds."""
        if not done:
            return self._timed("steps that wait for others", index, where)
        if then.condition is None:
            return [done]
        try:
            return [[*done, *group] for group in self._conditions.groups(then.condition)]
        except NotExpressed as err:
            return self._timed(str(err), index, where)

    def _action(self, action: Action) -> Any:  # noqa: ANN401 - the library has no types
        osc = library()
        if isinstance(action, Then | Wait) or action.actor not in self._placed:
            return None
        actor = self._placed[action.actor]
        if isinstance(action, ChangesSpeed):
            over = None if action.over is None else si_of(action.over)
            return self._to(actor, si_of(action.to), over)
        if isinstance(action, Stops):
            self.left_out["driving on after a stop"] += action.duration is not None
            return osc.AbsoluteSpeedAction(0, _rate(_STOPS_MPS2))
        if isinstance(action, ChangesLane):
            took = osc.TransitionDynamics(osc.DynamicsShapes.sinusoidal, osc.DynamicsDimension.time, _LANE_CHANGE_S)
            by = 1 if word_of(action.side) == "left" else -1
            return osc.RelativeLaneChangeAction(by, action.actor, took)
        if isinstance(action, Starts):
            self._set_off(actor, action)
            return self._to(actor, actor.cruise_mps)
        self.left_out[f"actions: {action.kind}"] += 1
        return None

    def _set_off(self, actor: PlacedActor, action: Starts) -> None:
        """Who is started on a path follows it from then on; until then it stands, so it may be told at once."""
        if actor.control == "path" and len(actor.path) >= 2:
            name = f"{action.actor}_path"
            if not any(event.name == name for event in self._events.get(actor.id, [])):
                self._add(actor.id, name, [_follow(actor)], [[at(0.0)]])
        self.left_out["delays after a trigger"] += actor.delay_s > 0

    def _to(self, actor: PlacedActor, speed_mps: float, over_s: float | None = None) -> Any:  # noqa: ANN401 - as above
        osc = library()
        if over_s:
            took = osc.TransitionDynamics(osc.DynamicsShapes.linear, osc.DynamicsDimension.time, figure(over_s))
        else:
            took = _rate(actor.model.acceleration_mps2) if actor.model.acceleration_mps2 > 0 else at_once()
        return osc.AbsoluteSpeedAction(figure(speed_mps), took)

    def _add(self, actor: str, name: str, actions: list[Any], starts: list[list[Make]], *, every: bool = False) -> None:
        osc = library()
        event = osc.Event(name, osc.Priority.parallel, _EVERY if every else 1)
        for k, action in enumerate(actions):
            event.add_action(f"{name}_{k + 1}", action)
        event.add_trigger(trigger(starts, name))
        self._events.setdefault(actor, []).append(event)


def _rate(by_mps2: float) -> Any:  # noqa: ANN401 - as above
    osc = library()
    return osc.TransitionDynamics(osc.DynamicsShapes.linear, osc.DynamicsDimension.rate, figure(by_mps2))


def _route(actor: PlacedActor, line: RouteLine, goal_s: float) -> Any:  # noqa: ANN401 - as above
    """Return a route with a waypoint at the start, where junctions are entered and left, and at the end."""
    osc = library()
    start_s = line.project(actor.x, actor.y, line.origin_s)[0]
    inner = [s for p in line.passages for s in (p.entry_s, p.exit_s) if start_s + 1 < s < goal_s - 1]
    route = osc.Route(f"{actor.id}_way")
    for s in (min(start_s, goal_s - 1), *inner, goal_s):
        x, y, heading = line.at(s)
        route.add_waypoint(world(x, y, heading), osc.RouteStrategy.shortest)
    return route


def _follow(actor: PlacedActor) -> Any:  # noqa: ANN401 - as above
    """Return the action that follows an actor's path at whatever speed it has."""
    osc = library()
    points = [(actor.x, actor.y), *_still_ahead(actor)]
    poses = []
    for k, (x, y) in enumerate(points):
        heading = actor.heading_rad if k == 0 else _direction(points[k - 1], (x, y))
        poses.append(world(*reference_point(x, y, heading, actor.model), heading))
    made = osc.Trajectory(f"{actor.id}_line", False)
    made.add_shape(osc.Polyline([], poses))
    return osc.FollowTrajectoryAction(made, osc.FollowingMode.position)


def _still_ahead(actor: PlacedActor) -> list[tuple[float, float]]:
    """Return the points of a path that lie ahead of an actor."""
    covered, found = 0.0, []
    for a, b in zip(actor.path, actor.path[1:], strict=False):
        covered += math.dist(a, b)
        if covered > actor.along_m + _LOOSE_M:
            found.append(b)
    return found or [actor.path[-1]]


def _direction(a: tuple[float, float], b: tuple[float, float]) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])
