"""Actors that Python moves along a path: pedestrians, and cyclists or vehicles off the lanes.

One is restored from what a clip holds: its length along the path and its speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import nan
from typing import NamedTuple

import numpy as np

from foresee_dsl.compile.roads.polyline import Points, as_line, line_of, wrap
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.lines import speed_points, vertices
from foresee_dsl.kernels.path_following import Follower, advance, pose_on_path
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.simulate.actors.bend_speeds import BendSpeeds

_ALONG, _SPEED, _PACE, _STOP = (Follower._fields.index(name) for name in ("along", "speed", "pace", "stop"))


class FollowerPose(NamedTuple):
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
        lateral_mps2: corners are taken so that it turns with less than this; None for an actor that turns on the spot.

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
        self.stop_m: float | None = None
        self.along_m, self.speed_mps = along_m, speed_mps
        self._half_m = length_m / 2
        self._vertices = vertices(self.line.points, self.line.s, self.line.heading)
        record = Follower(along_m, speed_mps, pace_mps, acceleration_mps2, braking_mps2, nan, self._half_m)
        self._record = np.array([record], dtype_of(Follower))
        self._numbers = self._record.view(np.float64)  # read in a tenth of the time that a record's field takes
        self._rates = {"acceleration": acceleration_mps2, "braking": braking_mps2}
        self._bends = speed_points((), ())
        if lateral_mps2 is not None and length_m > 0:
            self._bends = _bends_of(along, length_m, lateral_mps2, braking_mps2)
        self._heading = self._place()[2]

    @property
    def arrived(self) -> bool:
        """It has come to the end of its path."""
        return self.along_m >= self.line.length_m

    def hold(self, most_mps2: float) -> None:
        """Speed up and brake with no more than this from now on, nor than its own rates."""
        for name, rate in self._rates.items():
            self._record[name] = min(rate, most_mps2)

    def pose(self) -> FollowerPose:
        """Return where it is, as if it kept its speed (acceleration and yaw rate 0)."""
        x, y, heading = self._place()
        return FollowerPose(x, y, heading, self.speed_mps, 0.0, 0.0)

    def step(self, dt: float) -> FollowerPose:
        """Move on by `dt` seconds and return where it is then."""
        before, heading_before = self.speed_mps, self._heading
        self._numbers[_PACE] = self.pace_mps
        self._numbers[_STOP] = nan if self.stop_m is None else self.stop_m
        x, y, heading = advance(self._record, self._vertices, self._bends, dt)
        self.along_m, self.speed_mps = self._numbers.item(_ALONG), self._numbers.item(_SPEED)
        self._heading = heading
        turned = wrap(heading - heading_before)
        return FollowerPose(x, y, heading, self.speed_mps, (self.speed_mps - before) / dt, turned / dt)

    def _place(self) -> tuple[float, float, float]:
        place: tuple[float, float, float] = pose_on_path(self.along_m, self._half_m, self._vertices)
        return place


@lru_cache(maxsize=256)
def _bends_of(path: Points, length_m: float, lateral_mps2: float, braking_mps2: float) -> Records:
    """Return how fast a path's bends may be taken, as `SpeedPoint`s."""
    line = line_of(path)
    bends = BendSpeeds(line.marks, line.angles, axle_m=length_m, lateral_mps2=lateral_mps2, braking_mps2=braking_mps2)
    return speed_points(bends.marks, bends.speeds)
