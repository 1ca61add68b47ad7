"""The proposals: which lateral offsets are worth a thought, and who is in the way of each."""

from __future__ import annotations

import numpy as np

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.foes import STOP_S
from foresee_dsl.drivers.pdm.route import LEFT, RIGHT, IntArray, Projection, least_room
from foresee_dsl.drivers.pdm.situation import (
    A_SPEED,
    HALF_WIDTH,
    Actors,
    BoolArray,
    Car,
    EgoPose,
)
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.compiling import inner

FAR_M = 1e4
STANDS_MPS = 0.5
QUEUE_OFFSET_M = 0.6
"""Ours: who stands this far beside the middle of the lane is parked; nearer to it, before a stop line, in a queue."""
QUEUE_REACH_M = 60.0
"""Ours: how far before a stop line a queue is taken to reach."""
MOST_PASSED = 2
_FARTHER_M = cfg.PASSABLE_GAP_M - cfg.MINIMUM_GAP_M
_MOST_OFFSETS = len(cfg.LATERAL_OFFSETS_M) + 4 * MOST_PASSED
_SPLIT = 2.0**27 + 1.0
"""Veltkamp's constant: splits a double into two halves whose products are exact."""


@inner
def find_passable(
    actors: Actors, now: Projection, route: FloatArray, junctions: FloatArray, car: Car, found: BoolArray
) -> None:
    """Fill `found` [A]: who stands for good with room to pass in the ego's own lanes."""
    # Room between the thing's side and the edge of the lanes, on the better side.
    need = car.width + cfg.PASS_CLEARANCE_M + cfg.LANE_MARGIN_M
    for a in range(len(found)):
        found[a] = False
        if actors.pedestrian[a] or not actors.table[A_SPEED, a] < STANDS_MPS:
            continue
        s, d, k = now.s[a], now.d[a], now.point[a]
        room = max(route[k, LEFT] - d, route[k, RIGHT] + d) - actors.table[HALF_WIDTH, a] >= need
        queues = False
        for j in range(len(junctions)):
            queues |= abs(d) < QUEUE_OFFSET_M and 0.0 < junctions[j, STOP_S] - s < QUEUE_REACH_M
        found[a] = room and (actors.obstacle[a] or not queues)


@inner
def find_offsets(
    actors: Actors,
    now: Projection,
    can_pass: BoolArray,
    route: FloatArray,
    origin_s: float,
    pose: EgoPose,
    car: Car,
) -> FloatArray:
    """Return the lateral offsets to try: [O]."""
    left, right = least_room(route, origin_s, pose.s, pose.s + max(20.0, 2 * pose.speed))
    half = car.width / 2 + cfg.LANE_MARGIN_M
    most_left, most_right = max(left - half, 0.0), max(right - half, 0.0)
    found, count = np.empty(_MOST_OFFSETS), 0
    for k in range(len(cfg.LATERAL_OFFSETS_M)):
        count = _add_offset(min(max(cfg.LATERAL_OFFSETS_M[k], -most_right), most_left), found, count)
    blocking = _blocking(actors, now, can_pass, pose, car)
    for k in range(len(blocking)):
        a = blocking[k]
        beside = actors.table[HALF_WIDTH, a] + car.width / 2 + cfg.PASS_CLEARANCE_M
        left, right, d = route[now.point[a], LEFT] - half, route[now.point[a], RIGHT] - half, now.d[a]
        # The far sides too: from a stand only the larger offset turns the wheels far enough.
        if -right <= d + beside <= left:
            count = _add_offset(d + beside, found, count)
        if -right <= d - beside <= left:
            count = _add_offset(d - beside, found, count)
        if d + beside <= left:
            count = _add_offset(left, found, count)
        if d - beside >= -right:
            count = _add_offset(-right, found, count)
    return found[:count]


@inner
def _blocking(actors: Actors, now: Projection, can_pass: BoolArray, pose: EgoPose, car: Car) -> IntArray:
    """Return what is parked in the way, the nearest `MOST_PASSED`, the nearest first."""
    reach = max(25.0, pose.speed * cfg.HORIZON_S * 1.25)
    which, way, count = np.empty(MOST_PASSED, dtype=np.int64), np.full(MOST_PASSED, np.inf), 0
    for a in range(len(can_pass)):
        ahead, air = now.s[a] - pose.s, actors.table[HALF_WIDTH, a] + car.width / 2 + cfg.PASS_CLEARANCE_M
        if not (can_pass[a] and -2 * car.length < ahead < reach and abs(now.d[a]) < air + 1.0):
            continue
        count = min(count + 1, MOST_PASSED)
        k = count - 1
        if not ahead < way[k]:
            continue
        while k > 0 and ahead < way[k - 1]:
            which[k], way[k] = which[k - 1], way[k - 1]
            k -= 1
        which[k], way[k] = a, ahead
    return which[:count]


@inner
def _add_offset(offset: float, found: FloatArray, count: int) -> int:
    """Append an offset, rounded to a centimetre, to the first `count` where it is not among them; return how many."""
    rounded = to_cm(offset)
    for k in range(count):
        if found[k] == rounded:
            return count
    found[count] = rounded
    return count + 1


@inner
def to_cm(value: float) -> float:
    """Round to two decimals as Python's `round` does: the exact value decides, not that of a rounded product."""
    product = value * 100.0
    high = _SPLIT * value - (_SPLIT * value - value)
    missing = (high * 100.0 - product) + (value - high) * 100.0  # product + missing is exact (Dekker)
    whole: float = np.floor(product)
    beyond = (product - whole - 0.5) + missing
    if beyond > 0.0 or (beyond == 0.0 and whole % 2.0 == 1.0):
        whole += 1.0
    return whole / 100.0


@inner
def find_leaders(
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
    """Fill lead_s and lead_v [O, T] with the nearest in the way of each offset (the first row where there is none)."""
    front, side = ego_s + car.front, car.width / 2 + cfg.CORRIDOR_MARGIN_M
    for o in range(len(tried)):
        for t in range(s.shape[1]):
            nearest, least = 0, FAR_M
            for a in range(s.shape[0]):
                rear = s[a, t] - reach_s[a, t]
                if rear > front - 1.0 and abs(d[a, t] - tried[o]) < reach_d[a, t] + side:
                    if can_pass[a]:
                        rear -= _FARTHER_M
                    if rear < least:
                        nearest, least = a, rear
            # What comes towards the ego is for the scores; the IDM knows followers only.
            speed = speed_s[nearest, t] if s.shape[0] > 0 else 0.0
            lead_s[o, t], lead_v[o, t] = least, max(speed, 0.0)
