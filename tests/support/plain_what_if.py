"""Roll-outs of `kernels.what_if` in plain Python: boxes are shapely's, places along tracks are numpy's."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from shapely import Polygon
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, box

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.kernels.sumo_traffic import SIDEWAYS_SHARE
from foresee_dsl.kernels.what_if import (
    AHEAD_M,
    AHEAD_S,
    BEFORE_M,
    FRAMES,
    GAINS_MPS2,
    LEAST_PACE_MPS,
    LOOKS,
    RECOVERS_S,
    RELEASES_S,
    ROLLOUT_STEP_S,
    SIDEWAYS_S,
    SLACK_M,
    PathStyle,
    WhatIf,
)


class Plain(NamedTuple):
    """When a contact is, the smallest gap up to then, and when braking begins; infinite where there is none."""

    contact: float
    gap: float
    brakes: float


def footprint(x: float, y: float, heading: float, length: float, width: float) -> Polygon:
    flat = box(-length / 2, -width / 2, length / 2, width / 2)
    return translate(rotate(flat, heading, origin=(0, 0), use_radians=True), x, y)


def place(track: FloatArray, clock: float) -> tuple[float, float, float]:
    last = len(track) - 1
    if clock < last:
        frames = np.arange(len(track))
        x, y, heading = (float(np.interp(clock, frames, track[:, k])) for k in range(3))
        return x, y, heading
    x, y, heading, step = track[last].tolist()
    return x + (clock - last) * step * math.cos(heading), y + (clock - last) * step * math.sin(heading), heading


def mps(track: FloatArray, clock: float) -> float:
    return float(track[min(int(clock), len(track) - 1), 3]) * FRAMES / ROLLOUT_STEP_S


def further(track: FloatArray, clock: float, way: float) -> float:
    """The clock at which the track is so much further; where it stands, no time passes."""
    last = len(track) - 1
    if way <= 0:
        return clock
    if clock >= last:
        return clock + way / track[last, 3] if track[last, 3] > 0 else clock
    steps = np.hypot(*np.diff(track[:, :2], axis=0).T)
    k = int(clock)
    at = np.r_[0.0, np.cumsum(steps)]
    wanted = at[k] + steps[k] * (clock - k) + way
    if wanted >= at[-1]:
        return last + (wanted - at[-1]) / track[last, 3] if track[last, 3] > 0 else float(last)
    j = int(np.searchsorted(at, wanted, side="right")) - 1
    return j + (wanted - at[j]) / steps[j]


def hidden(line: LineString, actor: int, bodies: list[Polygon], tops: FloatArray) -> bool:
    return any(k != actor and tops[k] >= tops[actor] and line.intersects(b) for k, b in enumerate(bodies, start=1))


def rolled(what: WhatIf, style: PathStyle, near_s: float, tracks: FloatArray, sizes: FloatArray) -> Plain:
    """One roll-out."""
    ego, track = tracks[0], tracks[what.actor]
    clock = further(track, what.first, what.ahead)
    share, left, turned = what.pace if mps(track, clock) >= STANDS_MPS else 1.0, 0.0, 0.0
    at = what.first + (1 - style.pace) * near_s / ROLLOUT_STEP_S * FRAMES
    pace, aside, since_seen, until = style.pace, 0.0, math.inf, -math.inf
    nearest, brakes = math.inf, math.inf
    was = place(track, clock - (0.0 if what.delay > 0 else share * FRAMES)) if clock >= share * FRAMES else None
    assert was is not None, "the tests begin later"
    for step in range(int((what.last - what.first) / FRAMES) + 1):
        t = step * ROLLOUT_STEP_S
        frame = min(int(what.first + step * FRAMES), tracks.shape[1] - 1)
        x, y, heading = place(ego, at)
        x, y = x - aside * math.sin(heading), y + aside * math.cos(heading)
        ox, oy, oh = place(track, clock)
        ox, oy, oh = ox - left * math.sin(oh), oy + left * math.cos(oh), oh + turned
        vx, vy = (ox - was[0]) / ROLLOUT_STEP_S, (oy - was[1]) / ROLLOUT_STEP_S
        was = (ox, oy, oh)
        mine, theirs = footprint(x, y, heading, *sizes[0, :2]), footprint(ox, oy, oh, what.length, what.width)
        nearest = min(nearest, mine.distance(theirs))
        if nearest == 0.0:
            return Plain(t, 0.0, brakes)
        others = [footprint(*tracks[k, frame, :3], *sizes[k, :2]) for k in range(1, len(sizes))]
        if style.pace != 1.0 or style.aside != 0.0:
            for k, other in enumerate(others, start=1):
                dx, dy = tracks[k, frame, 0] - x, tracks[k, frame, 1] - y
                in_front = dx * math.cos(heading) + dy * math.sin(heading) >= 0
                if k != what.actor and in_front and mine.intersects(other):
                    return Plain(t, 0.0, brakes)
        threat = False
        for look in range(1, LOOKS + 1):
            later = style.horizon * look / LOOKS
            wide = footprint(*place(ego, at + style.pace * later / ROLLOUT_STEP_S * FRAMES), sizes[0, 0] + 2 * BEFORE_M,
                             sizes[0, 1] + SLACK_M + 2 * style.room)  # fmt: skip
            threat |= wide.intersects(footprint(ox + vx * later, oy + vy * later, oh, what.length, what.width))
        if threat and not hidden(LineString([(x, y), (ox, oy)]), what.actor, others, sizes[:, 2]):
            since_seen = min(since_seen, t)
            if t >= since_seen + style.delay - 1e-9:
                until, brakes = t + RELEASES_S, min(brakes, t)
        elif t > until:
            since_seen = math.inf
        before = max(mps(ego, at), LEAST_PACE_MPS)
        if t < until:
            pace = max(0.0, pace - style.braking * ROLLOUT_STEP_S / before)
        else:
            pace = min(style.pace, pace + GAINS_MPS2 * ROLLOUT_STEP_S / before)
        at += pace * FRAMES
        most = abs(style.aside) * ROLLOUT_STEP_S / SIDEWAYS_S
        aside += max(-most, min(most, style.aside - aside))
        # The actor's own step.
        slow = max(mps(track, clock), LEAST_PACE_MPS)
        braked = what.braking > 0 and t >= what.brakes_at
        if t < what.delay:
            share = 0.0
        elif braked and t < what.brakes_at + what.brakes_for:
            share = max(0.0, share - what.braking * ROLLOUT_STEP_S / slow)
        elif braked or what.delay > 0:
            share = min(what.pace, share + GAINS_MPS2 * ROLLOUT_STEP_S / slow)
        elif (later := mps(track, clock + FRAMES)) < STANDS_MPS:
            share = 1.0
        else:
            speed = share * mps(track, clock) + max(GAINS_MPS2 * ROLLOUT_STEP_S, later - mps(track, clock))
            share = min(what.pace, max(1.0, speed / later))
        moved = clock + share * FRAMES
        if t >= what.goes_at:
            onset = mps(track, what.first + what.goes_at / ROLLOUT_STEP_S * FRAMES)
            speed = min(onset + GAINS_MPS2 * (t - what.goes_at), max(what.cruise, onset))
            moved = further(track, clock, speed * ROLLOUT_STEP_S)
        way = math.dist(place(track, clock)[:2], place(track, moved)[:2])
        clock = moved
        if what.turn_at <= t < what.turn_at + what.turn_for:
            turned += what.turn * way
        elif what.turn != 0 and t >= what.turn_at:
            turned += (-left / max(AHEAD_M, AHEAD_S * way / ROLLOUT_STEP_S) - turned) * ROLLOUT_STEP_S / RECOVERS_S
        if what.left != 0 and t >= what.left_at:
            wanted, rate = what.left, min(what.left_rate * ROLLOUT_STEP_S, SIDEWAYS_SHARE * way)
            left += max(-rate, min(rate, (0.0 if t >= what.left_at + what.left_for else wanted) - left))
        left += way * math.sin(turned)
    return Plain(math.inf, nearest, brakes)
