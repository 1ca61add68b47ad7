"""Converts a concrete scenario to the scene at the first frame, or reports all its errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from foresee_dsl.compile.bundle import (
    ModelSpec,
    PlacedActor,
    Scene,
    Signal,
    SlipperyPatch,
    TrackPlayback,
)
from foresee_dsl.compile.catalogue import cruise_speed
from foresee_dsl.compile.placement import checks
from foresee_dsl.compile.placement.doors import door_problems, doors_of
from foresee_dsl.compile.placement.name_checks import NameChecks, never_near, never_passed
from foresee_dsl.compile.placement.paths import joined_way
from foresee_dsl.compile.placement.spots import PLACED_BEFORE, CircleError, OnPath, OnRoute, UnsettledError
from foresee_dsl.compile.placement.starts import StartSearch
from foresee_dsl.compile.placement.statements import (
    WHEELS,
    cruise_of,
    item,
    items,
    lane_kind,
    path_of,
    playback_of,
    recorded_state,
    route_of,
    si,
    timed,
    track_of,
)
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.routing import RouteError, metres
from foresee_dsl.compile.roads.walkways import walkways
from foresee_dsl.compile.tracks import TracksError, read_tracks
from foresee_dsl.errors import MessageText
from foresee_dsl.helps import HelpText, remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import PlacementError, Problem, TestCase
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model.scenario import DEFAULT_END_S
from foresee_dsl.language.traversal import all_actions, word_of

GOAL_BEFORE_END_M = 5.0
"""Distance of the goal from the end of the ego's route if there is no `goal` statement, m (ours: about a car's
length)."""
DRY_FRICTION, WET_FRICTION = 0.9, 0.5
"""Peak friction of a tyre on asphalt: dry 0.8 to 0.9, wet 0.5 to 0.7 (Wong, Theory of Ground Vehicles, table 1.3); the
lower end is for a road under water."""
PATH_LIMIT_MPS = 30 / 3.6
"""Speed of a vehicle without a `speed` statement on a path, which has no speed limit, m/s (ours)."""
TOP_SPEED_SLACK = 1.01
"""Factor by which a clip's speed may exceed its model's maximum, because it is rounded (ours)."""

_T = TypeVar("_T")


def friction_of(wetness: float) -> float:
    """Return the friction coefficient for a wetness from 0 to 1, linear between dry and wet."""
    return DRY_FRICTION - (DRY_FRICTION - WET_FRICTION) * min(max(wetness, 0.0), 1.0)


class SceneBuilder:
    """Places the actors of a concrete test case and collects its problems; `build` or `place` may be called once.

    `specs` holds all models by name, `signals` the signals by junction.
    """

    def __init__(
        self, case: TestCase, network: RoadNetwork, specs: Mapping[str, ModelSpec], signals: Mapping[str, Signal]
    ) -> None:
        self._case, self._network, self._specs = case, network, specs
        scenario = case.scenario
        self._actors: dict[str, m.Ego | m.Actor] = {}
        self._problems: list[Problem] = []
        self._patches: list[SlipperyPatch] = []
        self._circles: set[frozenset[str]] = set()
        for actor in scenario.actors:
            model = str(actor.model)
            if model in specs:
                self._actors[actor.name] = actor
            else:
                message = f"there is no model {model}"
                self._add(actor.name, "model", "FS251", message, did_you_mean(model, specs))
        self._spec_of = {name: specs[str(actor.model)] for name, actor in self._actors.items()}
        self._playbacks = self._read_playbacks()
        self._starts = StartSearch(network, self._actors, self._spec_of, self._playbacks)
        actions = [action for when in scenario.all(m.When) for action in all_actions(when.actions)]
        self._waiting = {action.actor for action in actions if isinstance(action, m.Starts)}
        self._guided = {action.actor for action in actions if isinstance(action, m.FollowsPath | m.Reverses)}
        self._names = NameChecks(case, network, signals, self._starts.spot)
        self._end_s = si(end.after) if (end := scenario.first(m.End)) is not None else DEFAULT_END_S

    def _read_playbacks(self) -> dict[str, TrackPlayback]:
        """Return how the actors with recorded tracks follow them, by name; add a problem for each track that cannot be
        followed."""
        statements = {name: item for name, actor in self._actors.items() if (item := track_of(actor)) is not None}
        if not statements:
            return {}
        try:
            tracks = read_tracks(self._case.tracks) if self._case.tracks is not None else {}
        except TracksError as err:
            self._add("", "use_tracks", "FS261", str(err), "correct the file, or write it again")
            return {}
        playbacks: dict[str, TrackPlayback] = {}
        for name, statement in statements.items():
            track = tracks.get(statement.name)
            if track is None:
                help_ = did_you_mean(statement.name, tracks) or "write the name of an actor in the tracks file"
                self._add(name, "track", "FS261", f"there is no track called {statement.name}", help_)
            elif si(statement.start) > track.end_s and not isinstance(self._actors[name], m.Ego):
                message = f"the track {statement.name} ends at {track.end_s:g} s, so {name} would never be there"
                self._add(name, "track", "FS261", message, "let it begin earlier, or " + remove("remove the actor"))
            else:
                playbacks[name] = playback_of(self._actors[name], track, self._spec_of[name])
        return playbacks

    def place(self) -> tuple[list[PlacedActor], float, float]:
        """Return the actors without background traffic, and the ego's start and goal along its line, m.

        Raises:
            PlacementError: statements do not fit the network or are impossible; the error holds all of them.
        """
        placed, start_s, goal_s, problems = self.attempt()
        if problems:
            raise PlacementError(problems)
        return placed, start_s, goal_s

    def attempt(self) -> tuple[list[PlacedActor], float, float, tuple[Problem, ...]]:
        """Return the result of `place` for the actors that could be placed, and the problems."""
        placed = [p for name in self._actors if (p := self._place(name)) is not None]
        self._problems += self._names.problems(placed)
        self._patches = self._slippery()
        start_s, goal_s = self._journey(placed)
        self._problems += checks.of_overlaps(placed, self._actors, clip=self._case.snapshot)
        self._problems += door_problems(self._case.scenario, placed)
        return placed, start_s, goal_s, checks.each_once(self._problems)

    def warnings(self) -> tuple[Problem, ...]:
        """Return warnings about what is permitted but probably not intended.

        Raises:
            PlacementError: as `place`.
        """
        placed, _, _ = self.place()
        warnings = (
            *never_near(self._case.scenario, placed, self._names.places, self._network),
            *(() if self._case.snapshot else never_passed(self._case.scenario, placed, self._network)),
            *checks.of_slippery(self._patches, self._network),
        )
        return checks.few(dict.fromkeys((*warnings, *checks.of_paths(placed, self._actors, self._network))))

    def build(self) -> Scene:
        """Return the scene with background traffic; actors of the traffic for which there is no room are left out.

        Raises:
            PlacementError: as `place`.
        """
        scenario = self._case.scenario
        placed, start_s, goal_s = self.place()
        more, notes = self.background(placed)
        placed += more
        placed += doors_of(scenario, placed)
        if any(actor.passes for actor in placed):  # SUMO's sublane model is for all its vehicles or for none
            placed = [replace(actor, sublanes=actor.control == "sumo") for actor in placed]
        weather = scenario.first(m.Weather)
        return Scene(
            actors=tuple(placed),
            start_s=start_s,
            goal_s=goal_s,
            end_s=self._end_s,
            whens=scenario.all(m.When),
            expects=scenario.all(m.Expect),
            signals=tuple((word_of(s.junction), word_of(s.stage), si(s.elapsed)) for s in scenario.all(m.SignalState)),
            friction=friction_of(si(weather.wetness) if weather else 0.0),
            rain=si(weather.rain) if weather else 0.0,
            fog=si(weather.fog) if weather else 0.0,
            sun=si(weather.sun) if weather else 0.0,
            clip=self._case.snapshot,
            began_s=self._case.clip.start_s if self._case.clip is not None else 0.0,
            must_arrive=self._must_arrive(),
            notes=tuple(notes),
            places=self._names.places,
            slippery=tuple(self._patches),
        )

    def _must_arrive(self) -> bool:
        """Return whether the ego has to arrive: in a test case, unless its `end` says `anywhere`."""
        scenario, end = self._case.scenario, self._case.scenario.first(m.End)
        if any(e.mode == "eventually" and _arrives(e.condition) for e in scenario.all(m.Expect)):
            return True
        return not self._case.snapshot and (end is None or end.where is None)

    def background(self, placed: Sequence[PlacedActor]) -> tuple[list[PlacedActor], list[str]]:
        """Return the background traffic around placed actors, and notes on its actors for which there is no room."""
        actors, notes = list(placed), []
        for traffic in self._case.scenario.all(m.Traffic):
            # slow import (numpy, shapely), which placing actors does not need
            from foresee_dsl.compile.placement.background_traffic import background

            more, note = background(traffic, network=self._network, specs=self._specs, placed=actors, end_s=self._end_s)
            actors += more
            notes += [note] if note else []
        return actors[len(placed) :], notes

    def _slippery(self) -> list[SlipperyPatch]:
        """Return the slippery patches that can be placed; add a problem for each of the others."""
        patches = []
        for item_ in self._case.scenario.all(m.Slippery):
            try:
                spot = self._starts.spot(item_.place)
            except UnsettledError:
                continue  # the error is reported at the actor to which the place refers
            except RouteError as err:
                self._problems.append(Problem("", item_.kind, "FS252", err.message, err.help, part=item_.place))
            else:
                patches.append(SlipperyPatch(item_.name, spot.x, spot.y, si(item_.radius), si(item_.friction)))
        return patches

    @property
    def slippery(self) -> tuple[SlipperyPatch, ...]:
        """The slippery patches, available after placing the actors."""
        return tuple(self._patches)

    @property
    def places(self) -> Mapping[m.Place, XY]:
        """Coordinates of the places in conditions, m, available after placing the actors."""
        return {place: xy for place, xy in self._names.places.items() if not isinstance(place, m.AtStop)}

    def _add(self, actor: str, at: str, code: str, message: MessageText, help: HelpText = "") -> None:
        self._problems.append(Problem(actor, at, code, message, help))

    def _try(self, actor: str, at: str, work: Callable[[], _T]) -> _T | None:
        """Return the result of `work`; if it raises `RouteError`, add a problem and return None."""
        try:
            return work()
        except UnsettledError:
            return None  # the error is reported at the actor to which the place refers
        except CircleError as err:
            if err.members not in self._circles:
                self._circles.add(err.members)
                self._add(actor, at, "FS252", err.message, err.help)
            return None
        except RouteError as err:
            code = "FS252" if at in ("start_at", "path", "path_along", "goal") else "FS250"
            self._add(actor, at, code, err.message, err.help)
            return None

    def _place(self, name: str) -> PlacedActor | None:
        actor, spec = self._actors[name], self._spec_of[name]
        playback, wrong = self._playbacks.get(name), len(self._problems)
        apart = name in self._waiting, name in self._guided, playback.track if playback is not None else None
        if track_of(actor) is not None and name not in self._playbacks:
            return None  # the problem of the track is reported
        former = PLACED_BEFORE.get(actor, spec, self._network, apart)
        if former is not None:
            self._starts.settle(name, former[1])
            return former[0]
        placed = self._place_anew(name, actor, spec)
        if placed is not None and len(self._problems) == wrong:
            PLACED_BEFORE.put(actor, self._network, apart, placed, self._starts.settled(name))
        return placed

    def _place_anew(self, name: str, actor: m.Ego | m.Actor, spec: ModelSpec) -> PlacedActor | None:
        routed = route_of(actor) is not None
        placed: PlacedActor | None = None
        if isinstance(actor, m.Ego) and not routed:
            self._add(name, "", "FS257", "the ego has no route", "add " + write("route from south straight over j4"))
        elif routed and spec.kind in WHEELS:
            at = "route" if item(actor, m.StartAt) is None or self._route_fails(name) else "start_at"
            if (start := self._try(name, at, lambda: self._starts.on_route(name))) is not None:
                placed = self._on_route(actor, spec, start)
        elif name in self._playbacks:
            return self._on_track(actor, spec, self._starts.on_track(name))
        elif (path := path_of(actor)) is not None:
            if (body := self._try(name, path.kind, lambda: self._starts.on_path(name))) is not None:
                placed = self._on_path(actor, spec, body)
        elif routed:
            route = route_of(actor)
            road = word_of(route.start if isinstance(route, m.Route) else route.edges[0]) if route is not None else ""
            help_ = "a pedestrian follows a path, such as " + write(f"path [10 m along {road}, 30 m along {road}]")
            self._add(name, "route", "FS257", f"{name} cannot follow a route", help_)
        elif (pose := self._try(name, "start_at", lambda: self._starts.still(name))) is not None:
            placed = PlacedActor(name, spec, "static", *pose, speed_mps=0.0)
        if placed is not None:
            self._problems += checks.of_place(actor, placed, self._network)
            self._problems += checks.of_speed(actor, placed, TOP_SPEED_SLACK)
        return placed

    def _route_fails(self, name: str) -> bool:
        """Return whether an actor's route itself is wrong, not only its start."""
        kind = lane_kind(self._spec_of[name])
        route = route_of(self._actors[name])
        try:
            self._network.line(self._network.route_edges(route, kind) if route is not None else (), kind=kind)
        except RouteError:
            return True
        return False

    def _on_route(self, actor: m.Ego | m.Actor, spec: ModelSpec, at: OnRoute) -> PlacedActor:
        ego = isinstance(actor, m.Ego)
        limits = [self._network.edges[edge].drivable[0].speed_mps for edge in at.edges]
        cruise_mps = cruise_of(actor, spec, max(limits) if ego else min(limits))
        pose = (at.x, at.y, at.heading_rad, self._first_speed(actor, cruise_mps))
        placed = PlacedActor(actor.name, spec, "ego" if ego else "sumo", *pose, cruise_mps=cruise_mps)
        return self._with_statements(actor, replace(placed, lane=at.lane, route=at.edges, line=at.line))

    def _on_path(self, actor: m.Ego | m.Actor, spec: ModelSpec, at: OnPath) -> PlacedActor:
        cruise_mps = cruise_of(actor, spec, PATH_LIMIT_MPS)
        pose = (at.x, at.y, at.heading_rad, self._first_speed(actor, cruise_mps))
        placed = PlacedActor(actor.name, spec, "path", *pose, path=at.path, along_m=at.along_m, cruise_mps=cruise_mps)
        joins = item(actor, m.Joins)
        if joins is not None:
            placed = self._joining(actor, placed, joins)
        if spec.kind == "pedestrian":
            placed = replace(placed, walk_stops=walkways(self._network).stops_on(at.path))
        return self._with_statements(actor, placed)

    def _on_track(self, actor: m.Ego | m.Actor, spec: ModelSpec, at: OnPath) -> PlacedActor:
        """Return an actor on its recorded track; neither its place nor its speed is checked, because they were so."""
        playback = self._playbacks[actor.name]
        top_mps = max(map(abs, playback.track.speed_mps))
        joins = item(actor, m.Joins)
        edges = self._edges_to_join(actor, spec, joins) if joins is not None else ()
        limits = [self._network.edges[edge].drivable[0].speed_mps for edge in edges]
        cruise_mps = min(max(top_mps, cruise_speed(spec, min(limits, default=0.0))), spec.max_speed_mps)
        speed_mps = playback.track.at(playback.start_s).speed_mps if playback.speed_mps is None else playback.speed_mps
        return PlacedActor(
            actor.name,
            spec,
            "path",
            at.x,
            at.y,
            at.heading_rad,
            0.0 if playback.delay_s > 0 else speed_mps,
            path=at.path,
            along_m=at.along_m,
            cruise_mps=cruise_mps,
            route=edges,
            joins=bool(edges),
            playback=playback,
            timing=playback.timing,
        )

    def _edges_to_join(self, actor: m.Ego | m.Actor, spec: ModelSpec, joins: m.Joins) -> tuple[str, ...]:
        """Return the edges along which an actor drives when it has left its track."""
        if spec.kind not in WHEELS:
            self._add(actor.name, "joins", "FS257", f"{actor.name} cannot join the traffic", remove("remove it"))
            return ()
        route = m.EdgeRoute(edges=joins.edges, shortest=True)
        return self._try(actor.name, "joins", lambda: self._network.route_edges(route, lane_kind(spec))) or ()

    def _joining(self, actor: m.Ego | m.Actor, placed: PlacedActor, joins: m.Joins) -> PlacedActor:
        """Return an actor on a path with the way that it follows after the path's end."""
        name, kind = actor.name, lane_kind(placed.model)
        if placed.model.kind not in WHEELS:
            self._add(name, "joins", "FS257", f"{name} cannot join the traffic", "end its path where it stays")
            return placed
        way = self._try(name, "joins", lambda: joined_way(self._network, joins.edges, placed.path[-1], kind))
        return placed if way is None else replace(placed, route=way[0], line=way[1], joins=True)

    def _first_speed(self, actor: m.Ego | m.Actor, cruise_mps: float) -> float:
        """Return the speed at the first frame, m/s."""
        delay, start = item(actor, m.Delay), item(actor, m.StartSpeed)
        if actor.state is not None:
            return max(si(actor.state.speed), 0.0)
        if actor.name in self._waiting or (delay is not None and si(delay.time) > 0):
            return 0.0
        if start is None and actor.name in self._playbacks:
            playback = self._playbacks[actor.name]
            recorded_mps = playback.track.at(playback.start_s).speed_mps
            return min(max(recorded_mps, 0.0), self._spec_of[actor.name].max_speed_mps)
        return si(start.speed) if start is not None else cruise_mps

    def _with_statements(self, actor: m.Ego | m.Actor, placed: PlacedActor) -> PlacedActor:
        """Return an actor with the values of statements that apply to routes and paths alike."""
        delay, timing, line = item(actor, m.Delay), item(actor, m.Timing), item(actor, m.Line)
        state, steers, brakes = actor.state, item(actor, m.Steers), item(actor, m.Brakes)
        style = item(actor, m.Style)
        later = line is not None and placed.control == "sumo" and (line.start is not None or line.duration is not None)
        return replace(
            placed,
            acceleration_mps2=si(state.acceleration) if state is not None else 0.0,
            steer_rad=si(state.steer) if state is not None else 0.0,
            waits=actor.name in self._waiting,
            delay_s=si(delay.time) if delay is not None else 0.0,
            timing=si(timing.factor) if timing is not None else 1.0,
            line_m=si(line.left) if line is not None and placed.control == "sumo" and not later else 0.0,
            strays=timed(line.left, line) if line is not None and later else None,
            brakes=timed(brakes.braking, brakes) if brakes is not None else None,
            playback=self._playbacks.get(actor.name),
            recorded=tuple(map(recorded_state, items(actor, m.Recorded))) if placed.control == "ego" else (),
            steering=timed(steers.value, steers) if steers is not None else None,
            guided=actor.name in self._guided,
            backs_mps=max(-si(state.speed), 0.0) if state is not None else 0.0,
            ignores=tuple(
                (i.what, None if i.junction is None else word_of(i.junction)) for i in items(actor, m.IgnoresRule)
            ),
            meets=items(actor, m.MeetsState),
            passes=placed.control == "sumo" and item(actor, m.PassesInLane) is not None,
            style=style.manner if style is not None and placed.control == "sumo" else "",
        )

    def _journey(self, placed: Iterable[PlacedActor]) -> tuple[float, float]:
        """Return the ego's start and goal along its line, m."""
        ego = next((p for p in placed if p.control == "ego"), None)
        if ego is None or ego.line is None:
            return 0.0, 0.0
        line, start = ego.line, self._starts.on_route("ego").s
        goal_at = item(self._actors["ego"], m.GoalAt)
        if goal_at is None and ego.playback is not None:
            last = ego.playback.track.at(ego.playback.track.end_s)
            half = ego.model.length_m / 2
            front = last.x + half * math.cos(last.heading_rad), last.y + half * math.sin(last.heading_rad)
            goal, lateral = line.project(*front)
            if abs(lateral) <= checks.GOAL_OFF_M and goal > start:
                return start, min(goal, line.end_s)
        if goal_at is None:
            return start, max(line.end_s - GOAL_BEFORE_END_M, min(start + 1.0, line.end_s))
        place = self._try("ego", "goal", lambda: self._starts.spot(goal_at.place))
        if place is None:
            return start, line.end_s
        goal, lateral = line.project(place.x, place.y) if place.actor != "ego" or place.s is None else (place.s, 0.0)
        if abs(lateral) > checks.GOAL_OFF_M:
            message = "the goal is " + metres(abs(lateral)) + " off the ego's route"
            self._add("ego", "goal", "FS255", message, "write it like " + write("goal 40 m past j4 on ego.route"))
        elif goal <= start and not self._case.snapshot:
            message = "the goal is " + metres(start - goal) + " behind the ego's start"
            help_ = "put it in front, or " + remove("remove it") + ": then the goal is the end of the route"
            self._add("ego", "goal", "FS255", message, help_)
        return start, goal


def _arrives(condition: m.Condition) -> bool:
    """Return whether a condition requires that the ego arrives (alone, or as one of several that must all hold)."""
    if isinstance(condition, m.Both):
        return any(_arrives(part) for part in condition.conditions)
    return isinstance(condition, m.Predicate) and condition.what == "arrived" and condition.actor == "ego"
