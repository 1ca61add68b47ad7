"""Ways of actors: routes over the network's edges, and recorded trajectories as paths with speeds over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np
import shapely
from numpy.typing import NDArray

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.roads.network import NearLane, RoadNetwork
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_exchange.openscenario.losses import NotExpressed
from foresee_exchange.openscenario.reading.places import Places
from foresee_exchange.openscenario.reading.ways.curves import vertices

ON_LANE_M = 3.0
"""A place farther than this from every lane is off the road, m (the same limit as for a start in the language)."""
AHEAD_M = 600.0
"""Length of the straight continuation if the file has no route, m (ours: half a minute at 70 km/h)."""
PATH_M = 0.001
"""Largest distance between a path and a trajectory's point that it leaves out, m (a requirement)."""
SPEED_M = 0.05
"""Largest error of an actor's position along its path, m, before rounding (ours: below the difference between two
simulators)."""
_MOST_PIECES = 60
_MOST_ROUNDS = 20
"""Maximum number of rounds on a loop (ours: half a minute on one of 30 m)."""
_STEADY_S = 1.0
"""Weight of an error of 1 m/s at a knot relative to an error of 1 m in the distance covered. Without it the speeds
oscillate between knots beyond a vehicle's abilities (ours)."""
_FIRST_SLACK_MPS, _LAST_SLACK_MPS = 0.4, 0.005


@dataclass(frozen=True)
class Trajectory:
    """A trajectory of the footprint's centre: times [N] s (NaN without times), points [N, 2] m, headings [N] rad."""

    time_s: NDArray[np.float64]
    points: NDArray[np.float64]
    heading_rad: NDArray[np.float64]

    def poses(self) -> list[Pose]:
        """Return the poses of the middle of the footprint."""
        return [Pose(float(x), float(y), float(h)) for (x, y), h in zip(self.points, self.heading_rad, strict=True)]


@dataclass(frozen=True)
class SpeedProfile:
    """Speeds along a path: times [K] s and speeds [K] m/s; linear in between, constant before and after."""

    time_s: tuple[float, ...]
    speed_mps: tuple[float, ...]


def read_trajectory(trajectory: Element, places: Places, centre_m: float) -> Trajectory:
    """Return a `<Trajectory>`; the footprint's centre is `centre_m` ahead of its reference point."""
    line = vertices(trajectory, places)
    if len(line) < 2:
        raise NotExpressed("trajectories: fewer than two vertices")
    points = np.array([(vertex.pose.x, vertex.pose.y) for vertex in line])
    heading = np.array([vertex.pose.heading_rad for vertex in line])
    if not all(vertex.has_heading for vertex in line):
        heading = _directions(points)
    points = points + centre_m * np.column_stack((np.cos(heading), np.sin(heading)))
    return Trajectory(_filled([vertex.time_s for vertex in line], points), points, heading)


def _filled(times: list[float], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times, missing ones interpolated by distance; NaN remains if the first or last is missing."""
    time_s = np.array(times)
    has_time = ~np.isnan(time_s)
    if has_time.all() or not (has_time[0] and has_time[-1]):
        return time_s
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    return np.asarray(np.interp(way, way[has_time], time_s[has_time]), dtype=np.float64)


def path_of(track: Trajectory) -> list[tuple[float, float]]:
    """Return the points of a path along a trajectory; empty if the trajectory does not move."""
    steps = np.hypot(*np.diff(track.points, axis=0).T)
    moving = track.points[np.r_[True, steps > PATH_M / 10]]
    if len(moving) < 2:
        return []
    line = shapely.simplify(shapely.LineString(moving), PATH_M, preserve_topology=False)
    return [(float(x), float(y)) for x, y in line.coords]


def speed_profile(track: Trajectory) -> SpeedProfile | None:
    """Return the speeds, in few pieces, with which an actor keeps the trajectory's times along its path; None if the
    trajectory has no times.

    Knots are placed where the speed bends; then their speeds are fitted to the distances covered.
    """
    time_s = track.time_s
    if np.isnan(time_s).any() or not (np.diff(time_s) > 0).all():
        return None
    steps = np.hypot(*np.diff(track.points, axis=0).T)
    way = np.r_[0.0, np.cumsum(steps)]
    middle = (time_s[1:] + time_s[:-1]) / 2
    speed = np.interp(time_s, middle, steps / np.diff(time_s))
    slack = _FIRST_SLACK_MPS
    while True:
        knots = _knots(time_s, speed, slack)
        fitted = _fitted(time_s, way, knots, np.interp(knots, time_s, speed))
        off = np.abs(_covered(time_s, knots, fitted) - way).max()
        if off <= SPEED_M or slack < _LAST_SLACK_MPS or len(knots) >= _MOST_PIECES:
            return SpeedProfile(tuple(map(float, knots)), tuple(float(v) for v in np.maximum(fitted, 0.0)))
        slack /= 2


def nearest(network: RoadNetwork, pose: Pose, kind: LaneKind) -> NearLane | None:
    """Return the lane at a pose, in the pose's direction, or None."""
    return network.nearest_lane(pose.x, pose.y, pose.heading_rad, kind, within_m=ON_LANE_M)


def route_through(network: RoadNetwork, poses: Sequence[Pose], kind: LaneKind) -> tuple[str, ...]:
    """Return the edges through some places, the first of which is an actor's start.

    Places off the lanes are skipped, except the first, which raises `NotExpressed`.
    """
    edges: list[str] = []
    for k, pose in enumerate(poses):
        near = nearest(network, pose, kind) or (
            network.nearest_lane(pose.x, pose.y, None, kind, ON_LANE_M) if k else None
        )
        if near is None:
            if not k:
                raise NotExpressed("starts off the lanes")
            continue
        for edge in _edges_at(network, near, kind, first=not k):
            if edges and edge not in edges[-1:]:
                try:
                    edges += network.shortest_route(edges[-1], edge, kind)[1:]
                except RouteError as err:
                    raise NotExpressed("routes with no way over the network") from err
            elif not edges:
                edges.append(edge)
    return tuple(edges)


def straight_on(network: RoadNetwork, edges: Sequence[str], kind: LaneKind) -> tuple[str, ...]:
    """Return edges continued as straight as possible, until the route is long enough or ends; loops repeat."""
    way = list(edges)
    while sum(network.edges[e].drivable[0].length_m for e in way) < AHEAD_M:
        onward = {m.to_edge: m for m in network.movements_from(way[-1], kind) if m.turn != "back"}
        movements = sorted(onward.values(), key=lambda m: (m.turn != "straight", m.direction not in "sR", m.to_edge))
        if not movements or way.count(movements[0].to_edge) >= _MOST_ROUNDS:
            break
        way.append(movements[0].to_edge)
    return tuple(way)


def _edges_at(network: RoadNetwork, near: NearLane, kind: LaneKind, *, first: bool) -> tuple[str, ...]:
    """Return the edge of a lane; for a lane inside a junction the edge before it (with `first`) and the one after
    it."""
    if not near.lane.internal:
        return (near.lane.edge,)
    for movement in network.movements:
        if near.lane.id in movement.via and kind in movement.kinds:
            return (movement.from_edge, movement.to_edge) if first else (movement.to_edge,)
    return ()


def _directions(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the direction from each point to the next, rad; for equal points, the previous direction."""
    steps = np.diff(points, axis=0)
    directions: list[float] = []
    for dx, dy in steps:
        directions.append(math.atan2(dy, dx) if math.hypot(dx, dy) > 1e-6 else directions[-1] if directions else 0.0)
    return np.array([*directions, directions[-1]])


def _knots(time_s: NDArray[np.float64], speed: NDArray[np.float64], slack: float) -> NDArray[np.float64]:
    """Return the times at which a speed bends (Douglas and Peucker), with a tolerance in m/s."""
    line = shapely.simplify(shapely.LineString(np.column_stack((time_s, speed))), slack, preserve_topology=False)
    return np.array([t for t, _ in line.coords])


def _fitted(
    time_s: NDArray[np.float64], way: NDArray[np.float64], knots: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the speeds at the knots for which the distances covered fit `way` best and the speeds stay near `speed`
    (least squares)."""
    unit = np.eye(len(knots))
    columns = [np.r_[_covered(time_s, knots, row), _STEADY_S * row] for row in unit]
    way = np.r_[way, _STEADY_S * speed]
    return np.asarray(np.linalg.lstsq(np.column_stack(columns), way, rcond=None)[0], dtype=np.float64)


def _covered(
    time_s: NDArray[np.float64], knots: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance covered with a speed that is linear between knots, m at each time."""
    at_knots = np.r_[0.0, np.cumsum(np.diff(knots) * (speed[1:] + speed[:-1]) / 2)]
    k = np.clip(np.searchsorted(knots, time_s, side="right") - 1, 0, len(knots) - 2)
    dt = time_s - knots[k]
    slope = (speed[k + 1] - speed[k]) / (knots[k + 1] - knots[k])
    covered: NDArray[np.float64] = at_knots[k] + speed[k] * dt + slope * dt * dt / 2
    return covered


def thinned(points: Sequence[Pose]) -> list[Pose]:
    """Return poses with some distance between them, for the search of a route along a trajectory."""
    spaced = list(points[:1])
    for pose in points[1:]:
        if math.hypot(pose.x - spaced[-1].x, pose.y - spaced[-1].y) > ON_LANE_M * 2:
            spaced.append(pose)
    return [*spaced, points[-1]] if points and spaced[-1] is not points[-1] else spaced
