"""Where actors are relative to each other along the way of one of them, which lanes they are in, and places near them.

An actor's way is its path, or the line of its route from the edge that it is on; that of an actor with neither is
straight on. It depends on where actors are and on what is left of their routes, and on nothing else of the past, so
that a clip, whose routes begin elsewhere, has the same ways.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

from foresee_dsl.compile.placement.standing import Pose, Standing
from foresee_dsl.compile.placement.statements import WHEELS, lane_kind
from foresee_dsl.compile.roads.polyline import Points, Polyline, distance_to
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.kernels.conditions import STILL_MPS
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor

BEHIND_M, BEYOND_M = 100.0, 200.0
"""How far a way goes on behind the edge that its actor is on, and beyond its route. Ours: a place or an actor farther
away is told from the straight line there."""
IN_LANE_OF_M = 300.0
"""How far a lane leads on for `a in lane of b`. Ours: farther than any sensor of a driver reaches."""


class Ways:
    """The ways of a simulation's actors at the frame that it is at."""

    def __init__(self, simulation: Simulation) -> None:
        """Compute nothing yet: only conditions and actions that ask for a way pay for it."""
        self._simulation, self._network = simulation, simulation.network
        self._line = lru_cache(maxsize=64)(self._make_line)
        self._strip = lru_cache(maxsize=256)(self._make_strip)
        self._edges: dict[str, tuple[tuple[float, int], ...]] = {}
        self._frame = -1
        self._standing: dict[str, Standing] = {}

    def of(self, actor: Actor) -> Standing:
        """Return where an actor stands on its way now."""
        if self._frame != self._simulation.frame:
            self._frame = self._simulation.frame
            self._standing.clear()
        known = self._standing.get(actor.id)
        if known is None:
            known = self._standing[actor.id] = self._find(actor)
        return known

    def place(self, place: m.OfActor) -> Pose | None:
        """Return where a place relative to an actor is now; None where the actor is not there."""
        actor = self._simulation.by_id.get(place.actor)
        if actor is None or not actor.present:
            return None
        return self.of(actor).place(place, wheels=actor.placed.model.kind in WHEELS)

    def overlap_m(self, one: Actor, other: Actor) -> float:
        """Return over how many metres of the first one's way both footprints are side by side; negative: the gap."""
        (rear, front), (other_rear, other_front) = self._span(one, one), self._span(one, other)
        return min(front, other_front) - max(rear, other_rear)

    def side_by_side_s(self, one: Actor, other: Actor) -> float:
        """Return how long it takes, s, until both footprints are side by side along the first one's way when both keep
        their speeds along it: 0 where they are, infinite where the gap between them does not close."""
        (rear, front), (other_rear, other_front) = self._span(one, one), self._span(one, other)
        gap_m = max(other_rear - front, rear - other_front)
        if gap_m <= 0:
            return 0.0
        closing_mps = self._speed_along(one, one) - self._speed_along(one, other)
        if other_front < rear:
            closing_mps = -closing_mps
        return gap_m / closing_mps if closing_mps > STILL_MPS else math.inf

    def ahead_m(self, one: Actor, other: Actor) -> float:
        """Return how far the rear of `one` is beyond the front of the other along the other's way, m (negative: short
        of it)."""
        return self._span(other, one)[0] - self._span(other, other)[1]

    def behind_m(self, one: Actor, other: Actor) -> float:
        """Return how far the front of `one` is short of the other's rear along the other's way, m."""
        return self._span(other, other)[0] - self._span(other, one)[1]

    def lateral_m(self, one: Actor, other: Actor) -> float:
        """Return how far apart two footprints are sideways, across the way of the first, m; 0 where they overlap."""
        _, left, _, half = self._beside(one, one)
        _, other_left, _, other_half = self._beside(one, other)
        return max(abs(other_left - left) - half - other_half, 0.0)

    def lane(self, actor: Actor) -> tuple[Lane, float] | None:
        """Return the lane that an actor's middle is in, with how far it is to the left of the lane's middle, m; None
        off the lanes.

        Of several that overlap, a vehicle is in one that points its way; elsewhere it may be in one that points the
        other way.
        """
        kind = lane_kind(actor.placed.model) if actor.placed.model.kind in WHEELS else "car"
        headings = (actor.heading, None) if actor.placed.model.kind in WHEELS else (None,)
        for heading in headings:
            near = self._network.nearest_lane(actor.x, actor.y, heading, kind)
            if near is not None and _off(near.lane, actor) <= near.lane.width_m / 2:
                return near.lane, near.lateral_m
        return None

    def in_lane_m(self, actor: Actor, number: int, road: str | None) -> float:
        """Return by how much an actor's middle is inside a lane's borders, m (negative: outside); NaN where it is off
        the lanes, or its edge (or the one named) has no such lane."""
        if road is None:
            found = self.lane(actor)
            if found is None:
                return math.nan
            if found[0].internal:
                return math.nan
            road = found[0].edge
        found_m = [
            lanes[number - 1].width_m / 2 - _off(lanes[number - 1], actor)
            for piece in self._network.pieces(road)
            if number <= len(lanes := self._network.edges[piece].drivable)
        ]
        return max(found_m, default=math.nan)

    def same_lane_m(self, one: Actor, other: Actor) -> float:
        """Return by how much the middle of one is inside the lane of the other, or of one that this leads on to, m
        (negative: outside), or the other way round; NaN where the other is in no lane."""
        theirs, mine = self.lane(other), self.lane(one)
        if theirs is None:
            return math.nan
        inside = theirs[0].width_m / 2 - distance_to(one.x, one.y, self._ahead(other, theirs[0]))
        if mine is not None:
            leads_there = mine[0].width_m / 2 - distance_to(other.x, other.y, self._ahead(one, mine[0]))
            inside = max(inside, leads_there) if leads_there >= 0 else inside
        return inside

    # --- inside --------------------------------------------------------------------------------------------------

    def _find(self, actor: Actor) -> Standing:
        body = actor.x, actor.y, actor.heading, actor.length, actor.width
        if isinstance(actor, PathActor):
            line: Polyline = actor.follower.line
            return Standing(*body, line, *line.project(actor.x, actor.y, actor.along))
        route = self._route_left(actor)
        if not route:
            return Standing(*body)
        line = self._line(route, lane_kind(actor.placed.model))
        return Standing(*body, line, *line.project(actor.x, actor.y))

    def _route_left(self, actor: Actor) -> tuple[str, ...]:
        """Return the edges of an actor's route from the one that it is on, or has been on before a junction."""
        line, route = actor.placed.line, actor.placed.route
        if line is None or not route:
            return ()
        if actor.id not in self._edges:
            self._edges[actor.id] = _edges_along(line)
        s, _ = self._simulation.progress.of(actor, self._simulation.frame)
        k = max((edge for begins, edge in self._edges[actor.id] if begins <= s), default=0)
        return route[min(k, len(route) - 1) :]

    def _make_line(self, route: tuple[str, ...], kind: LaneKind) -> RouteLine:
        try:
            return self._network.line(route, behind_m=BEHIND_M, beyond_m=BEYOND_M, kind=kind)
        except RouteError:  # the first edge has no lane for its kind to the next: a cyclist that began on another
            return self._network.line(route[:1], behind_m=BEHIND_M, beyond_m=BEYOND_M, kind=kind)

    def _beside(self, whose: Actor, other: Actor) -> tuple[float, float, float, float]:
        """Return where another is on somebody's way: length along it, distance to the left, and half of what its
        footprint takes along and across."""
        way = self.of(whose)
        if whose is other:
            return way.s, way.left_m, whose.length / 2, whose.width / 2
        if way.line is None:
            cos, sin = math.cos(way.heading_rad), math.sin(way.heading_rad)
            dx, dy = other.x - way.x, other.y - way.y
            s, left, heading = dx * cos + dy * sin, dy * cos - dx * sin, way.heading_rad
        else:
            s, left = way.line.project(other.x, other.y)
            heading = way.line.at(s)[2]
        cos, sin = abs(math.cos(other.heading - heading)), abs(math.sin(other.heading - heading))
        half, across = other.length / 2, other.width / 2
        return s, left, half * cos + across * sin, half * sin + across * cos

    def _speed_along(self, whose: Actor, other: Actor) -> float:
        """Return how fast another goes along somebody's way, m/s; negative against it."""
        way = self.of(whose)
        heading = way.heading_rad if way.line is None else way.line.at(self._beside(whose, other)[0])[2]
        return other.speed * math.cos(other.heading - heading)

    def _span(self, whose: Actor, other: Actor) -> tuple[float, float]:
        s, _, half, _ = self._beside(whose, other)
        return s - half, s + half

    def _ahead(self, actor: Actor, lane: Lane) -> Points:
        return self._strip(lane.id, self._route_left(actor), lane_kind(actor.placed.model))

    def _make_strip(self, lane: str, route: tuple[str, ...], kind: LaneKind) -> Points:
        """Return the middle of a lane and of those that it leads on to along a route, without changing lane."""
        lanes = self._network.lanes
        points, length, onward = [*lanes[lane].shape], lanes[lane].length_m, dict(pairwise(route))
        while length < IN_LANE_OF_M:
            through = self._network.movements_through(lane)
            ways = [w for w in through or self._network.movements_from(lanes[lane].edge, kind)
                    if (through or w.from_lane == lane) and onward.get(w.from_edge) == w.to_edge]  # fmt: skip
            if not ways:
                break
            way = ways[0]
            via = way.via[way.via.index(lane) + 1 :] if through else way.via
            for part in (*via, way.to_lane):
                points += lanes[part].shape
                length += lanes[part].length_m
            lane = way.to_lane
            onward.pop(way.from_edge)
        return tuple(points)


def _edges_along(line: RouteLine) -> tuple[tuple[float, int], ...]:
    """Return where each edge of a route begins along its line, with the edge's number."""
    found: list[tuple[float, int]] = []
    before = ""
    for s, lane in line.pieces:
        edge = "" if lane.startswith(":") else lane.rpartition("_")[0]
        if edge and edge != before:  # a change of lane begins another piece of the same edge
            found.append((s, len(found)))
        before = edge
    return tuple(found)


def _off(lane: Lane, actor: Actor) -> float:
    """Return how far an actor's middle is from a lane's middle, m."""
    return distance_to(actor.x, actor.y, lane.shape)
