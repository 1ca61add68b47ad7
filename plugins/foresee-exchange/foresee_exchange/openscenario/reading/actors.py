"""Entities with their places, speeds and routes as actors of the language."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.checks import NEAR_ROAD_M
from foresee_dsl.compile.placement.statements import WHEELS, lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.language import model as m
from foresee_exchange.naming import number, quantity
from foresee_exchange.openscenario.losses import Losses, NotExpressed
from foresee_exchange.openscenario.reading.actions import from_the_start, speed_changes
from foresee_exchange.openscenario.reading.conditions import RemainingWay
from foresee_exchange.openscenario.reading.entities import Entity, EntityState
from foresee_exchange.openscenario.reading.places import Places, point_of
from foresee_exchange.openscenario.reading.source import Source
from foresee_exchange.openscenario.reading.ways import trajectories as tracks
from foresee_exchange.openscenario.reading.ways.held_up import (
    held_by_tyres,
    lane_ahead,
    path_along,
    way_on,
    without_needless,
)

_WALK_M = 60.0
"""Length of a pedestrian's straight path if the file has no path, m (ours: the usual run of a minute at 1 m/s)."""
_OFF_ROAD_M = 200.0
"""Length of a vehicle's straight path off the lanes, m."""
_NEAR_M = NEAR_ROAD_M - 1.0
_LIMIT = 1.01
_APART_M = 1.0
"""An actor farther than this from its trajectory's beginning goes there first, m (ours)."""
_ASKEW_RAD = math.radians(20)
"""A vehicle whose heading differs by more than this from its lane's does not follow the lane (ours)."""
_NOTED_S = 20.0
"""An actor that reaches the end of its lane within this time, s, is reported (ours: a third of the usual run)."""
_GENTLE_MPS2 = 1.0
"""Assumed least braking of a driven vehicle, m/s^2 (ours)."""
_LATE_S = 0.1
"""Time by which a trajectory may begin before its action, s. Ours: two steps of the simulation."""
_CRAWLS_MPS = 0.05
"""An actor slower than this at the end of its trajectory stops there, m/s (ours)."""


@dataclass(frozen=True)
class BuiltActor:
    """An actor and the triggers that belong to it."""

    statement: m.Ego | m.Actor
    whens: tuple[m.When, ...] = ()


@dataclass
class ActorBuilder:
    """Builds actors from entities on a network; `ways` receives the remaining way of each.

    `lane_keepers`: entities that need lanes. `lane_changers`: those that change lanes. `beginnings`: pose and speed
    (m/s) of each entity at the beginning.
    """

    source: Source
    network: RoadNetwork
    places: Places
    losses: Losses
    ways: dict[str, RemainingWay] = field(default_factory=dict)
    lane_keepers: Set[str] = frozenset()
    lane_changers: Set[str] = frozenset()
    beginnings: Mapping[str, tuple[Pose, float]] = field(default_factory=dict)

    def actor(
        self, state: EntityState, routing: Element | None, *, begins_s: float | None, at_start: bool, acts: bool
    ) -> BuiltActor | None:
        """Return an entity as an actor, or None if it has no place on the network.

        `state` receives the speeds of its trajectory if an event starts that. `routing`: its route, target or
        trajectory, which applies from the beginning with `at_start`, otherwise from `begins_s` on (None: the run
        decides when). An entity that neither moves nor acts in an event (`acts`) is only placed.
        """
        entity = state.entity
        try:
            middle = self.places.initial(entity.ref).ahead(entity.centre_m)
            if not self._near_roads(middle):
                raise NotExpressed("entities outside the road network")
            track = self._trajectory(entity, routing, begins_s)
            path = tracks.path_of(track) if track is not None else []
            if self.network.far_from_lanes(path, _NEAR_M) is not None:
                raise NotExpressed("entities whose trajectories leave the road network")
        except NotExpressed as err:
            if entity.kind == "obstacle" and not acts:
                self.losses.leave(f"things: {err}", f"'{entity.ref}'")
            else:
                self.losses.lose(str(err), f"'{entity.ref}'")
            return None
        if entity.name == "ego":
            return self._ego(state, middle, routing, track, at_start=begins_s == 0)
        if track is not None and path:
            timed = _timed(tracks.speed_profile(track), routing, begins_s)
            if begins_s != 0 and not state.speed_mps and math.dist(path[0], (middle.x, middle.y)) > _APART_M:
                self.losses.lose("trajectories that begin away from where the actor stands", f"'{entity.ref}'")
            return self._on_trajectory(state, middle, path, timed, begins_s=begins_s, at_start=at_start)
        if entity.kind == "obstacle" or not (acts or routing is not None or state.speed_mps):
            return BuiltActor(_actor(entity, middle, 0.0, ()))
        if entity.kind not in WHEELS:
            return self._straight(state, middle, _WALK_M)
        return self._on_lanes(state, middle, routing, at_start=begins_s == 0)

    def _near_roads(self, pose: Pose) -> bool:
        return self.network.far_from_lanes([(pose.x, pose.y)], _NEAR_M) is None

    def _trajectory(self, entity: Entity, routing: Element | None, begins_s: float | None) -> tracks.Trajectory | None:
        if routing is None or routing.tag != "FollowTrajectoryAction":
            return None
        trajectory = trajectory_of(self.source, routing)
        try:
            if trajectory is None:
                raise NotExpressed("trajectories: nothing")
            if begins_s != 0:
                self.places.stay(trajectory)
            track = tracks.read_trajectory(trajectory, self.places, entity.centre_m)
            # Raises an error if the times of the trajectory cannot be kept.
            _timed(tracks.speed_profile(track), routing, begins_s)
            return track
        except NotExpressed as err:
            self.losses.lose(str(err), f"'{entity.ref}'")
            return None

    def _ego(
        self,
        state: EntityState,
        middle: Pose,
        routing: Element | None,
        track: tracks.Trajectory | None,
        *,
        at_start: bool,
    ) -> BuiltActor | None:
        """Return the ego: its route and goal, without actions, because its driver decides."""
        entity, kind = state.entity, lane_kind(state.entity.spec)
        front = middle.ahead(entity.spec.length_m / 2)
        # A trajectory is not a goal: a run that ended at the place of a recorded crash could not crash there.
        through = [
            front,
            *(tracks.thinned(track.poses())[1:] if track is not None else self._waypoints(routing, at_start=at_start)),
        ]
        goal = through[-1] if track is None and len(through) > 1 else None
        try:
            route = tracks.route_through(self.network, through, kind)
        except NotExpressed:
            try:
                route = tracks.route_through(self.network, [front], kind)
            except NotExpressed:
                return None
            self.losses.leave("ways of the ego that the network does not have")
            goal = None
        way = tracks.straight_on(self.network, route, kind) if goal is None else route
        self._goes(entity, front, way)
        body: list[m.ActorItem] = [m.EdgeRoute(edges=way)]
        if goal is not None and tracks.nearest(self.network, goal, "car") is not None:
            body.append(m.GoalAt(place=point_of(goal)))
        return BuiltActor(
            m.Ego(model=entity.model, state=_state(front, state.speed_mps or 0.0, entity), body=tuple(body))
        )

    def _on_trajectory(
        self,
        state: EntityState,
        middle: Pose,
        path: list[XY],
        profile: tracks.SpeedProfile | None,
        *,
        begins_s: float | None,
        at_start: bool,
    ) -> BuiltActor:
        self.losses.note("actors that follow a trajectory react to no other actor")
        entity, speed = state.entity, state.speed_mps or 0.0
        whens: tuple[m.When, ...] = ()
        if profile is not None:
            if begins_s == 0:
                state.speed_mps = speed = profile.speed_mps[0]
            if at_start:
                whens = (m.When(condition=from_the_start(), actions=tuple(speed_changes(state, profile))),)
            else:
                state.profile = profile
        if math.dist(path[0], (middle.x, middle.y)) > _APART_M and not at_start:
            path = [(middle.x, middle.y), *path]  # the actor drives to the trajectory's beginning first
        self._walks(entity, path)
        self._note_bends(entity, path, max(profile.speed_mps) if profile is not None else speed)
        last = profile.speed_mps[-1] if profile is not None else speed
        points = tuple(point_of(Pose(x, y, 0.0)) for x, y in self._going_on(path, last, entity))
        return BuiltActor(_actor(entity, middle, speed, _walk(entity, points, speed)), whens)

    def _on_lanes(self, state: EntityState, middle: Pose, routing: Element | None, *, at_start: bool) -> BuiltActor:
        """Return a vehicle that follows the lanes without any rules, as a default controller does."""
        entity, kind = state.entity, lane_kind(state.entity.spec)
        front = middle.ahead(entity.spec.length_m / 2)
        try:
            route = tracks.route_through(self.network, [front, *self._waypoints(routing, at_start=at_start)], kind)
        except NotExpressed as err:
            if str(err) == "starts off the lanes":
                if own := self._ahead(state):
                    return self._on_path(state, middle, own, state.speed_mps or 0.0)
                return self._straight(state, middle, _OFF_ROAD_M)
            self.losses.lose(str(err), f"'{entity.ref}'")
            route = tracks.route_through(self.network, [front], kind)
        speed = state.speed_mps or 0.0
        way = tracks.straight_on(self.network, route, kind)
        if routing is None and entity.ref not in self.lane_changers | self.lane_keepers and (own := self._ahead(state)):
            return self._on_path(state, middle, own, speed)
        if entity.ref not in self.lane_keepers:
            others = [other for ref, other in self.beginnings.items() if ref != entity.ref]
            only_if = (speed, others) if entity.ref in self.lane_changers else None
            if path := path_along(self.network, way, middle, front, kind, only_if):
                return self._on_path(state, middle, path, speed)
        self.losses.note(
            "vehicles on lanes ignore signals and priority, as a default controller does; they follow others"
        )
        state.on_lanes = True
        self._goes(entity, front, way)
        body: list[m.ActorItem] = [m.EdgeRoute(edges=way)]
        if speed > 0:
            body.append(m.CruiseSpeed(speed=quantity(min(speed, entity.most_mps), "speed")))
        body += [m.IgnoresRule(what="signals"), m.IgnoresRule(what="priority")]
        stands = m.When(condition=from_the_start(), actions=(m.Stops(actor=entity.name),))
        return BuiltActor(_actor(entity, middle, speed, tuple(body)), () if speed > 0 else (stands,))

    def _on_path(self, state: EntityState, middle: Pose, path: list[XY], speed: float) -> BuiltActor:
        """Return a vehicle that keeps its lane and speed regardless of what is ahead, as a default controller does."""
        self.losses.note(
            "vehicles that keep to their lane follow it as a path and react to no actor, as a default controller does"
        )
        self._walks(state.entity, path)
        self._note_bends(state.entity, path, speed)
        length_m = sum(math.dist(a, b) for a, b in itertools.pairwise(path))
        if length_m < speed * _NOTED_S:
            self.losses.note(
                f"{state.entity.name} brakes at the end of its lane, {length_m:.0f} m ahead: "
                "the map has no lane from there"
            )
        points = tuple(point_of(Pose(x, y, 0.0)) for x, y in path)
        return BuiltActor(_actor(state.entity, middle, speed, _walk(state.entity, points, speed)))

    def _note_bends(self, entity: Entity, path: list[XY], speed_mps: float) -> None:
        """Report an actor that cannot drive its path at the speed of the file."""
        held = held_by_tyres(path, entity.spec, speed_mps) if entity.kind in WHEELS and speed_mps > 0 else None
        if held is not None:
            self.losses.note(
                f"{entity.name} slows down to {held:.1f} m/s in bends, where the file has {speed_mps:.1f} m/s, because "
                "its tyres do not hold more"
            )

    def _ahead(self, state: EntityState) -> list[XY]:
        """Return the path ahead of a vehicle in its lane of the map, in either direction; empty if it is unknown."""
        entity, roads = state.entity, self.places.roads
        place = self.places.lane_of(entity.ref)
        if roads is None or place is None or not place.lane:
            return []
        poses = lane_ahead(roads, place, tracks.AHEAD_M, onward=state.ahead)
        points = [(pose.x, pose.y) for pose in (pose.ahead(entity.centre_m) for pose in poses)]
        looks = self.places.initial(entity.ref).heading_rad
        if len(points) < 2 or abs(math.remainder(poses[0].heading_rad - looks, math.tau)) > _ASKEW_RAD:
            return []
        if self.network.far_from_lanes(points, _NEAR_M) is not None:
            return []
        return without_needless(points)

    def _straight(self, state: EntityState, middle: Pose, length_m: float) -> BuiltActor:
        """Return an actor that goes straight on off the lanes, or stands still."""
        entity, speed = state.entity, state.speed_mps or 0.0
        end = self._straight_end(middle, length_m)
        self._walks(entity, [(middle.x, middle.y), (end.x, end.y)])
        points = (point_of(middle), point_of(end))
        body = _walk(entity, points, min(speed, entity.most_mps))
        return BuiltActor(_actor(entity, middle, speed, body))

    def _going_on(self, path: list[XY], speed: float, entity: Entity) -> list[XY]:
        """Return a path continued along its lane, or straight for the stopping distance, because actors do not brake
        for the end of their path."""
        if speed < _CRAWLS_MPS:
            return path
        end = Pose(*path[-1], math.atan2(path[-1][1] - path[-2][1], path[-1][0] - path[-2][0]))
        if entity.kind in WHEELS and (onward := way_on(self.network, end, lane_kind(entity.spec))):
            return [*path, *onward[1:]]
        further = self._straight_end(end, speed * speed / max(entity.spec.braking_mps2, _GENTLE_MPS2) + 1.0)
        return [*path, (further.x, further.y)]

    def _straight_end(self, start: Pose, length_m: float) -> Pose:
        """Return the end of a straight path that stays as near to the roads as the language requires."""
        ends = (start.ahead(k) for k in range(math.floor(length_m), 1, -1))
        return next((end for end in ends if self._near_roads(end)), start.ahead(1.0))

    def _waypoints(self, routing: Element | None, *, at_start: bool) -> list[Pose]:
        """Return the places of a route or target."""
        if routing is None:
            return []
        route = self.source.referred(routing, "Route")
        positions = route.findall("Waypoint/Position") if route is not None else []
        poses: list[Pose] = []
        for position in (*positions, *routing.iterfind("Position")):
            try:
                poses.append(self.places.pose(position) if at_start else self.places.later(position))
            except NotExpressed as err:
                self.losses.lose(f"waypoints: {err}")
        return poses

    def _goes(self, entity: Entity, front: Pose, edges: tuple[str, ...]) -> None:
        """Record the length of an actor's route from its start."""
        along = tracks.nearest(self.network, front, lane_kind(entity.spec))
        begin = along.pos_m if along is not None and along.lane.edge == edges[0] else 0.0
        length = sum(self.network.edges[e].drivable[0].length_m for e in edges) - begin
        self.ways[entity.name] = RemainingWay(length)

    def _walks(self, entity: Entity, path: list[XY]) -> None:
        length = sum(math.dist(a, b) for a, b in itertools.pairwise(path))
        self.ways[entity.name] = RemainingWay(length, tuple(path))


def trajectory_of(source: Source, routing: Element) -> Element | None:
    """Return the `<Trajectory>` of a `<FollowTrajectoryAction>`, or None."""
    trajectory = source.referred(routing, "Trajectory")
    return source.referred(routing.find("TrajectoryRef"), "Trajectory") if trajectory is None else trajectory


_KEYWORDS: dict[str, Literal["vehicle", "bicycle", "pedestrian", "obstacle"]] = {
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "obstacle": "obstacle",
}


def _actor(entity: Entity, middle: Pose, speed: float, body: tuple[m.ActorItem, ...]) -> m.Actor:
    """Return an actor's statement; `middle` is the centre of its footprint."""
    place = middle.ahead(entity.spec.length_m / 2) if entity.kind in WHEELS else middle
    kind = _KEYWORDS.get(entity.kind, "vehicle")
    return m.Actor(kind=kind, name=entity.name, model=entity.model, state=_state(place, speed, entity), body=body)


def _walk(entity: Entity, points: tuple[m.Point, ...], speed: float) -> tuple[m.ActorItem, ...]:
    """Return the path and speed of an actor; a pedestrian on a path also ignores signals."""
    heedless = (m.IgnoresRule(what="signals"),) if entity.kind == "pedestrian" else ()
    return m.Path(points=points), m.CruiseSpeed(speed=quantity(speed, "speed")), *heedless


def _timed(
    profile: tracks.SpeedProfile | None, routing: Element | None, begins_s: float | None
) -> tracks.SpeedProfile | None:
    """Return a profile whose times are scaled and shifted as the action states, and count from the action's beginning;
    None if the file says that times are ignored.

    Raises:
        NotExpressed: the profile's times count from the run's beginning, but the time at which the action begins is
            unknown; or the trajectory begins before the action.
    """
    if routing is None or routing.find("TimeReference/None") is not None:
        return None
    timing = routing.find("TimeReference/Timing")
    if timing is None:
        return profile
    scale, offset = number(timing, "scale", 1.0), number(timing, "offset", 0.0)
    if timing.get("domainAbsoluteRelative") == "absolute":
        if begins_s is None:
            raise NotExpressed("trajectories with times of the run, whose time of beginning is not known")
        offset -= begins_s
    if scale <= 0 or profile is None:
        return None
    if scale * profile.time_s[0] + offset < -_LATE_S:
        raise NotExpressed("trajectories that begin before their action does")
    return tracks.SpeedProfile(
        tuple(scale * t + offset for t in profile.time_s), tuple(v / scale for v in profile.speed_mps)
    )


def _state(place: Pose, speed: float, entity: Entity) -> m.State:
    return m.State(
        at=point_of(place),
        heading=quantity(math.remainder(place.heading_rad, math.tau), "angle"),
        speed=quantity(min(speed, entity.most_mps * _LIMIT) if entity.kind != "obstacle" else 0.0, "speed"),
    )
