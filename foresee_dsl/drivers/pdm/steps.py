"""The further steps of a decision of the `pdm` driver, for drivers that put them together in another way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm.foes import FOES, FoeTable
from foresee_dsl.drivers.pdm.prediction import FRAMES
from foresee_dsl.drivers.pdm.proposals import FAR_M, find_leaders, find_offsets, find_passable
from foresee_dsl.drivers.pdm.reading import FoeMatches, Prediction, Situation
from foresee_dsl.drivers.pdm.rollout import decay_length
from foresee_dsl.drivers.pdm.route import IntArray, Projection, Route
from foresee_dsl.drivers.pdm.rules import find_wall, signal_brakings
from foresee_dsl.drivers.pdm.scoring import STEERS_ASIDE_M, compare, find_relevant
from foresee_dsl.drivers.pdm.situation import (
    ACTORS,
    CAR,
    EGO,
    NOW,
    POSE,
    Actors,
    BoolArray,
    Car,
    EgoOnRoute,
    EgoPose,
    car_of,
    stops_within,
)
from foresee_dsl.drivers.pdm.tracking import pedals, steer
from foresee_dsl.drivers.protocol import Control, EgoState, FloatArray, VehicleLimits
from foresee_dsl.kernels.compiling import CUBE, FLAG_TABLE, FLAGS, FLOAT, FLOATS, INTS, TABLE, compiled


class Rollout(NamedTuple):
    """All proposals over the horizon.

    Attributes:
        s, d, speed: [P, T] of the rear axle, on the route. x, y, cos, sin: [P, T], the footprint's centre and heading.
        centre_d: [P, T] offset of that centre. offset: [P] what it heads for. brake: [P] one of the braking ones.
        acceleration: [P] at the beginning, m/s^2.
    """

    s: FloatArray
    d: FloatArray
    speed: FloatArray
    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    centre_d: FloatArray
    offset: FloatArray
    brake: BoolArray
    acceleration: FloatArray


def passable(situation: Situation) -> BoolArray:
    """Return who stands for good with room to pass in the ego's own lanes: [A]."""
    found = np.zeros(situation.actors.number, dtype=bool)
    route, car = situation.route, car_of(situation.vehicle)
    _find_passable(situation.actors, situation.now, route.table, route.foe_table.junctions, car, found)
    return found


def offsets(situation: Situation, can_pass: BoolArray) -> FloatArray:
    """Return the lateral offsets to try, the middle of the lane first: PDM's, and those that pass what is parked."""
    route, car = situation.route, car_of(situation.vehicle)
    return _find_offsets(situation.actors, situation.now, can_pass, route.table, route.origin_s, situation.pose, car)


def leaders(
    situation: Situation, prediction: Prediction, tried: FloatArray, can_pass: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return for each offset and frame where the front of the ego must stay behind, and how fast that moves: [O, T]."""
    lead_s, lead_v = np.full((len(tried), FRAMES), FAR_M), np.zeros((len(tried), FRAMES))
    p, car = prediction, car_of(situation.vehicle)
    _find_leaders(p.s, p.d, p.reach_s, p.reach_d, p.speed_s, can_pass, tried, situation.pose.s, car, lead_s, lead_v)
    return lead_s, lead_v


def wall(situation: Situation, matches: FoeMatches, can_pass: BoolArray) -> float | None:
    """Return where the front bumper must stop, the nearest of all reasons; None when the way is free.

    Args:
        situation: what is seen.
        matches: who is on which foe's path, of the junctions that are near.
        can_pass: [A], what stands for good and can be passed (so that it is no queue).
    """
    route, ego = situation.route, situation.ego
    braking = signal_brakings(route, ego.strongest_braking_mps2, situation.signals)
    others = situation.actors, situation.now, situation.own, can_pass
    found = _find_wall(
        *others, matches.which, matches.on, matches.found, route.foe_table, braking, route.table, route.origin_s, ego
    )
    return found if found < math.inf else None


@compiled(EGO, FLOAT, FLOAT)
def stops_before(ego: EgoOnRoute, wall_s: float, braking: float) -> bool:
    """Tell whether the ego can stop before a place with this braking (more, where it brakes already)."""
    return stops_within(ego, wall_s, braking)


def conflicts(situation: Situation, rollout: Rollout, prediction: Prediction) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Compare footprints: [P, T] collides (and is to blame), passes closely, would collide within TTC_S."""
    actors, p, r = situation.actors, prediction, rollout
    hit, close, ttc = np.zeros((3, *r.s.shape), dtype=bool)
    if not actors.number:
        return hit, close, ttc
    # A driver may have cut frames out of a prediction.
    where = _whole(p.x), _whole(p.y), _whole(p.cos), _whole(p.sin), _whole(p.half_length)
    on_route = _whole(p.s), _whole(p.d), _whole(p.reach_s), _whole(p.reach_d)
    own = _whole(r.speed), _whole(r.x), _whole(r.y), _whole(r.cos), _whole(r.sin)
    car, begins_s, ends_s = car_of(situation.vehicle), float(r.s[0, 0]), float(r.s.max())
    who = np.empty(actors.number, dtype=bool)
    _find_relevant(*on_route, begins_s, ends_s, car, who)
    _compare(actors, who, *where, *own, np.abs(r.offset - situation.pose.d) > STEERS_ASIDE_M, car, hit, close, ttc)
    return hit, close, ttc


def _whole(values: FloatArray) -> FloatArray:
    """Return an array in one piece, the same where it is that already."""
    return values if values.flags.c_contiguous else np.ascontiguousarray(values)


def steering(route: Route, pose: EgoPose, offset: float, vehicle: VehicleLimits) -> float:
    """Return the front-wheel angle, rad, that leads to an offset (the law is `steer`'s)."""
    return _steering(pose, offset, car_of(vehicle), route.table, route.origin_s)


def control(angle_rad: float, acceleration: float, state: EgoState, vehicle: VehicleLimits) -> Control:
    """Turn wheel angle and acceleration into the protocol's shares; a car that shall stand is held."""
    return Control(*_control(angle_rad, acceleration, state.speed_mps, car_of(vehicle)))


def tracking_length(speed: float, error: FloatArray, vehicle: VehicleLimits) -> FloatArray:
    """Return `decay_length` of many errors, m: [N]."""
    length = np.empty(error.shape)
    sharpest = math.tan(vehicle.steer_max_rad) / vehicle.wheelbase_m
    _decay_lengths(speed, np.atleast_1d(error), sharpest, np.atleast_1d(length))
    return length


@compiled(ACTORS, NOW, TABLE, TABLE, CAR, FLAGS)
def _find_passable(
    actors: Actors, now: Projection, route: FloatArray, junctions: FloatArray, car: Car, found: BoolArray
) -> None:
    find_passable(actors, now, route, junctions, car, found)


@compiled(ACTORS, NOW, FLAGS, TABLE, FLOAT, POSE, CAR)
def _find_offsets(
    actors: Actors,
    now: Projection,
    can_pass: BoolArray,
    route: FloatArray,
    origin_s: float,
    pose: EgoPose,
    car: Car,
) -> FloatArray:
    return find_offsets(actors, now, can_pass, route, origin_s, pose, car)


@compiled(*(TABLE,) * 5, FLAGS, FLOATS, FLOAT, CAR, TABLE, TABLE)
def _find_leaders(
    s: FloatArray,
    d: FloatArray,
    reach_s: FloatArray,
    reach_d: FloatArray,
    speed_s: FloatArray,
    can_pass: BoolArray,
    tried: FloatArray,
    ego_s: float,
    car: Car,
    lead_s: FloatArray,
    lead_v: FloatArray,
) -> None:
    find_leaders(s, d, reach_s, reach_d, speed_s, can_pass, tried, ego_s, car, lead_s, lead_v)


@compiled(ACTORS, NOW, FLAGS, FLAGS, INTS, FLAG_TABLE, CUBE, FOES, FLOATS, TABLE, FLOAT, EGO)
def _find_wall(
    actors: Actors,
    now: Projection,
    own: BoolArray,
    can_pass: BoolArray,
    which: IntArray,
    on: BoolArray,
    found: FloatArray,
    foes: FoeTable,
    braking: FloatArray,
    route: FloatArray,
    origin_s: float,
    ego: EgoOnRoute,
) -> float:
    return find_wall(actors, now, own, can_pass, which, on, found, foes, braking, route, origin_s, ego)


@compiled(*(TABLE,) * 4, FLOAT, FLOAT, CAR, FLAGS)
def _find_relevant(
    s: FloatArray,
    d: FloatArray,
    reach_s: FloatArray,
    reach_d: FloatArray,
    begins_s: float,
    ends_s: float,
    car: Car,
    who: BoolArray,
) -> bool:
    return find_relevant(s, d, reach_s, reach_d, begins_s, ends_s, car, who)


@compiled(ACTORS, FLAGS, *(TABLE,) * 10, FLAGS, CAR, *(FLAG_TABLE,) * 3)
def _compare(
    actors: Actors,
    who: BoolArray,
    ax: FloatArray,
    ay: FloatArray,
    acos: FloatArray,
    asin: FloatArray,
    half_length: FloatArray,
    speed: FloatArray,
    x: FloatArray,
    y: FloatArray,
    cos: FloatArray,
    sin: FloatArray,
    aside: BoolArray,
    car: Car,
    hit: BoolArray,
    close: BoolArray,
    ttc: BoolArray,
) -> None:
    compare(actors, who, ax, ay, acos, asin, half_length, speed, x, y, cos, sin, aside, car, hit, close, ttc)


@compiled(POSE, FLOAT, CAR, TABLE, FLOAT)
def _steering(pose: EgoPose, offset: float, car: Car, route: FloatArray, origin_s: float) -> float:
    return steer(pose, offset, car, route, origin_s)


@compiled(FLOAT, FLOAT, FLOAT, CAR)
def _control(angle: float, acceleration: float, speed: float, car: Car) -> tuple[float, float, float]:
    return pedals(angle, acceleration, speed, car)


@compiled(FLOAT, FLOATS, FLOAT, FLOATS)
def _decay_lengths(speed: float, error: FloatArray, sharpest: float, length: FloatArray) -> None:
    """Fill `length` [N]."""
    for n in range(len(error)):
        length[n] = decay_length(speed, error[n], sharpest)
