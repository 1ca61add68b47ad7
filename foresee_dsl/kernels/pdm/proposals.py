"""The proposals: which lateral offsets are tried, what is ahead on each, and how each with each speed is rolled out."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, compiled, inner
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import FRAMES
from foresee_dsl.kernels.pdm.records import LEADER
from foresee_dsl.kernels.pdm.route import GRID_M, grid_point, least_room, profile_at

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


@compiled(r.EGOS, r.ACTORS, r.ROUTE, r.JUNCTIONS)
def find_passable(egos: Records, actors: Records, route: Records, junctions: Records) -> None:
    """Fill `passable` of the actors [A]: parked, with room to pass in the ego's own lanes."""
    # Needed between the actor's side and the edge of the lanes, on the wider side.
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
    """Return the nearest `MOST_PASSED` parked actors that block the lane, the nearest first."""
    reach = max(25.0, ego["forward"] * cfg.HORIZON_S * 1.25)
    which, away, count = np.empty(MOST_PASSED, dtype=np.int64), np.full(MOST_PASSED, np.inf), 0
    for a in range(len(actors)):
        one = actors[a]
        ahead, air = one["s"] - ego["s"], one["half_width"] + ego["width"] / 2 + cfg.PASS_CLEARANCE_M
        if not (one["passable"] and -2 * ego["length"] < ahead < reach and abs(one["d"]) < air + 1.0):
            continue
        count = min(count + 1, MOST_PASSED)
        k = count - 1
        if not ahead < away[k]:
            continue
        while k > 0 and ahead < away[k - 1]:
            which[k], away[k] = which[k - 1], away[k - 1]
            k -= 1
        which[k], away[k] = a, ahead
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


@compiled(r.EGOS, r.ACTORS, r.ROUTE)
def find_offsets(egos: Records, actors: Records, route: Records) -> FloatArray:
    """Return the lateral offsets to try, [O]: the middle of the lane, PDM's others, those that pass parked
    actors."""
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
        # The lanes' edges too: from a stand only the larger offset turns the wheels far enough.
        if -right <= d + beside <= left:
            count = _add_offset(d + beside, found, count)
        if -right <= d - beside <= left:
            count = _add_offset(d - beside, found, count)
        if d + beside <= left:
            count = _add_offset(left, found, count)
        if d - beside >= -right:
            count = _add_offset(-right, found, count)
    return found[:count]


@compiled(r.EGOS, r.ACTORS, r.PREDICTION, FLOATS)
def find_leaders(egos: Records, actors: Records, predicted: Records, offsets: FloatArray) -> Records:
    """Return the nearest actor ahead at each offset and frame, [O, T]; `FAR_M` away where there is none."""
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
            # Oncoming actors are left to the scores: the IDM knows followers only.
            speed = predicted[nearest, t]["speed_s"] if len(actors) > 0 else 0.0
            found[o, t]["s"], found[o, t]["speed"] = least, max(speed, 0.0)
    return found


BRAKING = 4
"""How many proposals, the last ones, brake: comfortably and as hard as it can, where the ego is and in the middle."""
_HELD = round(cfg.ACCELERATION_STEP_S / cfg.ROLLOUT_STEP_S)
_PER_NEARING = 1.0 / (2.0 * math.sqrt(cfg.ACCELERATION_MPS2 * cfg.BRAKING_MPS2))
_SHARES = len(cfg.SPEED_SHARES)


@compiled(FLOAT, FLOAT, FLOAT)
def decay_length(speed: float, error: float, sharpest: float) -> float:
    """Return the length over which a lateral error decays (critically damped), m: longer for larger errors, so that the
    lateral acceleration stays under OFFSET_LATERAL and the curvature under what the wheels can do."""
    size = abs(error)
    comfort = speed * max(cfg.TRACK_TIME_S, math.sqrt(size / cfg.OFFSET_LATERAL_MPS2))
    return max(comfort, math.sqrt(size / sharpest), cfg.TRACK_LENGTH_M)


@inner
def allowed_speeds(ego: np.void, route: Records, wall_s: float) -> FloatArray:
    """Return the speeds allowed from the ego's place on, `GRID_M` apart: the route's profile, and a stop before a wall
    (infinite: there is none) with everyday braking, or as hard as is needed."""
    braking, room, speed = cfg.PROFILE_BRAKING_MPS2, wall_s - ego["front"] - ego["s"], ego["forward"]
    if room < cfg.HOLD_M and speed < cfg.HOLD_MPS:
        room = 0.0
    if room > 0 and room < np.inf:
        braking = min(max(braking, speed * speed / (2 * room)), ego["strongest"])
    from_s = ego["s"]
    step = (from_s + GRID_M) - from_s  # as numpy's arange has it
    allowed = np.empty(int(np.ceil((from_s + ego["forward"] * cfg.HORIZON_S + 16.0 - from_s) / GRID_M)))
    for i in range(len(allowed)):
        most = profile_at(route, from_s + i * step)
        if room < np.inf:
            most = min(most, math.sqrt(2 * braking * max(room - GRID_M * i, 0.0)))
        allowed[i] = max(most, 1e-3)
    return allowed


@inner
def _behind(speed: float, gap: float, nearing: float, top: float) -> float:
    """Return the IDM's acceleration behind a leader, m/s^2."""
    per_gap = 1.0 / max(gap, 0.1)
    wish = (max((nearing * _PER_NEARING + cfg.HEADWAY_S) * speed, 0.0) + cfg.MINIMUM_GAP_M) * per_gap
    closing = max(nearing, 0.0)
    needed = closing * closing * per_gap * cfg.KINEMATIC_FACTOR
    return max(top - top * (wish * wish), -max(needed, cfg.BRAKING_MPS2))


@inner
def _fill(frames: Records) -> None:
    """Interpolate s and speed of a proposal between frames that are `_HELD` apart."""
    for k in range(0, len(frames) - _HELD, _HELD):
        before, after = frames[k], frames[k + _HELD]
        for j in range(1, _HELD):
            w, one = j / _HELD, frames[k + j]
            one["s"] = (1 - w) * before["s"] + w * after["s"]
            one["speed"] = (1 - w) * before["speed"] + w * after["speed"]


@inner
def _longitudinal(
    ego: np.void, wishes: FloatArray, which: IntArray, leaders: Records, allowed: FloatArray, out: Records
) -> FloatArray:
    """Integrate the IDM: fill s and speed of all proposals, [P, T], and return their first accelerations [P].

    All of them in each frame, not one after the other: a processor then works on several at once.

    `wishes`: [2, P] share of the allowed speed and largest acceleration. `which`: [P] row of `leaders` [O, T].
    `allowed`: speeds along the route, `GRID_M` apart.
    """
    last, top, count = len(allowed) - 1, min(cfg.ACCELERATION_MPS2, ego["motor"]), len(which)
    front_s, strongest = ego["front"], ego["strongest"]
    s, v, first = np.zeros(count), np.full(count, ego["forward"]), np.empty(count)
    for k in range(0, FRAMES, _HELD):
        led = False
        for o in range(len(leaders)):
            led |= leaders[o, k]["s"] < FAR_M
        for p in range(count):
            share, most, way, speed = wishes[0, p], wishes[1, p], s[p], v[p]
            ahead = min((way + cfg.PROFILE_PREVIEW_S * speed) * (1.0 / GRID_M), float(last))
            i = max(int(ahead), 0)
            rise = allowed[i + 1] - allowed[i] if i < last else 0.0
            limit = ahead * rise + (allowed[i] - rise * i)
            ratio = speed / (limit * share)
            ratio *= ratio
            ratio *= ratio
            # Never gentler than the profile asks for, never (for a lower share alone) harder than comfortable.
            a = min(max(top - top * ratio, -cfg.BRAKING_MPS2), (limit - speed) * (1.0 / cfg.PROFILE_PREVIEW_S))
            if led:
                leader = leaders[which[p], k]
                gap = leader["s"] - front_s - ego["s"] - way
                a = min(a, _behind(speed, gap, speed - leader["speed"], top))
            a = max(min(a, most), -strongest)
            if k == 0:
                first[p] = a
            faster = max(speed + cfg.ACCELERATION_STEP_S * a, 0.0)
            out[p, k]["s"], out[p, k]["speed"] = way, speed
            s[p], v[p] = way + (cfg.ACCELERATION_STEP_S / 2) * (speed + faster), faster
    for p in range(count):
        _fill(out[p])
        for t in range(FRAMES):
            out[p, t]["s"] += ego["s"]
    return first


@inner
def _lateral(ego: np.void, offset: float, slope: float, out: Records) -> None:
    """Fill d and its slope of a proposal [T]: the error decays critically damped over the distance travelled."""
    error = ego["d"] - offset
    length = decay_length(ego["forward"], error, ego["sharpest"])
    steep = slope + error / length
    rest = np.empty(FRAMES)
    for t in range(FRAMES):
        rest[t] = math.exp(-(out[t]["s"] - ego["s"]) / length)
    for t in range(FRAMES):
        change = (error + steep * (out[t]["s"] - ego["s"])) * rest[t]
        out[t]["d"], out[t]["slope"] = offset + change, steep * rest[t] - change / length


@inner
def place_footprints(ego: np.void, route: Records, out: Records) -> None:
    """Fill the footprints' centres and headings, [P, T]."""
    for p in range(out.shape[0]):
        for t in range(FRAMES):
            one = out[p, t]
            s, d, tilt = one["s"], one["d"], one["slope"]
            road = route[grid_point(route, s)]
            base_cos, base_sin = road["cos"], road["sin"]
            along, norm = s - road["s"], 1.0 / math.sqrt(1.0 + tilt * tilt)
            cos, sin = (base_cos - base_sin * tilt) * norm, (base_sin + base_cos * tilt) * norm
            one["x"] = road["x"] + along * base_cos - d * base_sin + ego["centre"] * cos
            one["y"] = road["y"] + along * base_sin + d * base_cos + ego["centre"] * sin
            one["cos"], one["sin"] = cos, sin


@inner
def roll(
    ego: np.void, leaders: Records, offsets: FloatArray, allowed: FloatArray, out: Records, heads_for: FloatArray
) -> FloatArray:
    """Roll out in the route's coordinates: each offset with each share of the speed, then the braking proposals.

    Filled are `out`, [P, T], and the offset that each heads for, [P]; returned their first accelerations, [P].
    `leaders`: [O, T]. `allowed`: speeds along the route, `GRID_M` apart.
    """
    count, here, slope = len(heads_for), 0, math.tan(max(-1.0, min(1.0, ego["heading_error"])))
    for o in range(len(offsets)):
        if abs(offsets[o] - ego["d"]) < abs(offsets[here] - ego["d"]):
            here = o
    wishes, which = np.empty((2, count)), np.empty(count, np.int64)
    for p in range(count):
        braking = p - (count - BRAKING)
        if braking < 0:
            which[p], wishes[0, p], wishes[1, p] = p // _SHARES, cfg.SPEED_SHARES[p % _SHARES], np.inf
            heads_for[p] = offsets[which[p]]
        else:  # comfortably and as hard as it can: at its present offset, then in the middle of the lane
            which[p], heads_for[p] = (here, ego["d"]) if braking < 2 else (0, offsets[0])
            wishes[0, p], wishes[1, p] = 1.0, -cfg.BRAKING_MPS2 if braking % 2 == 0 else -ego["strongest"]
    first = _longitudinal(ego, wishes, which, leaders, allowed, out)
    for p in range(count):
        _lateral(ego, heads_for[p], slope, out[p])
    return first


@inner
def count_proposals(offsets: int) -> int:
    """Return how many proposals there are for so many offsets."""
    return offsets * _SHARES + BRAKING
