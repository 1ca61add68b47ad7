"""The proposals: which lateral offsets are worth a thought, who is in the way of each, and the roll-out of them all."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.compiled import CUBE, FLAGS, FLOAT, FLOATS, INTS, TABLE, compiled, inner
from foresee_dsl.drivers.pdm_prediction import TIMES_S, IntArray, Prediction
from foresee_dsl.drivers.pdm_route import GRID_M
from foresee_dsl.drivers.pdm_situation import BoolArray, Situation, to_centre
from foresee_dsl.drivers.protocol import FloatArray, VehicleLimits

FAR_M = 1e4
STANDS_MPS = 0.5
QUEUE_OFFSET_M = 0.6
"""Ours: who stands this far beside the middle of the lane is parked; nearer to it, before a stop line, in a queue."""
QUEUE_REACH_M = 60.0
"""Ours: how far before a stop line a queue is taken to reach."""
MOST_PASSED = 2
BRAKING = 4
"""How many proposals, the last ones, brake: comfortably and as hard as it can, where the ego is and in the middle."""
_FARTHER_M = cfg.PASSABLE_GAP_M - cfg.MINIMUM_GAP_M


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
    route, actors, now = situation.route, situation.actors, situation.now
    found = np.zeros(actors.count, dtype=bool)
    # Room between the thing's side and the edge of the lanes, on the better side.
    need = situation.vehicle.width_m + cfg.PASS_CLEARANCE_M + cfg.LANE_MARGIN_M
    for a in np.flatnonzero(actors.speed < STANDS_MPS).tolist():
        if actors.pedestrian[a]:
            continue
        s, d, k = float(now.s[a]), float(now.d[a]), int(now.index[a])
        room = max(float(route.left[k]) - d, float(route.right[k]) + d) - float(actors.half_width[a]) >= need
        queues = abs(d) < QUEUE_OFFSET_M and any(0.0 < j.stop_s - s < QUEUE_REACH_M for j in route.junctions)
        found[a] = room and (bool(actors.obstacle[a]) or not queues)
    return found


def offsets(situation: Situation, can_pass: BoolArray) -> FloatArray:
    """Return the lateral offsets to try, the middle of the lane first: PDM's, and those that pass what is parked."""
    route, pose, vehicle = situation.route, situation.pose, situation.vehicle
    left, right = route.room(pose.s, pose.s + max(20.0, 2 * pose.speed))
    half = vehicle.width_m / 2 + cfg.LANE_MARGIN_M
    most_left, most_right = max(left - half, 0.0), max(right - half, 0.0)
    found = [min(max(o, -most_right), most_left) for o in cfg.LATERAL_OFFSETS_M]
    if can_pass.any():
        found += _passing(situation, can_pass)
    # Equal ones once, in this order.
    return np.array(list(dict.fromkeys(round(o, 2) for o in found)))


def _passing(situation: Situation, can_pass: BoolArray) -> list[float]:
    """Return the offsets that pass what is parked in the way."""
    route, pose, actors, now = situation.route, situation.pose, situation.actors, situation.now
    vehicle, found = situation.vehicle, list[float]()
    half = vehicle.width_m / 2 + cfg.LANE_MARGIN_M
    reach, blocking = max(25.0, pose.speed * cfg.HORIZON_S * 1.25), []
    for a in np.flatnonzero(can_pass).tolist():
        ahead, air = float(now.s[a]) - pose.s, float(actors.half_width[a]) + vehicle.width_m / 2 + cfg.PASS_CLEARANCE_M
        if -2 * vehicle.length_m < ahead < reach and abs(float(now.d[a])) < air + 1.0:
            blocking.append((ahead, a))
    for _, a in sorted(blocking)[:MOST_PASSED]:
        beside = float(actors.half_width[a]) + vehicle.width_m / 2 + cfg.PASS_CLEARANCE_M
        left, right = float(route.left[now.index[a]]) - half, float(route.right[now.index[a]]) - half
        d = float(now.d[a])
        # The far sides too: from a stand only the larger offset turns the wheels far enough.
        found += [o for o in (d + beside, d - beside) if -right <= o <= left]
        found += [o for o, room in ((left, d + beside <= left), (-right, d - beside >= -right)) if room]
    return found


def leaders(
    situation: Situation, prediction: Prediction, tried: FloatArray, can_pass: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return for each offset and frame where the front of the ego must stay behind, and how fast that moves: [O, T]."""
    shape = (len(tried), len(TIMES_S))
    lead_s, lead_v = np.full(shape, FAR_M), np.zeros(shape)
    if len(prediction.s):
        front, side = situation.pose.s + _front(situation.vehicle), situation.vehicle.width_m / 2
        others = prediction.s, prediction.d, prediction.reach_s, prediction.reach_d, prediction.speed_s, can_pass
        _find_leaders(*others, tried, front, side + cfg.CORRIDOR_MARGIN_M, _FARTHER_M, lead_s, lead_v)
    return lead_s, lead_v


def roll_out(
    situation: Situation, tried: FloatArray, lead: tuple[FloatArray, FloatArray], wall_s: float | None
) -> Rollout:
    """Roll every proposal out: each offset with each share of the speed, then comfortable and hardest braking."""
    pose, vehicle, route = situation.pose, situation.vehicle, situation.route
    strongest, front = situation.ego.strongest_braking_mps2, _front(situation.vehicle)
    room, braking = _before_wall(None if wall_s is None else wall_s - front - pose.s, pose.speed, strongest)
    start = _Start(
        s=pose.s,
        d=pose.d,
        speed=pose.speed,
        slope=math.tan(max(-1.0, min(1.0, pose.heading_error))),
        end_s=pose.s + pose.speed * cfg.HORIZON_S + 16.0,
        room_m=room,
        braking_mps2=braking,
        strongest_mps2=strongest,
        top_mps2=min(cfg.ACCELERATION_MPS2, vehicle.acceleration_mps2),
        front_m=front,
        centre_m=to_centre(vehicle),
        sharpest=_sharpest(vehicle),
        grid_m=GRID_M,
        here=min(range(len(tried)), key=lambda k: abs(float(tried[k]) - pose.d)),
    )
    which, share, brake = _grid(len(tried))
    out, offset, first = np.empty((8, len(which), len(TIMES_S))), np.empty(len(which)), np.empty(len(which))
    profile, grid, origin_s = route.profile, route.grid, route.origin_s
    _roll(start, _IDM, _DECAY, *lead, tried, which, share, profile, grid, origin_s, out, offset, first)
    return Rollout._make((*out, offset, brake, first))


@cache
def _grid(count: int) -> tuple[IntArray, FloatArray, BoolArray]:
    """Return of each proposal which offset it has, which share of the speed, and whether it is a braking one: [P]."""
    which = [k for k in range(count) for _ in cfg.SPEED_SHARES]
    share = np.array([*cfg.SPEED_SHARES * count, *(1.0,) * BRAKING])
    brake = np.arange(len(share)) >= len(share) - BRAKING
    return np.array([*which, *(0,) * BRAKING], dtype=np.int64), share, brake


def _before_wall(room: float | None, speed: float, strongest_mps2: float) -> tuple[float, float]:
    """Return the room before a wall, m (infinite: there is none), and the braking to stop there: the everyday one, or
    as hard as is needed."""
    braking = cfg.PROFILE_BRAKING_MPS2
    if room is None:
        return math.inf, braking
    if room < cfg.HOLD_M and speed < cfg.HOLD_MPS:
        room = 0.0
    if room > 0:
        braking = min(max(braking, speed * speed / (2 * room)), strongest_mps2)
    return room, braking


def _front(vehicle: VehicleLimits) -> float:
    """Return the distance from the rear axle to the front bumper, m."""
    return vehicle.wheelbase_m + vehicle.front_overhang_m


def tracking_length(speed: float, error: FloatArray, vehicle: VehicleLimits) -> FloatArray:
    """Return `decay_length` of many errors: [N]."""
    length = np.empty(error.shape)
    _decay_lengths(speed, np.atleast_1d(error), _sharpest(vehicle), _DECAY, np.atleast_1d(length))
    return length


def decay_length(speed: float, error: float, vehicle: VehicleLimits) -> float:
    """Return the length over which a lateral error decays (critically damped), m.

    It is longer for larger errors, so that lateral acceleration stays under OFFSET_LATERAL and curvature under what the
    wheels can do.
    """
    return _decay_length(speed, error, _sharpest(vehicle), _DECAY)


def _sharpest(vehicle: VehicleLimits) -> float:
    """Return the curvature that the wheels can do, 1/m."""
    return math.tan(vehicle.steer_max_rad) / vehicle.wheelbase_m


class _Decay(NamedTuple):
    """Settings of `_decay_length`."""

    time_s: float
    lateral_mps2: float
    least_m: float


_DECAY = _Decay(cfg.TRACK_TIME_S, cfg.OFFSET_LATERAL_MPS2, cfg.TRACK_LENGTH_M)


@compiled(FLOAT, FLOAT, FLOAT, _DECAY)
def _decay_length(speed: float, error: float, sharpest: float, k: _Decay) -> float:
    size = abs(error)
    comfort = speed * max(k.time_s, math.sqrt(size / k.lateral_mps2))
    return max(comfort, math.sqrt(size / sharpest), k.least_m)


@compiled(FLOAT, FLOATS, FLOAT, _DECAY, FLOATS)
def _decay_lengths(speed: float, error: FloatArray, sharpest: float, k: _Decay, length: FloatArray) -> None:
    """Fill `length` [N]."""
    for n in range(len(error)):
        length[n] = _decay_length(speed, error[n], sharpest, k)


class _Start(NamedTuple):
    """What a roll-out begins with: the rear axle on the route, how fast it is, what holds for all proposals; `here` is
    the offset that it is nearest to, `grid_m` the spacing of the route's grid."""

    s: float
    d: float
    speed: float
    slope: float
    end_s: float
    room_m: float
    braking_mps2: float
    strongest_mps2: float
    top_mps2: float
    front_m: float
    centre_m: float
    sharpest: float
    grid_m: float
    here: int


_START = _Start(*(0.0,) * 13, 0)


class _Idm(NamedTuple):
    """Settings of `_longitudinal`."""

    braking_mps2: float
    minimum_gap_m: float
    headway_s: float
    per_nearing: float
    kinematic_factor: float
    preview_s: float
    step_s: float
    held: int


_IDM = _Idm(
    braking_mps2=cfg.BRAKING_MPS2,
    minimum_gap_m=cfg.MINIMUM_GAP_M,
    headway_s=cfg.HEADWAY_S,
    per_nearing=1.0 / (2.0 * math.sqrt(cfg.ACCELERATION_MPS2 * cfg.BRAKING_MPS2)),
    kinematic_factor=cfg.KINEMATIC_FACTOR,
    preview_s=cfg.PROFILE_PREVIEW_S,
    step_s=cfg.ACCELERATION_STEP_S,
    held=round(cfg.ACCELERATION_STEP_S / cfg.ROLLOUT_STEP_S),
)


@compiled(*(TABLE,) * 5, FLAGS, FLOATS, FLOAT, FLOAT, FLOAT, TABLE, TABLE)
def _find_leaders(
    s: FloatArray,
    d: FloatArray,
    reach_s: FloatArray,
    reach_d: FloatArray,
    speed_s: FloatArray,
    can_pass: BoolArray,
    tried: FloatArray,
    front: float,
    side: float,
    farther: float,
    lead_s: FloatArray,
    lead_v: FloatArray,
) -> None:
    """Fill lead_s and lead_v [O, T] with the nearest in the way of each offset (the first row where there is none)."""
    for o in range(len(tried)):
        for t in range(s.shape[1]):
            nearest, least = 0, FAR_M
            for a in range(s.shape[0]):
                rear = s[a, t] - reach_s[a, t]
                if rear > front - 1.0 and abs(d[a, t] - tried[o]) < reach_d[a, t] + side:
                    if can_pass[a]:
                        rear -= farther
                    if rear < least:
                        nearest, least = a, rear
            # What comes towards the ego is for the scores; the IDM knows followers only.
            lead_s[o, t], lead_v[o, t] = least, max(speed_s[nearest, t], 0.0)


@inner
def _allowed_speeds(values: FloatArray, origin_s: float, start: _Start) -> FloatArray:
    """Return the speeds allowed from its place on, `grid_m` apart: the route's profile, and a stop after the room."""
    from_s, room = start.s, start.room_m
    step = (from_s + start.grid_m) - from_s  # as numpy's arange has it
    profile = np.empty(int(np.ceil((start.end_s - from_s) / start.grid_m)))
    for i in range(len(profile)):
        place = min(max((from_s + i * step - origin_s) * (1.0 / start.grid_m), 0.0), len(values) - 1.001)
        k = max(int(place), 0)
        speed = values[k] + (place - k) * (values[k + 1] - values[k])
        if room < np.inf:
            speed = min(speed, math.sqrt(2 * start.braking_mps2 * max(room - start.grid_m * i, 0.0)))
        profile[i] = max(speed, 1e-3)
    return profile


@inner
def _behind(speed: float, gap: float, nearing: float, top: float, idm: _Idm) -> float:
    """Return the IDM's acceleration behind a leader, m/s^2."""
    per_gap = 1.0 / max(gap, 0.1)
    wish = (max((nearing * idm.per_nearing + idm.headway_s) * speed, 0.0) + idm.minimum_gap_m) * per_gap
    closing = max(nearing, 0.0)
    needed = closing * closing * per_gap * idm.kinematic_factor
    return max(top - top * (wish * wish), -max(needed, idm.braking_mps2))


@inner
def _fill(values: FloatArray, held: int) -> None:
    """Interpolate between frames that are `held` apart."""
    for k in range(0, len(values) - held, held):
        for j in range(1, held):
            w = j / held
            values[k + j] = (1 - w) * values[k] + w * values[k + held]


@inner
def _longitudinal(
    p: int,
    share: float,
    most: float,
    lead_s: FloatArray,
    lead_v: FloatArray,
    led: BoolArray,
    profile: FloatArray,
    start: _Start,
    idm: _Idm,
    out: FloatArray,
) -> float:
    """Integrate the IDM: rows 0 and 2 of `out` [8, P, T], s and v of proposal p; return the first acceleration."""
    frames, last, top = out.shape[2], len(profile) - 1, start.top_mps2
    s, v, first = 0.0, start.speed, 0.0
    for k in range(0, frames, idm.held):
        place = min((s + idm.preview_s * v) * (1.0 / start.grid_m), float(last))
        i = max(int(place), 0)
        rise = profile[i + 1] - profile[i] if i < last else 0.0
        allowed = place * rise + (profile[i] - rise * i)
        ratio = v / (allowed * share)
        ratio *= ratio
        ratio *= ratio
        # Never gentler than the profile asks for, never (for a lower share alone) harder than comfortable.
        a = min(max(top - top * ratio, -idm.braking_mps2), (allowed - v) * (1.0 / idm.preview_s))
        if led[k]:
            a = min(a, _behind(v, lead_s[k] - start.front_m - start.s - s, v - lead_v[k], top, idm))
        a = max(min(a, most), -start.strongest_mps2)
        if k == 0:
            first = a
        faster = max(v + idm.step_s * a, 0.0)
        out[0, p, k], out[2, p, k] = s, v
        s, v = s + (idm.step_s / 2) * (v + faster), faster
    _fill(out[0, p], idm.held)
    _fill(out[2, p], idm.held)
    for t in range(frames):
        out[0, p, t] += start.s
    return first


@inner
def _lateral(
    p: int, offset: float, grid: FloatArray, origin_s: float, start: _Start, decay: _Decay, out: FloatArray
) -> None:
    """Fill the other rows of `out` with where the tracking law leads to: a critically damped decay of the error over
    the way travelled."""
    error = start.d - offset
    length = _decay_length(start.speed, error, start.sharpest, decay)
    rate = start.slope + error / length
    for t in range(out.shape[2]):
        s = out[0, p, t]
        way = s - start.s
        rest = math.exp(-way / length)
        change = (error + rate * way) * rest
        tilt = rate * rest - change / length  # d'(s)
        d = offset + change
        k = min(max(int((s - origin_s) * (1.0 / start.grid_m)), 0), grid.shape[1] - 1)
        base_cos, base_sin = grid[2, k], grid[3, k]
        along, norm = s - (origin_s + k * start.grid_m), 1.0 / math.sqrt(1.0 + tilt * tilt)
        cos, sin = (base_cos - base_sin * tilt) * norm, (base_sin + base_cos * tilt) * norm
        out[1, p, t], out[7, p, t] = d, d + start.centre_m * tilt
        out[3, p, t] = grid[0, k] + along * base_cos - d * base_sin + start.centre_m * cos
        out[4, p, t] = grid[1, k] + along * base_sin + d * base_cos + start.centre_m * sin
        out[5, p, t], out[6, p, t] = cos, sin


@compiled(_START, _IDM, _DECAY, TABLE, TABLE, FLOATS, INTS, FLOATS, FLOATS, TABLE, FLOAT, CUBE, FLOATS, FLOATS)
def _roll(
    start: _Start,
    idm: _Idm,
    decay: _Decay,
    lead_s: FloatArray,
    lead_v: FloatArray,
    tried: FloatArray,
    which: IntArray,
    share: FloatArray,
    values: FloatArray,
    grid: FloatArray,
    origin_s: float,
    out: FloatArray,
    offset: FloatArray,
    first: FloatArray,
) -> None:
    """Fill `out` [8, P, T], the first rows of a `Rollout`, and offset and first acceleration, [P]."""
    profile, count = _allowed_speeds(values, origin_s, start), len(which)
    led = np.zeros(out.shape[2], dtype=np.bool_)
    for k in range(0, len(led), idm.held):
        for o in range(len(tried)):
            led[k] |= lead_s[o, k] < FAR_M
    for p in range(count):
        o, most, braking = which[p], np.inf, p - (count - BRAKING)
        offset[p] = tried[o]
        if braking >= 0:  # comfortably and as hard as it can: without steering aside, then in the middle of the lane
            most = -idm.braking_mps2 if braking % 2 == 0 else -start.strongest_mps2
            if braking < 2:
                o, offset[p] = start.here, start.d
        first[p] = _longitudinal(p, share[p], most, lead_s[o], lead_v[o], led, profile, start, idm, out)
        _lateral(p, offset[p], grid, origin_s, start, decay, out)
