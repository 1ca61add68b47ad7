"""Actors that Python moves along a path: pedestrians, and cyclists or vehicles off the lanes.

One is restored from what a clip holds: its length along the path and its speed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import atan2, hypot, nan, sqrt

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.polyline import Polyline, wrap
from foresee_dsl.simulate.bends import BendSpeeds

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
        self.line = Polyline.of(points)
        self.pace_mps = pace_mps
        self.acceleration_mps2, self.braking_mps2 = acceleration_mps2, braking_mps2
        self.stop_m: float | None = None
        self.along_m, self.speed_mps = along_m, speed_mps
        self._half_m = length_m / 2
        self._bends = None
        if lateral_mps2 is not None and length_m > 0:
            self._bends = BendSpeeds(
                self.line.marks,
                self.line.angles,
                axle_m=length_m,
                lateral_mps2=lateral_mps2,
                braking_mps2=braking_mps2,
            )
        self._placed: tuple[float, tuple[float, float, float]] = (nan, (0.0, 0.0, 0.0))

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
        before, heading_before = self.speed_mps, self._place()[2]
        pace = self.pace_mps
        if self._bends is not None:  # its front comes to a corner before its middle does
            pace = min(pace, self._bends.at(self.along_m + self._half_m + before * dt))
        speed = max(before - self.braking_mps2 * dt, min(pace, before + self.acceleration_mps2 * dt), 0.0)
        for stop in self._stops():
            room = stop - self.along_m
            speed = min(speed, max(self._approach(room, dt), before - self.braking_mps2 * dt, 0.0))
            if room <= (before + speed) / 2 * dt + 1e-9 and speed <= self.braking_mps2 * dt:
                # The last step: onto the very point, and still.
                self.along_m, self.speed_mps = stop, 0.0
                return self._moved(before, heading_before, dt)
        self.along_m = min(self.along_m + (before + speed) / 2 * dt, self.line.length_m)
        self.speed_mps = 0.0 if self.arrived else speed
        return self._moved(before, heading_before, dt)

    def _moved(self, before: float, heading_before: float, dt: float) -> FollowerPose:
        x, y, heading = self._place()
        return FollowerPose(
            x, y, heading, self.speed_mps, (self.speed_mps - before) / dt, wrap(heading - heading_before) / dt
        )

    def _stops(self) -> Iterable[float]:
        if self.stop_m is not None and self.along_m <= self.stop_m < self.line.length_m:
            yield self.stop_m
        yield self.line.length_m

    def _approach(self, room: float, dt: float) -> float:
        """The largest speed at the end of this step from which braking still ends within `room`."""
        b = self.braking_mps2
        left = room - self.speed_mps * dt / 2
        return b * (sqrt(max(0.0, dt * dt / 4 + 2 * left / b)) - dt / 2)

    def _place(self) -> tuple[float, float, float]:
        # A step asks where it was and where it is; where it was is known from the step before.
        if self._placed[0] != self.along_m:
            self._placed = (self.along_m, self._look_up())
        return self._placed[1]

    def _look_up(self) -> tuple[float, float, float]:
        x, y, heading = self.line.at(self.along_m)
        if self._half_m > 0:
            rear, front = self.line.at(self.along_m - self._half_m), self.line.at(self.along_m + self._half_m)
            dx, dy = front[0] - rear[0], front[1] - rear[1]
            if hypot(dx, dy) > self._half_m / 2:  # less: the path folds back on itself here
                heading = atan2(dy, dx)
        return x, y, heading
