"""Vehicles that their lanes would hold up follow their way as a path at their speed, as a default controller does."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import shapely

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.exchange.openscenario.reading.ways.trajectories import nearest, straight_on

_LOOKS_S = 20.0
"""How far ahead a bend or a slower actor is looked for: what the vehicle drives in this time, s (ours: a third of the
usual run)."""
_SLOWER = 0.98
_IN_THE_WAY_M = 2.0
"""An actor that is at most this far from the way stands on it, m (ours: half a lane)."""
_STRAIGHT_M = 0.02
"""A path may leave out points that are at most this far from it, m (ours)."""


def path_if_held_up(
    network: RoadNetwork,
    edges: tuple[str, ...],
    middle: Pose,
    front: Pose,
    kind: LaneKind,
    speed_mps: float,
    others: Iterable[tuple[Pose, float]],
) -> list[XY]:
    """Return the way along some edges as a path of a vehicle's middle, where it could not keep its speed on the lanes.

    That is where limits and bends are slower, or one of the `others` (pose, m/s) is ahead and slower. Else nothing:
    SUMO moves it.
    """
    near = nearest(network, front, kind)
    if near is None or speed_mps <= 0:
        return []
    try:
        line = network.line(edges, start_lane=near.lane.id, kind=kind)
    except RouteError:
        return []
    begin, _ = line.project(middle.x, middle.y)
    ahead = [k for k, s in enumerate(line.marks) if s > begin + 1.0]
    seen = [k for k in ahead if line.marks[k] - begin < speed_mps * _LOOKS_S]
    if len(seen) < 2:
        return []
    allowed = min(line.limits[k] for k in seen)
    way = shapely.LineString([line.xy[k] for k in seen])
    blocked = any(
        slower < speed_mps * _SLOWER and way.distance(shapely.Point(pose.x, pose.y)) < _IN_THE_WAY_M
        for pose, slower in others
    )
    if allowed >= speed_mps * _SLOWER and not blocked:
        return []
    return _along(line, middle)


def way_on(network: RoadNetwork, end: Pose, kind: LaneKind) -> list[XY]:
    """Return the way along the lanes from a place on, as straight as possible; nothing where it is on none."""
    near = nearest(network, end, kind)
    if near is None or near.lane.internal:
        return []
    try:
        line = network.line(straight_on(network, (near.lane.edge,), kind), start_lane=near.lane.id, kind=kind)
    except RouteError:
        return []
    return _along(line, end)


def _along(line: RouteLine, start: Pose) -> list[XY]:
    """Return the points of a line from a place on, as far beside it as the place is."""
    begin, beside = line.project(start.x, start.y)
    points = [
        (x - beside * math.sin(angle), y + beside * math.cos(angle))
        for (x, y), s, angle in zip(line.xy, line.marks, line.angles, strict=True)
        if s > begin + 1.0
    ]
    if not points:
        return []
    kept = shapely.simplify(shapely.LineString([(start.x, start.y), *points]), _STRAIGHT_M)
    return [(float(x), float(y)) for x, y in np.asarray(kept.coords)]
