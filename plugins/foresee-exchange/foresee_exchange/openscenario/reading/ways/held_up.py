"""Vehicles that follow their lanes as a path at constant speed, as a default controller does, and the lane ahead."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import shapely

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, line_of
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.errors import CompileError
from foresee_dsl.simulate.actors.bend_speeds import BendSpeeds
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_exchange.openscenario.losses import SourceError
from foresee_exchange.openscenario.reading.roads import RoadPlace, Roads, linked_lane
from foresee_exchange.openscenario.reading.ways.trajectories import nearest, straight_on

_LOOKS_S = 20.0
"""Time horizon in which bends and slower actors ahead matter, s (ours: a third of the usual run)."""
_SLOWER = 0.98
_IN_THE_WAY_M = 2.0
"""An actor at most this far from the line of a way is on that way, m (ours: half a lane)."""
_NEAR_S = 1.5
"""An actor within this time ahead that is not faster holds a vehicle up, s (ours: SUMO's gap of 1 s plus half)."""
_STRAIGHT_M = 0.02
"""Largest distance between a path and a point that it leaves out, m (ours)."""
_STEP_M = 1.0
"""Sampling distance of lanes, m (ours: within 0.02 m of a bend of 10 m radius)."""
_MOST_ROADS = 1000


def path_along(
    network: RoadNetwork,
    edges: tuple[str, ...],
    middle: Pose,
    front: Pose,
    kind: LaneKind,
    if_held_up: tuple[float, Iterable[tuple[Pose, float]]] | None = None,
) -> list[XY]:
    """Return the way along some edges as a path of a vehicle's centre; empty if the vehicle is on none of the edges'
    lanes.

    `if_held_up`: its speed, m/s, and the other actors (pose, m/s). With it, a path is returned only if SUMO could not
    keep the speed on the lanes: limits or bends are slower, or an actor ahead is slower or too near. Otherwise the path
    is empty, and SUMO moves the vehicle.
    """
    near = nearest(network, front, kind)
    if near is None:
        return []
    try:
        line = network.line(edges, start_lane=near.lane.id, kind=kind)
    except RouteError:
        return []
    if if_held_up is not None and not _held_up(line, middle, *if_held_up):
        return []
    return _along(line, middle)


def _held_up(line: RouteLine, middle: Pose, speed_mps: float, others: Iterable[tuple[Pose, float]]) -> bool:
    begin, _ = line.project(middle.x, middle.y)
    seen = [k for k, s in enumerate(line.marks) if 1.0 < s - begin < speed_mps * _LOOKS_S]
    if speed_mps <= 0 or len(seen) < 2:
        return False
    if min(line.limits[k] for k in seen) < speed_mps * _SLOWER:
        return True
    way = shapely.LineString([line.xy[k] for k in seen])
    for pose, slower in others:
        point = shapely.Point(pose.x, pose.y)
        near = math.dist((pose.x, pose.y), (middle.x, middle.y)) < speed_mps * _NEAR_S
        if (near or slower < speed_mps * _SLOWER) and way.distance(point) < _IN_THE_WAY_M:
            return True
    return False


def held_by_tyres(path: Sequence[XY], spec: ModelSpec, speed_mps: float) -> float | None:
    """Return the speed to which a path's bends slow a vehicle down within the horizon, m/s, because its tyres hold no
    more on a dry road; None if no bend does."""
    line = line_of(tuple(path))
    lateral = lateral_limit_mps2(spec.name, DRY_FRICTION)
    bends = BendSpeeds(
        line.marks, line.angles, axle_m=spec.length_m, lateral_mps2=lateral, braking_mps2=spec.braking_mps2
    )
    seen = [v for s, v in zip(bends.marks, bends.speeds, strict=True) if s < speed_mps * _LOOKS_S]
    slowest = min(seen, default=speed_mps)
    return slowest if slowest < speed_mps * _SLOWER else None


def way_on(network: RoadNetwork, end: Pose, kind: LaneKind) -> list[XY]:
    """Return the way along the lanes from a place on, as straight as possible; empty if it is on no lane."""
    near = nearest(network, end, kind)
    if near is None or near.lane.internal:
        return []
    try:
        line = network.line(straight_on(network, (near.lane.edge,), kind), start_lane=near.lane.id, kind=kind)
    except RouteError:
        return []
    return _along(line, end)


def _along(line: RouteLine, start: Pose) -> list[XY]:
    """Return the points of a line from a place on, at the place's lateral offset."""
    begin, beside = line.project(start.x, start.y)
    points = [
        (x - beside * math.sin(angle), y + beside * math.cos(angle))
        for (x, y), s, angle in zip(line.xy, line.marks, line.angles, strict=True)
        if s > begin + 1.0
    ]
    if not points:
        return []
    return without_needless([(start.x, start.y), *points])


def without_needless(points: list[XY]) -> list[XY]:
    """Return a way without points on straight parts; at least two points."""
    return [(float(x), float(y)) for x, y in shapely.simplify(shapely.LineString(points), _STRAIGHT_M).coords]


def lane_ahead(roads: Roads, place: RoadPlace, length_m: float, *, onward: bool) -> list[Pose]:
    """Return the poses of a lane from a place on, at the place's lateral offset, straight on at junctions.

    `onward`: in the road's direction, whatever the direction of traffic; otherwise against it.
    """
    poses: list[Pose] = []
    road, lane, begin, offset = place.road, place.lane, place.s, place.offset
    try:
        for _ in range(_MOST_ROADS):
            for s, there in _lengths_along(roads, road, lane, begin, onward=onward):
                pose, lane = roads.on_lane(road, there, s, offset), there
                poses.append(pose if onward else Pose(pose.x, pose.y, pose.heading_rad + math.pi))
                if len(poses) * _STEP_M > length_m:
                    return poses
            step = roads.lane_behind(road, lane, onward=onward) if lane else None
            if step is None:
                break
            offset = -offset if step[2] != onward else offset
            road, lane, onward = step
            begin = 0.0 if onward else roads.length(road)
    except (CompileError, SourceError):
        pass  # the lane ends here, or the map is incomplete
    return poses


def _lengths_along(roads: Roads, road: str, lane: int, begin: float, *, onward: bool) -> Iterator[tuple[float, int]]:
    """Yield lengths along a road in a direction, each with the lane there, which begins as `lane`."""
    sections = roads.lane_sections(road)
    for k, (first, last, section) in enumerate(sections if onward else reversed(sections)):
        begun = begin < last if onward else begin > first
        if not begun and k < len(sections) - 1:
            continue
        low, high = (max(first, begin), last) if onward else (min(last, begin), first)
        steps = max(math.floor(abs(high - low) / _STEP_M), 0)
        for step in range(steps + 1):
            yield low + step * _STEP_M * (1 if onward else -1), lane
        if k < len(sections) - 1:
            lane = linked_lane(section, lane, onward=onward)
            if not lane:
                return
