"""The proposals: which lateral offsets are tried, and who is in the way of each."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.compiling import FLOATS, compiled, inner
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.records import (
    ACTORS,
    EGOS,
    JUNCTIONS,
    LEADER,
    PREDICTION,
    ROUTE,
    FloatArray,
    IntArray,
    Records,
)
from foresee_dsl.kernels.pdm.route import least_room

FAR_M = 1e4
STANDS_MPS = 0.5
QUEUE_OFFSET_M = 0.6
"""Ours: a vehicle that stands this far beside the middle of the lane is parked; nearer to it, before a stop line, it
waits in a queue."""
QUEUE_REACH_M = 60.0
"""Ours: how far before a stop line a queue is taken to reach."""
MOST_PASSED = 2
_FARTHER_M = cfg.PASSABLE_GAP_M - cfg.MINIMUM_GAP_M
_MOST_OFFSETS = len(cfg.LATERAL_OFFSETS_M) + 4 * MOST_PASSED
_SPLIT = 2.0**27 + 1.0
"""Veltkamp's constant: splits a double into two halves whose products are exact."""


@compiled(EGOS, ACTORS, ROUTE, JUNCTIONS)
def find_passable(egos: Records, actors: Records, route: Records, junctions: Records) -> None:
    """Fill `passable` of the actors [A]: they stand for good, with room to pass in the ego's own lanes."""
    # Room between the thing's side and the edge of the lanes, on the better side.
    need = egos[0]["width"] + cfg.PASS_CLEARANCE_M + cfg.LANE_MARGIN_M
    for a in range(len(actors)):
        one = actors[a]
        one["passable"] = False
        if one["pedestrian"] or not one["speed"] < STANDS_MPS:
            continue
        s, d, road = one["s"], one["d"], route[one["point"]]
        room = max(road["left"] - d, road["right"] + d) - one["half_width"] >= need
        queues = False
        for j in range(len(junctions)):
            queues |= abs(d) < QUEUE_OFFSET_M and 0.0 < junctions[j]["stop_s"] - s < QUEUE_REACH_M
        one["passable"] = room and (one["obstacle"] or not queues)


@inner
def _blocking(ego: np.void, actors: Records) -> IntArray:
    """Return what is parked in the way, the nearest `MOST_PASSED`, the nearest first."""
    reach = max(25.0, ego["forward"] * cfg.HORIZON_S * 1.25)
    which, way, count = np.empty(MOST_PASSED, dtype=np.int64), np.full(MOST_PASSED, np.inf), 0
    for a in range(len(actors)):
        one = actors[a]
        ahead, air = one["s"] - ego["s"], one["half_width"] + ego["width"] / 2 + cfg.PASS_CLEARANCE_M
        if not (one["passable"] and -2 * ego["length"] < ahead < reach and abs(one["d"]) < air + 1.0):
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


@compiled(EGOS, ACTORS, ROUTE)
def find_offsets(egos: Records, actors: Records, route: Records) -> FloatArray:
    """Return the lateral offsets to try, [O]: the middle of the lane, PDM's others, those that pass what is parked."""
    ego = egos[0]
    left, right = least_room(route, ego["s"], ego["s"] + max(20.0, 2 * ego["forward"]))
    half = ego["width"] / 2 + cfg.LANE_MARGIN_M
    most_left, most_right = max(left - half, 0.0), max(right - half, 0.0)
    found, count = np.empty(_MOST_OFFSETS), 0
    for k in range(len(cfg.LATERAL_OFFSETS_M)):
        count = _add_offset(min(max(cfg.LATERAL_OFFSETS_M[k], -most_right), most_left), found, count)
    blocking = _blocking(ego, actors)
    for k in range(len(blocking)):
        one = actors[blocking[k]]
        beside, road = one["half_width"] + ego["width"] / 2 + cfg.PASS_CLEARANCE_M, route[one["point"]]
        left, right, d = road["left"] - half, road["right"] - half, one["d"]
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


@compiled(EGOS, ACTORS, PREDICTION, FLOATS)
def find_leaders(egos: Records, actors: Records, predicted: Records, offsets: FloatArray) -> Records:
    """Return what the ego must stay behind at each offset and frame, [O, T]; `FAR_M` away where there is nothing.

    Args:
        egos: [1]. actors: [A]. predicted: [A, T] their predictions. offsets: [O] that are tried.
    """
    found = np.empty((len(offsets), predicted.shape[1]), LEADER)
    front, side = egos[0]["s"] + egos[0]["front"], egos[0]["width"] / 2 + cfg.CORRIDOR_MARGIN_M
    for o in range(len(offsets)):
        for t in range(predicted.shape[1]):
            nearest, least = 0, FAR_M
            for a in range(len(actors)):
                one = predicted[a, t]
                rear = one["s"] - one["reach_s"]
                if rear > front - 1.0 and abs(one["d"] - offsets[o]) < one["reach_d"] + side:
                    if actors[a]["passable"]:
                        rear -= _FARTHER_M
                    if rear < least:
                        nearest, least = a, rear
            # What comes towards the ego is for the scores; the IDM knows followers only.
            speed = predicted[nearest, t]["speed_s"] if len(actors) > 0 else 0.0
            found[o, t]["s"], found[o, t]["speed"] = least, max(speed, 0.0)
    return found
