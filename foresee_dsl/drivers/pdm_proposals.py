"""The proposals: which lateral offsets are worth a thought, who is in the way of each, and the roll-out of them all."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.pdm_prediction import TIMES_S, Prediction
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
HELD = round(cfg.ACCELERATION_STEP_S / cfg.ROLLOUT_STEP_S)


@dataclass(frozen=True)
class Rollout:
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
    if not actors.count:
        return np.zeros(0, dtype=bool)
    left, right = route.left[now.index], route.right[now.index]
    need = situation.vehicle.width_m + cfg.PASS_CLEARANCE_M + cfg.LANE_MARGIN_M
    # Room between the thing's side and the edge of the lanes, on the better side.
    room = np.maximum(left - now.d, right + now.d) - actors.half_width >= need
    stops = np.array([j.stop_s for j in route.junctions])
    before_line = stops[:, None] - now.s
    queue = ((before_line > 0) & (before_line < QUEUE_REACH_M)).any(axis=0) & (np.abs(now.d) < QUEUE_OFFSET_M)
    return (actors.speed < STANDS_MPS) & room & (actors.obstacle | ~queue) & ~actors.pedestrian


def offsets(situation: Situation, can_pass: BoolArray) -> FloatArray:
    """Return the lateral offsets to try, the middle of the lane first: PDM's, and those that pass what is parked."""
    route, pose, actors, now = situation.route, situation.pose, situation.actors, situation.now
    vehicle = situation.vehicle
    first = route.index(pose.s)
    last = route.index(pose.s + max(20.0, 2 * pose.speed)) + 1
    half = vehicle.width_m / 2 + cfg.LANE_MARGIN_M
    most_left = max(float(route.left[first:last].min()) - half, 0.0)
    most_right = max(float(route.right[first:last].min()) - half, 0.0)
    found = [min(max(o, -most_right), most_left) for o in cfg.LATERAL_OFFSETS_M]
    ahead = now.s - pose.s
    reach = max(25.0, pose.speed * cfg.HORIZON_S * 1.25)
    blocking = can_pass & (ahead > -2 * vehicle.length_m) & (ahead < reach)
    blocking &= np.abs(now.d) < actors.half_width + vehicle.width_m / 2 + cfg.PASS_CLEARANCE_M + 1.0
    for a in np.flatnonzero(blocking)[np.argsort(ahead[blocking], kind="stable")][:MOST_PASSED].tolist():
        beside = float(actors.half_width[a]) + vehicle.width_m / 2 + cfg.PASS_CLEARANCE_M
        left, right = float(route.left[now.index[a]]) - half, float(route.right[now.index[a]]) - half
        d = float(now.d[a])
        # The far sides too: from a stand only the larger offset turns the wheels far enough.
        found += [o for o in (d + beside, d - beside) if -right <= o <= left]
        found += [o for o, room in ((left, d + beside <= left), (-right, d - beside >= -right)) if room]
    # Equal ones once, in this order.
    return np.array(list(dict.fromkeys(round(o, 2) for o in found)))


def leaders(
    situation: Situation, prediction: Prediction, tried: FloatArray, can_pass: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return for each offset and frame where the front of the ego must stay behind, and how fast that moves: [O, T]."""
    pose, vehicle = situation.pose, situation.vehicle
    front = pose.s + _front(vehicle)
    if not len(prediction.s):
        return np.full((len(tried), len(TIMES_S)), FAR_M), np.zeros((len(tried), len(TIMES_S)))
    rear = prediction.s - prediction.reach_s
    rear = np.where(can_pass[:, None], rear - (cfg.PASSABLE_GAP_M - cfg.MINIMUM_GAP_M), rear)
    ahead = prediction.s - prediction.reach_s > front - 1.0
    side = prediction.reach_d + vehicle.width_m / 2 + cfg.CORRIDOR_MARGIN_M
    inside = ahead & (np.abs(prediction.d - tried[:, None, None]) < side)
    gap = np.where(inside, rear, FAR_M)
    nearest = gap.argmin(axis=1)
    frames = np.arange(len(TIMES_S))
    lead_s = np.take_along_axis(gap, nearest[:, None, :], axis=1)[:, 0, :]
    # What comes towards the ego is for the scores; the IDM knows followers only.
    return lead_s, np.maximum(prediction.speed_s[nearest, frames], 0.0)


def roll_out(
    situation: Situation, tried: FloatArray, lead: tuple[FloatArray, FloatArray], wall_s: float | None
) -> Rollout:
    """Roll every proposal out: each offset with each share of the speed, then comfortable and hardest braking."""
    pose = situation.pose
    shares = np.array(cfg.SPEED_SHARES)
    here = min(range(len(tried)), key=lambda k: abs(float(tried[k]) - pose.d))
    which = np.concatenate([np.repeat(np.arange(len(tried)), len(shares)), [here, here, 0, 0]])
    brake = np.zeros(len(which), dtype=bool)
    brake[-4:] = True
    offset = tried[which]
    offset[-4:-2] = pose.d  # braking without steering aside
    wishes = _Wishes(
        share=np.concatenate([np.tile(shares, len(tried)), np.ones(4)]),
        most=np.full(len(which), np.inf),
        lead_s=lead[0][:, ::HELD][which].T.copy(),
        lead_v=lead[1][:, ::HELD][which].T.copy(),
    )
    wishes.most[-4:] = np.tile([-cfg.BRAKING_MPS2, -situation.ego.strongest_braking_mps2], 2)
    s, v, a = _longitudinal(situation, wishes, _profile(situation, wall_s))
    return _lateral(situation, (s, v, a), offset, brake)


class _Wishes(NamedTuple):
    """Of each proposal: share of the speed and most acceleration [P]; whom it follows, how fast that is [K, P]."""

    share: FloatArray
    most: FloatArray
    lead_s: FloatArray
    lead_v: FloatArray


def _profile(situation: Situation, wall_s: float | None) -> FloatArray:
    """Return the speeds allowed from the rear axle's present place on, GRID_M apart, for the whole horizon."""
    route, pose = situation.route, situation.pose
    profile = route.between(route.profile, np.arange(pose.s, pose.s + pose.speed * cfg.HORIZON_S + 16.0, GRID_M))
    if wall_s is not None:
        room = wall_s - _front(situation.vehicle) - pose.s
        profile = _with_wall(profile, room, pose.speed, situation.ego.strongest_braking_mps2)
    return np.maximum(profile, 1e-3)


def _longitudinal(
    situation: Situation, wishes: _Wishes, profile: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate the IDM: s and v [P, T], and the first acceleration [P]."""
    pose, share = situation.pose, wishes.share
    least = -situation.ego.strongest_braking_mps2
    dt, top = cfg.ACCELERATION_STEP_S, min(cfg.ACCELERATION_MPS2, situation.vehicle.acceleration_mps2)
    lead_s = wishes.lead_s - _front(situation.vehicle) - pose.s
    led = np.asarray((wishes.lead_s < FAR_M).any(axis=1)).tolist()
    s_all, v_all = np.empty(lead_s.shape), np.empty(lead_s.shape)
    s, v = np.zeros(len(share)), np.full(len(share), pose.speed)
    last, rise = len(profile) - 1, np.diff(profile, append=profile[-1])
    base = profile - rise * np.arange(len(profile))  # the profile's value at x is base + rise x
    first_a = v
    for k in range(len(lead_s)):
        s_all[k], v_all[k] = s, v
        place = (s + cfg.PROFILE_PREVIEW_S * v) * (1.0 / GRID_M)
        np.minimum(place, last, out=place)
        index = place.astype(np.int64)
        place *= rise[index]
        place += base[index]  # the speed allowed there
        ratio = v / (place * share)
        ratio *= ratio
        ratio *= ratio
        a = top - top * ratio
        # Never gentler than the profile asks for, never (for a lower share alone) harder than comfortable.
        np.maximum(a, -cfg.BRAKING_MPS2, out=a)
        place -= v
        place *= 1.0 / cfg.PROFILE_PREVIEW_S
        np.minimum(a, place, out=a)
        if led[k]:
            np.minimum(a, _behind(v, lead_s[k] - s, v - wishes.lead_v[k], top), out=a)
        np.minimum(a, wishes.most, out=a)
        np.maximum(a, least, out=a)
        if k == 0:
            first_a = a
        faster = np.maximum(v + dt * a, 0.0)
        s = s + (dt / 2) * (v + faster)
        v = faster
    return _fill(s_all).T + pose.s, _fill(v_all).T, first_a


def _behind(speed: FloatArray, gap: FloatArray, nearing: FloatArray, top: float) -> FloatArray:
    """Return the IDM's acceleration behind leaders, m/s^2: [P]."""
    per_gap = 1.0 / np.maximum(gap, 0.1)
    wish = nearing * (1.0 / (2.0 * math.sqrt(cfg.ACCELERATION_MPS2 * cfg.BRAKING_MPS2)))
    wish += cfg.HEADWAY_S
    wish *= speed
    np.maximum(wish, 0.0, out=wish)
    wish += cfg.MINIMUM_GAP_M
    wish *= per_gap
    wish *= wish
    needed = np.maximum(nearing, 0.0)
    needed *= needed
    needed *= per_gap
    needed *= cfg.KINEMATIC_FACTOR
    return np.asarray(np.maximum(top - top * wish, -np.maximum(needed, cfg.BRAKING_MPS2)))


def _front(vehicle: VehicleLimits) -> float:
    """Return the distance from the rear axle to the front bumper, m."""
    return vehicle.wheelbase_m + vehicle.front_overhang_m


def _with_wall(profile: FloatArray, room: float, speed: float, strongest_braking: float) -> FloatArray:
    """Cap a profile so that it ends in a stop: with everyday braking, or as hard as is needed."""
    braking = cfg.PROFILE_BRAKING_MPS2
    if room < cfg.HOLD_M and speed < cfg.HOLD_MPS:
        room = 0.0
    if room > 0:
        braking = min(max(braking, speed * speed / (2 * room)), strongest_braking)
    left = np.maximum(room - GRID_M * np.arange(len(profile)), 0.0)
    return np.asarray(np.minimum(profile, np.sqrt(2 * braking * left)))


def _fill(coarse: FloatArray) -> FloatArray:
    """Interpolate frames that are HELD apart: [K, P] to [(K - 1) * HELD + 1, P]."""
    fine = np.empty(((len(coarse) - 1) * HELD + 1, coarse.shape[1]))
    for part in range(HELD):
        w = part / HELD
        rows = fine[part::HELD]
        rows[...] = coarse[: len(rows)] if part == 0 else (1 - w) * coarse[:-1] + w * coarse[1:]
    return fine


def tracking_length(speed: float, error: FloatArray, vehicle: VehicleLimits) -> FloatArray:
    """Return the length over which a lateral error decays (critically damped), m.

    It is longer for larger errors, so that lateral acceleration stays under OFFSET_LATERAL and curvature under what the
    wheels can do.
    """
    sharpest = np.tan(vehicle.steer_max_rad) / vehicle.wheelbase_m
    size = np.abs(error)
    comfort = speed * np.maximum(cfg.TRACK_TIME_S, np.sqrt(size / cfg.OFFSET_LATERAL_MPS2))
    return np.asarray(np.maximum(np.maximum(comfort, np.sqrt(size / sharpest)), cfg.TRACK_LENGTH_M))


def _lateral(
    situation: Situation, motion: tuple[FloatArray, FloatArray, FloatArray], offset: FloatArray, brake: BoolArray
) -> Rollout:
    """Add where the tracking law leads to: a critically damped decay of the error over the way travelled."""
    route, pose, vehicle = situation.route, situation.pose, situation.vehicle
    s, v, a = motion
    error = pose.d - offset
    length = tracking_length(pose.speed, error, vehicle)
    slope = np.tan(max(-1.0, min(1.0, pose.heading_error)))
    rate = (slope + error / length)[:, None]
    way = s - pose.s
    decay = np.exp(-way / length[:, None])
    change = (error[:, None] + rate * way) * decay
    tilt = rate * decay - change / length[:, None]  # d'(s)
    d = offset[:, None] + change
    k = route.indices(s)
    base_cos, base_sin = route.cos[k], route.sin[k]
    part = s - (route.origin_s + k * GRID_M)
    norm = 1.0 / np.sqrt(1.0 + tilt * tilt)
    cos, sin = (base_cos - base_sin * tilt) * norm, (base_sin + base_cos * tilt) * norm
    centre = to_centre(vehicle)
    return Rollout(
        s=s,
        d=d,
        speed=v,
        x=route.x[k] + part * base_cos - d * base_sin + centre * cos,
        y=route.y[k] + part * base_sin + d * base_cos + centre * sin,
        cos=cos,
        sin=sin,
        centre_d=d + centre * tilt,
        offset=offset,
        brake=brake,
        acceleration=a,
    )
