"""Turns a concrete scenario into the scene at the first frame, or says everything that is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TypeVar

from foresee_dsl.compile import codes
from foresee_dsl.compile.bundle import ModelSpec, PlacedActor, RecordedState, Scene, Signal, Steering
from foresee_dsl.compile.catalogue import cruise_speed
from foresee_dsl.compile.placement import actor_checks as checks
from foresee_dsl.compile.placement.name_checks import Said
from foresee_dsl.compile.placement.places import si
from foresee_dsl.compile.placement.starts import WHEELS, OnPath, OnRoute, Starts, item, items, lane_kind, route_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.walkways import Walk, walkways
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import (
    Actor,
    Both,
    Condition,
    CruiseSpeed,
    Delay,
    Ego,
    End,
    Expect,
    GoalAt,
    IgnoresRule,
    Line,
    MeetsState,
    Path,
    Predicate,
    Recorded,
    SignalState,
    StartAt,
    StartSpeed,
    Steers,
    Timing,
    Traffic,
    Weather,
    When,
)
from foresee_dsl.language.model import (
    Starts as StartsAction,
)
from foresee_dsl.language.project.document import PlacementError, Problem, TestCase
from foresee_dsl.language.traversal import all_actions, word_of

DEFAULT_END_S = 60.0
"""Ours: a route of 180 m, the longest of CARLA's on Town10HD, at 20 km/h with a red light on the way."""
GOAL_BEFORE_END_M = 5.0
"""Without a goal the ego is to come within a car's length of its route's end."""
DRY_FRICTION, WET_FRICTION = 0.9, 0.5
"""Tyre on asphalt, peak: dry 0.8 to 0.9, wet 0.5 to 0.7 (Wong, Theory of Ground Vehicles, table 1.3); the lower end for
a road under water."""
PATH_LIMIT_MPS = 30 / 3.6
"""What a vehicle on a path drives without a `speed`: a path has no limit of its own, and follows no lane (ours)."""
TOP_SPEED_SLACK = 1.01
"""A speed of a clip may exceed the model's by its rounding."""

_T = TypeVar("_T")


def friction_of(wetness: float) -> float:
    """Return the tyre-road coefficient for a wetness from 0 to 1: linear between dry and wet."""
    return DRY_FRICTION - (DRY_FRICTION - WET_FRICTION) * min(max(wetness, 0.0), 1.0)


def build_scene(
    case: TestCase, network: RoadNetwork, specs: Mapping[str, ModelSpec], signals: Mapping[str, Signal]
) -> Scene:
    """Make the scene of a test case.

    Args:
        case: concrete.
        network: its road network.
        specs: every model that may be named, by its name.
        signals: of the network, by junction.

    Raises:
        PlacementError: with everything that does not fit the network or is impossible.
    """
    return _Builder(case, network, specs, signals).build()


def check_scene(
    case: TestCase, network: RoadNetwork, specs: Mapping[str, ModelSpec], signals: Mapping[str, Signal]
) -> None:
    """Place the actors of a test case as `build_scene` does, without the background traffic, which is never wrong.

    Raises:
        PlacementError: as `build_scene`.
    """
    _Builder(case, network, specs, signals).place()


class _Builder:
    """Collects actors and problems; one use."""

    def __init__(
        self, case: TestCase, network: RoadNetwork, specs: Mapping[str, ModelSpec], signals: Mapping[str, Signal]
    ) -> None:
        self._case, self._network, self._specs, self._signals = case, network, specs, signals
        scenario = case.scenario
        self._actors: dict[str, Ego | Actor] = {}
        self._problems: list[Problem] = []
        for actor in scenario.actors:
            if str(actor.model) in specs:
                self._actors[actor.name] = actor
            else:
                self._add(
                    actor.name,
                    "model",
                    codes.UNKNOWN,
                    f"there is no model {actor.model}",
                    did_you_mean(str(actor.model), specs),
                )
        self._spec_of = {name: specs[str(actor.model)] for name, actor in self._actors.items()}
        self._starts = Starts(network, self._actors, self._spec_of)
        self._waiting = {
            action.actor
            for when in scenario.all(When)
            for action in all_actions(when.actions)
            if isinstance(action, StartsAction)
        }
        self._said = Said(case, network, signals, self._starts.spot)
        self._end_s = si(end.after) if (end := scenario.one(End)) is not None else DEFAULT_END_S

    def place(self) -> tuple[list[PlacedActor], float, float]:
        """Return the actors, and where the ego's journey starts and ends."""
        placed = [p for name in self._actors if (p := self._place(name)) is not None]
        self._problems += checks.of_names(self._case, self._network, self._signals)
        self._problems += self._said.problems({actor.id: actor for actor in placed})
        self._problems += checks.of_meetings(self._case, placed)
        start_s, goal_s = self._journey(placed)
        self._problems += checks.of_overlaps(placed, clip=self._case.snapshot)
        if self._problems:
            raise PlacementError(tuple(dict.fromkeys(self._problems)))
        return placed, start_s, goal_s

    def build(self) -> Scene:
        scenario = self._case.scenario
        placed, start_s, goal_s = self.place()
        notes: list[str] = []
        for traffic in scenario.all(Traffic):
            from foresee_dsl.compile.placement.background_traffic import (
                background,  # numpy and shapely: placing actors does without
            )

            more, note = background(traffic, network=self._network, specs=self._specs, placed=placed, end_s=self._end_s)
            placed += more
            notes += [note] if note else []
        weather = scenario.one(Weather)
        return Scene(
            actors=tuple(placed),
            start_s=start_s,
            goal_s=goal_s,
            end_s=self._end_s,
            whens=scenario.all(When),
            expects=scenario.all(Expect),
            signals=tuple((word_of(s.junction), word_of(s.stage), si(s.elapsed)) for s in scenario.all(SignalState)),
            friction=friction_of(si(weather.wetness)) if weather is not None else DRY_FRICTION,
            rain=si(weather.rain) if weather is not None else 0.0,
            fog=si(weather.fog) if weather is not None else 0.0,
            sun=si(weather.sun) if weather is not None else 0.0,
            clip=self._case.snapshot,
            began_s=self._case.clip.start_s if self._case.clip is not None else 0.0,
            must_arrive=any(e.mode == "eventually" and _arrives(e.condition) for e in scenario.all(Expect)),
            notes=tuple(notes),
            places=self._said.places,
        )

    def _add(self, actor: str, at: str, code: str, message: str, help: str = "") -> None:
        self._problems.append(Problem(actor, at, code, message, help))

    def _try(self, actor: str, at: str, work: Callable[[], _T]) -> _T | None:
        """Do something that may find a mistake, and note that."""
        try:
            return work()
        except RouteError as err:
            code = codes.PLACE if at in ("start_at", "path", "goal") else codes.ROUTE
            self._add(actor, at, code, str(err), err.help)
            return None

    def _place(self, name: str) -> PlacedActor | None:
        actor, spec = self._actors[name], self._spec_of[name]
        if isinstance(actor, Ego) and route_of(actor) is None:
            self._add(name, "", codes.NO_WAY, "the ego has no route", "add one: route from ROAD straight over JUNCTION")
            return None
        if route_of(actor) is not None and spec.kind in WHEELS:
            at = "route" if item(actor, StartAt) is None or self._route_fails(name) else "start_at"
            found = self._try(name, at, lambda: self._starts.on_route(name))
            placed = self._vehicle(name, found) if found is not None else None
        elif item(actor, Path) is not None:
            body = self._try(name, "path", lambda: self._starts.on_path(name))
            placed = self._walker(name, body) if body is not None else None
        elif route_of(actor) is not None:
            self._add(
                name,
                "route",
                codes.NO_WAY,
                f"{name} cannot follow a route",
                "a pedestrian follows a path: path [PLACE, PLACE]",
            )
            return None
        else:
            here = self._try(name, "start_at", lambda: self._starts.still(name))
            placed = self._still(name, here) if here is not None else None
        if placed is not None:
            self._problems += checks.of_place(actor, placed, self._network)
            self._problems += checks.of_speed(actor, placed, TOP_SPEED_SLACK)
        return placed

    def _route_fails(self, name: str) -> bool:
        """Say whether an actor's route is wrong in itself (or only its start)."""
        route = route_of(self._actors[name])
        try:
            edges = self._network.route_edges(route, lane_kind(self._spec_of[name])) if route is not None else ()
            self._network.line(edges, kind=lane_kind(self._spec_of[name]))
        except RouteError:
            return True
        return False

    def _vehicle(self, name: str, at: OnRoute) -> PlacedActor:
        actor, spec = self._actors[name], self._spec_of[name]
        ego = isinstance(actor, Ego)
        limits = [self._network.edges[edge].drivable[0].speed_mps for edge in at.edges]
        cruise = self._cruise(actor, spec, max(limits) if ego else min(limits))
        return self._common(
            actor,
            PlacedActor(
                id=name,
                model=spec,
                control="ego" if ego else "sumo",
                x=at.x,
                y=at.y,
                heading_rad=at.heading_rad,
                speed_mps=0.0,
                lane=at.lane,
                route=at.edges,
                line=at.line,
                cruise_mps=cruise,
            ),
        )

    def _walker(self, name: str, at: OnPath) -> PlacedActor:
        actor, spec = self._actors[name], self._spec_of[name]
        walks = spec.kind == "pedestrian"
        return self._common(
            actor,
            PlacedActor(
                id=name,
                model=spec,
                control="path",
                x=at.x,
                y=at.y,
                heading_rad=at.heading_rad,
                speed_mps=0.0,
                path=at.path,
                along_m=at.along_m,
                cruise_mps=self._cruise(actor, spec, PATH_LIMIT_MPS),
                walk_stops=Walk(at.path, walkways(self._network).crossings_on(at.path)).stops if walks else (),
            ),
        )

    def _still(self, name: str, at: tuple[float, float, float]) -> PlacedActor:
        x, y, heading = at
        spec = self._spec_of[name]
        return PlacedActor(id=name, model=spec, control="static", x=x, y=y, heading_rad=heading, speed_mps=0.0)

    def _common(self, actor: Ego | Actor, placed: PlacedActor) -> PlacedActor:
        """Add what is said in the same way for vehicles and walkers."""
        delay = item(actor, Delay)
        delay_s = si(delay.time) if delay is not None else 0.0
        timing = item(actor, Timing)
        aside = item(actor, Line)
        waits = actor.name in self._waiting
        state, said = actor.state, item(actor, StartSpeed)
        if state is not None:
            speed = max(si(state.speed), 0.0)
        elif waits or delay_s > 0:
            speed = 0.0
        else:
            speed = si(said.speed) if said is not None else placed.cruise_mps
        return replace(
            placed,
            speed_mps=speed,
            acceleration_mps2=si(state.acceleration) if state is not None else 0.0,
            steer_rad=si(state.steer) if state is not None else 0.0,
            waits=waits,
            delay_s=delay_s,
            timing=si(timing.factor) if timing is not None else 1.0,
            line_m=si(aside.left) if aside is not None and placed.control == "sumo" else 0.0,
            recorded=tuple(_recorded(i) for i in items(actor, Recorded)) if placed.control == "ego" else (),
            steering=_steering(item(actor, Steers)),
            ignores=tuple(
                (i.what, None if i.junction is None else word_of(i.junction)) for i in items(actor, IgnoresRule)
            ),
            meets=items(actor, MeetsState),
        )

    def _cruise(self, actor: Ego | Actor, spec: ModelSpec, limit_mps: float) -> float:
        said = item(actor, CruiseSpeed)
        if said is not None:
            return si(said.speed)
        return cruise_speed(spec, limit_mps)

    def _journey(self, placed: Iterable[PlacedActor]) -> tuple[float, float]:
        """Return where the ego's journey starts and ends along its line."""
        ego = next((p for p in placed if p.control == "ego"), None)
        if ego is None or ego.line is None:
            return 0.0, 0.0
        line, start = ego.line, self._starts.on_route("ego").s
        goal_item = item(self._actors["ego"], GoalAt)
        if goal_item is None:
            return start, max(line.end_s - GOAL_BEFORE_END_M, min(start + 1.0, line.end_s))
        place = self._try("ego", "goal", lambda: self._starts.spot(goal_item.place))
        if place is None:
            return start, line.end_s
        goal, lateral = line.project(place.x, place.y) if place.actor != "ego" or place.s is None else (place.s, 0.0)
        if abs(lateral) > checks.GOAL_OFF_M:
            message = f"the goal is {abs(lateral):.1f} m off the ego's route"
            self._add("ego", "goal", codes.GOAL, message, "write it like `40 m past JUNCTION on ego.route`")
        elif goal <= start and not self._case.snapshot:
            message = f"the goal is {start - goal:.1f} m behind the ego's start"
            self._add("ego", "goal", codes.GOAL, message, "put it in front, or let the ego start earlier")
        return start, goal


def _recorded(said: Recorded) -> RecordedState:
    state = said.state
    return RecordedState(
        time_s=si(said.time),
        x=si(state.at.x),
        y=si(state.at.y),
        heading_rad=si(state.heading),
        speed_mps=max(si(state.speed), 0.0),
        acceleration_mps2=si(state.acceleration),
        steer_rad=si(state.steer),
    )


def _steering(said: Steers | None) -> Steering | None:
    if said is None:
        return None
    return Steering(si(said.value), si(said.start), si(said.duration) if said.duration is not None else None)


def _arrives(condition: Condition) -> bool:
    """Whether a condition says that the ego arrives (alone, or as one of several that must all hold)."""
    if isinstance(condition, Both):
        return any(_arrives(part) for part in condition.conditions)
    return isinstance(condition, Predicate) and condition.what == "arrived" and condition.actor == "ego"
