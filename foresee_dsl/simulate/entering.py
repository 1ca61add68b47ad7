"""How those whom SUMO drives are put into it: on which of overlapping lanes, and who came to a junction first."""

from __future__ import annotations

import math
from itertools import pairwise

import shapely

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.geometry import RoadNetwork

SLOWEST_MPS = 0.1
"""Who is slower stands, and has come to where it is a while ago."""
CREEPS_MPS = 0.5
"""So fast, on the whole, comes into a junction who waits inside. Ours: it orders by the way inside those who wait."""
_APART_M = 1e-2
"""Lanes nearer to a place than this are equally near. Ours: netconvert's centimetre."""


def since_entry_s(inside_m: float, speed_mps: float, acceleration_mps2: float) -> float:
    """Return how long ago somebody seems to have come to a junction, s.

    Args:
        inside_m: how far inside its front is.
        speed_mps: as fast it came.
        acceleration_mps2: over 0 where it was slower before: as long as it gains speed now it has gained speed before,
            from a stand if the way is long enough, and until then it crept.
    """
    if acceleration_mps2 <= 0.0:
        return inside_m / max(speed_mps, SLOWEST_MPS)
    began = speed_mps * speed_mps - 2 * acceleration_mps2 * inside_m
    if began >= 0.0:
        return (speed_mps - math.sqrt(began)) / acceleration_mps2
    crept_m = inside_m - speed_mps * speed_mps / (2 * acceleration_mps2)
    return speed_mps / acceleration_mps2 + crept_m / CREEPS_MPS


def found_by_route(network: RoadNetwork, actor: PlacedActor) -> bool:
    """Say whether SUMO finds an actor's lane by its route: no other lane of it is as near.

    Otherwise it has to be told the lane, and looks at those of other routes, too.
    """
    lane = network.lanes.get(actor.lane)
    if lane is None:
        return False
    if not lane.internal:
        return True
    place = shapely.Point(actor.x, actor.y)
    own_m = place.distance(shapely.LineString(lane.shape))
    others = _inside(network, actor.route) - {lane.id}
    near = (name for name in others if _near(network.lanes[name].shape[0], actor, network.lanes[name].length_m))
    return all(place.distance(shapely.LineString(network.lanes[name].shape)) > own_m + _APART_M for name in near)


def _inside(network: RoadNetwork, route: tuple[str, ...]) -> set[str]:
    """The lanes inside junctions that SUMO looks at along a route: all of the edges between its edges."""
    steps = set(pairwise(route))
    return {
        via for edge, to in steps for move in network.movements_from(edge) if move.to_edge == to for via in move.via
    }


def _near(start: tuple[float, float], actor: PlacedActor, length_m: float) -> bool:
    return math.hypot(start[0] - actor.x, start[1] - actor.y) <= length_m + 1.0
