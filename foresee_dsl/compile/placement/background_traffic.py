"""Background traffic: vehicles on random routes and pedestrians on random walks, from a seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.compile.catalogue import cruise_speed
from foresee_dsl.compile.placement.actor_checks import footprint
from foresee_dsl.compile.placement.parked_vehicles import Kerb
from foresee_dsl.compile.placement.places import si
from foresee_dsl.compile.placement.starts import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Polyline
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import onward
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.compile.roads.walkways import walkways
from foresee_dsl.language.model import Traffic

GAP_M = 12.0
"""Free road in front of and behind every vehicle at the start: with 12 m a car at 25 km/h can stop."""
STEP_M = 3.0
"""Candidate places are this far apart."""
MAX_EDGES = 12
"""Longest random route."""
TURN_WEIGHTS = {"straight": 3.0, "left": 1.0, "right": 1.0, "back": 0.0}
"""Three in five go straight on at a crossroads (ours)."""
REACTION_S = 1.0
"""Krauss' reaction time, SUMO's default tau: the start speed is one that SUMO would call safe."""
PACE = (0.8, 1.05)
"""Cruise speeds, as a share of the limit: most drive a little slower, few a little faster (ours)."""
DEAD_END_M = 50.0
"""No vehicle starts nearer to the end of a road that leads nowhere: it would be gone at once."""
PEDESTRIAN_GAP_M = 1.0


@dataclass(frozen=True)
class _Slot:
    """A vehicle on a lane: from its rear to its front, m along the lane; `speed_mps` where it is fixed."""

    rear: float
    front: float
    speed_mps: float
    braking_mps2: float


def background(
    traffic: Traffic,
    *,
    network: RoadNetwork,
    specs: Mapping[str, ModelSpec],
    placed: Sequence[PlacedActor],
    end_s: float,
) -> tuple[list[PlacedActor], str]:
    """Draw background actors `NAME_01`, `NAME_02`, ...: the same for the same arguments.

    Args:
        traffic: the statement.
        network: where.
        specs: by model name.
        placed: who is there already; the first is the ego, whose line says where "near" is.
        end_s: routes are long enough for this time, or have 12 edges.

    Returns:
        The actors, and a note for the author where fewer found room than asked ("" otherwise).
    """
    ego = placed[0]
    if ego.line is None:
        return [], f"{traffic.name}: the ego has no route to be near to"
    rng = np.random.Generator(np.random.PCG64(int(si(traffic.seed))))
    wanted = int(si(traffic.count))
    mix = [specs[str(name)] for name in traffic.models if str(name) in specs]
    drawn = [mix[int(rng.integers(len(mix)))] for _ in range(wanted)] if mix else []
    road = _Road(network, ego.line, si(traffic.within), placed)
    paths = _Paths(network, ego.line, si(traffic.within), placed)
    kerb = Kerb(network, ego.line, si(traffic.within), placed)
    found: list[PlacedActor] = []
    for spec in drawn:
        name = f"{traffic.name}_{len(found) + 1:02d}"
        if spec.kind == "obstacle":
            one = kerb.draw(name, spec, rng)
        elif spec.kind == "pedestrian":
            one = paths.draw(name, spec, end_s, rng)
        else:
            one = road.draw(name, spec, end_s, rng)
        if one is not None:
            found.append(one)
    missing = wanted - len(found)
    note = f"{traffic.name}: {missing} of {wanted} actors found no room and were left out" if missing else ""
    return road.with_safe_speeds(found), note


class _Road:
    """Draws vehicles on lanes near the ego's line."""

    def __init__(self, network: RoadNetwork, line: RouteLine, within_m: float, placed: Sequence[PlacedActor]) -> None:
        self._network = network
        self._near = shapely.LineString(line.points).buffer(within_m)
        shapely.prepare(self._near)
        self._boxes = [shapely.Polygon(footprint(actor)) for actor in placed]
        self._slots: dict[str, list[_Slot]] = {}
        self._candidates: dict[LaneKind, list[tuple[Lane, float]]] = {}
        for actor in placed:
            if actor.lane and actor.control in ("ego", "sumo"):
                self._occupy(actor.lane, actor)

    def draw(self, name: str, spec: ModelSpec, end_s: float, rng: np.random.Generator) -> PlacedActor | None:
        """Place one vehicle, or None where there is no room for it."""
        kind = lane_kind(spec)
        places = self._places(kind)
        pace = float(rng.uniform(*PACE))
        for k in rng.permutation(len(places)):
            lane, front = places[int(k)]
            if not self._fits(lane, front, spec):
                continue
            cruise = _cruise(spec, lane.speed_mps, pace)
            route = self._route(lane, front, cruise * end_s, kind, rng)
            x, y, heading = lane.line.at(front)
            actor = PlacedActor(
                id=name,
                model=spec,
                control="sumo",
                x=x,
                y=y,
                heading_rad=heading,
                speed_mps=cruise,
                lane=lane.id,
                route=route,
                line=self._network.line(route, start_lane=lane.id, after_m=round(front, 3), kind=kind),
                cruise_mps=cruise,
            )
            box = shapely.Polygon(footprint(actor))
            if any(box.distance(other) < PEDESTRIAN_GAP_M for other in self._boxes):
                continue
            self._boxes.append(box)
            self._occupy(lane.id, actor)
            return actor
        return None

    def with_safe_speeds(self, actors: Sequence[PlacedActor]) -> list[PlacedActor]:
        """Bound the start speeds by what is ahead: the vehicle in front, standing, or the lane's end."""
        return [self._safe(actor) if actor.control == "sumo" else actor for actor in actors]

    def _safe(self, actor: PlacedActor) -> PlacedActor:
        lane = self._network.lanes[actor.lane]
        front = lane.line.project(actor.x, actor.y)[0]
        ahead = [slot.rear for slot in self._slots[actor.lane] if slot.rear > front]
        gap = min([*ahead, lane.line.length_m]) - front - 1.0
        bound = _stopping_speed(max(gap, 0.0), actor.model.braking_mps2)
        return replace(actor, speed_mps=min(actor.speed_mps, bound))

    def _occupy(self, lane_id: str, actor: PlacedActor) -> None:
        front = self._network.lanes[lane_id].line.project(actor.x, actor.y)[0]
        slot = _Slot(front - actor.model.length_m, front, actor.speed_mps, actor.model.braking_mps2)
        self._slots.setdefault(lane_id, []).append(slot)

    def _fits(self, lane: Lane, front: float, spec: ModelSpec) -> bool:
        rear = front - spec.length_m
        if rear < 0.5:
            return False
        for slot in self._slots.get(lane.id, ()):
            # whoever comes from behind must be able to stop, as a queue may stand here
            reach = slot.speed_mps * REACTION_S + slot.speed_mps**2 / (2 * slot.braking_mps2)
            behind = max(GAP_M, reach)
            if rear < slot.front + behind and front > slot.rear - GAP_M:
                return False
        return True

    def _places(self, kind: LaneKind) -> list[tuple[Lane, float]]:
        if kind not in self._candidates:
            found: list[tuple[Lane, float]] = []
            for edge in self._network.edges.values():
                lanes = edge.for_kind(kind)
                dead_end = all(m.turn == "back" for m in onward(self._network, edge.id, kind))
                for lane in lanes[:1] if kind == "bicycle" else lanes:  # bicycles keep to the right
                    found += self._places_on(lane, dead_end, kind)
            self._candidates[kind] = found
        return self._candidates[kind]

    def _places_on(self, lane: Lane, dead_end: bool, kind: LaneKind) -> list[tuple[Lane, float]]:
        last = lane.line.length_m - (DEAD_END_M if dead_end else 3.0)
        leads_on = dead_end or any(m.from_lane == lane.id for m in self._network.movements_from(lane.edge, kind))
        s = np.arange(3.0, last, STEP_M)
        if not len(s) or not leads_on:
            return []
        x = np.interp(s, lane.line.s, lane.line.points[:, 0])
        y = np.interp(s, lane.line.s, lane.line.points[:, 1])
        near = shapely.contains_xy(self._near, x, y)
        return [(lane, float(v)) for v in s[near]]

    def _route(
        self, lane: Lane, front: float, length_m: float, kind: LaneKind, rng: np.random.Generator
    ) -> tuple[str, ...]:
        edges = [lane.edge]
        missing = length_m - (lane.line.length_m - front)
        while missing > 0 and len(edges) < MAX_EDGES:
            ways = onward(self._network, edges[-1], kind)
            if len(edges) == 1:  # the first turn is one that its lane allows
                allowed = {m.to_edge for m in self._network.movements_from(lane.edge, kind) if m.from_lane == lane.id}
                ways = tuple(m for m in ways if m.to_edge in allowed)
            weights = np.array([TURN_WEIGHTS[m.turn] for m in ways])
            if not ways or weights.sum() == 0:
                break
            way = ways[int(rng.choice(len(ways), p=weights / weights.sum()))]
            edges.append(way.to_edge)
            missing -= self._network.lanes[way.to_lane].line.length_m
        return tuple(edges)


class _Paths:
    """Draws pedestrians on sidewalks near the ego's line."""

    def __init__(self, network: RoadNetwork, line: RouteLine, within_m: float, placed: Sequence[PlacedActor]) -> None:
        self._ways = walkways(network)
        self._near = shapely.LineString(line.points).buffer(within_m)
        shapely.prepare(self._near)
        self._boxes = [shapely.Polygon(footprint(actor)) for actor in placed]
        self._candidates: list[tuple[float, float]] | None = None

    def draw(self, name: str, spec: ModelSpec, end_s: float, rng: np.random.Generator) -> PlacedActor | None:
        """Place one pedestrian, or None where there is no room."""
        places = self._places()
        for k in rng.permutation(len(places))[:20]:
            cruise = cruise_speed(spec, spec.max_speed_mps) * float(rng.uniform(*PACE))
            walk = self._ways.walk(places[int(k)], cruise * end_s, rng)
            if walk is None:
                return None
            x, y, heading = Polyline.of(walk.points).at(0.0)
            actor = PlacedActor(
                id=name,
                model=spec,
                control="path",
                x=x,
                y=y,
                heading_rad=heading,
                speed_mps=cruise,
                path=walk.points,
                cruise_mps=cruise,
                walk_stops=walk.stops,
            )
            box = shapely.Polygon(footprint(actor))
            if all(box.distance(other) >= PEDESTRIAN_GAP_M for other in self._boxes):
                self._boxes.append(box)
                return actor
        return None

    def _places(self) -> list[tuple[float, float]]:
        if self._candidates is None:
            found: list[XY] = [xy for way in self._ways.sidewalks for xy in Polyline.of(self._ways.shapes[way]).xy]
            points = np.array(found, dtype=np.float64).reshape(-1, 2)
            near = shapely.contains_xy(self._near, points[:, 0], points[:, 1])
            self._candidates = [(float(x), float(y)) for x, y in points[near]]
        return self._candidates


def _cruise(spec: ModelSpec, limit_mps: float, pace: float) -> float:
    limit = limit_mps if spec.cruise_mps is None else min(limit_mps, spec.cruise_mps)
    return min(limit * pace, spec.max_speed_mps)


def _stopping_speed(gap_m: float, braking_mps2: float) -> float:
    """The highest speed from which a vehicle can stop within a gap, with its reaction time."""
    lost = braking_mps2 * REACTION_S
    return math.sqrt(lost * lost + 2 * braking_mps2 * gap_m) - lost
