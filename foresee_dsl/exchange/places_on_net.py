"""Finds foreign start and end places on a road network, and the way between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from foresee_dsl.compile.geometry import RoadNetwork
from foresee_dsl.compile.polyline import wrap
from foresee_dsl.compile.roads import Lane
from foresee_dsl.compile.routeline import RouteLine
from foresee_dsl.compile.routing import RouteError, shortest_route

NEAR_M = 3.5
"""A place farther from every lane's centre is not on this map. Ours: a lane's width; the farthest of CARLA's places
lies 2.9 m off, on a map of another year."""
SAME_WAY_RAD = math.radians(60)
"""Whose lane a place is by its direction: with 60 degrees all 612 routes of Town01 to 10 find theirs (measured)."""
ALIKE_M = 0.1
"""Lanes of a junction that lie this near to each other may both be meant (ours); the shorter way decides."""


class Placed(Protocol):
    """A place with a direction; NaN for any direction."""

    @property
    def x(self) -> float: ...  # noqa: D102 - m

    @property
    def y(self) -> float: ...  # noqa: D102 - m

    @property
    def heading_rad(self) -> float: ...  # noqa: D102 - counter-clockwise from east


@dataclass(frozen=True)
class OnLane:
    """A place on a lane.

    Attributes:
        lane: outside junctions or inside one.
        at_m: along it. off_m: distance from its centre line.
        edges: the lane's edge; of a lane inside a junction the edge before and the edge after it.
    """

    lane: Lane
    at_m: float
    off_m: float
    edges: tuple[str, ...]


@dataclass(frozen=True)
class Way:
    """A way between two places: the edges, and where on their lanes it starts and ends."""

    edges: tuple[str, ...]
    start: OnLane
    end: OnLane
    length_m: float


def lanes_at(network: RoadNetwork, place: Placed, within_m: float = NEAR_M) -> list[OnLane]:
    """Return the car lanes that a place may be on, the nearest first; those that are hardly farther come along.

    Args:
        network: the roads.
        place: lanes whose direction differs by more than 60 degrees from its own are left out.
        within_m: no farther away than this.
    """
    found: list[OnLane] = []
    around = _movements_by_lane(network)
    for lane in network.lanes.values():
        if "car" not in lane.kinds or lane.edge in network.walking_areas or not _may_be_near(lane, place, within_m):
            continue
        edges = around.get(lane.id, ()) if lane.internal else ((lane.edge,),)
        s, _ = lane.line.project(place.x, place.y)
        at = min(max(s, 0.0), lane.line.length_m)
        x, y, heading = lane.line.at(at)
        off = math.hypot(x - place.x, y - place.y)
        turned = 0.0 if math.isnan(place.heading_rad) else abs(wrap(heading - place.heading_rad))
        if off <= within_m and turned <= SAME_WAY_RAD:
            found += [OnLane(lane, at, off, pair) for pair in edges]
    found.sort(key=lambda one: one.off_m)
    return [one for one in found if one.off_m <= found[0].off_m + ALIKE_M]


def way_between(network: RoadNetwork, start: Placed, end: Placed) -> Way:
    """Return the shortest way between two places.

    Raises:
        RouteError: a place is on no lane, or there is no way.
    """
    starts, ends = lanes_at(network, start), lanes_at(network, end)
    for name, found, place in (("start", starts, start), ("end", ends, end)):
        if not found:
            raise RouteError(f"its {name} ({place.x:.1f} m, {place.y:.1f} m) is on no car lane of the map")
    ways = [way for one in starts for other in ends if (way := _joined(network, one, other)) is not None]
    if not ways:
        raise RouteError(f"there is no way from {starts[0].edges[0]} to {ends[0].edges[-1]}")
    return min(ways, key=lambda way: (round(way.length_m + 10 * (way.start.off_m + way.end.off_m), 3), way.edges))


def through_of(network: RoadNetwork, edges: tuple[str, ...]) -> tuple[str, ...]:
    """Return the fewest edges between which the shortest ways make up a route: `route [first, ..., last]`."""
    kept = [edges[0]]
    at = 0
    while at < len(edges) - 1:
        reach = next(k for k in range(len(edges) - 1, at, -1) if _shortest(network, edges[at : k + 1]))
        kept.append(edges[reach])
        at = reach
    return tuple(kept)


def length_to(line: RouteLine, place: Placed, least_m: float) -> float:
    """Return the length along a line of the point nearest to a place, at or behind `least_m`."""
    # a route may pass a place's surroundings twice; headings tell the passes apart
    best = min(
        (math.hypot(x - place.x, y - place.y) + _turned(angle, place), s)
        for s, (x, y), angle in zip(line.marks, line.xy, line.angles, strict=True)
        if s >= least_m
    )
    return max(line.project(place.x, place.y, best[1])[0], least_m)


def _turned(angle: float, place: Placed) -> float:
    return 0.0 if math.isnan(place.heading_rad) else abs(wrap(angle - place.heading_rad))


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
            return None  # once around the block is no way that a route of two places means
        edges = (*start.edges[:-1], *between, *end.edges[1:])
    try:
        line = network.line(edges, start_lane=start.lane.id)
    except RouteError:
        return None
    return Way(edges, start, end, sum(b - a for a, b in pairwise(line.marks)))


def _shortest(network: RoadNetwork, edges: tuple[str, ...]) -> bool:
    if len(edges) == 2:
        return True
    try:
        return shortest_route(network, edges[0], edges[-1]) == edges
    except RouteError:
        return False


def _movements_by_lane(network: RoadNetwork) -> dict[str, tuple[tuple[str, str], ...]]:
    """For each lane inside a junction, the edges before and after it."""
    found: dict[str, dict[tuple[str, str], None]] = {}
    for movement in network.movements:
        if "car" in movement.kinds:
            for lane in movement.via:
                found.setdefault(lane, {})[movement.from_edge, movement.to_edge] = None
    return {lane: tuple(pairs) for lane, pairs in found.items()}


def _may_be_near(lane: Lane, place: Placed, within_m: float) -> bool:
    xs, ys = [x for x, _ in lane.shape], [y for _, y in lane.shape]
    return min(xs) - within_m <= place.x <= max(xs) + within_m and min(ys) - within_m <= place.y <= max(ys) + within_m
