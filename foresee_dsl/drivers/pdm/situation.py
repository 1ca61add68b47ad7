"""What the `pdm` driver sees, as its kernels take it: itself and the others, now, on the route."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.foes import END_S, STOP_S
from foresee_dsl.drivers.pdm.route import COS, SIN, IntArray, Projection, locate, project
from foresee_dsl.drivers.protocol import ActorClass, FloatArray, VehicleLimits
from foresee_dsl.drivers.tracking import HEADING, LENGTH, SPEED, WIDTH
from foresee_dsl.drivers.tracking import X as TRACKED_X
from foresee_dsl.drivers.tracking import Y as TRACKED_Y
from foresee_dsl.kernels.compiling import inner

BoolArray = NDArray[np.bool_]

OWN_LANE_M = 1.2
"""Ours: an aligned actor this near the centreline is in the ego's lane, whatever foe's path runs there too."""
BRAKING_ALREADY_MPS2 = -1.0
"""Ours: who brakes this hard has decided to stop, and sticks to it (instead of a memory)."""
STUCK_TO_FACTOR = 1.5
"""Ours: it then accepts this much more braking before it gives up; covers the lag of the brakes."""
LEAST_REACH_M = 30.0
A_X, A_Y, A_COS, A_SIN, A_SPEED, HALF_LENGTH, SPEEDS_UP, HALF_WIDTH = range(8)
"""Rows of `Actors.table`."""
ALIGNED_COSINE = math.cos(cfg.ALIGNED_RAD)


class Actors(NamedTuple):
    """The others as they are taken to be now; every array is [A].

    Attributes:
        table: [8, A] x, y, cos, sin, speed, half length, the acceleration by which the speed may grow, half width.
        pedestrian, obstacle: their classes.
    """

    table: FloatArray
    pedestrian: BoolArray
    obstacle: BoolArray

    @property
    def number(self) -> int:
        """How many there are, A."""
        return len(self.pedestrian)

    @property
    def x(self) -> FloatArray:
        """East, m."""
        row: FloatArray = self.table[A_X]
        return row

    @property
    def y(self) -> FloatArray:
        """North, m."""
        row: FloatArray = self.table[A_Y]
        return row

    @property
    def cos(self) -> FloatArray:
        """Of the heading."""
        row: FloatArray = self.table[A_COS]
        return row

    @property
    def sin(self) -> FloatArray:
        """Of the heading."""
        row: FloatArray = self.table[A_SIN]
        return row

    @property
    def speed(self) -> FloatArray:
        """Along the heading, m/s, never negative."""
        row: FloatArray = self.table[A_SPEED]
        return row

    @property
    def half_length(self) -> FloatArray:
        """Half of the length, m."""
        row: FloatArray = self.table[HALF_LENGTH]
        return row

    @property
    def half_width(self) -> FloatArray:
        """Half of the width, m."""
        row: FloatArray = self.table[HALF_WIDTH]
        return row


class Car(NamedTuple):
    """What the kernels know of a vehicle.

    Attributes:
        length, width, wheelbase: m. front: m from the rear axle to the front bumper. back: m from the rear axle to the
            middle of the footprint.
        sharpest: the curvature that the wheels can do, 1/m. steer_max: rad. grip, acceleration, braking: m/s^2, what
            the tyres hold (as far as it is used), and what motor and brakes do at most. strongest: braking, m/s^2.
    """

    length: float
    width: float
    wheelbase: float
    front: float
    back: float
    sharpest: float
    steer_max: float
    grip: float
    acceleration: float
    braking: float
    strongest: float


class EgoNow(NamedTuple):
    """What the kernels know of the ego's state: place, heading, speed and acceleration."""

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float


class EgoPose(NamedTuple):
    """The middle of the rear axle on the route: lengths in m, heading error in rad."""

    s: float
    d: float
    heading_error: float
    speed: float


class EgoOnRoute(NamedTuple):
    """The ego along its route: m along it of the front and rear bumper, its motion, and what it can brake."""

    front_s: float
    rear_s: float
    speed_mps: float
    acceleration_mps2: float
    strongest_braking_mps2: float


def to_centre(vehicle: VehicleLimits) -> float:
    """Return the distance from the rear axle to the middle of the footprint, m."""
    return vehicle.wheelbase_m + vehicle.front_overhang_m - vehicle.length_m / 2


@lru_cache(maxsize=64)
def car_of(vehicle: VehicleLimits) -> Car:
    """Return what the kernels know of a vehicle."""
    grip = cfg.FRICTION_SHARE * vehicle.friction * cfg.GRAVITY_MPS2
    car = Car(
        length=vehicle.length_m,
        width=vehicle.width_m,
        wheelbase=vehicle.wheelbase_m,
        front=vehicle.wheelbase_m + vehicle.front_overhang_m,
        back=to_centre(vehicle),
        sharpest=math.tan(vehicle.steer_max_rad) / vehicle.wheelbase_m,
        steer_max=vehicle.steer_max_rad,
        grip=grip,
        acceleration=vehicle.acceleration_mps2,
        braking=vehicle.emergency_braking_mps2,
        strongest=min(vehicle.emergency_braking_mps2, grip),
    )
    return Car._make(map(float, car))  # the kernels take no integers


CAR, POSE = Car(*(0.0,) * len(Car._fields)), EgoPose(*(0.0,) * len(EgoPose._fields))
EGO = EgoOnRoute(*(0.0,) * len(EgoOnRoute._fields))
ACTORS = Actors(np.empty((8, 0)), np.empty(0, dtype=bool), np.empty(0, dtype=bool))
NOW = Projection(np.empty(0), np.empty(0), np.empty(0, dtype=np.int64))
"""Examples, for their types."""


@lru_cache(maxsize=64)  # the same from step to step, until somebody comes or goes
def classes(kinds: tuple[ActorClass, ...]) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Return who walks, what is an obstacle, and by how much each may speed up: [A]."""
    return (
        np.array([kind == "pedestrian" for kind in kinds], dtype=bool),
        np.array([kind == "obstacle" for kind in kinds], dtype=bool),
        np.array([cfg.SPEEDS_UP_MPS2.get(kind, 0.0) for kind in kinds], dtype=float),
    )


@inner
def pose_of(ego: EgoNow, car: Car, coarse: FloatArray, route: FloatArray, origin_s: float) -> EgoPose:
    """Put the rear axle on the route."""
    s, d, error = locate(ego.x, ego.y, ego.heading, car.back, coarse, route, origin_s)
    return EgoPose(s, d, error, max(ego.speed, 0.0))


@inner
def car_from(car: FloatArray) -> Car:
    """Return what an array of a car's numbers says; to hand over a named tuple takes Python 3 us."""
    return Car(car[0], car[1], car[2], car[3], car[4], car[5], car[6], car[7], car[8], car[9], car[10])


@inner
def look(
    tracked: FloatArray,
    speeds_up: FloatArray,
    route: FloatArray,
    origin_s: float,
    pose: EgoPose,
    car: Car,
    actors: Actors,
    now: Projection,
    own: BoolArray,
) -> tuple[float, float, float]:
    """Fill the table of `actors`, where they are on the route `now`, and who drives in the ego's lane, [A].

    Returns:
        How far ahead predictions are put on the route, and where the ego's front and rear bumper are, m.
    """
    table = actors.table
    for a in range(len(own)):
        heading = tracked[HEADING, a]
        table[A_X, a], table[A_Y, a] = tracked[TRACKED_X, a], tracked[TRACKED_Y, a]
        table[A_COS, a], table[A_SIN, a] = math.cos(heading), math.sin(heading)
        table[A_SPEED, a], table[SPEEDS_UP, a] = tracked[SPEED, a], speeds_up[a]
        table[HALF_LENGTH, a], table[HALF_WIDTH, a] = tracked[LENGTH, a] * 0.5, tracked[WIDTH, a] * 0.5
    reach = max(LEAST_REACH_M, pose.speed * cfg.HORIZON_S + 25.0)
    project(table[A_X], table[A_Y], route, origin_s, pose.s, max(reach, cfg.JUNCTION_REACH_M), now)
    for a in range(len(own)):
        i = now.point[a]
        cosine = table[A_COS, a] * route[i, COS] + table[A_SIN, a] * route[i, SIN]
        own[a] = abs(now.d[a]) < OWN_LANE_M and cosine > ALIGNED_COSINE and not actors.pedestrian[a]
    centre_s = pose.s + car.back
    return reach, centre_s + car.length / 2, centre_s - car.length / 2


@inner
def stops_within(ego: EgoOnRoute, wall_s: float, braking: float) -> bool:
    """Tell whether the ego can stop before a place with this braking (more, where it brakes already)."""
    if ego.acceleration_mps2 < BRAKING_ALREADY_MPS2:
        braking *= STUCK_TO_FACTOR
    room = wall_s - ego.front_s
    return ego.speed_mps < cfg.COAST_MPS or 2 * braking * room >= ego.speed_mps**2


@inner
def near_junctions(front_s: float, rear_s: float, junctions: FloatArray) -> IntArray:
    """Return the indices of the junctions that the ego is in or comes to."""
    found, count = np.empty(len(junctions), dtype=np.int64), 0
    for k in range(len(junctions)):
        if rear_s < junctions[k, END_S] and junctions[k, STOP_S] < front_s + cfg.JUNCTION_REACH_M:
            found[count] = k
            count += 1
    return found[:count]
