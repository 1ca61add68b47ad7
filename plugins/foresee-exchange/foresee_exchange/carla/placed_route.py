"""A CARLA route on a network: edges, lengths along the route, kerbs, and the junction at which the scenario happens."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.starts import StartSearch
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, wrap
from foresee_dsl.compile.roads.route_line import Passage, RouteLine
from foresee_dsl.compile.roads.routing import RouteError, onward
from foresee_dsl.exchange.bridges import Heights
from foresee_dsl.language import model as m
from foresee_exchange.carla.files import CarlaRoute, Trigger
from foresee_exchange.carla.ways import SAME_WAY_RAD, Way, length_to, through_of, way_between

TRIGGER_NEAR_M, TRIGGER_FAR_M = 2.0, 5.0
"""A trigger belongs to a route that passes it within 2 m (CARLA's leaderboard, with 10 degrees); if none does, within
5 m, which finds a trigger for each of Town10HD's routes (measured)."""
_BACK_RAD = math.radians(100)
"""No road turns by more than this within a metre (ours: the tightest corner of CARLA's towns has a radius of 4 m)."""
_BESIDE_M = 0.05
"""A start at most this far from the middle of its lane is on the middle (ours: no place of Town10HD is farther off)."""
BESIDE_GOAL_M, _ON_GOAL_M = 1.0, 0.5
"""A line farther from the goal than the first value, m, passes it on another lane; up to the second, it is on the
goal's lane (ours: a goal lies 3.5 m from the middle of the next lane)."""
_EDGES_BEHIND_GOAL = 3
"""Number of edges after the goal that are searched (ours: a goal lies just after a junction, and lanes part at the
next one or two)."""
MISSED_M = 0.5
"""A start farther than this from CARLA's, m, is reported in a note (ours: rounding gives up to 1 cm)."""
_STRAY_M = 0.5
"""A centre line farther beside the road than this, m, takes wheels off it (ours: half a car is 0.9 m wide)."""
_NEAR_SPOT_M = 30.0
"""At less than this distance, m, from a bridge the ego sees the traffic of the other road (ours)."""
_LOOK_M, _LOOK_STEP_M = 25.0, 0.25
"""Distance up to which a kerb is searched, and the step of the search, both m (ours: six lanes and a median)."""


@dataclass(frozen=True, eq=False)
class PlacedRoute:
    """A route of CARLA on a network.

    Attributes:
        named: the edges to write; the route is made up of the shortest paths between them. The last may be after the
            goal.
        begin_m: distance from the beginning of the route to the ego's front. beside_m: offset to the left of the middle
            of its first lane.
        finish_m: distance from the ego's front to the goal, along the line.
        start_off_m: distance between CARLA's start and the ego's centre at its start.
        line: the line that the ego follows. s: position of the ego's front on it, m.
        trigger_m: distance from the ego's start to the trigger. trigger: the trigger, or None if none belongs to the
            route.
    """

    route: CarlaRoute
    way: Way
    named: tuple[str, ...]
    begin_m: float
    beside_m: float
    finish_m: float
    start_off_m: float
    line: RouteLine
    s: float
    trigger_m: float = 0.0
    trigger: Trigger | None = None

    @property
    def goal_s(self) -> float:
        """Return the position of the goal on the line, m."""
        return self.s + self.finish_m

    def s_of(self, pose: Pose) -> float:
        """Return the position on the line that is nearest to a place, m."""
        return min(length_to(self.line, pose, max(self.s - TRIGGER_FAR_M, 0.0)), self.goal_s)

    def off(self, pose: Pose) -> float:
        """Return the distance of a pose from the line, m; infinite if the pose faces in another direction than the
        line."""
        x, y, heading = self.line.at(self.s_of(pose))
        if abs(wrap(heading - pose.heading_rad)) > SAME_WAY_RAD:
            return math.inf
        return math.hypot(x - pose.x, y - pose.y)

    def first(self, triggers: Sequence[Trigger]) -> Trigger | None:
        """Return the first trigger, of those on the line, that the ego reaches."""
        away = [(self.off(trigger.pose), trigger.order, trigger) for trigger in triggers]
        for within_m in (TRIGGER_NEAR_M, TRIGGER_FAR_M):
            if near := [candidate for candidate in away if candidate[0] <= within_m]:
                return min(
                    near, key=lambda candidate: (round(self.s_of(candidate[2].pose), 1), candidate[0], candidate[1])
                )[2]
        return None


def place_route(
    network: RoadNetwork,
    route: CarlaRoute,
    triggers: Sequence[Trigger],
    spec: ModelSpec,
    *,
    in_order: bool,
    heights: Heights | None = None,
) -> PlacedRoute:
    """Return how a route is written, with its trigger.

    Args:
        triggers: the triggers of the route's family and town. spec: the ego's model.
        in_order: the k-th trigger belongs to the k-th route.

    Raises:
        RouteError: its places are not on the map, or not connected.
    """
    placed = _over_goal_lane(network, way_between(network, route.start, route.end, route.between, heights), route, spec)
    own = (t for t in triggers if in_order and t.order == route.order and placed.off(t.pose) <= TRIGGER_FAR_M)
    trigger = next(own, None) or placed.first(triggers)
    trigger_m = 0.0 if trigger is None else placed.s_of(trigger.pose) - placed.s
    return replace(placed, named=through_of(network, placed.named), trigger_m=trigger_m, trigger=trigger)


def _over_goal_lane(network: RoadNetwork, way: Way, route: CarlaRoute, spec: ModelSpec) -> PlacedRoute:
    """Place a route on the edges of a path, if necessary with further edges to which only the goal's lane leads.

    A line uses the rightmost lanes that need no lane change; they depend on the edges after the goal.
    """
    whole, goal_off_m = _placed(network, way, way.edges, route, spec)
    if goal_off_m <= BESIDE_GOAL_M:
        return whole
    longer = [way.edges]
    for _ in range(_EDGES_BEHIND_GOAL):
        longer = [
            (*edges, movement.to_edge)
            for edges in longer
            for movement in onward(network, edges[-1], "car")
            if movement.turn != "back" and movement.to_edge not in edges
        ]
        for edges in longer:
            with suppress(RouteError):
                placed, goal_off_m = _placed(network, way, edges, route, spec)
                if goal_off_m <= _ON_GOAL_M:
                    return placed
    return whole


def _placed(
    network: RoadNetwork, way: Way, edges: tuple[str, ...], route: CarlaRoute, spec: ModelSpec
) -> tuple[PlacedRoute, float]:
    """Return a route on some edges, all of them named and without its trigger, and the distance of its line from the
    goal, m."""
    half_m = spec.length_m / 2  # CARLA places a vehicle by its centre, our statement by its front
    begin, beside = _front_on(network.line(edges), route.start, half_m)
    beside = 0.0 if abs(beside) < _BESIDE_M else round(beside, 2)
    offset = m.Quantity.of(beside, "length", 2) if beside else None
    at = m.AlongRoute(actor="ego", at=m.Quantity.of(begin, "length", 2), offset=offset)
    ego = m.Ego(model=spec.name, body=(m.EdgeRoute(edges=edges), m.StartAt(place=at)))
    start = StartSearch(network, {"ego": ego}, {"ego": spec}).on_route("ego")
    goal_s = min(length_to(start.line, route.end, start.s), start.line.end_s)
    x, y = start.x - half_m * math.cos(start.heading_rad), start.y - half_m * math.sin(start.heading_rad)
    goal_x, goal_y, _ = start.line.at(goal_s)
    placed = PlacedRoute(
        route=route,
        way=way,
        named=edges,
        begin_m=round(begin, 2),
        beside_m=beside,
        finish_m=math.floor((goal_s - start.s) * 100) / 100,  # rounding must not move the goal beyond the end
        start_off_m=math.hypot(x - route.start.x, y - route.start.y),
        line=start.line,
        s=start.s,
    )
    return placed, math.hypot(goal_x - route.end.x, goal_y - route.end.y)


def _front_on(line: RouteLine, place: Pose, half_m: float) -> tuple[float, float]:
    """Return the position on a line and the lateral offset of the front of a vehicle whose centre is at a place.

    In a bend the nearest point of the line is not exact, because offsets turn with the line, segment by segment.
    """
    s = length_to(line, place, 0.0)
    beside = line.project(place.x, place.y, s)[1]
    s = min(s + half_m, line.length_m)
    for _ in range(8):  # each round leaves about a tenth of the error
        x, y, heading = line.at(s, beside)
        dx, dy = place.x - x + half_m * math.cos(heading), place.y - y + half_m * math.sin(heading)
        s = min(max(s + dx * math.cos(heading) + dy * math.sin(heading), 0.0), line.length_m)
        beside += dy * math.cos(heading) - dx * math.sin(heading)
    return s, beside


def turns_back(route: PlacedRoute) -> bool:
    """Return whether the route turns back between two points, because lanes of the net overlap wrongly."""
    marks, angles = route.line.marks, route.line.angles
    return any(
        route.s <= at <= route.goal_s and abs(wrap(b - a)) > _BACK_RAD
        for at, a, b in zip(marks[1:], angles, angles[1:], strict=False)
    )


def strays(network: RoadNetwork, route: PlacedRoute) -> tuple[float, float, float]:
    """Return how far the route leaves the road, m, and where (x, y in m); 0 if it stays on it.

    A lane of a map may end beside its successor; the line then goes straight from one to the other.
    """
    import numpy as np

    inside = _driven(route)
    depth = network.off_road_depth(np.array(inside or route.line.xy[:1]))
    k = int(depth.argmax())
    return (float(depth[k]), *inside[k]) if depth[k] > _STRAY_M else (0.0, 0.0, 0.0)


def passes(route: PlacedRoute, spots: Sequence[XY]) -> bool:
    """Return whether the route comes near one of some places."""
    driven = _driven(route)
    return any(math.dist(spot, xy) < _NEAR_SPOT_M for spot in spots for xy in driven)


def _driven(route: PlacedRoute) -> list[XY]:
    """Return the points of the line between start and goal."""
    return [xy for s, xy in zip(route.line.marks, route.line.xy, strict=True) if route.s <= s <= route.goal_s]


def passages_of(network: RoadNetwork, route: PlacedRoute) -> list[Passage]:
    """Return the junctions at which the scenario may happen: those after the trigger on the ego's route, in order.

    Places where two roads merely join do not count. Without a junction after the trigger, all on the route count.
    """
    passages = []
    for passage in route.line.passages:
        arms = {movement.from_edge for movement in network.movements_at(passage.junction) if "car" in movement.kinds}
        if route.s + 1.0 < passage.entry_s < route.goal_s and len(arms) > 2:
            passages.append(passage)
    behind = [passage_ for passage_ in passages if passage_.exit_s > route.s + route.trigger_m - TRIGGER_FAR_M]
    return behind or passages


def kerbs(network: RoadNetwork, line: RouteLine, s: float) -> tuple[float, float]:
    """Return offsets (m, left positive) from a line to just beyond the road's edge, on the right and on the left."""
    return _edge(network, line, s, -1), _edge(network, line, s, 1)


def _edge(network: RoadNetwork, line: RouteLine, s: float, side: int) -> float:
    import shapely

    steps = [side * _LOOK_STEP_M * k for k in range(4, int(_LOOK_M / _LOOK_STEP_M) + 1)]
    places = [line.at(s, offset)[:2] for offset in steps]
    on_road = shapely.contains_xy(network.drivable, [x for x, _ in places], [y for _, y in places])
    beyond = next((offset for offset, road in zip(steps, on_road, strict=True) if not road), steps[-1])
    return beyond + side * 0.75  # beyond the kerb
