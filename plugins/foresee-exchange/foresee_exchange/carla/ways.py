"""Paths of CARLA's routes on a road network: the lanes of their start and end places, and the way between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError, shortest_route
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.exchange.bridges import Heights

NEAR_M = 3.5
"""A place farther than this from every lane's centre, m, is not on this map. Ours: a lane's width; the farthest of
CARLA's places is 2.9 m off, on a map of another year."""
SAME_WAY_RAD = math.radians(60)
"""Largest difference between the directions of a place and its lane: with 60 degrees all 612 routes of Town01 to 10
are found (measured)."""
ALIKE_M, NEARLY_M = 0.1, 1.0
"""A place may be on any lane that is at most `ALIKE_M` farther away than the nearest lane (ours); the lane with the
shorter way is chosen. Lanes up to `NEARLY_M` farther count if the others need a long detour: lanes of a junction
overlap."""
TURNED_M = 20.0
"""Cost of a difference in direction, in metres of route length per radian (ours: so that roads that cross at 30 degrees
are told apart)."""
_SLACK_M = 2.0
"""A place counts as reached if it is at most this far behind the previous one, m (ours: the lengths of a road's lanes
differ by as much)."""
STOREY_M = 3.0
"""Difference in height that separates two storeys, m. Ours: less than the clearance of any bridge, and more than the
heights of routes' places above the road (up to 2 m)."""
INSIDE_M = 5.0
"""Extra cost of a lane inside a junction, in metres of route length (ours): where a road meets its junction, the road's
lane is preferred."""
DETOUR = 200.0
"""Cost of lateral distance to a lane, in metres of route length per metre. Ours: seven routes of Town03 start or end
0.1 m to 0.4 m nearer to a lane that takes a detour of 350 m or more; with 200 these seven change, and none of the
others of CARLA's four towns (measured)."""


@dataclass(frozen=True)
class OnLane:
    """A place on a lane.

    Attributes:
        lane: the lane, which may be inside a junction.
        at_m: position along it. off_m: distance from its centre line. turned_rad: difference between the directions.
        edges: the lane's edge; for a lane inside a junction the edges before and after it.
    """

    lane: Lane
    at_m: float
    off_m: float
    turned_rad: float
    edges: tuple[str, ...]


@dataclass(frozen=True)
class Way:
    """A way between two places: its edges, its start and end on lanes, and its length, m."""

    edges: tuple[str, ...]
    start: OnLane
    end: OnLane
    length_m: float


def lanes_at(network: RoadNetwork, place: Pose, heights: Heights | None = None) -> list[OnLane]:
    """Return the car lanes on which a place may be, the nearest first, up to `NEARLY_M` farther than the nearest.

    Lanes whose direction differs by more than 60 degrees from the place's are left out; if one road goes over another,
    only lanes at the place's height count.
    """
    places: list[OnLane] = []
    around = _around(network)
    for lane in network.lanes.values():
        if "car" not in lane.kinds or lane.edge in network.walking_areas or not _may_be_near(lane, place):
            continue
        edges = around.get(lane.id, ()) if lane.internal else ((lane.edge,),)
        s, _ = lane.line.project(place.x, place.y)
        at = min(max(s, 0.0), lane.line.length_m)
        x, y, heading = lane.line.at(at)
        off = math.hypot(x - place.x, y - place.y)
        turned = _turned(heading, place)
        if off <= NEAR_M and turned <= SAME_WAY_RAD:
            places += [OnLane(lane, at, off, turned, pair) for pair in edges]
    if place.z is not None and heights is not None and places:
        above = [abs(heights.at(place_.lane.id, place_.at_m) - place.z) for place_ in places]
        places = [place_ for place_, m in zip(places, above, strict=True) if m <= min(above) + STOREY_M]
    places.sort(key=lambda place_: place_.off_m)
    return [place_ for place_ in places if place_.off_m <= places[0].off_m + NEARLY_M]


def way_between(
    network: RoadNetwork, start: Pose, end: Pose, between: Sequence[Pose] = (), heights: Heights | None = None
) -> Way:
    """Return the shortest way between two places through others in their order; places on no lane are skipped.

    Raises:
        RouteError: the start or the end is on no lane, there is no way, or it uses a road twice.
    """
    starts, ends = lanes_at(network, start, heights), lanes_at(network, end, heights)
    for name, candidates, place in (("start", starts, start), ("end", ends, end)):
        if not candidates:
            raise RouteError(f"its {name} ({place.x:.1f} m, {place.y:.1f} m) is not on a car lane of the map")
    stops = [candidates for place in between if (candidates := lanes_at(network, place, heights))]
    if stops:
        ways = [_way_over(network, (starts, *stops, ends))]
    else:
        ways = [way for first in starts for other in ends if (way := _joined(network, first, other)) is not None]
    if not ways:
        raise RouteError(f"there is no way from {starts[0].edges[0]} to {ends[0].edges[-1]}")
    start_m, end_m = starts[0].off_m + ALIKE_M, ends[0].off_m + ALIKE_M

    def cost_m(way: Way) -> float:
        return round(way.length_m + _cost_m(way.start, start_m) + _cost_m(way.end, end_m), 3)

    way = min(ways, key=lambda way: (cost_m(way), way.edges))
    twice = next((edge for k, edge in enumerate(way.edges) if edge in way.edges[:k]), None)
    if twice is not None:
        raise RouteError(f"it uses {twice} twice, but a length along a route must mean a single place")
    return way


def _cost_m(place: OnLane, best_m: float) -> float:
    """Return the cost of placing a place on this lane, in metres of route; lateral distance costs far more beyond
    `best_m`."""
    beyond = max(place.off_m - best_m, 0.0)
    return 10 * place.off_m + DETOUR * beyond + INSIDE_M * place.lane.internal + TURNED_M * place.turned_rad


def through_of(network: RoadNetwork, edges: tuple[str, ...]) -> tuple[str, ...]:
    """Return the fewest edges that determine a route by the shortest paths between them: `route [first, ..., last]`."""
    named = [edges[0]]
    at = 0
    while at < len(edges) - 1:
        reach = next(k for k in range(len(edges) - 1, at, -1) if _shortest(network, edges[at : k + 1]))
        named.append(edges[reach])
        at = reach
    return tuple(named)


def length_to(line: RouteLine, place: Pose, least_m: float) -> float:
    """Return the position on a line that is nearest to a place, at `least_m` or later, m."""
    # A route may pass a place twice; the headings tell the two passages apart.
    best_m, best_s = math.inf, 0.0
    for s, (x, y), angle in zip(line.marks, line.xy, line.angles, strict=True):
        # The heading is compared only where the distance alone is not too large: at a few of thousands of points.
        if s >= least_m and (away_m := math.hypot(x - place.x, y - place.y)) < best_m:
            away_m += _turned(angle, place)
            if away_m < best_m:
                best_m, best_s = away_m, s
    return max(line.project(place.x, place.y, best_s)[0], least_m)


def _turned(angle: float, place: Pose) -> float:
    """Return the difference between a direction and a place's, rad; 0 for a place without a direction."""
    return 0.0 if math.isnan(place.heading_rad) else abs(wrap(angle - place.heading_rad))


def _way_over(network: RoadNetwork, stages: Sequence[Sequence[OnLane]]) -> Way:
    """Return the shortest way through places, each of which may be on several lanes; `RouteError` if there is none."""
    first = stages[0][0].off_m + ALIKE_M
    best: list[tuple[float, OnLane, tuple[str, ...], OnLane]] = [
        (_cost_m(previous, first), previous, previous.edges, previous) for previous in stages[0]
    ]
    for stage in stages[1:]:
        nearest = stage[0].off_m + ALIKE_M
        offers = []
        for other in stage:
            ways = [
                (cost + more[0] + _cost_m(other, nearest), start, (*edges, *more[1]), other)
                for cost, start, edges, previous in best
                if (more := _onward(network, previous, other)) is not None
            ]
            if ways:
                offers.append(min(ways, key=lambda way: (round(way[0], 3), way[2])))
        if not offers:
            raise RouteError(f"there is no way from {best[0][3].edges[0]} to {stage[0].edges[-1]}")
        best = offers
    cost, start, edges, end = min(best, key=lambda way: (round(way[0], 3), way[2]))
    network.line(edges, start_lane=start.lane.id)  # this raises an error if no lanes lead there
    return Way(edges, start, end, cost)


def _onward(network: RoadNetwork, first: OnLane, other: OnLane) -> tuple[float, tuple[str, ...]] | None:
    """Return the approximate distance from one place to the next, m, and the edges to append; None without a way."""
    ahead_m = other.at_m - first.at_m
    if first.edges == other.edges and ahead_m > -_SLACK_M:
        return max(ahead_m, 0.0), ()
    if first.edges[-1] == other.edges[0] and first.lane.internal and not other.lane.internal:
        return first.lane.line.length_m - first.at_m + other.at_m, ()
    try:
        edges = shortest_route(network, first.edges[-1], other.edges[0])
    except RouteError:
        return None
    if len(edges) == 1 and not (first.lane.internal or other.lane.internal):
        return None  # a way back to the same road would lead around the block
    length_m = sum(network.edges[edge].drivable[0].line.length_m for edge in edges)
    before_m = first.lane.line.length_m - first.at_m if first.lane.internal else -first.at_m
    behind_m = other.at_m if other.lane.internal else other.at_m - other.lane.line.length_m
    return max(length_m + before_m + behind_m, 0.0), (*edges[1:], *other.edges[1:])


def _joined(network: RoadNetwork, start: OnLane, end: OnLane) -> Way | None:
    edges: tuple[str, ...]
    if start.lane.id == end.lane.id and start.edges == end.edges and end.at_m > start.at_m:
        edges = start.edges
    else:
        try:
            between = shortest_route(network, start.edges[-1], end.edges[0])
        except RouteError:
            return None
        if start.lane.edge == end.lane.edge and not start.lane.internal and end.at_m <= start.at_m:
            return None  # a route of two places is not meant to lead around the block
        edges = (*start.edges[:-1], *between, *end.edges[1:])
    try:
        line = network.line(edges, start_lane=start.lane.id)
    except RouteError:
        return None
    begins = {lane: s for s, lane in reversed(line.pieces)}
    ends = {lane: s for s, lane in line.pieces}
    before_m = begins.get(start.lane.id, 0.0) + start.at_m if start.lane.internal else start.at_m
    rest_m = end.lane.line.length_m - end.at_m
    if end.lane.internal and end.lane.id in ends:
        until_m = ends[end.lane.id] + end.at_m
    elif end.lane.internal:  # the line uses another lane of the same movement
        until_m = line.length_m - network.edges[edges[-1]].drivable[0].line.length_m - rest_m
    else:
        until_m = line.length_m - rest_m
    return Way(edges, start, end, until_m - before_m)


def _shortest(network: RoadNetwork, edges: tuple[str, ...]) -> bool:
    if len(edges) == 2:
        return True
    try:
        return shortest_route(network, edges[0], edges[-1]) == edges
    except RouteError:
        return False


@lru_cache(maxsize=4)
def _around(network: RoadNetwork) -> dict[str, tuple[tuple[str, str], ...]]:
    """Return, for each lane inside a junction, the edges before and after it."""
    pairs_of_lane: dict[str, dict[tuple[str, str], None]] = {}
    for movement in network.movements:
        if "car" in movement.kinds:
            for lane in movement.via:
                pairs_of_lane.setdefault(lane, {})[movement.from_edge, movement.to_edge] = None
    return {lane: tuple(pairs) for lane, pairs in pairs_of_lane.items()}


def _may_be_near(lane: Lane, place: Pose) -> bool:
    xs, ys = [x for x, _ in lane.shape], [y for _, y in lane.shape]
    return min(xs) - NEAR_M <= place.x <= max(xs) + NEAR_M and min(ys) - NEAR_M <= place.y <= max(ys) + NEAR_M
