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
"""A path that ends further than this from the middle of every lane of the edges joins none. Ours: the half of a
wide lane and a margin."""


def joined_way(
    network: RoadNetwork, edges: Sequence[str | m.Ref], end: XY, kind: LaneKind
) -> tuple[tuple[str, ...], RouteLine]:
    """Return the edges that a vehicle drives over from a place on, the first being the one where that is, and their
    line, which begins on the lane nearest to it; a `RouteError` where it is on no lane of any, or there is no such way.
    """
    way = network.route_edges(m.EdgeRoute(edges=tuple(edges), shortest=True), kind)
    for k, edge in enumerate(way):
        for lane in network.edges[edge].for_kind(kind):
            s, beside_m = lane.line.project(*end)
            if abs(beside_m) <= BESIDE_M and -BESIDE_M <= s <= lane.line.length_m:
                nearest = min(network.edges[edge].for_kind(kind), key=lambda one: abs(one.line.project(*end)[1]))
                return way[k:], network.line(way[k:], start_lane=nearest.id, after_m=max(s, 0.0), kind=kind)
    raise RouteError(f"the path ends on no lane of {way[0]}", f"end it on the middle of a lane of {way[0]}")
