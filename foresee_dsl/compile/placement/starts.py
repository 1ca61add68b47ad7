"""Where each actor stands at the first frame: its route, lane and line, or its path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.lateral_offset import moved_aside
from foresee_dsl.compile.placement.places import Spot, si, spot
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points, distance, distinct, line_of, whole_millimetres, wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import (
    Actor,
    AlongEdge,
    AlongRoute,
    EdgeRoute,
    Ego,
    Item,
    Line,
    PastJunction,
    Path,
    Point,
    Route,
    StartAt,
    State,
    Walked,
)
from foresee_dsl.language.traversal import word_of

EGO_BEHIND_M = 10.0
"""The ego's line begins this much before its first edge: its rear may still be there (ours: a rigid truck's length)."""
EGO_BEYOND_M = 80.0
"""...and goes on this much after its last edge: a driver that plans 4 s ahead at 60 km/h looks 67 m ahead."""
OFF_ROUTE_M = 3.0
"""A start farther from every lane of the route than this is a mistake (asked for)."""

NEARLY_M = 0.2
"""Who is beside a line by a lane's width less this follows another. Ours: who passes something in the next lane stays
that much on its own side (measured: 3.05 m of 3.5 m)."""

OFF_STATE_M = 0.05
"""Who is further than this from where `moving` says has been moved along its path by a mutation, and is there. Ours:
the roundings of a clip's figures come to 1 mm."""

_SAME_WAY_RAD = math.radians(60)
_BEYOND_WEIGHT = 30.0
"""Who is beyond a lane's end is on the next one, though it has not turned with that yet. Ours: lanes inside junctions
begin with a corner of up to 0.3 rad; 1 cm outweighs it."""
_T = TypeVar("_T", bound=Item)
WHEELS = frozenset({"car", "van", "truck", "bus", "motorcycle", "bicycle"})


def lane_kind(spec: ModelSpec) -> LaneKind:
    """Return whose lanes a model uses."""
    if spec.kind == "bicycle":
        return "bicycle"
    return "pedestrian" if spec.kind == "pedestrian" else "car"


def item(actor: Ego | Actor, kind: type[_T]) -> _T | None:
    """Return an actor's (last) statement of a kind; a mutation's comes after the author's."""
    return next((i for i in reversed(actor.body) if isinstance(i, kind)), None)


def items(actor: Ego | Actor, kind: type[_T]) -> tuple[_T, ...]:
    """Return an actor's statements of a kind."""
    return tuple(i for i in actor.body if isinstance(i, kind))


def route_of(actor: Ego | Actor) -> Route | EdgeRoute | None:
    """Return an actor's route statement."""
    return item(actor, Route) or item(actor, EdgeRoute)


@dataclass(frozen=True)
class OnRoute:
    """A vehicle on its route: front bumper, lane, edges from the one it stands on, its line and where it is on it."""

    x: float
    y: float
    heading_rad: float
    lane: str
    edges: tuple[str, ...]
    line: RouteLine
    s: float


@dataclass(frozen=True)
class OnPath:
    """A body on its path: centre of the footprint, its points, how far along."""

    x: float
    y: float
    heading_rad: float
    path: Points
    along_m: float


class Starts:
    """Works out starts, one actor at a time, as places refer to other actors' routes and starts."""

    def __init__(self, network: RoadNetwork, actors: Mapping[str, Ego | Actor], specs: Mapping[str, ModelSpec]) -> None:
        """Take the actors by name, and the spec of each by its name."""
        self._network, self._actors, self._specs = network, actors, specs
        self._found: dict[str, OnRoute] = {}
        self._resolving: list[str] = []

    def line_of(self, actor: str) -> RouteLine:
        """See `places.Lines`."""
        if actor in self._resolving:
            return self._first_line(actor)
        return self.on_route(actor).line

    def start_of(self, actor: str) -> float:
        """See `places.Lines`."""
        if actor in self._resolving:
            if actor != self._resolving[-1]:
                raise RouteError(f"the starts of {' and '.join(self._resolving)} depend on each other")
            return self._first_line(actor).origin_s
        return self.on_route(actor).s

    def on_route(self, name: str) -> OnRoute:
        """Return where a vehicle with a route starts.

        Raises:
            RouteError: no such actor, it has no route, or its route or start is impossible.
        """
        if name not in self._found:
            if name not in self._actors:
                raise RouteError(f"there is no actor called {name}", did_you_mean(name, self._actors))
            self._resolving.append(name)
            try:
                self._found[name] = self._place(name)
            finally:
                self._resolving.pop()
        return self._found[name]

    def spot(self, place: Item) -> Spot:
        """Return where a place is.

        Raises:
            RouteError: see `places.spot`.
        """
        return spot(place, self._network, self)  # type: ignore[arg-type]  # a Place is a union of Items

    def on_path(self, name: str) -> OnPath:
        """Return where an actor with a path starts.

        Raises:
            RouteError: a place of the path is impossible, or the path has no length.
        """
        actor, spec = self._actors[name], self._specs[name]
        statement = item(actor, Path)
        if statement is None:
            raise RouteError(f"{name} has no path")
        spots = [self.spot(place) for place in statement.points]
        path = distinct(whole_millimetres((p.x, p.y) for p in spots))
        if len(path) == 2 and distance(*path) < 0.1:
            raise RouteError(f"the path of {name} has no length")
        line = line_of(path)
        walked, start = item(actor, Walked), item(actor, StartAt)
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
        aside = item(actor, Line)
        path = moved_aside(path, along, si(aside.left)) if aside is not None else path
        return OnPath(x, y, heading, path, along)

    def still(self, name: str) -> tuple[float, float, float]:
        """Return the middle and heading of an actor without route and path.

        Raises:
            RouteError: it is nowhere, or its place is impossible.
        """
        actor, spec = self._actors[name], self._specs[name]
        if actor.state is not None:
            return centre(actor.state, spec)
        start = item(actor, StartAt)
        if start is None:
            raise RouteError(f"{name} is nowhere", "give it a route, a path, or start at a place")
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
        """The line before the start is known: from the route's beginning, on the lanes that need no change."""
        return self._network.line(self._edges(name), kind=lane_kind(self._specs[name]))

    def _place(self, name: str) -> OnRoute:
        actor, spec = self._actors[name], self._specs[name]
        edges, kind = self._edges(name), lane_kind(spec)
        x, y, heading = self._front(name, actor, spec)
        # a clip's route begins where the actor is; an author's start may be on a later edge
        ego = isinstance(actor, Ego)
        near = edges[:2] if actor.state is not None and not ego else edges
        start = item(actor, StartAt)
        if actor.state is None and start is not None and isinstance(start.place, AlongEdge):
            edge = word_of(start.place.edge)
            if edge not in edges:
                raise RouteError(f"{name} starts on {edge}, off its route", f"its route is {', '.join(edges)}")
        match = self._match(near, kind, x, y, heading)
        if isinstance(match, float):
            raise RouteError(f"{name} starts {match:.1f} m off its route", f"its route is {', '.join(edges)}")
        k, lane, pos = match
        came = self._line_of_clip(edges, lane, kind, (x, y)) if ego and k and actor.state is not None else None
        if came is not None:
            return OnRoute(x, y, heading, lane.id, edges[k:], *came)
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

    def _line_of_clip(
        self, edges: tuple[str, ...], lane: Lane, kind: LaneKind, front: tuple[float, float]
    ) -> tuple[RouteLine, float] | None:
        """Return the line that a clip's ego has followed since before its window, and where it is on it.

        That is its parent's, whatever it is passing in another lane. None where it is a lane off: the parent began on
        another lane than it would have by itself.
        """
        line = self._network.line(edges, behind_m=EGO_BEHIND_M, beyond_m=EGO_BEYOND_M, kind=kind)
        s, lateral = line.project(*front)
        return (line, s) if abs(lateral) < lane.width_m - NEARLY_M else None

    def _before(self, edge: str, lane: Lane, kind: LaneKind) -> float:
        """Length from an edge's beginning to that of a lane inside the junction after it."""
        for movement in self._network.movements_from(edge, kind):
            if lane.id in movement.via:
                via = movement.via[: movement.via.index(lane.id)]
                chain = (movement.from_lane, *via)
                return sum(self._network.lanes[one].line.length_m for one in chain)
        return 0.0

    def _front(self, name: str, actor: Ego | Actor, spec: ModelSpec) -> tuple[float, float, float]:
        if actor.state is not None:
            return si(actor.state.at.x), si(actor.state.at.y), wrap(si(actor.state.heading))
        start = item(actor, StartAt)
        line = self._first_line(name)
        if start is None:
            # the whole vehicle on its first edge, where that is long enough
            return line.at(min(line.origin_s + spec.length_m, (line.origin_s + line.end_s) / 2))
        place = self.spot(start.place)
        elsewhere = isinstance(start.place, AlongRoute | PastJunction) and start.place.actor != name
        if place.heading_rad is not None and not elsewhere:
            return place.x, place.y, place.heading_rad
        s, lateral = line.project(place.x, place.y)  # coordinates, or a place on somebody else's route
        if isinstance(start.place, Point) and abs(lateral) < 1e-6:
            return line.at(s)
        return place.x, place.y, line.at(s)[2]

    def _match(
        self, edges: tuple[str, ...], kind: LaneKind, x: float, y: float, heading: float
    ) -> tuple[int, Lane, float] | float:
        """Find the lane of a route (inside junctions too) that a point is on: the edge's place, the lane, m along it.

        Where there is none within 3 m of its edge, the distance to the nearest is all that comes back.
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
            # of lanes that overlap, the one that points the same way; a skidding actor may stand across
            cost = off + turned + _BEYOND_WEIGHT * abs(s - inside) + (OFF_ROUTE_M if turned > _SAME_WAY_RAD else 0.0)
            if best is None or cost < best[0] - 1e-9:
                best = cost, k, lane, inside
        return best[1:] if best is not None else nearest

    def _lanes_of(self, edges: tuple[str, ...], kind: LaneKind) -> list[tuple[int, Lane]]:
        found: list[tuple[int, Lane]] = []
        for k, edge in enumerate(edges):
            found += [(k, lane) for lane in self._network.edges[edge].for_kind(kind)]
            if k + 1 < len(edges):
                inside = {
                    via: None
                    for m in self._network.movements_from(edge, kind)
                    if m.to_edge == edges[k + 1]
                    for via in m.via
                }
                found += [(k, self._network.lanes[via]) for via in inside]
        return found


def centre(state: State, spec: ModelSpec) -> tuple[float, float, float]:
    """Return the middle of the footprint and the heading of an exact state (which has the front for wheels)."""
    heading = wrap(si(state.heading))
    back = spec.length_m / 2 if spec.kind in WHEELS else 0.0
    return si(state.at.x) - back * math.cos(heading), si(state.at.y) - back * math.sin(heading), heading
