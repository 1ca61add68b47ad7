"""Computes the start of each actor (its route, lane and line, or its path) and the positions of places."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from types import MappingProxyType
from typing import TypeVar, assert_never

from foresee_dsl.compile.bundle import ModelSpec, TrackPlayback
from foresee_dsl.compile.placement.paths import shifted, smooth_beside
from foresee_dsl.compile.placement.spots import CircleError, OnPath, OnRoute, PlacedFootprint, Spot, UnsettledError
from foresee_dsl.compile.placement.statements import WHEELS, centre, item, lane_kind, path_of, route_of, si
from foresee_dsl.compile.roads import polyline as lines
from foresee_dsl.compile.roads.network import SAME_DIRECTION_RAD, RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, distance, wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError, check_junction, metres
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.helps import one_of, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.traversal import word_of

EGO_BEHIND_M = 10.0
"""Length by which the ego's line begins before its first edge, m, because the ego's rear may still be there (ours: a
rigid truck's length)."""
EGO_BEYOND_M = 80.0
"""Length by which the ego's line continues after its last edge, m (ours: a driver that plans 4 s ahead at 60 km/h needs
67 m)."""
OFF_ROUTE_M = 3.0
"""A start that is farther than this from every lane of the actor's route is reported, m (ours: about a lane's width).
"""
OTHER_LANE_MARGIN_M = 0.2
"""Margin, m: a clip's ego follows its route's line if its distance from the line is less than a lane's width minus
this. Ours: an ego that passes an obstacle in the next lane was measured up to 3.05 m from its line, where lanes are 3.5
m wide."""
OFF_STATE_M = 0.05
"""If an actor's state is farther than this from the position that `moving` states, a mutation has moved the actor along
its path, and it starts at that position, m. Ours: a clip rounds to 1 mm.
"""
_BEYOND_WEIGHT = 30.0
"""Cost per metre beyond a lane's end, where 1 rad of heading costs 1: a vehicle beyond the end is on the next lane,
even if it has not turned yet. Ours: internal lanes begin with a corner of up to 0.3 rad, and 1 cm beyond the end costs
as much.
"""
_SHORTEST_M = 0.1
"""Length below which a path has no direction, m (ours)."""
_SLACK_M = 1e-3
"""Distance by which a place may be beyond an end, m (ours: rounding errors in files)."""
_R = TypeVar("_R")


class StartSearch:
    """Computes the starts of actors, one at a time, because a place may refer to the route and start of another actor.

    `actors` holds the actors, `specs` their models and `playbacks` their recorded tracks, all by the actor's name.
    """

    def __init__(
        self,
        network: RoadNetwork,
        actors: Mapping[str, m.Ego | m.Actor],
        specs: Mapping[str, ModelSpec],
        playbacks: Mapping[str, TrackPlayback] = MappingProxyType({}),
    ) -> None:
        self._network, self._actors, self._specs, self._playbacks = network, actors, specs, playbacks
        self._on_routes: dict[str, OnRoute] = {}
        self._paths: dict[str, OnPath] = {}
        self._resolving: list[str] = []

    def _line_of(self, actor: str) -> tuple[RouteLine, float]:
        """Return an actor's route line and its start along it, m; while the start is being computed, the beginning of
        the route instead."""
        if actor not in self._resolving:
            if actor not in self._actors or route_of(self._actors[actor]) is None:
                self.on_route(actor)  # raises the error here, not at the other actor
            with self._counted_from_here():
                on_route = self.on_route(actor)
            return on_route.line, on_route.s
        line = self._first_line(actor)
        return line, line.origin_s

    def on_route(self, name: str) -> OnRoute:
        """Return the start of a vehicle with a route.

        Raises:
            RouteError: its route or start is impossible.
        """
        if name not in self._on_routes:
            if name not in self._actors:
                raise RouteError(f"there is no actor called {name}", did_you_mean(name, self._actors))
            self._on_routes[name] = self._resolved(name, self._place)
        return self._on_routes[name]

    def settled(self, name: str) -> OnRoute | None:
        """Return the start of a vehicle with a route, if it was computed."""
        return self._on_routes.get(name)

    def settle(self, name: str, start: OnRoute | None) -> None:
        """Store the start of a vehicle with a route; None for an actor without a route."""
        if start is not None:
            self._on_routes[name] = start

    def _resolved(self, name: str, find: Callable[[str], _R]) -> _R:
        self._resolving.append(name)
        try:
            return find(name)
        finally:
            self._resolving.pop()

    def _footprint(self, name: str) -> PlacedFootprint:
        """Return the start of an actor of any kind, with its way."""
        if name not in self._actors:
            if re.fullmatch(r".+_[0-9]+", name):  # unknown names are reported elsewhere
                message = f"{name} belongs to the background traffic, which is placed after all other actors"
                raise RouteError(message, "name an actor that has its own statement")
            raise RouteError(f"there is no actor called {name}", did_you_mean(name, self._actors))
        if name in self._resolving:
            raise CircleError(tuple(self._resolving[self._resolving.index(name) :]))
        actor, spec = self._actors[name], self._specs[name]
        with self._counted_from_here():
            if route_of(actor) is not None:
                at = self.on_route(name)
                back = spec.length_m / 2
                x, y = at.x - back * math.cos(at.heading_rad), at.y - back * math.sin(at.heading_rad)
                _, left = at.line.project(at.x, at.y, at.s)
                return PlacedFootprint(x, y, at.heading_rad, spec.length_m, spec.width_m, at.line, at.s - back, left)
            if path_of(actor) is not None or name in self._playbacks:
                on = self.on_path(name) if path_of(actor) is not None else self.on_track(name)
                body = on.x, on.y, on.heading_rad, spec.length_m, spec.width_m
                return PlacedFootprint(*body, lines.line_of(on.path), on.along_m)
            return PlacedFootprint(*self.still(name), spec.length_m, spec.width_m)

    @contextmanager
    def _counted_from_here(self) -> Iterator[None]:
        """Convert errors in the start of another actor, to which a place refers, so that they are reported at that
        actor."""
        try:
            yield
        except CircleError as err:
            if self._resolving and self._resolving[-1] not in err.members:
                raise UnsettledError(str(err)) from err
            raise
        except RouteError as err:
            raise UnsettledError(str(err)) from err

    def spot(self, place: m.Place | m.AtStop) -> Spot:
        """Return the position of a place.

        Raises:
            RouteError: a name is unknown, or a position is beyond the end of an edge or route.
            CircleError: starts depend on each other.
            UnsettledError: the start of the actor to which the place refers is impossible.
        """
        match place:
            case m.Point():
                return Spot(si(place.x), si(place.y))
            case m.AlongEdge():
                return Spot(*self._network.locate(word_of(place.edge), si(place.at), si(place.offset)))
            case m.AtStop():
                stop = self._network.stop(place.stop)
                return Spot(*stop.lane.line.at(stop.pos_m))
            case m.AlongRoute():
                line, start = self._route_from(place.actor)
                return _on(line, start + si(place.at), place)
            case m.PastJunction():
                return self._past(place)
            case m.AheadOf() | m.BehindOf() | m.Beside() | m.PlaceOf():
                return self._of_actor(place)
            case _:
                assert_never(place)

    def _route_from(self, actor: str) -> tuple[RouteLine, float]:
        """Return the line of an actor's route, and the position along it from which places are measured, m."""
        line, start = self._line_of(actor)
        if actor in self._resolving[:-1]:
            raise CircleError(tuple(self._resolving[self._resolving.index(actor) :]))
        return line, start

    def _of_actor(self, place: m.OfActor) -> Spot:
        footprint = self._footprint(place.actor)
        pose = footprint.place(place, wheels=self._specs[place.actor].kind in WHEELS)
        if not isinstance(footprint.line, RouteLine):
            return Spot(*pose, actor=place.actor)
        s = footprint.s + footprint.onwards_m(place)
        _check_on(footprint.line, s, place.actor)
        return Spot(*pose, actor=place.actor, s=s)

    def _past(self, place: m.PastJunction) -> Spot:
        junction = word_of(place.junction)
        check_junction(self._network, junction)
        line, _ = self._line_of(place.actor)
        passage = line.passage(junction)
        if passage is None or passage.entry_s >= line.end_s - _SLACK_M:
            passed = (p.junction for p in line.passages if p.entry_s < line.end_s - _SLACK_M)
            over = one_of(passed, wrong=junction)
            raise RouteError(
                f"the route of {place.actor} does not go over {junction}",
                "it goes over " + over if over else "it goes over no junction",
            )
        s = passage.exit_s + si(place.at) if place.side == "past" else passage.entry_s - si(place.at)
        return _on(line, s, place)

    def on_path(self, name: str) -> OnPath:
        """Return the start of an actor with a path."""
        if name not in self._paths:
            self._paths[name] = self._resolved(name, self._find_on_path)
        return self._paths[name]

    def _find_on_path(self, name: str) -> OnPath:
        actor, spec = self._actors[name], self._specs[name]
        statement = path_of(actor)
        if statement is None:
            raise RouteError(f"{name} has no path")
        path = lines.distinct(lines.whole_millimetres(self._points_of(statement)))
        if len(path) == 2 and distance(*path) < 0.1:
            raise RouteError(f"the path of {name} has no length")
        line = lines.line_of(path)
        walked, start = item(actor, m.Walked), item(actor, m.StartAt)
        along = si(walked.along) if walked is not None else 0.0
        if actor.state is not None:
            x, y, heading = centre(actor.state, spec)
            if walked is None:
                along = line.project(x, y)[0]
        elif start is not None and walked is None:
            place = self.spot(start.place)
            along = line.project(place.x, place.y)[0]
        along = min(max(along, 0.0), line.length_m)
        if actor.state is None or (walked is not None and distance(line.at(along)[:2], (x, y)) > OFF_STATE_M):
            x, y, heading = line.at(along)
        line_statement = item(actor, m.Line)
        path = shifted(path, along, si(line_statement.left)) if line_statement is not None else path
        return OnPath(x, y, heading, path, along)

    def on_track(self, name: str) -> OnPath:
        """Return the start of an actor with a recorded track."""
        playback = self._playbacks[name]
        state = playback.track.at(playback.start_s)
        return OnPath(state.x, state.y, state.heading_rad, playback.track.way, state.along_m)

    def _points_of(self, path: m.AnyPath) -> Iterable[XY]:
        """Return the corners of a path, m."""
        if isinstance(path, m.Path):
            return [(spot.x, spot.y) for spot in map(self.spot, path.points)]
        line, start = self._route_from(path.actor)
        ends = start + si(path.begin), start + si(path.end)
        for s in ends:
            _check_on(line, s, path.actor)
        if abs(ends[1] - ends[0]) < _SHORTEST_M:
            raise RouteError("the path has no length", "let it end farther along the route than it begins")
        return smooth_beside(line, *ends, left_m=si(path.offset))

    def still(self, name: str) -> tuple[float, float, float]:
        """Return the middle of the footprint and the heading of an actor without route and path."""
        return self._resolved(name, self._find_still)

    def _find_still(self, name: str) -> tuple[float, float, float]:
        actor, spec = self._actors[name], self._specs[name]
        if actor.state is not None:
            return centre(actor.state, spec)
        start = item(actor, m.StartAt)
        if start is None:
            raise RouteError(f"{name} has no position", "give it a route, a path, or start at a place")
        place = self.spot(start.place)
        heading = place.heading_rad
        if heading is None:
            near = self._network.nearest_lane(place.x, place.y, within_m=30.0)
            heading = near.lane.line.at(near.pos_m)[2] if near is not None else 0.0
        back = spec.length_m / 2 if spec.kind in WHEELS else 0.0
        return place.x - back * math.cos(heading), place.y - back * math.sin(heading), heading

    def _edges(self, name: str) -> tuple[str, ...]:
        actor, spec = self._actors[name], self._specs[name]
        route = route_of(actor)
        if route is None:
            raise RouteError(f"{name} has no route")
        return self._network.route_edges(route, lane_kind(spec))

    def _first_line(self, name: str) -> RouteLine:
        """Return the line to use before the start is known: from the route's beginning, with the fewest lane
        changes."""
        return self._network.line(self._edges(name), kind=lane_kind(self._specs[name]))

    def _place(self, name: str) -> OnRoute:
        actor, spec = self._actors[name], self._specs[name]
        edges, kind = self._edges(name), lane_kind(spec)
        x, y, heading = self._front(name, actor, spec)
        # a clip's route begins at the actor; an author's start may be on a later edge
        ego = isinstance(actor, m.Ego)
        near = edges[:2] if actor.state is not None and not ego else edges
        start = item(actor, m.StartAt)
        if actor.state is None and start is not None:
            self._check_on_route(name, start.place, edges, kind)
        match = self._match(near, kind, x, y, heading)
        if isinstance(match, float):
            start_there = write(f"start at 10 m along {edges[0]}")
            help = "its route is " + one_of(edges) + "; write " + start_there + ", for example"
            raise RouteError(f"{name} starts " + metres(match) + " off its route", help)
        k, lane, pos = match
        if ego and k and actor.state is not None:
            # A clip's ego follows the line of its parent's ego. If the parent began on another lane than the one that
            # its route alone gives, the clip's ego would be a whole lane off that line.
            line = self._network.line(edges, behind_m=EGO_BEHIND_M, beyond_m=EGO_BEYOND_M, kind=kind)
            s, lateral = line.project(x, y)
            if abs(lateral) < lane.width_m - OTHER_LANE_MARGIN_M:
                return OnRoute(x, y, heading, lane.id, edges[k:], line, s)
        line = self._network.line(
            edges[k:],
            start_lane=lane.id,
            after_m=0.0 if lane.internal else round(pos, 3),
            behind_m=EGO_BEHIND_M if ego else 0.0,
            beyond_m=EGO_BEYOND_M if ego else 0.0,
            kind=kind,
        )
        hint = line.origin_s + pos + (self._before(edges[k], lane, kind) if lane.internal else 0.0)
        s, _ = line.project(x, y, hint)
        return OnRoute(x, y, heading, lane.id, edges[k:], line, s)

    def _check_on_route(self, name: str, place: m.Place | m.AtStop, edges: tuple[str, ...], kind: LaneKind) -> None:
        """Check a start on an edge.

        Raises:
            RouteError: the edge is not on the route, or the start is in a bay, which only buses may use.
        """
        if isinstance(place, m.AtStop):
            stop = self._network.stop(place.stop)
            edge = self._network.bus_stops[place.stop].road
            pieces: tuple[str, ...] = (stop.lane.edge,)
            if stop.bay and kind != "bus":
                parked = f"obstacle NAME: obstacle.parked_car {{ start at {place.stop} }}"
                help = "for a parked one write " + write(parked)
                raise RouteError(f"{name} cannot start in the bay of {place.stop}: only buses may use it", help)
        elif isinstance(place, m.AlongEdge):
            edge = word_of(place.edge)
            pieces = self._network.pieces(edge)
        else:
            return
        if not set(pieces) & set(edges):
            raise RouteError(f"{name} starts on {edge}, off its route", "its route is " + one_of(edges, wrong=edge))

    def _before(self, edge: str, lane: Lane, kind: LaneKind) -> float:
        """Return the distance from an edge's beginning to that of an internal lane of the junction after it, m."""
        for movement in self._network.movements_from(edge, kind):
            if lane.id in movement.via:
                before = (movement.from_lane, *movement.via[: movement.via.index(lane.id)])
                return sum(self._network.lanes[name].line.length_m for name in before)
        return 0.0

    def _front(self, name: str, actor: m.Ego | m.Actor, spec: ModelSpec) -> tuple[float, float, float]:
        if actor.state is not None:
            return si(actor.state.at.x), si(actor.state.at.y), wrap(si(actor.state.heading))
        start = item(actor, m.StartAt)
        if start is None and name in self._playbacks:
            recorded, half = self.on_track(name), spec.length_m / 2
            heading = recorded.heading_rad
            return recorded.x + half * math.cos(heading), recorded.y + half * math.sin(heading), heading
        line = self._first_line(name)
        if start is None:
            # places the whole vehicle on its first edge, if that is long enough
            return line.at(min(line.origin_s + spec.length_m, (line.origin_s + line.end_s) / 2))
        place = self.spot(start.place)
        elsewhere = isinstance(start.place, m.AlongRoute | m.PastJunction | m.OfActor) and start.place.actor != name
        if place.heading_rad is not None and not elsewhere:
            return place.x, place.y, place.heading_rad
        s, lateral = line.project(place.x, place.y)  # the place is given by coordinates or on another actor's route
        if isinstance(start.place, m.Point) and abs(lateral) < 1e-6:
            return line.at(s)
        return place.x, place.y, line.at(s)[2]

    def _match(
        self, edges: tuple[str, ...], kind: LaneKind, x: float, y: float, heading: float
    ) -> tuple[int, Lane, float] | float:
        """Return the lane of a route (also an internal one) at a point: index of the edge, lane, position along it, m.

        If no lane's border is within `OFF_ROUTE_M`, return only the distance to the nearest centreline, m.
        """
        best: tuple[float, int, Lane, float] | None = None
        nearest = math.inf
        for k, lane in self._lanes_of(edges, kind):
            s, lateral = lane.line.project(x, y)
            inside = min(max(s, 0.0), lane.line.length_m)
            off = math.hypot(s - inside, lateral)
            nearest = min(nearest, off)
            turned = abs(wrap(lane.line.at(inside)[2] - heading))
            if off > OFF_ROUTE_M + lane.width_m / 2:
                continue
            # lanes overlap in junctions: prefer the lane in the same direction, but allow any for a skidding actor
            cost = off + turned + _BEYOND_WEIGHT * abs(s - inside)
            cost += OFF_ROUTE_M if turned > SAME_DIRECTION_RAD else 0.0
            if best is None or cost < best[0] - 1e-9:
                best = cost, k, lane, inside
        return best[1:] if best is not None else nearest

    def _lanes_of(self, edges: tuple[str, ...], kind: LaneKind) -> list[tuple[int, Lane]]:
        lanes: list[tuple[int, Lane]] = []
        for k, edge in enumerate(edges):
            lanes += [(k, lane) for lane in self._network.edges[edge].for_kind(kind)]
            if k + 1 < len(edges):
                ways = [way.via for way in self._network.movements_from(edge, kind) if way.to_edge == edges[k + 1]]
                lanes += [(k, self._network.lanes[via]) for via in dict.fromkeys(chain.from_iterable(ways))]
        return lanes


def _check_on(line: RouteLine, s: float, actor: str) -> None:
    """Check a position along an actor's route.

    Raises:
        RouteError: the position is not on the route.
    """
    if not line.origin_s - _SLACK_M <= s <= line.end_s + _SLACK_M:
        beyond = s - line.end_s if s > line.end_s else line.origin_s - s
        side = "after the end" if s > line.end_s else "before the beginning"
        raise RouteError(
            "the place is " + metres(beyond) + f" {side} of the route of {actor}",
            f"the route is {line.end_s - line.origin_s:.1f} m long",
        )


def _on(line: RouteLine, s: float, place: m.AlongRoute | m.PastJunction) -> Spot:
    _check_on(line, s, place.actor)
    return Spot(*line.at(s, si(place.offset)), actor=place.actor, s=s)
