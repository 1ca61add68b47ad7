"""The proposals: the lateral offsets, the leader ahead on each, and the roll-out of each offset with each speed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, compiled, inner
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import FRAMES
from foresee_dsl.kernels.pdm.records import LEADER
from foresee_dsl.kernels.pdm.route import GRID_M, grid_point, least_room, profile_at

FAR_M = 1e4
QUEUE_OFFSET_M = 0.6
"""A standing vehicle at least this far from the lane's middle is parked, m; one nearer to the middle, before a stop
line, waits in a queue. Ours."""
QUEUE_REACH_M = 60.0
"""Assumed length of a queue before a stop line, m. Ours."""
MOST_PASSED = 2
_FARTHER_M = cfg.PASSABLE_GAP_M - cfg.MINIMUM_GAP_M
_MOST_OFFSETS = len(cfg.LATERAL_OFFSETS_M) + 4 * MOST_PASSED
_HELD = round(cfg.ACCELERATION_STEP_S / cfg.ROLLOUT_STEP_S)
"""Number of frames for which the IDM's acceleration stays constant."""
_SPLIT = 2.0**27 + 1.0
"""Veltkamp's constant, which splits a double into two halves whose products are exact."""


@compiled(r.EGOS, r.ACTORS, r.ROUTE, r.JUNCTIONS)
def find_passable(egos: Records, actors: Records, route: Records, junctions: Records) -> None:
    """Fill `passable` of the actors [A]: whether they are parked with room to pass in lanes of the ego's direction."""
    # The room needed between the actor's side and the edge of the lanes, on the wider side.
    need = egos[0]["width"] + cfg.PASS_CLEARANCE_M + cfg.LANE_MARGIN_M
    for a in range(len(actors)):
        actor = actors[a]
        actor["passable"] = False
        if actor["pedestrian"] or not actor["speed"] < cfg.SENSED_STANDS_MPS:
            continue
        s, d, road = actor["s"], actor["d"], route[actor["point"]]
        room = max(road["left"] - d, road["right"] + d) - actor["half_width"] >= need
        queues = False
        for j in range(len(junctions)):
            queues |= abs(d) < QUEUE_OFFSET_M and 0.0 < junctions[j]["stop_s"] - s < QUEUE_REACH_M
        actor["passable"] = room and (actor["obstacle"] or not queues)


@inner
def _blocking(ego: np.void, actors: Records) -> IntArray:
    """Return the indices of the nearest `MOST_PASSED` parked actors that block the lane, the nearest first."""
    reach = max(25.0, ego["forward"] * cfg.HORIZON_S * 1.25)
    which, away, count = np.empty(MOST_PASSED, dtype=np.int64), np.full(MOST_PASSED, np.inf), 0
    for a in range(len(actors)):
        actor = actors[a]
        ahead, air = actor["s"] - ego["s"], actor["half_width"] + ego["width"] / 2 + cfg.PASS_CLEARANCE_M
        if not (actor["passable"] and -2 * ego["length"] < ahead < reach and abs(actor["d"]) < air + 1.0):
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
def _add_offset(offset: float, offsets: FloatArray, count: int) -> int:
    """Append an offset, rounded to a centimetre, if it is not among the first `count`; return the new count."""
    rounded = to_cm(offset)
    for k in range(count):
        if offsets[k] == rounded:
            return count
    offsets[count] = rounded
    return count + 1


@inner
def to_cm(value: float) -> float:
    """Round to two decimals as Python's `round`: the exact value decides, not a rounded product."""
    product = value * 100.0
    high = _SPLIT * value - (_SPLIT * value - value)
    missing = (high * 100.0 - product) + (value - high) * 100.0  # product + missing is exact (Dekker's product)
    whole: float = np.floor(product)
    beyond = (product - whole - 0.5) + missing
    if beyond > 0.0 or (beyond == 0.0 and whole % 2.0 == 1.0):
        whole += 1.0
    return whole / 100.0


@compiled(r.EGOS, r.ACTORS, r.ROUTE)
def find_offsets(egos: Records, actors: Records, route: Records) -> FloatArray:
    """Return the lateral offsets to evaluate, [O]: the middle of the lane, PDM's other offsets, and those that pass
    parked actors.
    """
    ego = egos[0]
    left, right = least_room(route, ego["s"], ego["s"] + max(20.0, 2 * ego["forward"]))
    half = ego["width"] / 2 + cfg.LANE_MARGIN_M
    most_left, most_right = max(left - half, 0.0), max(right - half, 0.0)
    offsets, count = np.empty(_MOST_OFFSETS), 0
    for k in range(len(cfg.LATERAL_OFFSETS_M)):
        count = _add_offset(min(max(cfg.LATERAL_OFFSETS_M[k], -most_right), most_left), offsets, count)
    blocking = _blocking(ego, actors)
    for k in range(len(blocking)):
        actor = actors[blocking[k]]
        beside, road = actor["half_width"] + ego["width"] / 2 + cfg.PASS_CLEARANCE_M, route[actor["point"]]
        left, right, d = road["left"] - half, road["right"] - half, actor["d"]
        # The edges of the lanes are added as well: for a standing ego, only the larger offset turns the wheels far
        # enough.
        if -right <= d + beside <= left:
            count = _add_offset(d + beside, offsets, count)
        if -right <= d - beside <= left:
            count = _add_offset(d - beside, offsets, count)
        if d + beside <= left:
            count = _add_offset(left, offsets, count)
        if d - beside >= -right:
            count = _add_offset(-right, offsets, count)
    return offsets[:count]


@inner
def _find_leaders(ego: np.void, actors: Records, predicted: Records, offsets: FloatArray, every: int) -> Records:
    """Return the leaders as `find_leaders`, of every `every`th frame, [O, K]."""
    leaders = np.empty((len(offsets), (predicted.shape[1] - 1) // every + 1), LEADER)
    behind_s, side = ego["s"] + ego["front"] - 1.0, ego["width"] / 2 + cfg.CORRIDOR_MARGIN_M
    nearest = np.empty(len(offsets), np.int64)
    for k in range(leaders.shape[1]):
        t = k * every
        nearest[:] = 0
        for o in range(len(offsets)):
            leaders[o, k]["s"] = FAR_M
        for a in range(len(actors)):
            other = predicted[a, t]
            rear = other["s"] - other["reach_s"]
            if not rear > behind_s:
                continue
            if actors[a]["passable"]:
                rear -= _FARTHER_M
            for o in range(len(offsets)):
                if abs(other["d"] - offsets[o]) < other["reach_d"] + side and rear < leaders[o, k]["s"]:
                    nearest[o], leaders[o, k]["s"] = a, rear
        for o in range(len(offsets)):
            # The speed is at least 0: the IDM is a model of followers; the scores treat oncoming actors.
            speed = predicted[nearest[o], t]["speed_s"] if len(actors) > 0 else 0.0
            leaders[o, k]["speed"] = max(speed, 0.0)
    return leaders


@compiled(r.EGOS, r.ACTORS, r.PREDICTION, FLOATS)
def find_leaders(egos: Records, actors: Records, predicted: Records, offsets: FloatArray) -> Records:
    """Return the nearest actor ahead at each offset and frame, [O, T]; if there is no actor ahead, its place is
    `FAR_M`."""
    return _find_leaders(egos[0], actors, predicted, offsets, 1)


BRAKING = 4
"""The last four proposals brake: comfortably and as hard as possible, at the ego's offset and in the lane's middle."""
_PER_NEARING = 1.0 / (2.0 * math.sqrt(cfg.ACCELERATION_MPS2 * cfg.BRAKING_MPS2))
_SHARES = len(cfg.SPEED_SHARES)


@compiled(FLOAT, FLOAT, FLOAT)
def decay_length(speed: float, error: float, sharpest: float) -> float:
    """Return the length over which a lateral error decays (critically damped), m.

    It is longer for larger errors, so that the lateral acceleration stays below `OFFSET_LATERAL_MPS2` and the curvature
    below the limit of the wheels.
    """
    size = abs(error)
    comfort = speed * max(cfg.TRACK_TIME_S, math.sqrt(size / cfg.OFFSET_LATERAL_MPS2))
    return max(comfort, math.sqrt(size / sharpest), cfg.TRACK_LENGTH_M)


@inner
def allowed_speeds(ego: np.void, route: Records, wall_s: float) -> FloatArray:
    """Return the allowed speeds from the ego's position on, `GRID_M` apart.

    At these speeds the ego keeps the route's profile and can stop before a wall (infinite: no wall) with everyday
    braking, or with harder braking if that is needed.
    """
    braking, room, speed = cfg.PROFILE_BRAKING_MPS2, wall_s - ego["front"] - ego["s"], ego["forward"]
    if room < cfg.HOLD_M and speed < cfg.HOLD_MPS:
        room = 0.0
    if room > 0 and room < np.inf:
        braking = min(max(braking, speed * speed / (2 * room)), ego["strongest"])
    from_s = ego["s"]
    step = (from_s + GRID_M) - from_s  # the step with which numpy's arange computes
    allowed = np.empty(int(np.ceil((from_s + ego["forward"] * cfg.HORIZON_S + 16.0 - from_s) / GRID_M)))
    for i in range(len(allowed)):
        most = profile_at(route, from_s + i * step)
        if room < np.inf:
            most = min(most, math.sqrt(2 * braking * max(room - GRID_M * i, 0.0)))
        allowed[i] = max(most, 1e-3)
    return allowed


@inner
def _behind(speed: float, gap: float, nearing: float, top: float) -> float:
    """Return the acceleration of the IDM behind a leader, m/s^2."""
    per_gap = 1.0 / max(gap, 0.1)
    wish = (max((nearing * _PER_NEARING + cfg.HEADWAY_S) * speed, 0.0) + cfg.MINIMUM_GAP_M) * per_gap
    closing = max(nearing, 0.0)
    needed = closing * closing * per_gap * cfg.KINEMATIC_FACTOR
    return max(top - top * (wish * wish), -max(needed, cfg.BRAKING_MPS2))


class Motions(NamedTuple):
    """The proposals, and their motions along the route.

    A proposal is an offset with a wish, which is a target speed or a braking. Proposals with the same wish behind the
    same leaders share a motion.

    Attributes:
        heads_for: [P] the offset of each proposal, m. of: [P] the row of its motion.
        s, speed: [M, K] length along the route from the ego on and speed, in every `_HELD`th frame.
        acceleration: [M] the first acceleration, m/s^2.
    """

    heads_for: FloatArray
    of: IntArray
    s: FloatArray
    speed: FloatArray
    acceleration: FloatArray


@inner
def _first_with_same_leaders(leaders: Records) -> IntArray:
    """Return, for each offset, the first one that has the same leaders in all frames; `leaders`: [O, K]."""
    first = np.empty(len(leaders), np.int64)
    for o in range(len(leaders)):
        first[o], same = 0, False
        while not same and first[o] < o:
            same, other = True, leaders[first[o]]
            for k in range(leaders.shape[1]):
                same &= leaders[o, k]["s"] == other[k]["s"] and leaders[o, k]["speed"] == other[k]["speed"]
            if not same:
                first[o] += 1
    return first


@inner
def _integrate(
    ego: np.void, wishes: FloatArray, which: IntArray, leaders: Records, allowed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate the IDM: return s from the ego on and speed of all motions, both [M, K], and their first accelerations
    [M].

    The loop over motions is inside the loop over frames, so that the processor works on several motions at once.

    `wishes`: [2, M] share of the allowed speed, and largest acceleration. `which`: [M] row of `leaders` [O, K].
    `allowed`: speeds along the route, `GRID_M` apart.
    """
    last, top, count = len(allowed) - 1, min(cfg.ACCELERATION_MPS2, ego["motor"]), len(which)
    front_s, strongest = ego["front"], ego["strongest"]
    s, v, first = np.zeros(count), np.full(count, ego["forward"]), np.empty(count)
    all_s, all_v = np.empty((count, leaders.shape[1])), np.empty((count, leaders.shape[1]))
    for k in range(leaders.shape[1]):
        led = False
        for o in range(len(leaders)):
            led |= leaders[o, k]["s"] < FAR_M
        for m in range(count):
            share, most, way, speed = wishes[0, m], wishes[1, m], s[m], v[m]
            ahead = min((way + cfg.PROFILE_PREVIEW_S * speed) * (1.0 / GRID_M), float(last))
            i = max(int(ahead), 0)
            rise = allowed[i + 1] - allowed[i] if i < last else 0.0
            limit = ahead * rise + (allowed[i] - rise * i)
            ratio = speed / (limit * share)
            ratio *= ratio
            ratio *= ratio
            # The braking is at least that which the profile needs; to drive at a lower share of the speed, it is at
            # most comfortable.
            a = min(max(top - top * ratio, -cfg.BRAKING_MPS2), (limit - speed) * (1.0 / cfg.PROFILE_PREVIEW_S))
            if led:
                leader = leaders[which[m], k]
                gap = leader["s"] - front_s - ego["s"] - way
                a = min(a, _behind(speed, gap, speed - leader["speed"], top))
            a = max(min(a, most), -strongest)
            if k == 0:
                first[m] = a
            faster = max(speed + cfg.ACCELERATION_STEP_S * a, 0.0)
            all_s[m, k], all_v[m, k] = way, speed
            s[m], v[m] = way + (cfg.ACCELERATION_STEP_S / 2) * (speed + faster), faster
    return all_s, all_v, first


@inner
def find_motions(
    ego: np.void, actors: Records, predicted: Records, offsets: FloatArray, allowed: FloatArray
) -> Motions:
    """Return the proposals: each offset with each share of the speed, then the braking proposals.

    `predicted`: [A, T]. `allowed`: speeds along the route, `GRID_M` apart.
    """
    leaders, here = _find_leaders(ego, actors, predicted, offsets, _HELD), 0
    for o in range(len(offsets)):
        if abs(offsets[o] - ego["d"]) < abs(offsets[here] - ego["d"]):
            here = o
    first, count, motions = _first_with_same_leaders(leaders), count_proposals(len(offsets)), 0
    heads_for, of = np.empty(count), np.empty(count, np.int64)
    wishes, which = np.empty((2, count)), np.empty(count, np.int64)
    for p in range(count):
        braking = p - (count - BRAKING)
        if braking < 0:
            o, share, most, same = p // _SHARES, cfg.SPEED_SHARES[p % _SHARES], np.inf, p % _SHARES
            heads_for[p] = offsets[o]
            same += first[o] * _SHARES
        else:  # comfortably and as hard as possible: at the current offset, then in the middle of the lane
            o, heads_for[p] = (here, ego["d"]) if braking < 2 else (0, offsets[0])
            share, most = 1.0, -cfg.BRAKING_MPS2 if braking % 2 == 0 else -ego["strongest"]
            same = p - 2 if braking >= 2 and first[here] == first[0] else p
        if same < p:
            of[p] = of[same]
        else:
            of[p], which[motions], wishes[0, motions], wishes[1, motions] = motions, o, share, most
            motions += 1
    s, speed, acceleration = _integrate(ego, wishes[:, :motions], which[:motions], leaders, allowed)
    return Motions(heads_for, of, s, speed, acceleration)


@inner
def progress_of(ego: np.void, motions: Motions, p: int) -> float:
    """Return the length that a proposal drives within the horizon, m: the difference of its last and first `s`."""
    return float((motions.s[motions.of[p], -1] + ego["s"]) - ego["s"])


@inner
def _along(ego: np.void, s: FloatArray, speed: FloatArray, out: Records) -> None:
    """Fill s and speed of a proposal [T] from those of its motion [K]: between its frames they are interpolated."""
    for t in range(len(out)):
        k, frame, w = t // _HELD, out[t], (t % _HELD) / _HELD
        way, frame["speed"] = s[k], speed[k]
        if w > 0.0:
            way = (1 - w) * s[k] + w * s[k + 1]
            frame["speed"] = (1 - w) * speed[k] + w * speed[k + 1]
        frame["s"] = way + ego["s"]


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
def roll(ego: np.void, motions: Motions, p: int, out: Records) -> None:
    """Roll a proposal out in the route's coordinates: fill `out`, [T], except the footprints."""
    m, slope = motions.of[p], math.tan(max(-1.0, min(1.0, ego["heading_error"])))
    _along(ego, motions.s[m], motions.speed[m], out)
    _lateral(ego, motions.heads_for[p], slope, out)


@inner
def place_footprints(ego: np.void, route: Records, out: Records) -> None:
    """Fill the footprints' centres and headings of a proposal [T]."""
    for t in range(FRAMES):
        frame = out[t]
        s, d, tilt = frame["s"], frame["d"], frame["slope"]
        road = route[grid_point(route, s)]
        base_cos, base_sin = road["cos"], road["sin"]
        along, norm = s - road["s"], 1.0 / math.sqrt(1.0 + tilt * tilt)
        cos, sin = (base_cos - base_sin * tilt) * norm, (base_sin + base_cos * tilt) * norm
        frame["x"] = road["x"] + along * base_cos - d * base_sin + ego["centre"] * cos
        frame["y"] = road["y"] + along * base_sin + d * base_cos + ego["centre"] * sin
        frame["cos"], frame["sin"] = cos, sin


@inner
def count_proposals(offsets: int) -> int:
    """Return the number of proposals for a number of offsets."""
    return offsets * _SHARES + BRAKING
