"""The roll-out of all proposals: each offset with each share of the speed, then comfortable and hardest braking."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.compiling import FLOAT, compiled, inner
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.prediction import FRAMES
from foresee_dsl.kernels.pdm.proposals import FAR_M
from foresee_dsl.kernels.pdm.records import FloatArray, IntArray, Records
from foresee_dsl.kernels.pdm.route import GRID_M, grid_point, profile_at

BRAKING = 4
"""How many proposals, the last ones, brake: comfortably and as hard as it can, where the ego is and in the middle."""
_HELD = round(cfg.ACCELERATION_STEP_S / cfg.ROLLOUT_STEP_S)
_PER_NEARING = 1.0 / (2.0 * math.sqrt(cfg.ACCELERATION_MPS2 * cfg.BRAKING_MPS2))
_SHARES = len(cfg.SPEED_SHARES)


class Wall(NamedTuple):
    """The room before a wall, m (infinite: there is none), and the braking to stop there: the everyday one, or as hard
    as is needed."""

    room: float
    braking: float


@compiled(FLOAT, FLOAT, FLOAT)
def decay_length(speed: float, error: float, sharpest: float) -> float:
    """Return the length over which a lateral error decays (critically damped), m.

    It is longer for larger errors, so that lateral acceleration stays under OFFSET_LATERAL and curvature under what the
    wheels can do.
    """
    size = abs(error)
    comfort = speed * max(cfg.TRACK_TIME_S, math.sqrt(size / cfg.OFFSET_LATERAL_MPS2))
    return max(comfort, math.sqrt(size / sharpest), cfg.TRACK_LENGTH_M)


@inner
def before_wall(ego: np.void, wall_s: float) -> Wall:
    """Return how to stop before a length along the route (infinite: there is no wall)."""
    braking, room, speed = cfg.PROFILE_BRAKING_MPS2, wall_s - ego["front"] - ego["s"], ego["forward"]
    if room < cfg.HOLD_M and speed < cfg.HOLD_MPS:
        room = 0.0
    if room > 0 and room < np.inf:
        braking = min(max(braking, speed * speed / (2 * room)), ego["strongest"])
    return Wall(room, braking)


@inner
def allowed_speeds(ego: np.void, route: Records, wall: Wall) -> FloatArray:
    """Return the speeds allowed from its place on, `GRID_M` apart: the route's profile, and a stop before the wall."""
    from_s = ego["s"]
    step = (from_s + GRID_M) - from_s  # as numpy's arange has it
    allowed = np.empty(int(np.ceil((from_s + ego["forward"] * cfg.HORIZON_S + 16.0 - from_s) / GRID_M)))
    for i in range(len(allowed)):
        speed = profile_at(route, from_s + i * step)
        if wall.room < np.inf:
            speed = min(speed, math.sqrt(2 * wall.braking * max(wall.room - GRID_M * i, 0.0)))
        allowed[i] = max(speed, 1e-3)
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
    """Integrate the IDM: fill s and speed of all proposals, and return their first accelerations [P].

    All of them in each frame, not one after the other: a processor then works on several at once.

    Args:
        ego: the ego. wishes: [2, P] share of the allowed speed and largest acceleration. which: [P] row of `leaders`.
        leaders: [O, T]. allowed: speeds along the way, `GRID_M` apart. out: [P, T].
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
    """Fill d and its slope of a proposal [T] with where the tracking law leads to: a critically damped decay of the
    error over the way travelled."""
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
def place(ego: np.void, route: Records, out: Records) -> None:
    """Fill where the footprint's centre is and which way it faces, [P, T]."""
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
    """Roll every proposal out, but for where that is on the map: fill `out` [P, T] and the offset that each heads for,
    [P]; return their first accelerations, [P].

    Args:
        ego: the ego. leaders: [O, T]. offsets: [O] that are tried. allowed: speeds along the way. out, heads_for: see
            above; each offset with each share of the speed, then the braking ones.
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
        else:  # comfortably and as hard as it can: without steering aside, then in the middle of the lane
            which[p], heads_for[p] = (here, ego["d"]) if braking < 2 else (0, offsets[0])
            wishes[0, p], wishes[1, p] = 1.0, -cfg.BRAKING_MPS2 if braking % 2 == 0 else -ego["strongest"]
    first = _longitudinal(ego, wishes, which, leaders, allowed, out)
    for p in range(count):
        _lateral(ego, heads_for[p], slope, out[p])
    return first


@inner
def proposals(offsets: int) -> int:
    """Return how many proposals there are for so many offsets."""
    return offsets * _SHARES + BRAKING
