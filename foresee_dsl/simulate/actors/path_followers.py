"""The path of an actor and its motion along it: pedestrians, and cyclists or vehicles away from the lanes.

`path_groups` moves all followers of a run together. A clip restores a follower from its length along the path and its
speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isnan, nan

import numpy as np

from foresee_dsl.compile.roads.polyline import Points, Polyline, as_line, line_of
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.lines import speed_points, vertices
from foresee_dsl.kernels.path_following import OFF_ROAD, ActorOnPath, pose_on_path
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.simulate.actors.bend_speeds import BendSpeeds

_ALONG, _SPEED, _PACE, _STOP = map(ActorOnPath._fields.index, ("along", "speed", "pace", "stop"))


class PathFollower:
    """Follows a polyline, accelerates or brakes to a pace, and stops at `stop_m` and at the end.

    Each step depends only on `along_m`, `speed_mps`, the pace and the stop in force, so a follower restored from these
    continues with the same positions.

    Args:
        path: [N, 2] m.
        pace_mps: the speed to reach, m/s.
        acceleration_mps2, braking_mps2: rates of speeding up and of braking, m/s^2, both positive.
        length_m: length of the follower's footprint, m. Its heading is that of the line from its rear to its front, so
            that a cyclist turns gradually at a corner.
        along_m, speed_mps: its length along the path and its speed at the beginning.
        lateral_mps2: largest lateral acceleration in a corner; None for an actor that turns on the spot.

    Raises:
        ValueError: the path has no length, or a rate is not positive.

    A `stop_m` that lies behind the follower, or so near that the follower cannot brake for it, has no effect.

    Attributes:
        path: the polyline. line: the polyline with lengths. vertices: its points, as records for kernels. bends: the
            speed limits of its bends, also as records.
        record: its state and parameters, an array of one `kernels.path_following.ActorOnPath`.
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
            raise ValueError(
                f"the rates must be positive: speeding up is {acceleration_mps2} m/s^2, braking {braking_mps2} m/s^2"
            )
        self.path = path if isinstance(path, tuple) else as_line(np.asarray(path, dtype=np.float64).reshape(-1, 2))
        self.line = _line_of(self.path)
        self.vertices, self.bends = _vertices_of(self.path), speed_points((), ())
        if lateral_mps2 is not None and length_m > 0:
            self.bends = _bends_of(self.path, length_m, lateral_mps2, braking_mps2)
        half_m = length_m / 2
        heading = pose_on_path(along_m, half_m, self.vertices)[2]
        record = ActorOnPath(
            along=along_m,
            speed=speed_mps,
            pace=pace_mps,
            acceleration=acceleration_mps2,
            braking=braking_mps2,
            stop=nan,
            half_length=half_m,
            heading=heading,
            length=0.0,
            width=0.0,
            row=0,
            seen_on=OFF_ROAD,
            line_begin=0,
            line_end=len(self.vertices),
            bends_begin=0,
            bends_end=len(self.bends),
            cells_begin=0,
            cells_end=0,
        )
        self._rates = {"acceleration": acceleration_mps2, "braking": braking_mps2}
        self._braking_mps2, self._half_m = braking_mps2, half_m
        self.keep_in(np.array([record], dtype_of(ActorOnPath)))

    def keep_in(self, record: Records) -> None:
        """Keep the follower's state in this array of one record from now on.

        The record must already hold the state; the array may be a view of a larger one.
        """
        self.record = record
        # A view of the record's numbers: reading from it takes a tenth of the time of reading a record's field.
        self._numbers = record.view(np.float64)

    @property
    def along_m(self) -> float:
        """Length along the path, m."""
        return self._numbers.item(_ALONG)

    @along_m.setter
    def along_m(self, along_m: float) -> None:
        self._numbers[_ALONG] = along_m

    @property
    def speed_mps(self) -> float:
        """Speed, m/s."""
        return self._numbers.item(_SPEED)

    @property
    def pace_mps(self) -> float:
        """Speed that the follower accelerates or brakes to, m/s; 0 halts it."""
        return self._numbers.item(_PACE)

    @pace_mps.setter
    def pace_mps(self, pace_mps: float) -> None:
        self._numbers[_PACE] = pace_mps

    @property
    def stop_m(self) -> float | None:
        """Length along the path at which the follower must wait, m; None when it may go on."""
        stop_m = self._numbers.item(_STOP)
        return None if isnan(stop_m) else stop_m

    @stop_m.setter
    def stop_m(self, stop_m: float | None) -> None:
        self._numbers[_STOP] = nan if stop_m is None else stop_m

    @property
    def arrived(self) -> bool:
        """Whether the follower has reached the end of its path."""
        return self.along_m >= self.line.length_m

    def hold(self, most_mps2: float) -> None:
        """Limit acceleration and braking to this value where it is lower than the follower's own rates."""
        for name, rate in self._rates.items():
            self.record[name] = min(rate, most_mps2)

    def brake_harder(self, most_mps2: float) -> None:
        """Brake with this rate where it is higher than the follower's own; 0 restores its own rate."""
        self._rates["braking"] = self.record["braking"] = max(self._braking_mps2, most_mps2)

    def pose(self) -> tuple[float, float, float]:
        """Return where the follower is: x, y (m) and heading (rad)."""
        pose: tuple[float, float, float] = pose_on_path(self.along_m, self._half_m, self.vertices)
        return pose


@lru_cache(maxsize=128)
def _line_of(path: Points) -> Polyline:
    """Return the line of a path; raises `ValueError` if the path has no length."""
    points = np.array(path)
    if not np.isfinite(points).all() or len(points) < 2 or not np.ptp(points, axis=0).max() > 0:
        raise ValueError(f"a path needs at least two different points, and this one has {points.tolist()}")
    return line_of(path)


@lru_cache(maxsize=128)
def _vertices_of(path: Points) -> Records:
    """Return the vertices of a path, as records for kernels."""
    line = line_of(path)
    return vertices(line.points, line.s, line.heading)


@lru_cache(maxsize=128)
def _bends_of(path: Points, length_m: float, lateral_mps2: float, braking_mps2: float) -> Records:
    """Return the speed limits of a path's bends, as `SpeedPoint`s."""
    line = line_of(path)
    bends = BendSpeeds(line.marks, line.angles, axle_m=length_m, lateral_mps2=lateral_mps2, braking_mps2=braking_mps2)
    return speed_points(bends.marks, bends.speeds)
