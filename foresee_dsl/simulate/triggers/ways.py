"""Relative positions of two actors along the way of one of them, the lanes that actors are in, and places relative to
actors.

An actor's way is its path, or the line of its route from its current edge on; an actor with neither has a straight way.
A way depends only on the actor's position and the rest of its route, so that a clip, whose routes begin elsewhere, has
the same ways.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial
from itertools import pairwise

from foresee_dsl.compile.placement.spots import PlacedFootprint, Pose
from foresee_dsl.compile.placement.statements import WHEELS, lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points, Polyline, distance_to
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.kernels.conditions import STILL_MPS
from foresee_dsl.language import model as m
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor

BEHIND_M, BEYOND_M = 100.0, 200.0
"""Length by which a way extends behind its actor's edge, and beyond its route, m. Ours: a place or an actor farther
away is located relative to a straight continuation."""
IN_LANE_OF_M = 300.0
"""Length ahead within which lanes continue a lane for `a in lane of b`, m. Ours: beyond the range of any sensor."""


class Ways:
    """The ways of a simulation's actors at the current frame; each is computed when it is first needed."""

    def __init__(self, simulation: Simulation) -> None:
        """Begin without ways; each is computed when a condition or action first needs it."""
        self._simulation, self._network = simulation, simulation.network
        self._line = lru_cache(maxsize=64)(self._make_line)
        self._strip = lru_cache(maxsize=256)(partial(strip_of, self._network))
        self._edges: dict[str, tuple[tuple[float, int], ...]] = {}
        self._frame = -1
        self._footprints: dict[str, PlacedFootprint] = {}

    def of(self, actor: SimulatedActor) -> PlacedFootprint:
        """Return the current position of an actor on its way."""
        if self._frame != self._simulation.frame:
            self._frame = self._simulation.frame
            self._footprints.clear()
        footprint = self._footprints.get(actor.id)
        if footprint is None:
            footprint = self._footprints[actor.id] = self._find(actor)
        return footprint

    def place(self, place: m.OfActor) -> Pose | None:
        """Return the current pose of a place relative to an actor; None if the actor is absent."""
        actor = self._simulation.by_id.get(place.actor)
        if actor is None or not actor.present:
            return None
        return self.of(actor).place(place, wheels=actor.placed.model.kind in WHEELS)

    def overlap_m(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return the length along an actor's way over which both footprints are side by side, m; if negative, the gap
        between them.
        """
        (rear, front), (other_rear, other_front) = self._span(actor, actor), self._span(actor, other)
        return min(front, other_front) - max(rear, other_rear)

    def side_by_side_s(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return the time (s) until both footprints are side by side along an actor's way, if both keep their speeds
        along it.

        It is 0 if they are side by side now, and infinite if the gap does not close.
        """
        (rear, front), (other_rear, other_front) = self._span(actor, actor), self._span(actor, other)
        gap_m = max(other_rear - front, rear - other_front)
        if gap_m <= 0:
            return 0.0
        closing_mps = self._speed_along(actor, actor) - self._speed_along(actor, other)
        if other_front < rear:
            closing_mps = -closing_mps
        return gap_m / closing_mps if closing_mps > STILL_MPS else math.inf

    def ahead_m(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return how far the rear of the actor is ahead of the front of the other, along the other's way, m; negative
        if it is not ahead.
        """
        return self._span(other, actor)[0] - self._span(other, other)[1]

    def behind_m(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return how far the rear of the other is ahead of the front of the actor, along the other's way, m; negative
        if it is not ahead.
        """
        return self._span(other, other)[0] - self._span(other, actor)[1]

    def lateral_m(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return the lateral gap between two footprints, across the way of the first, m; 0 if they overlap."""
        _, left, _, half = self._beside(actor, actor)
        _, other_left, _, other_half = self._beside(actor, other)
        return max(abs(other_left - left) - half - other_half, 0.0)

    def lane(self, actor: SimulatedActor) -> tuple[Lane, float] | None:
        """Return the lane that an actor's centre is in, and the distance to the left of that lane's centreline, m; None
        off the lanes.

        Where lanes overlap, a vehicle is in the lane with its own direction; where there is none, it may be in one with
        the opposite direction.
        """
        kind = lane_kind(actor.placed.model) if actor.placed.model.kind in WHEELS else "car"
        headings = (actor.heading, None) if actor.placed.model.kind in WHEELS else (None,)
        for heading in headings:
            near = self._network.nearest_lane(actor.x, actor.y, heading, kind)
            if near is not None and _off(near.lane, actor) <= near.lane.width_m / 2:
                return near.lane, near.lateral_m
        return None

    def in_lane_m(self, actor: SimulatedActor, number: int, road: str | None) -> float:
        """Return how far an actor's centre is inside the borders of a lane, m; negative outside.

        NaN if the actor is off the lanes, or if its edge (or `road`) has no lane with this number.
        """
        if road is None:
            current = self.lane(actor)
            if current is None:
                return math.nan
            if current[0].internal:
                return math.nan
            road = current[0].edge
        inside_m = [
            lanes[number - 1].width_m / 2 - _off(lanes[number - 1], actor)
            for piece in self._network.pieces(road)
            if number <= len(lanes := self._network.edges[piece].drivable)
        ]
        return max(inside_m, default=math.nan)

    def same_lane_m(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return how far an actor's centre is inside the lane of another actor, or a lane that continues it, m;
        negative outside.

        The other's centre inside the actor's lane counts as well. NaN if the other is off the lanes.
        """
        theirs, mine = self.lane(other), self.lane(actor)
        if theirs is None:
            return math.nan
        inside = theirs[0].width_m / 2 - distance_to(actor.x, actor.y, self._ahead(other, theirs[0]))
        if mine is not None:
            leads_there = mine[0].width_m / 2 - distance_to(other.x, other.y, self._ahead(actor, mine[0]))
            inside = max(inside, leads_there) if leads_there >= 0 else inside
        return inside

    # --- inside --------------------------------------------------------------------------------------------------

    def _find(self, actor: SimulatedActor) -> PlacedFootprint:
        body = actor.x, actor.y, actor.heading, actor.length, actor.width
        if isinstance(actor, PathActor):
            line: Polyline = actor.follower.line
            return PlacedFootprint(*body, line, *line.project(actor.x, actor.y, actor.along))
        route = self._route_left(actor)
        if not route:
            return PlacedFootprint(*body)
        line = self._line(route, lane_kind(actor.placed.model))
        return PlacedFootprint(*body, line, *line.project(actor.x, actor.y))

    def _route_left(self, actor: SimulatedActor) -> tuple[str, ...]:
        """Return the rest of an actor's route, from its current edge on; inside a junction, from the edge
        before it on.
        """
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
        except RouteError:  # the first edge has no lane that leads on for this kind of actor, for example a cyclist
            return self._network.line(route[:1], behind_m=BEHIND_M, beyond_m=BEYOND_M, kind=kind)

    def _beside(self, whose: SimulatedActor, other: SimulatedActor) -> tuple[float, float, float, float]:
        """Return where another actor is on an actor's way: length along it and distance to its left, m.

        The other two numbers are half the extent of its footprint along and across the way, m.
        """
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

    def _speed_along(self, whose: SimulatedActor, other: SimulatedActor) -> float:
        """Return the speed of another actor along an actor's way, m/s; negative if it moves against the way."""
        way = self.of(whose)
        heading = way.heading_rad if way.line is None else way.line.at(self._beside(whose, other)[0])[2]
        return other.speed * math.cos(other.heading - heading)

    def _span(self, whose: SimulatedActor, other: SimulatedActor) -> tuple[float, float]:
        s, _, half, _ = self._beside(whose, other)
        return s - half, s + half

    def _ahead(self, actor: SimulatedActor, lane: Lane) -> Points:
        return self._strip(lane.id, self._route_left(actor), lane_kind(actor.placed.model))


def strip_of(network: RoadNetwork, lane: str, route: tuple[str, ...], kind: LaneKind) -> Points:
    """Return the centreline of a lane and of the lanes that continue it along a route without a lane change.

    Args:
        network: the road network.
        lane: id of the lane at which the strip begins.
        route: the edges of the route, in driving order.
        kind: the traffic that drives on it.
    """
    lanes = network.lanes
    points, length, onward = [*lanes[lane].shape], lanes[lane].length_m, dict(pairwise(route))
    while length < IN_LANE_OF_M:
        through = network.movements_through(lane)
        ways = [w for w in through or network.movements_from(lanes[lane].edge, kind)
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
    """Return the length along its line at which each edge of a route begins, with the edge's index."""
    edges: list[tuple[float, int]] = []
    before = ""
    for s, lane in line.pieces:
        edge = "" if lane.startswith(":") else lane.rpartition("_")[0]
        if edge and edge != before:  # after a change of lane the line continues on another piece of the same edge
            edges.append((s, len(edges)))
        before = edge
    return tuple(edges)


def _off(lane: Lane, actor: SimulatedActor) -> float:
    """Return the distance of an actor's centre from a lane's centreline, m."""
    return distance_to(actor.x, actor.y, lane.shape)
