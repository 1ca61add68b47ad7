"""Entities with their places, speeds and ways as actors of the language."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.actor_checks import NEAR_ROAD_M
from foresee_dsl.compile.placement.starts import WHEELS, lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.exchange.foreign_xml import number
from foresee_dsl.exchange.openscenario.reading.actions import Player, paced
from foresee_dsl.exchange.openscenario.reading.entities import Entity
from foresee_dsl.exchange.openscenario.reading.motion import (
    Pace,
    Track,
    nearest,
    pace_of,
    path_of,
    read_track,
    route_through,
    straight_on,
    thinned,
)
from foresee_dsl.exchange.openscenario.reading.places import NotExpressed, Places
from foresee_dsl.exchange.openscenario.reading.source import Source
from foresee_dsl.exchange.values import quantity as _quantity
from foresee_dsl.language.model import (
    Action,
    Actor,
    ActorItem,
    Comparison,
    CruiseSpeed,
    EdgeRoute,
    Ego,
    GoalAt,
    IgnoresRule,
    Measure,
    Path,
    Point,
    State,
    Stops,
    When,
)

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by foreign_xml

_WALK_M = 60.0
"""Who walks without a given way goes straight on for so long (ours: the run's usual minute at 1 m/s)."""
_OFF_ROAD_M = 200.0
"""The same for a vehicle off the lanes."""
_NEAR_M = NEAR_ROAD_M - 1.0
_LIMIT = 1.01
_CRAWLS_MPS = 0.05
"""Who is slower at the end of a trajectory stops there (ours)."""


@dataclass(frozen=True)
class Made:
    """An actor, and triggers that belong to it."""

    statement: Ego | Actor
    whens: tuple[When, ...] = ()


@dataclass
class Actors:
    """Makes actors of entities on a network; what cannot be said is counted in `left_out`, and told in `notes`."""

    source: Source
    network: RoadNetwork
    places: Places
    left_out: Counter[str]
    notes: dict[str, None] = field(default_factory=dict)

    def actor(
        self, entity: Entity, player: Player, routing: Element | None, *, at_start: bool, acts: bool
    ) -> Made | None:
        """Return an entity as an actor, or None where it is nowhere.

        Args:
            entity: who. player: gets the speeds of its trajectory, if an event is to start that.
            routing: its route, target or trajectory. at_start: that is its way from the beginning.
            acts: an event is about it; who does not act and does not move only stands there.
        """
        try:
            middle = self._middle(entity)
            track = self._track(entity, routing)
            path = path_of(track) if track is not None else []
            if self.network.far_from_lanes(path, _NEAR_M) is not None:
                raise NotExpressed("entities whose trajectories leave the road network")
        except NotExpressed as err:
            self.left_out[str(err)] += 1
            return None
        if entity.name == "ego":
            return self._ego(entity, player, middle, routing, track)
        if track is not None and path:
            return self._on_track(entity, player, middle, track, path, at_start=at_start, routing=routing)
        return self._without_track(entity, player, middle, routing, acts=acts)

    def _without_track(
        self, entity: Entity, player: Player, middle: Pose, routing: Element | None, *, acts: bool
    ) -> Made:
        if entity.kind == "obstacle" or not (acts or routing is not None or player.speed_mps):
            return Made(self._actor(entity, middle, 0.0, ()))
        if entity.kind not in WHEELS:
            return self._straight(entity, player, middle, _WALK_M)
        return self._on_lanes(entity, player, middle, routing)

    def _track(self, entity: Entity, routing: Element | None) -> Track | None:
        if routing is None or routing.tag != "FollowTrajectoryAction":
            return None
        found = self._meant(routing, "Trajectory") or self._meant(routing.find("TrajectoryRef"), "Trajectory")
        try:
            if not found:
                raise NotExpressed("trajectories: nothing")
            return read_track(found[0], self.places, entity.centre_m)
        except NotExpressed as err:
            self.left_out[str(err)] += 1
            return None

    def _meant(self, holder: Element | None, tag: str) -> list[Element]:
        """Return the element of a kind that stands in another, or in a catalogue that it refers to; none, or one."""
        if holder is None:
            return []
        reference = holder.find("CatalogReference")
        found = self.source.entry(reference) if reference is not None else holder.find(tag)
        return [found] if found is not None and found.tag == tag else []

    def _middle(self, entity: Entity) -> Pose:
        """Return the pose of the middle of the footprint at the beginning."""
        middle = _ahead(self.places.initial(entity.ref), entity.centre_m)
        if self.network.far_from_lanes([(middle.x, middle.y)], _NEAR_M) is not None:
            raise NotExpressed("entities off the road network")
        return middle

    def _ego(
        self, entity: Entity, player: Player, middle: Pose, routing: Element | None, track: Track | None
    ) -> Made | None:
        """Return the ego: a route and a goal, and no orders, which are its driver's to decide."""
        front = _ahead(middle, entity.spec.length_m / 2)
        goal: Pose | None = None
        if track is not None:
            # Its way goes on: who ends his run where the recorded one crashed cannot crash there.
            through = [front, *thinned(track.poses())[1:]]
        else:
            through = [front, *self._waypoints(routing)]
            goal = through[-1] if len(through) > 1 else None
        try:
            route = route_through(self.network, through, lane_kind(entity.spec))
        except NotExpressed:
            try:
                route = route_through(self.network, [front], lane_kind(entity.spec))
                self.left_out["ways of the ego that the network does not have"] += 1
                goal = None
            except NotExpressed:
                return None
        body: list[ActorItem] = [EdgeRoute(edges=self._whole(route, lane_kind(entity.spec), go_on=goal is None))]
        if goal is not None and nearest(self.network, goal, "car") is not None:
            body.append(GoalAt(place=_point(goal)))
        state = _state(front, player.speed_mps or 0.0, entity)
        return Made(Ego(model=entity.model, state=state, body=tuple(body)))

    def _on_track(
        self,
        entity: Entity,
        player: Player,
        middle: Pose,
        track: Track,
        path: list[tuple[float, float]],
        *,
        at_start: bool,
        routing: Element | None,
    ) -> Made:
        """Return an actor that follows a trajectory."""
        self.notes["who follows a trajectory looks out for nobody"] = None
        pace = _timed(pace_of(track), routing)
        speed = player.speed_mps or 0.0
        if pace is not None:
            speed = pace.speed_mps[0]
            if not at_start:
                player.pace = pace
        body = (
            Path(points=tuple(_point(Pose(x, y, 0.0)) for x, y in self._beyond(path, pace, entity))),
            CruiseSpeed(speed=_quantity(speed, "speed")),
            *((IgnoresRule(what="signals"),) if entity.kind == "pedestrian" else ()),
        )
        whens: tuple[When, ...] = ()
        if pace is not None and at_start:
            whens = (_when_begins(paced(entity.name, pace)),)
        return Made(self._actor(entity, middle, speed, body), whens)

    def _on_lanes(self, entity: Entity, player: Player, middle: Pose, routing: Element | None) -> Made:
        """Return a vehicle that follows the lanes, as a default controller does: by no rules."""
        kind, front = lane_kind(entity.spec), _ahead(middle, entity.spec.length_m / 2)
        try:
            route = route_through(self.network, [front, *self._waypoints(routing)], kind)
        except NotExpressed as err:
            if str(err) != "starts off the lanes":
                self.left_out[str(err)] += 1
                route = route_through(self.network, [front], kind)
            else:
                return self._straight(entity, player, middle, _OFF_ROAD_M)
        self.notes[
            "vehicles on lanes ignore signals and priority, as a default controller does; they follow others"
        ] = None
        speed = player.speed_mps or 0.0
        body: list[ActorItem] = [EdgeRoute(edges=self._whole(route, kind, go_on=True))]
        if speed > 0:
            body.append(CruiseSpeed(speed=_quantity(min(speed, entity.spec.max_speed_mps), "speed")))
        body += [IgnoresRule(what="signals"), IgnoresRule(what="priority")]
        whens = () if speed > 0 else (_when_begins([Stops(actor=entity.name)]),)
        return Made(self._actor(entity, middle, speed, tuple(body)), whens)

    def _straight(self, entity: Entity, player: Player, middle: Pose, length_m: float) -> Made:
        """Return an actor that goes straight on off the lanes, or stands."""
        speed = player.speed_mps or 0.0
        end = self._before_the_wild(middle, length_m)
        body = (
            Path(points=(_point(middle), _point(end))),
            CruiseSpeed(speed=_quantity(min(speed, entity.spec.max_speed_mps), "speed")),
            *((IgnoresRule(what="signals"),) if entity.kind == "pedestrian" else ()),
        )
        return Made(self._actor(entity, middle, speed, body))

    def _beyond(
        self, path: Sequence[tuple[float, float]], pace: Pace | None, entity: Entity
    ) -> Sequence[tuple[float, float]]:
        """Return a path that goes on straight for as long as stopping takes: nobody brakes for the end."""
        speed = pace.speed_mps[-1] if pace is not None else 0.0
        if speed < _CRAWLS_MPS:
            return path
        end = Pose(*path[-1], math.atan2(path[-1][1] - path[-2][1], path[-1][0] - path[-2][0]))
        further = self._before_the_wild(end, speed * speed / entity.spec.braking_mps2 + 1.0)
        return [*path, (further.x, further.y)]

    def _before_the_wild(self, start: Pose, length_m: float) -> Pose:
        """Return the end of a straight way that stays as near to the roads as the language asks."""
        steps = math.floor(length_m)
        near = (_ahead(start, k) for k in range(steps, 1, -1))
        return next(
            (end for end in near if self.network.far_from_lanes([(end.x, end.y)], _NEAR_M) is None), _ahead(start, 1.0)
        )

    def _whole(self, route: tuple[str, ...], kind: LaneKind, *, go_on: bool) -> tuple[str, ...]:
        return straight_on(self.network, route, kind) if go_on else route

    def _waypoints(self, routing: Element | None) -> list[Pose]:
        """Return the places of a route or target."""
        if routing is None:
            return []
        found: list[Pose] = []
        routes = self._meant(routing, "Route")
        positions = [p for route in routes for p in route.iterfind("Waypoint/Position")]
        for position in (*positions, *routing.iterfind("Position")):
            try:
                found.append(self.places.pose(position))
            except NotExpressed as err:
                self.left_out[str(err)] += 1
        return found

    def _actor(self, entity: Entity, middle: Pose, speed: float, body: tuple[ActorItem, ...]) -> Actor:
        """Return the actor's statement; `middle` is that of its footprint."""
        wheels = entity.kind in WHEELS
        place = _ahead(middle, entity.spec.length_m / 2) if wheels else middle
        return Actor(
            kind=_KEYWORDS.get(entity.kind, "vehicle"),
            name=entity.name,
            model=entity.model,
            state=_state(place, speed, entity),
            body=body,
        )


_KEYWORDS: dict[str, Literal["vehicle", "bicycle", "pedestrian", "obstacle"]] = {
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "obstacle": "obstacle",
}


def _timed(pace: Pace | None, routing: Element | None) -> Pace | None:
    """Return a pace with the offset and scale that the action gives its times; None where they do not count."""
    if pace is None or routing is None or routing.find("TimeReference/None") is not None:
        return None
    timing = routing.find("TimeReference/Timing")
    if timing is None:
        return pace
    scale, offset = number(timing, "scale", 1.0), number(timing, "offset", 0.0)
    if scale <= 0:
        return None
    return Pace(tuple(scale * t + offset for t in pace.time_s), tuple(v / scale for v in pace.speed_mps))


def _when_begins(actions: Sequence[Action]) -> When:
    begin = Comparison(left=Measure(what="time"), op=">=", right=_quantity(0.0, "time"))
    return When(condition=begin, actions=tuple(actions))


def _state(place: Pose, speed: float, entity: Entity) -> State:
    return State(
        at=_point(place),
        heading=_quantity(math.remainder(place.heading_rad, math.tau), "angle"),
        speed=_quantity(min(speed, entity.spec.max_speed_mps * _LIMIT) if entity.kind != "obstacle" else 0.0, "speed"),
    )


def _ahead(pose: Pose, by_m: float) -> Pose:
    return Pose(
        pose.x + by_m * math.cos(pose.heading_rad), pose.y + by_m * math.sin(pose.heading_rad), pose.heading_rad
    )


def _point(pose: Pose) -> Point:
    return Point(x=_quantity(pose.x, "length"), y=_quantity(pose.y, "length"))
