"""What the `pdm` driver sees, in arrays and in the route's coordinates: itself and the others, now."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.compiled import FLAGS, FLOAT, FLOATS, INTS, TABLE, compiled
from foresee_dsl.drivers.pdm_route import Projection, Route
from foresee_dsl.drivers.protocol import ActorClass, EgoState, FloatArray, Observation, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker, Tracks

BoolArray = NDArray[np.bool_]

OWN_LANE_M = 1.2
"""Ours: an aligned actor this near the centreline is in the ego's lane, whatever foe's path runs there too."""
BRAKING_ALREADY_MPS2 = -1.0
"""Ours: who brakes this hard has decided to stop, and sticks to it (instead of a memory)."""
STUCK_TO_FACTOR = 1.5
"""Ours: it then accepts this much more braking before it gives up; covers the lag of the brakes."""
LEAST_REACH_M = 30.0


@dataclass(frozen=True)
class Actors:
    """The others as they are taken to be now; every array is [A].

    Attributes:
        table: [7, A] x, y, cos, sin, speed, half length, and the acceleration by which the speed may grow.
        heading: rad. half_width: m. pedestrian, obstacle: their classes.
    """

    table: FloatArray
    heading: FloatArray
    half_width: FloatArray
    pedestrian: BoolArray
    obstacle: BoolArray

    @property
    def count(self) -> int:
        """The number of actors, A."""
        return len(self.heading)

    @property
    def x(self) -> FloatArray:
        """East, m."""
        row: FloatArray = self.table[0]
        return row

    @property
    def y(self) -> FloatArray:
        """North, m."""
        row: FloatArray = self.table[1]
        return row

    @property
    def cos(self) -> FloatArray:
        """Of the heading."""
        row: FloatArray = self.table[2]
        return row

    @property
    def sin(self) -> FloatArray:
        """Of the heading."""
        row: FloatArray = self.table[3]
        return row

    @property
    def speed(self) -> FloatArray:
        """Along the heading, m/s, never negative."""
        row: FloatArray = self.table[4]
        return row

    @property
    def half_length(self) -> FloatArray:
        """Half of the length, m."""
        row: FloatArray = self.table[5]
        return row

    @property
    def speeds_up(self) -> FloatArray:
        """By how much it may speed up, m/s^2."""
        row: FloatArray = self.table[6]
        return row


class EgoPose(NamedTuple):
    """The middle of the rear axle on the route: lengths in m, heading error in rad."""

    s: float
    d: float
    heading_error: float
    speed: float


class EgoOnRoute(NamedTuple):
    """The ego along its route: m along it of the front and rear bumper, and what it can brake."""

    front_s: float
    rear_s: float
    state: EgoState
    strongest_braking_mps2: float

    def stops_within(self, wall_s: float, braking_mps2: float) -> bool:
        """Tell whether it can stop before a place with this braking (more, where it brakes already)."""
        if self.state.acceleration_mps2 < BRAKING_ALREADY_MPS2:
            braking_mps2 *= STUCK_TO_FACTOR
        room = wall_s - self.front_s
        return self.state.speed_mps < cfg.COAST_MPS or 2 * braking_mps2 * room >= self.state.speed_mps**2


@dataclass(frozen=True)
class Situation:
    """One step's input, read.

    Attributes:
        now: the others on the route, [A]. own: [A], in the ego's lane, in its direction.
        reach_m: how far ahead predictions are put on the route. signals: the colours that are known.
    """

    route: Route
    vehicle: VehicleLimits
    observation: Observation
    pose: EgoPose
    ego: EgoOnRoute
    actors: Actors
    now: Projection
    own: BoolArray
    reach_m: float
    signals: Mapping[str, SignalColour]

    @cached_property
    def near_junctions(self) -> tuple[int, ...]:
        """The indices of the junctions that the ego is in or comes to."""
        rear_s, seen_s = self.ego.rear_s, self.ego.front_s + cfg.JUNCTION_REACH_M
        ends = zip(self.route.junctions, self.route.junctions_end_s, strict=True)
        return tuple([k for k, (j, end_s) in enumerate(ends) if rear_s < end_s and j.stop_s < seen_s])


def read_situation(
    route: Route,
    vehicle: VehicleLimits,
    observation: Observation,
    tracks: Tracks | None = None,
    signals: Mapping[str, SignalColour] | None = None,
    pose: EgoPose | None = None,
) -> Situation:
    """Read an observation.

    Args:
        route: where it goes. vehicle: the ego. observation: of this step.
        tracks: the others as they were tracked; None: what a tracker makes of the observation at first sight.
        signals: the colours that are known; None: those of the observation.
        pose: the rear axle on the route, where that was found already.
    """
    state = observation.ego
    pose = pose_on(route, state, vehicle) if pose is None else pose
    actors = _read_actors(Tracker().update(observation) if tracks is None else tracks)
    reach = max(LEAST_REACH_M, pose.speed * cfg.HORIZON_S + 25.0)
    now = route.project(actors.x, actors.y, pose.s, max(reach, cfg.JUNCTION_REACH_M))
    return Situation(
        route=route,
        vehicle=vehicle,
        observation=observation,
        pose=pose,
        ego=_ego_on_route(state, vehicle, pose.s + to_centre(vehicle)),
        actors=actors,
        now=now,
        own=_in_lane(route, actors, now),
        reach_m=reach,
        signals=observation.signals if signals is None else signals,
    )


def to_centre(vehicle: VehicleLimits) -> float:
    """Return the distance from the rear axle to the middle of the footprint, m."""
    return vehicle.wheelbase_m + vehicle.front_overhang_m - vehicle.length_m / 2


def pose_on(route: Route, state: EgoState, vehicle: VehicleLimits) -> EgoPose:
    """Put the rear axle on the route."""
    back = to_centre(vehicle)
    x, y = state.x - back * math.cos(state.heading_rad), state.y - back * math.sin(state.heading_rad)
    s, d, error = route.locate(x, y, state.heading_rad)
    return EgoPose(s=s, d=d, heading_error=error, speed=max(state.speed_mps, 0.0))


def _ego_on_route(state: EgoState, vehicle: VehicleLimits, centre_s: float) -> EgoOnRoute:
    """Put the ego on its route."""
    strongest = min(vehicle.emergency_braking_mps2, cfg.FRICTION_SHARE * vehicle.friction * cfg.GRAVITY_MPS2)
    return EgoOnRoute(centre_s + vehicle.length_m / 2, centre_s - vehicle.length_m / 2, state, strongest)


def _read_actors(tracks: Tracks) -> Actors:
    """Take over what the tracker knows."""
    pedestrian, obstacle, speeds_up = _classes(tracks.kinds)
    table = np.empty((7, len(tracks.x)))
    table[0], table[1], table[4], table[6] = tracks.x, tracks.y, tracks.speed, speeds_up
    np.cos(tracks.heading, out=table[2])
    np.sin(tracks.heading, out=table[3])
    np.multiply(tracks.length, 0.5, out=table[5])
    return Actors(table, tracks.heading, tracks.width * 0.5, pedestrian, obstacle)


@lru_cache(maxsize=64)  # the same from step to step, until somebody comes or goes
def _classes(kinds: tuple[ActorClass, ...]) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Return who walks, what is an obstacle, and by how much each may speed up: [A]."""
    return (
        np.array([kind == "pedestrian" for kind in kinds], dtype=bool),
        np.array([kind == "obstacle" for kind in kinds], dtype=bool),
        np.array([cfg.SPEEDS_UP_MPS2.get(kind, 0.0) for kind in kinds], dtype=float),
    )


def _in_lane(route: Route, actors: Actors, now: Projection) -> BoolArray:
    """Return who drives in the ego's lane, in its direction: [A]."""
    own = np.empty(actors.count, dtype=bool)
    _find_own(actors.table, actors.pedestrian, now.d, now.index, route.grid, _ALIGNED_COSINE, own)
    return own


_ALIGNED_COSINE = math.cos(cfg.ALIGNED_RAD)


@compiled(TABLE, FLAGS, FLOATS, INTS, TABLE, FLOAT, FLAGS)
def _find_own(
    actors: FloatArray,
    pedestrian: BoolArray,
    d: FloatArray,
    index: NDArray[np.int64],
    grid: FloatArray,
    aligned_cosine: float,
    own: BoolArray,
) -> None:
    """Fill `own` [A]."""
    for a in range(len(own)):
        cosine = actors[2, a] * grid[2, index[a]] + actors[3, a] * grid[3, index[a]]
        own[a] = abs(d[a]) < OWN_LANE_M and cosine > aligned_cosine and not pedestrian[a]
