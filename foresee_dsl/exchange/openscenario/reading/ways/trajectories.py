"""Where actors go: routes over the network's edges, and recorded trajectories as paths with speeds over time."""

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
from foresee_dsl.exchange.openscenario.reading.places import Places
from foresee_dsl.exchange.openscenario.reading.ways.curves import vertices
from foresee_dsl.exchange.outcome import NotExpressed

ON_LANE_M = 3.0
"""A place farther from every lane is off the road (what the language asks of a start, too)."""
AHEAD_M = 600.0
"""A route that the file does not give goes straight on for this length, m (ours: half a minute at 70 km/h)."""
PATH_M = 0.001
"""A path may leave out points of a trajectory that are at most this far from it, m (asked for)."""
SPEED_M = 0.05
"""Along its path an actor is at most this much from where the trajectory has it, before rounding (ours: below what
two simulators differ by)."""
_MOST_PIECES = 60
_MOST_ROUNDS = 20
"""The most rounds that are driven of a loop (ours: half a minute on one of 30 m)."""
_STEADY_S = 1.0
"""Weight of an error of 1 m/s at a knot relative to an error of 1 m in the distance covered. Without it the speeds
swing between knots faster than a vehicle's can (ours)."""
_FIRST_SLACK_MPS, _LAST_SLACK_MPS = 0.4, 0.005


@dataclass(frozen=True)
class Trajectory:
    """A trajectory: [N] s (NaN where it has no times), [N, 2] m and [N] rad of the middle of the footprint."""

    time_s: NDArray[np.float64]
    points: NDArray[np.float64]
    heading_rad: NDArray[np.float64]

    def poses(self) -> list[Pose]:
        """Return the poses of the middle of the footprint."""
        return [Pose(float(x), float(y), float(h)) for (x, y), h in zip(self.points, self.heading_rad, strict=True)]


@dataclass(frozen=True)
class SpeedProfile:
    """Speeds along a path: [K] s and [K] m/s; linear in between, constant before and after."""

    time_s: tuple[float, ...]
    speed_mps: tuple[float, ...]


def read_trajectory(trajectory: Element, places: Places, centre_m: float) -> Trajectory:
    """Return a `<Trajectory>`; the footprint's middle lies `centre_m` ahead of its reference point."""
    found = vertices(trajectory, places)
    if len(found) < 2:
        raise NotExpressed("trajectories: fewer than two vertices")
    points = np.array([(vertex.pose.x, vertex.pose.y) for vertex in found])
    heading = np.array([vertex.pose.heading_rad for vertex in found])
    if not all(vertex.has_heading for vertex in found):
        heading = _directions(points)
    points = points + centre_m * np.column_stack((np.cos(heading), np.sin(heading)))
    return Trajectory(_filled([vertex.time_s for vertex in found], points), points, heading)


def _filled(times: list[float], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times, those between two that are given by the way between; NaN where first or last is missing."""
    time_s = np.array(times)
    known = ~np.isnan(time_s)
    if known.all() or not (known[0] and known[-1]):
        return time_s
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    return np.asarray(np.interp(way, way[known], time_s[known]), dtype=np.float64)


def path_of(track: Trajectory) -> list[tuple[float, float]]:
    """Return the points of a path along a trajectory, in its order; none but the ends where it leaves them out."""
    steps = np.hypot(*np.diff(track.points, axis=0).T)
    kept = track.points[np.r_[True, steps > PATH_M / 10]]
    if len(kept) < 2:
        return []
    line = shapely.simplify(shapely.LineString(kept), PATH_M, preserve_topology=False)
    return [(float(x), float(y)) for x, y in line.coords]


def speed_profile(track: Trajectory) -> SpeedProfile | None:
    """Return the speeds that bring an actor along its path in the trajectory's times, in few pieces; None without
    times.

    Knots are chosen where the speed bends; then their speeds are fitted so that the way covered is right.
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
    """Return the lane that a pose is on, in its direction, or None."""
    return network.nearest_lane(pose.x, pose.y, pose.heading_rad, kind, within_m=ON_LANE_M)


def route_through(network: RoadNetwork, poses: Sequence[Pose], kind: LaneKind) -> tuple[str, ...]:
    """Return the edges through some places, the first being where an actor stands.

    Places off the lanes are left out, but for the first, which is a `NotExpressed`. With one place the way goes on as
    straight as it can.
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
    """Return edges continued as straight as possible, until the way is long enough or ends; a loop is driven round."""
    way = list(edges)
    while sum(network.edges[e].drivable[0].length_m for e in way) < AHEAD_M:
        onward = {m.to_edge: m for m in network.movements_from(way[-1], kind) if m.turn != "back"}
        found = sorted(onward.values(), key=lambda m: (m.turn != "straight", m.direction not in "sR", m.to_edge))
        if not found or way.count(found[0].to_edge) >= _MOST_ROUNDS:
            break
        way.append(found[0].to_edge)
    return tuple(way)


def _edges_at(network: RoadNetwork, near: NearLane, kind: LaneKind, *, first: bool) -> tuple[str, ...]:
    """Return the edge of a lane; of one inside a junction the edge before it (and the one after it)."""
    if not near.lane.internal:
        return (near.lane.edge,)
    for movement in network.movements:
        if near.lane.id in movement.via and kind in movement.kinds:
            return (movement.from_edge, movement.to_edge) if first else (movement.to_edge,)
    return ()


def _directions(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the direction of each point to the next, rad; where two are the same, that of the one before."""
    steps = np.diff(points, axis=0)
    found: list[float] = []
    for dx, dy in steps:
        found.append(math.atan2(dy, dx) if math.hypot(dx, dy) > 1e-6 else found[-1] if found else 0.0)
    return np.array([*found, found[-1]])


def _knots(time_s: NDArray[np.float64], speed: NDArray[np.float64], slack: float) -> NDArray[np.float64]:
    """Return the times at which a speed bends: Douglas and Peucker's choice, with a slack in m/s."""
    line = shapely.simplify(shapely.LineString(np.column_stack((time_s, speed))), slack, preserve_topology=False)
    return np.array([t for t, _ in line.coords])


def _fitted(
    time_s: NDArray[np.float64], way: NDArray[np.float64], knots: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the speeds at the knots whose way is nearest to `way`, and that are near to `speed` (least squares)."""
    unit = np.eye(len(knots))
    columns = [np.r_[_covered(time_s, knots, row), _STEADY_S * row] for row in unit]
    way = np.r_[way, _STEADY_S * speed]
    return np.asarray(np.linalg.lstsq(np.column_stack(columns), way, rcond=None)[0], dtype=np.float64)


def _covered(
    time_s: NDArray[np.float64], knots: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the way covered with a speed that is linear between knots, m at each time."""
    at_knots = np.r_[0.0, np.cumsum(np.diff(knots) * (speed[1:] + speed[:-1]) / 2)]
    k = np.clip(np.searchsorted(knots, time_s, side="right") - 1, 0, len(knots) - 2)
    dt = time_s - knots[k]
    slope = (speed[k + 1] - speed[k]) / (knots[k + 1] - knots[k])
    covered: NDArray[np.float64] = at_knots[k] + speed[k] * dt + slope * dt * dt / 2
    return covered


def thinned(points: Sequence[Pose]) -> list[Pose]:
    """Return poses that lie apart, for looking up a route along a trajectory."""
    kept = list(points[:1])
    for pose in points[1:]:
        if math.hypot(pose.x - kept[-1].x, pose.y - kept[-1].y) > ON_LANE_M * 2:
            kept.append(pose)
    return [*kept, points[-1]] if points and kept[-1] is not points[-1] else kept
