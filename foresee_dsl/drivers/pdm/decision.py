"""One decision of the `pdm` driver, from tracks to the proposal that is driven, in one call."""

from __future__ import annotations

import numpy as np

from foresee_dsl.drivers.pdm.foes import FoeTable
from foresee_dsl.drivers.pdm.prediction import (
    FRAMES,
    P_COS,
    P_D,
    P_HALF_LENGTH,
    P_S,
    P_SIN,
    P_X,
    P_Y,
    REACH_D,
    REACH_S,
    SPEED_S,
    match,
    move_on,
)
from foresee_dsl.drivers.pdm.proposals import find_leaders, find_offsets, find_passable
from foresee_dsl.drivers.pdm.rollout import (
    R_COS,
    R_S,
    R_SIN,
    R_SPEED,
    R_X,
    R_Y,
    allowed_speeds,
    before_wall,
    place,
    proposals,
    roll,
)
from foresee_dsl.drivers.pdm.route import IntArray, Projection
from foresee_dsl.drivers.pdm.rules import find_wall
from foresee_dsl.drivers.pdm.scoring import STEERS_ASIDE_M, choose, compare, find_relevant, rate
from foresee_dsl.drivers.pdm.situation import (
    Actors,
    BoolArray,
    Car,
    EgoNow,
    EgoOnRoute,
    EgoPose,
    car_from,
    look,
    near_junctions,
    pose_of,
)
from foresee_dsl.drivers.pdm.tracking import follow
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.compiling import FLAGS, FLOAT, FLOATS, INTS, TABLE, compiled, inner


@inner
def _near_foes(ego: EgoOnRoute, foes: FoeTable) -> IntArray:
    """Return the indices of the foes of the junctions that the ego is in or comes to."""
    found, count = np.empty(len(foes.walking), dtype=np.int64), 0
    near = near_junctions(ego.front_s, ego.rear_s, foes.junctions)
    for n in range(len(near)):
        for f in range(foes.first_of[near[n]], foes.first_of[near[n] + 1]):
            found[count] = f
            count += 1
    return found[:count]


@inner
def _best(
    pose: EgoPose,
    car: Car,
    route: FloatArray,
    origin_s: float,
    actors: Actors,
    can_pass: BoolArray,
    predicted: FloatArray,
    tried: FloatArray,
    wall_s: float,
) -> tuple[float, float]:
    """Roll out and score what is tried, and return offset and acceleration of the best proposal."""
    lead_s, lead_v, count = np.empty((len(tried), FRAMES)), np.empty((len(tried), FRAMES)), proposals(len(tried))
    s, d, reach_s, reach_d = predicted[P_S], predicted[P_D], predicted[REACH_S], predicted[REACH_D]
    find_leaders(s, d, reach_s, reach_d, predicted[SPEED_S], can_pass, tried, pose.s, car, lead_s, lead_v)

    rolled, offset, acceleration = np.empty((8, count, FRAMES)), np.empty(count), np.empty(count)
    allowed = allowed_speeds(route, origin_s, pose, before_wall(wall_s, pose, car))
    roll(pose, car, lead_s, lead_v, tried, allowed, rolled, offset, acceleration)

    shape = count, FRAMES
    hit, close, ttc = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
    who = np.empty(len(can_pass), np.bool_)
    if find_relevant(s, d, reach_s, reach_d, rolled[R_S, 0, 0], rolled[R_S].max(), car, who):
        place(route, origin_s, car, rolled)
        x, y, cos, sin = predicted[P_X], predicted[P_Y], predicted[P_COS], predicted[P_SIN]
        own = rolled[R_SPEED], rolled[R_X], rolled[R_Y], rolled[R_COS], rolled[R_SIN]
        aside = np.abs(offset - pose.d) > STEERS_ASIDE_M
        compare(actors, who, x, y, cos, sin, predicted[P_HALF_LENGTH], *own, aside, car, hit, close, ttc)

    score, collides = np.empty(count), np.empty(count, np.int64)
    rate(rolled, offset, acceleration, hit, close, ttc, pose, car, route, origin_s, score, collides)
    best = choose(score, collides, rolled[R_SPEED])
    return offset[best], acceleration[best]


@compiled(
    *(FLOAT,) * 5, FLOATS, TABLE, TABLE, FLOAT, TABLE, FLAGS, TABLE, INTS, TABLE, INTS,
    FLOATS, TABLE, FLAGS, FLAGS, FLOATS,
)  # fmt: skip
def decide(
    x: float,
    y: float,
    heading: float,
    speed: float,
    acceleration: float,
    car: FloatArray,
    coarse: FloatArray,
    route: FloatArray,
    origin_s: float,
    numbers: FloatArray,
    walking: BoolArray,
    points: FloatArray,
    first: IntArray,
    junctions: FloatArray,
    first_of: IntArray,
    braking: FloatArray,
    tracked: FloatArray,
    pedestrian: BoolArray,
    obstacle: BoolArray,
    speeds_up: FloatArray,
) -> tuple[float, float, tuple[float, float, float]]:
    """Try the proposals and take the best: the offset to steer for, m, the acceleration, and what `go_on` makes of it.

    Args:
        x, y, heading, speed, acceleration: of the ego. car: a `Car` as an array.
        coarse, route: of the route, from `origin_s` on.
        numbers, walking, points, first, junctions, first_of: a `FoeTable`. braking: [J] what the signals ask for.
        tracked: [9, A] a table of tracks. pedestrian, obstacle, speeds_up: their classes.
    """
    state, known, count = EgoNow(x, y, heading, speed, acceleration), car_from(car), len(pedestrian)
    pose = pose_of(state, known, coarse, route, origin_s)
    foes = FoeTable(numbers, walking, points, first, junctions, first_of)
    actors = Actors(np.empty((8, count)), pedestrian, obstacle)
    now, own = Projection(np.empty(count), np.empty(count), np.empty(count, dtype=np.int64)), np.empty(count, np.bool_)
    reach, front_s, rear_s = look(tracked, speeds_up, route, origin_s, pose, known, actors, now, own)
    ego = EgoOnRoute(front_s, rear_s, speed, acceleration, known.strongest)

    which = _near_foes(ego, foes)
    on, found = np.empty((count, len(which)), np.bool_), np.empty((3, count, len(which)))
    match(actors, own, which, foes, on, found)
    predicted = np.empty((10, count, FRAMES))
    move_on(actors, now, which, on, found, foes, route, origin_s, pose.s, reach, predicted)

    can_pass = np.empty(count, np.bool_)
    find_passable(actors, now, route, junctions, known, can_pass)
    tried = find_offsets(actors, now, can_pass, route, origin_s, pose, known)
    wall_s = find_wall(actors, now, own, can_pass, which, on, found, foes, braking, route, origin_s, ego)
    offset, wish = _best(pose, known, route, origin_s, actors, can_pass, predicted, tried, wall_s)
    return offset, wish, follow(state, pose, known, route, origin_s, offset, wish)
