"""The way that a vehicle takes on lanes from the end of a path on."""

from __future__ import annotations

from collections.abc import Sequence

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.language import model as m

BESIDE_M = 2.5
"""A path that ends further than this from the middle of every lane of the first edge joins none. Ours: the half of a
wide lane and a margin."""


def joined_way(
    network: RoadNetwork, edges: Sequence[str | m.Ref], end: XY, kind: LaneKind
) -> tuple[tuple[str, ...], RouteLine]:
    """Return the edges that a vehicle drives over from a place on, and their line, which begins on the lane nearest to
    the place; a `RouteError` where it is on no lane of the first edge, or there is no such way."""
    way = network.route_edges(m.EdgeRoute(edges=tuple(edges), shortest=True), kind)
    lanes = [(abs(lane.line.project(*end)[1]), lane.id) for lane in network.edges[way[0]].for_kind(kind)]
    beside_m, lane = min(lanes)
    s = network.lanes[lane].line.project(*end)[0]
    if beside_m > BESIDE_M or not -BESIDE_M <= s <= network.lanes[lane].line.length_m:
        raise RouteError(f"the path ends on no lane of {way[0]}", f"end it on the middle of a lane of {way[0]}")
    return way, network.line(way, start_lane=lane, after_m=max(s, 0.0), kind=kind)
