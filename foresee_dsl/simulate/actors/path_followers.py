"""Actors that Python moves along a path: pedestrians, and cyclists or vehicles off the lanes.

One is restored from what a clip holds: its length along the path and its speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import nan

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.polyline import Points, as_line, line_of, wrap
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, compiled, inner
from foresee_dsl.kernels.lines import place_at, value_at
from foresee_dsl.simulate.actors.bend_speeds import BendSpeeds

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FollowerPose:
    """Where a path-follower is: centre (m), heading (rad), speed (m/s), acceleration (m/s^2), yaw rate (rad/s)."""

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    yaw_rate: float


class PathFollower:
    """Moves along a polyline toward a pace, and stops at its end and where it is told to.

    Each step follows from `along_m` and `speed_mps` (and the pace and the stop in force), so one restored from those
    continues on the same positions.

    Args:
        path: [N, 2] m.
        pace_mps: the speed that it takes up.
        acceleration_mps2, braking_mps2: how fast it does so; positive.
        length_m: its footprint's length: the heading is that of the path between its rear and its front, so that a
            cyclist turns gradually at a corner.
        along_m, speed_mps: where it is and how fast.
        lateral_mps2: corners are taken so that it turns with less than this; None for who turns on the spot.

    Raises:
        ValueError: the path has no length, or a rate is not positive.

    Attributes:
        pace_mps: may be changed at any time; 0 halts it.
        stop_m: a length along the path where it must wait, None when it may go on. One that lies behind, or nearer
            than it can brake for, does not hold it.
    """

    def __init__(
        self,
        path: FloatArray | Sequence[Sequence[float]],
        *,
        pace_mps: float,
        acceleration_mps2: float,
        braking_mps2: float,
        length_m: float = 0.0,
        along_m: float = 0.0,
        speed_mps: float = 0.0,
        lateral_mps2: float | None = None,
    ) -> None:
        if not (acceleration_mps2 > 0 and braking_mps2 > 0):
            raise ValueError(f"rates must be positive: {acceleration_mps2} and {braking_mps2} m/s^2")
        points = np.asarray(path, dtype=np.float64).reshape(-1, 2)
        if not np.isfinite(points).all() or len(points) < 2 or not np.ptp(points, axis=0).max() > 0:
            raise ValueError(f"a path needs two different points: {points.tolist()}")
        along = as_line(points)
        self.line = line_of(along)
        self.pace_mps = pace_mps
        self.acceleration_mps2, self.braking_mps2 = acceleration_mps2, braking_mps2
        self.stop_m: float | None = None
        self.along_m, self.speed_mps = along_m, speed_mps
        self._half_m = length_m / 2
        self._line = self.line.points[:, 0].copy(), self.line.points[:, 1].copy(), self.line.s, self.line.heading
        self._bends: tuple[FloatArray, FloatArray] = _NO_BENDS
        if lateral_mps2 is not None and length_m > 0:
            self._bends = _bends_of(along, length_m, lateral_mps2, braking_mps2)
        self._heading = self._place()[2]

    @property
    def arrived(self) -> bool:
        """It has come to the end of its path."""
        return self.along_m >= self.line.length_m

    def pose(self) -> FollowerPose:
        """Return where it is, as if it kept its speed (acceleration and yaw rate 0)."""
        x, y, heading = self._place()
        return FollowerPose(x, y, heading, self.speed_mps, 0.0, 0.0)

    def step(self, dt: float) -> FollowerPose:
        """Move on by `dt` seconds and return where it is then."""
        before, heading_before = self.speed_mps, self._heading
        stop_m = nan if self.stop_m is None else self.stop_m
        self.along_m, self.speed_mps, x, y, heading = _advance(
            self.along_m, before, self.pace_mps, self.acceleration_mps2, self.braking_mps2, stop_m, self._half_m, dt,
            *self._line, *self._bends,
        )  # fmt: skip
        self._heading = heading
        turned = wrap(heading - heading_before)
        return FollowerPose(x, y, heading, self.speed_mps, (self.speed_mps - before) / dt, turned / dt)

    def _place(self) -> tuple[float, float, float]:
        place: tuple[float, float, float] = _stands(self.along_m, self._half_m, *self._line)
        return place


_NO_BENDS = np.empty(0), np.empty(0)


@lru_cache(maxsize=256)
def _bends_of(path: Points, length_m: float, lateral_mps2: float, braking_mps2: float) -> tuple[FloatArray, FloatArray]:
    """Return marks (m) and speeds (m/s) of a path's bends."""
    line = line_of(path)
    bends = BendSpeeds(line.marks, line.angles, axle_m=length_m, lateral_mps2=lateral_mps2, braking_mps2=braking_mps2)
    return np.array(bends.marks), np.array(bends.speeds)


@inner
def _approach(room: float, speed: float, braking: float, dt: float) -> float:
    """The largest speed at the end of this step from which braking still ends within `room`."""
    left = room - speed * dt / 2
    return float(braking * (np.sqrt(max(0.0, dt * dt / 4 + 2 * left / braking)) - dt / 2))


@compiled(FLOAT, FLOAT, FLOATS, FLOATS, FLOATS, FLOATS)
def _stands(
    along: float, half: float, xs: FloatArray, ys: FloatArray, marks: FloatArray, angles: FloatArray
) -> tuple[float, float, float]:
    """Return x, y and heading of who has come so far: with a length, that of the path between its rear and front."""
    x, y, heading = place_at(along, xs, ys, marks, angles)
    if half > 0.0:
        rear_x, rear_y, _ = place_at(along - half, xs, ys, marks, angles)
        front_x, front_y, _ = place_at(along + half, xs, ys, marks, angles)
        dx, dy = front_x - rear_x, front_y - rear_y
        if np.hypot(dx, dy) > half / 2:  # less: the path folds back on itself here
            heading = np.arctan2(dy, dx)
    return x, y, heading - 2 * np.pi * np.round(heading / (2 * np.pi))


@compiled(
    FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOATS, FLOATS, FLOATS, FLOATS, FLOATS, FLOATS
)  # fmt: skip
def _advance(
    along: float,
    before: float,
    pace: float,
    gains: float,
    braking: float,
    stop: float,
    half: float,
    dt: float,
    xs: FloatArray,
    ys: FloatArray,
    marks: FloatArray,
    angles: FloatArray,
    bend_marks: FloatArray,
    bend_speeds: FloatArray,
) -> tuple[float, float, float, float, float]:
    """Move on by a step.

    Args:
        along, before: m along the path, and m/s. pace, gains, braking, stop, half: see `PathFollower`; no stop is NaN.
        xs, ys, marks, angles: of the path. bend_marks, bend_speeds: how fast its bends may be taken; empty for none.

    Returns:
        m along the path, speed (m/s), x, y, heading.
    """
    length = marks[-1]
    if bend_marks.size:  # its front comes to a corner before its middle does
        pace = min(pace, value_at(along + half + before * dt, bend_marks, bend_speeds))
    speed = max(before - braking * dt, min(pace, before + gains * dt), 0.0)
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
    x, y, heading = _stands(along, half, xs, ys, marks, angles)
    return along, speed, x, y, heading
