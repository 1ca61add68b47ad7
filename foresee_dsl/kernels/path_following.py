"""The kernel that moves an actor along a path: it takes up a pace, slows for bends and stops where it is told to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.compiling import FLOAT, compiled, inner
from foresee_dsl.kernels.lines import SPEED_POINTS, VERTICES, place_at, speed_at
from foresee_dsl.kernels.records import array_of


class Follower(NamedTuple):
    """An actor on a path.

    Attributes:
        along: how far it has come, m. speed: m/s. pace: the speed that it takes up, m/s.
        acceleration, braking: how fast it does so, m/s^2, positive.
        stop: a length at which it must wait, m; NaN for none. half_length: of its footprint, m; 0 for one that turns on
            the spot.
    """

    along: float
    speed: float
    pace: float
    acceleration: float
    braking: float
    stop: float
    half_length: float


FOLLOWERS = array_of(Follower)


@inner
def _approach(room: float, speed: float, braking: float, dt: float) -> float:
    """Return the largest speed at the end of this step from which braking still ends within `room`, m/s."""
    left = room - speed * dt / 2
    return float(braking * (np.sqrt(max(0.0, dt * dt / 4 + 2 * left / braking)) - dt / 2))


@compiled(FLOAT, FLOAT, VERTICES)
def pose_on_path(along: float, half: float, line: Records) -> tuple[float, float, float]:
    """Return x, y (m) and heading (rad) of an actor that has come so far (m).

    With a length (`half` of it, m) its heading is that of the path between its rear and its front.
    """
    x, y, heading = place_at(along, line)
    if half > 0.0:
        rear_x, rear_y, _ = place_at(along - half, line)
        front_x, front_y, _ = place_at(along + half, line)
        dx, dy = front_x - rear_x, front_y - rear_y
        if np.hypot(dx, dy) > half / 2:  # less: the path folds back on itself here
            heading = np.arctan2(dy, dx)
    return x, y, heading - 2 * np.pi * np.round(heading / (2 * np.pi))


@compiled(FOLLOWERS, VERTICES, SPEED_POINTS, FLOAT)
def advance(followers: Records, line: Records, bends: Records, dt: float) -> tuple[float, float, float]:
    """Move the first of some followers on by a step: its `along` and `speed` are changed; return x, y (m), heading
    (rad).

    `bends`: how fast the path's bends may be taken; empty for none.
    """
    follower = followers[0]
    along, before, braking = follower["along"], follower["speed"], follower["braking"]
    pace, stop, half = follower["pace"], follower["stop"], follower["half_length"]
    length = line[line.size - 1]["along"]
    if bends.size:  # its front comes to a corner before its middle does
        pace = min(pace, speed_at(along + half + before * dt, bends, 0, bends.size))
    speed = max(before - braking * dt, min(pace, before + follower["acceleration"] * dt), 0.0)
    held = False
    if not along <= stop < length:  # a NaN neither
        stop = length
    for wait in (stop, length):
        if held:
            continue
        room = wait - along
        speed = min(speed, max(_approach(room, before, braking, dt), before - braking * dt, 0.0))
        if room <= (before + speed) / 2 * dt + 1e-9 and speed <= braking * dt:
            along, speed, held = wait, 0.0, True  # the last step: onto the very point, and still
    if not held:
        along = min(along + (before + speed) / 2 * dt, length)
        if along >= length:
            speed = 0.0
    follower["along"], follower["speed"] = along, speed
    x, y, heading = pose_on_path(along, half, line)
    return x, y, heading
