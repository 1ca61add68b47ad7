"""The roll-out of all proposals: each offset with each share of the speed, then comfortable and hardest braking."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.prediction import FRAMES
from foresee_dsl.drivers.pdm.proposals import FAR_M
from foresee_dsl.drivers.pdm.route import COS, GRID_M, PROFILE, SIN, IntArray, X, Y, grid_point
from foresee_dsl.drivers.pdm.situation import BoolArray, Car, EgoPose
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.compiling import inner

BRAKING = 4
"""How many proposals, the last ones, brake: comfortably and as hard as it can, where the ego is and in the middle."""
R_S, R_D, R_SPEED, R_X, R_Y, R_COS, R_SIN, TILT = range(8)
"""Rows of a roll-out, as the first ones of `Rollout`; and the slope of the way, d'(s)."""
_HELD = round(cfg.ACCELERATION_STEP_S / cfg.ROLLOUT_STEP_S)
_PER_NEARING = 1.0 / (2.0 * math.sqrt(cfg.ACCELERATION_MPS2 * cfg.BRAKING_MPS2))
_SHARES = len(cfg.SPEED_SHARES)


class Wall(NamedTuple):
    """The room before a wall, m (infinite: there is none), and the braking to stop there: the everyday one, or as hard
    as is needed."""

    room: float
    braking: float


@inner
def decay_length(speed: float, error: float, sharpest: float) -> float:
    """Return the length over which a lateral error decays (critically damped), m.

    It is longer for larger errors, so that lateral acceleration stays under OFFSET_LATERAL and curvature under what the
    wheels can do.
    """
    size = abs(error)
    comfort = speed * max(cfg.TRACK_TIME_S, math.sqrt(size / cfg.OFFSET_LATERAL_MPS2))
    return max(comfort, math.sqrt(size / sharpest), cfg.TRACK_LENGTH_M)


@inner
def before_wall(wall_s: float, pose: EgoPose, car: Car) -> Wall:
    """Return how to stop before a length along the route (infinite: there is no wall)."""
    braking, room, speed = cfg.PROFILE_BRAKING_MPS2, wall_s - car.front - pose.s, pose.speed
    if room < cfg.HOLD_M and speed < cfg.HOLD_MPS:
        room = 0.0
    if room > 0 and room < np.inf:
        braking = min(max(braking, speed * speed / (2 * room)), car.strongest)
    return Wall(room, braking)


@inner
def allowed_speeds(route: FloatArray, origin_s: float, pose: EgoPose, wall: Wall) -> FloatArray:
    """Return the speeds allowed from its place on, `GRID_M` apart: the route's profile, and a stop before the wall."""
    from_s, last = pose.s, route.shape[0] - 1.001
    step = (from_s + GRID_M) - from_s  # as numpy's arange has it
    profile = np.empty(int(np.ceil((from_s + pose.speed * cfg.HORIZON_S + 16.0 - from_s) / GRID_M)))
    for i in range(len(profile)):
        place = min(max((from_s + i * step - origin_s) * (1.0 / GRID_M), 0.0), last)
        k = max(int(place), 0)
        speed = route[k, PROFILE] + (place - k) * (route[k + 1, PROFILE] - route[k, PROFILE])
        if wall.room < np.inf:
            speed = min(speed, math.sqrt(2 * wall.braking * max(wall.room - GRID_M * i, 0.0)))
        profile[i] = max(speed, 1e-3)
    return profile


@inner
def _behind(speed: float, gap: float, nearing: float, top: float) -> float:
    """Return the IDM's acceleration behind a leader, m/s^2."""
    per_gap = 1.0 / max(gap, 0.1)
    wish = (max((nearing * _PER_NEARING + cfg.HEADWAY_S) * speed, 0.0) + cfg.MINIMUM_GAP_M) * per_gap
    closing = max(nearing, 0.0)
    needed = closing * closing * per_gap * cfg.KINEMATIC_FACTOR
    return max(top - top * (wish * wish), -max(needed, cfg.BRAKING_MPS2))


@inner
def _fill(values: FloatArray) -> None:
    """Interpolate between frames that are `_HELD` apart."""
    for k in range(0, len(values) - _HELD, _HELD):
        for j in range(1, _HELD):
            w = j / _HELD
            values[k + j] = (1 - w) * values[k] + w * values[k + _HELD]


@inner
def _longitudinal(
    wishes: FloatArray,
    which: IntArray,
    lead_s: FloatArray,
    lead_v: FloatArray,
    led: BoolArray,
    profile: FloatArray,
    pose: EgoPose,
    car: Car,
    out: FloatArray,
    first: FloatArray,
) -> None:
    """Integrate the IDM: s and v of all proposals of a roll-out, and their first accelerations.

    All of them in each frame, not one after the other: a processor then works on several at once.
    """
    last, top, count = len(profile) - 1, min(cfg.ACCELERATION_MPS2, car.acceleration), len(which)
    s, v = np.zeros(count), np.full(count, pose.speed)
    for k in range(0, FRAMES, _HELD):
        for p in range(count):
            share, most, way, speed = wishes[0, p], wishes[1, p], s[p], v[p]
            ahead = min((way + cfg.PROFILE_PREVIEW_S * speed) * (1.0 / GRID_M), float(last))
            i = max(int(ahead), 0)
            rise = profile[i + 1] - profile[i] if i < last else 0.0
            allowed = ahead * rise + (profile[i] - rise * i)
            ratio = speed / (allowed * share)
            ratio *= ratio
            ratio *= ratio
            # Never gentler than the profile asks for, never (for a lower share alone) harder than comfortable.
            a = min(max(top - top * ratio, -cfg.BRAKING_MPS2), (allowed - speed) * (1.0 / cfg.PROFILE_PREVIEW_S))
            if led[k]:
                gap = lead_s[which[p], k] - car.front - pose.s - way
                a = min(a, _behind(speed, gap, speed - lead_v[which[p], k], top))
            a = max(min(a, most), -car.strongest)
            if k == 0:
                first[p] = a
            faster = max(speed + cfg.ACCELERATION_STEP_S * a, 0.0)
            out[R_S, p, k], out[R_SPEED, p, k] = way, speed
            s[p], v[p] = way + (cfg.ACCELERATION_STEP_S / 2) * (speed + faster), faster
    for p in range(count):
        _fill(out[R_S, p])
        _fill(out[R_SPEED, p])
        for t in range(FRAMES):
            out[R_S, p, t] += pose.s


@inner
def _lateral(p: int, offset: float, pose: EgoPose, slope: float, car: Car, out: FloatArray) -> None:
    """Fill d and its slope with where the tracking law leads to: a critically damped decay of the error over the way
    travelled."""
    error = pose.d - offset
    length = decay_length(pose.speed, error, car.sharpest)
    steep = slope + error / length
    rest = np.empty(FRAMES)
    for t in range(FRAMES):
        rest[t] = math.exp(-(out[R_S, p, t] - pose.s) / length)
    for t in range(FRAMES):
        change = (error + steep * (out[R_S, p, t] - pose.s)) * rest[t]
        out[R_D, p, t], out[TILT, p, t] = offset + change, steep * rest[t] - change / length


@inner
def place(route: FloatArray, origin_s: float, car: Car, out: FloatArray) -> None:
    """Fill where the footprint's centre is and which way it faces."""
    for p in range(out.shape[1]):
        for t in range(FRAMES):
            s, d, tilt = out[R_S, p, t], out[R_D, p, t], out[TILT, p, t]
            k = grid_point(route, origin_s, s)
            base_cos, base_sin = route[k, COS], route[k, SIN]
            along, norm = s - (origin_s + k * GRID_M), 1.0 / math.sqrt(1.0 + tilt * tilt)
            cos, sin = (base_cos - base_sin * tilt) * norm, (base_sin + base_cos * tilt) * norm
            out[R_X, p, t] = route[k, X] + along * base_cos - d * base_sin + car.back * cos
            out[R_Y, p, t] = route[k, Y] + along * base_sin + d * base_cos + car.back * sin
            out[R_COS, p, t], out[R_SIN, p, t] = cos, sin


@inner
def roll(
    pose: EgoPose,
    car: Car,
    lead_s: FloatArray,
    lead_v: FloatArray,
    tried: FloatArray,
    profile: FloatArray,
    out: FloatArray,
    offset: FloatArray,
    first: FloatArray,
) -> None:
    """Roll every proposal out, but for where that is on the map: fill `out` [8, P, T], and what each heads for and its
    first acceleration, [P]."""
    count, here, slope = len(offset), 0, math.tan(max(-1.0, min(1.0, pose.heading_error)))
    led = np.zeros(FRAMES, dtype=np.bool_)
    for o in range(len(tried)):
        if abs(tried[o] - pose.d) < abs(tried[here] - pose.d):
            here = o
        for k in range(0, FRAMES, _HELD):
            led[k] |= lead_s[o, k] < FAR_M
    wishes, which = np.empty((2, count)), np.empty(count, np.int64)
    for p in range(count):
        braking = p - (count - BRAKING)
        if braking < 0:
            which[p], wishes[0, p], wishes[1, p] = p // _SHARES, cfg.SPEED_SHARES[p % _SHARES], np.inf
            offset[p] = tried[which[p]]
        else:  # comfortably and as hard as it can: without steering aside, then in the middle of the lane
            which[p], offset[p] = (here, pose.d) if braking < 2 else (0, tried[0])
            wishes[0, p], wishes[1, p] = 1.0, -cfg.BRAKING_MPS2 if braking % 2 == 0 else -car.strongest
    _longitudinal(wishes, which, lead_s, lead_v, led, profile, pose, car, out, first)
    for p in range(count):
        _lateral(p, offset[p], pose, slope, car, out)


@inner
def proposals(offsets: int) -> int:
    """Return how many proposals there are for so many offsets."""
    return offsets * _SHARES + BRAKING
