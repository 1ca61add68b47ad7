"""Background traffic from a seed: vehicles on random routes, pedestrians on random walks, parked vehicles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import shapely

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.compile.catalogue import cruise_speed
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.compile.placement.statements import lane_kind, si
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Polyline
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import onward
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.compile.roads.walkways import walkways
from foresee_dsl.language.model import Traffic, name_in_traffic

GAP_M = 12.0
"""Free road in front of and behind every vehicle at the start, m (ours: a car at 25 km/h can stop within it)."""
_ROUNDING_M = 0.01
"""A lane farther than this from the area of the traffic has no candidate place in the area, m (ours: far more than
rounding errors).
"""
STEP_M = 3.0
"""Spacing of the candidate places of vehicles on lanes, m (ours)."""
MAX_EDGES = 12
"""Longest random route, edges (ours)."""
TURN_WEIGHTS = {"straight": 3.0, "left": 1.0, "right": 1.0, "back": 0.0}
"""Weights of the turns at a junction: three in five go straight on at a crossroads (ours)."""
SUMO_TAU_S = 1.0
"""Reaction time of SUMO's Krauss model, s (its default tau); with it, SUMO considers the start speeds safe."""
PACE = (0.8, 1.05)
"""Range of cruise speeds as a share of the limit: most drive a little slower, few a little faster (ours)."""
DEAD_END_M = 50.0
"""Distance to a dead end within which no vehicle starts, m, because it would leave the network at once (ours)."""
PEDESTRIAN_GAP_M = 1.0
"""Smallest distance between the footprints of a new vehicle or pedestrian and any other actor, m (ours)."""
PARKED_STEP_M = 0.5
"""Spacing of the candidate places on parking strips, m (ours: real gaps have any size)."""
PARKED_GAP_M = 0.8
"""Smallest gap between two parked vehicles, m. Ours: about the least with which a vehicle can pull out."""
CORNER_M = 8.0
"""Distance to a junction within which no vehicle is parked, m: Germany's StVO, section 12 (3), requires this distance
on roads with a cycle track, and 5 m on other roads.
"""
SLACK_M = 0.15
"""Largest distance of a parked vehicle from the middle of its strip, to either side, m (ours)."""
WALKS_TRIED = 20
"""Maximum number of candidate places for a pedestrian (ours: each costs a random walk)."""


def background(
    traffic: Traffic,
    *,
    network: RoadNetwork,
    specs: Mapping[str, ModelSpec],
    placed: Sequence[PlacedActor],
    end_s: float,
) -> tuple[list[PlacedActor], str]:
    """Draw background actors `NAME_01`, `NAME_02`, ...; equal arguments give equal actors.

    Args:
        traffic: the statement.
        network: the roads.
        specs: models by name.
        placed: the actors so far; the first is the ego, from whose line `within` is measured.
        end_s: duration for which a route must be long enough, s, unless it has `MAX_EDGES` edges.

    Returns:
        The actors, and a note for the author if there is no room for all of them ("" otherwise).
    """
    ego = placed[0]
    if ego.line is None:
        return [], f"{traffic.name}: the ego has no route, near which this traffic could be placed"
    rng = np.random.Generator(np.random.PCG64(int(si(traffic.seed))))
    wanted = int(si(traffic.count))
    mix = [specs[str(name)] for name in traffic.models if str(name) in specs]
    models = [mix[int(rng.integers(len(mix)))] for _ in range(wanted)] if mix else []
    around = _Around(network, ego.line, si(traffic.within), placed, end_s, rng)
    actors: list[PlacedActor] = []
    for spec in models:
        if (new := around.add(name_in_traffic(traffic.name, len(actors) + 1), spec)) is not None:
            actors.append(new)
    missing = wanted - len(actors)
    note = (
        f"{traffic.name}: {missing} of {wanted} actors were left out, because there was no room for them"
        if missing
        else ""
    )
    return [around.with_safe_speed(actor) if actor.control == "sumo" else actor for actor in actors], note


class _Around:
    """Draws actors near the ego's line, and keeps their footprints apart.

    Vehicles, pedestrians and parked vehicles keep a distance from the placed actors and from new ones of the same kind.
    """

    def __init__(
        self,
        network: RoadNetwork,
        line: RouteLine,
        within_m: float,
        placed: Sequence[PlacedActor],
        end_s: float,
        rng: np.random.Generator,
    ) -> None:
        self._network, self._end_s, self._rng = network, end_s, rng
        self._near = shapely.LineString(line.points).buffer(within_m)
        shapely.prepare(self._near)
        taken = [shapely.Polygon(footprint(actor)) for actor in placed]
        self._taken = {control: list(taken) for control in ("sumo", "path", "static")}
        self._lane_places: dict[LaneKind, list[tuple[Lane, float]]] = {}
        self._slots: dict[str, list[tuple[float, PlacedActor]]] = {}
        """The vehicles on each lane, with the positions of their fronts along it, m."""
        for actor in placed:
            if actor.lane and actor.control in ("ego", "sumo"):
                self._occupy(actor)

    def add(self, name: str, spec: ModelSpec) -> PlacedActor | None:
        """Place an actor and return it, or return None if there is no room for it."""
        draw = {"obstacle": self._parked, "pedestrian": self._pedestrians}.get(spec.kind, self._vehicles)
        gap_m = PARKED_GAP_M if spec.kind == "obstacle" else PEDESTRIAN_GAP_M
        for actor in draw(name, spec):
            if self._has_room(actor, gap_m):
                if actor.control == "sumo":
                    self._occupy(actor)
                return actor
        return None

    def _vehicles(self, name: str, spec: ModelSpec) -> Iterator[PlacedActor]:
        """Yield the vehicle at each candidate place on a lane, in random order."""
        kind = lane_kind(spec)
        places = self._places(kind)
        pace = float(self._rng.uniform(*PACE))
        for k in self._rng.permutation(len(places)):
            lane, front = places[int(k)]
            if not self._fits(lane, front, spec):
                continue
            limit = lane.speed_mps if spec.cruise_mps is None else min(lane.speed_mps, spec.cruise_mps)
            cruise = min(limit * pace, spec.max_speed_mps)
            missing_m = cruise * self._end_s - (lane.line.length_m - front)
            route = random_route(self._network, self._rng, lane, missing_m, kind, most_edges=MAX_EDGES)
            line = self._network.line(route, start_lane=lane.id, after_m=round(front, 3), kind=kind)
            actor = PlacedActor(name, spec, "sumo", *lane.line.at(front), speed_mps=cruise, cruise_mps=cruise)
            yield replace(actor, lane=lane.id, route=route, line=line)

    def _pedestrians(self, name: str, spec: ModelSpec) -> Iterator[PlacedActor]:
        """Yield the pedestrian at candidate places on sidewalks, in random order, each with a random walk."""
        for k in self._rng.permutation(len(self._sidewalk_places))[:WALKS_TRIED]:
            cruise = cruise_speed(spec, spec.max_speed_mps) * float(self._rng.uniform(*PACE))
            walk = walkways(self._network).walk(self._sidewalk_places[int(k)], cruise * self._end_s, self._rng)
            if walk is None:
                return
            pose = Polyline.of(walk[:2]).at(0.0)
            actor = PlacedActor(name, spec, "path", *pose, speed_mps=cruise, cruise_mps=cruise)
            yield replace(actor, path=walk, walk_stops=walkways(self._network).stops_on(walk))

    def _parked(self, name: str, spec: ModelSpec) -> Iterator[PlacedActor]:
        """Yield the parked vehicle, which is an obstacle, at each candidate place on a strip, in random order."""
        for k in self._rng.permutation(len(self._parking_places)):
            lane, at = self._parking_places[int(k)]
            reach = spec.length_m / 2
            if CORNER_M + reach <= at <= lane.line.length_m - CORNER_M - reach:
                pose = lane.line.at(at, float(self._rng.uniform(-SLACK_M, SLACK_M)))
                yield PlacedActor(name, spec, "static", *pose, speed_mps=0.0)

    def with_safe_speed(self, actor: PlacedActor) -> PlacedActor:
        """Return a vehicle with a start speed at which it can stop behind the one in front, or at the lane's end."""
        line, braking = self._network.lanes[actor.lane].line, actor.model.braking_mps2
        front = line.project(actor.x, actor.y)[0]
        ahead = [front_m - other.model.length_m for front_m, other in self._slots[actor.lane]]
        ahead = [rear for rear in ahead if rear > front]
        gap_m = max(min([*ahead, line.length_m]) - front - 1.0, 0.0)
        lost = braking * SUMO_TAU_S
        return replace(actor, speed_mps=min(actor.speed_mps, math.sqrt(lost * lost + 2 * braking * gap_m) - lost))

    def _has_room(self, actor: PlacedActor, gap_m: float) -> bool:
        """Reserve an actor's footprint if its distance to all others is at least `gap_m`; return whether it was
        reserved.
        """
        taken, box = self._taken[actor.control], shapely.Polygon(footprint(actor))
        free = all(box.distance(other) >= gap_m for other in taken)
        if free:
            taken.append(box)
        return free

    def _occupy(self, actor: PlacedActor) -> None:
        front = self._network.lanes[actor.lane].line.project(actor.x, actor.y)[0]
        self._slots.setdefault(actor.lane, []).append((front, actor))

    def _fits(self, lane: Lane, front: float, spec: ModelSpec) -> bool:
        rear = front - spec.length_m
        if rear < 0.5:
            return False
        for other_front, other in self._slots.get(lane.id, ()):
            # a vehicle behind must be able to stop, because a queue may form here
            reach = other.speed_mps * SUMO_TAU_S + other.speed_mps**2 / (2 * other.model.braking_mps2)
            if rear < other_front + max(GAP_M, reach) and front > other_front - other.model.length_m - GAP_M:
                return False
        return True

    def _places(self, kind: LaneKind) -> list[tuple[Lane, float]]:
        """Return the candidate places of vehicles: lanes and positions of the front along them, m."""
        if kind not in self._lane_places:
            places: list[tuple[Lane, float]] = []
            for edge in self._network.edges.values():
                lanes = edge.for_kind(kind)
                dead_end = all(m.turn == "back" for m in onward(self._network, edge.id, kind))
                for lane in lanes[:1] if kind == "bicycle" else lanes:  # bicycles keep to the right
                    places += self._places_on(lane, dead_end, kind)
            self._lane_places[kind] = places
        return self._lane_places[kind]

    def _places_on(self, lane: Lane, dead_end: bool, kind: LaneKind) -> list[tuple[Lane, float]]:
        if not shapely.dwithin(self._near, lane.centreline, _ROUNDING_M):  # skips most of a large map
            return []
        last = lane.line.length_m - (DEAD_END_M if dead_end else 3.0)
        leads_on = dead_end or any(m.from_lane == lane.id for m in self._network.movements_from(lane.edge, kind))
        s = np.arange(3.0, last, STEP_M)
        if not len(s) or not leads_on:
            return []
        x = np.interp(s, lane.line.s, lane.line.points[:, 0])
        y = np.interp(s, lane.line.s, lane.line.points[:, 1])
        near = shapely.contains_xy(self._near, x, y)
        return [(lane, float(v)) for v in s[near]]

    @cached_property
    def _sidewalk_places(self) -> list[XY]:
        points = np.array(walkways(self._network).sidewalk_points).reshape(-1, 2)
        near = shapely.contains_xy(self._near, points[:, 0], points[:, 1])
        return [(float(x), float(y)) for x, y in points[near]]

    @cached_property
    def _parking_places(self) -> list[tuple[Lane, float]]:
        """Return the candidate places of parked vehicles: strips, and positions of the vehicle's middle along them,
        m."""
        places = [
            (lane, at)
            for lane in self._network.lanes.values()
            if lane.parking
            for at in np.arange(CORNER_M, lane.line.length_m - CORNER_M, PARKED_STEP_M).tolist()
        ]
        return [(lane, at) for lane, at in places if shapely.contains_xy(self._near, *lane.line.at(at)[:2])]


def random_route(
    network: RoadNetwork, rng: np.random.Generator, lane: Lane, missing_m: float, kind: LaneKind, *, most_edges: float
) -> tuple[str, ...]:
    """Draw a route that begins on a lane and continues for `missing_m` after its first edge, or to a dead end."""
    edges = [lane.edge]
    while missing_m > 0 and len(edges) < most_edges:
        ways = onward(network, edges[-1], kind)
        if len(edges) == 1:  # the first turn must be one that the lane allows
            allowed = {m.to_edge for m in network.movements_from(lane.edge, kind) if m.from_lane == lane.id}
            ways = tuple(m for m in ways if m.to_edge in allowed)
        weights = np.array([TURN_WEIGHTS[m.turn] for m in ways])
        if not ways or weights.sum() == 0:
            break
        way = ways[int(rng.choice(len(ways), p=weights / weights.sum()))]
        edges.append(way.to_edge)
        missing_m -= network.lanes[way.to_lane].line.length_m
    return tuple(edges)
