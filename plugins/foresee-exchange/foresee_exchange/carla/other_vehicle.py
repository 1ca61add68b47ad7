"""The vehicle that the ego meets in a junction: a movement that suits the family of the scenario, and the road before
and after it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.compile.roads.routing import RouteError, onward
from foresee_dsl.compile.roads.topology import Movement
from foresee_exchange.carla.ways import through_of

APPROACH_M = 80.0
"""Length of road before the junction for the other vehicle, m, if the road is that long (ours: 6 s at 50 km/h)."""
BEYOND_M = 30.0
"""Length of road after the junction, m (ours: the vehicle should not vanish in the ego's view)."""
LEAST_M = 12.0
"""If the road before the junction is shorter than this, m, the vehicle cannot gain speed (ours: two and a half car
lengths)."""
_MOST_EDGES = 12


@dataclass(frozen=True)
class OtherVehicle:
    """A vehicle that comes to the same junction.

    Attributes:
        named: the two edges to write; the shortest path between them is its route.
        begin_m: distance from the beginning of its route to its front at the start.
    """

    named: tuple[str, str]
    begin_m: float


def other_vehicle(network: RoadNetwork, passage: Passage, family: str, away_m: float) -> OtherVehicle | None:
    """Return the vehicle that meets the ego in a junction, or None if no movement conflicts with the ego's.

    Family 7: crossing traffic, preferably straight on. 8: oncoming traffic, straight on. 9: traffic that comes to the
    road that the ego turns into, preferably from the left.

    Args:
        away_m: intended distance of its start from the junction.
    """
    own = passage.movement
    junction = network.junctions[passage.junction]
    foes = [
        other
        for other in network.movements_at(passage.junction)
        if "car" in other.kinds and other.from_edge != own.from_edge and junction.conflicts(own.index, other.index)
    ]
    for foe in sorted(foes, key=lambda other: (_rank(network, own, other, family), other.from_lane, other.to_lane)):
        vehicle = _on_road(network, foe, away_m)
        if vehicle is not None:
            return vehicle
    return None


def _rank(network: RoadNetwork, own: Movement, other: Movement, family: str) -> tuple[float, ...]:
    """Return a sort key; the movement that suits the family best comes first."""
    angle = wrap(_heading(network, other) - _heading(network, own))
    straight = other.turn != "straight"
    if family == "8":
        return (straight, round(math.pi - abs(angle), 1))
    from_left = round(abs(wrap(angle + math.pi / 2)), 1)  # the vehicle drives to the right of the ego's direction
    if family == "9":
        return (other.to_edge != own.to_edge, straight, from_left)
    return (straight, round(abs(abs(angle) - math.pi / 2), 1), from_left)


def _heading(network: RoadNetwork, movement: Movement) -> float:
    line = network.lanes[movement.from_lane].line
    return line.at(line.length_m)[2]


def _on_road(network: RoadNetwork, foe: Movement, away_m: float) -> OtherVehicle | None:
    """Return the movement as a vehicle with enough road before and after it, as far as two edges determine its
    route."""
    before = _before(network, foe.from_edge)
    behind = _behind(network, foe.to_edge, before)
    while True:
        edges = (*before, *behind)
        named = through_of(network, edges)
        if len(named) == 2:
            break
        if len(behind) > 1:
            behind = behind[:-1]
        elif len(before) > 1:
            before = before[1:]
        else:
            return None
    try:
        line = network.line(edges)
    except RouteError:
        return None
    passage = line.passage(foe.junction)
    if passage is None or passage.entry_s < LEAST_M:
        return None
    begin = min(max(passage.entry_s - away_m, LEAST_M / 2), passage.entry_s - LEAST_M / 2)
    return OtherVehicle((named[0], named[1]), round(begin, 1))


def _before(network: RoadNetwork, edge: str) -> tuple[str, ...]:
    edges = [edge]
    while _length(network, edges) < APPROACH_M and len(edges) < _MOST_EDGES:
        into = [m for lane in network.edges[edges[0]].for_kind("car") for m in network.movements_into(lane.id)]
        into = [m for m in into if m.turn != "back" and m.from_edge not in edges]
        if not into:
            break
        edges.insert(0, min(into, key=lambda m: (m.turn != "straight", m.from_lane)).from_edge)
    return tuple(edges)


def _behind(network: RoadNetwork, edge: str, before: tuple[str, ...]) -> tuple[str, ...]:
    edges = [edge]
    while _length(network, edges) < BEYOND_M and len(edges) < _MOST_EDGES:
        ways = (m for m in onward(network, edges[-1], "car") if m.turn != "back" and m.to_edge not in (*edges, *before))
        way = next(ways, None)
        if way is None:
            break
        edges.append(way.to_edge)
    return tuple(edges)


def _length(network: RoadNetwork, edges: list[str]) -> float:
    return sum(network.edges[edge].drivable[0].line.length_m for edge in edges)
