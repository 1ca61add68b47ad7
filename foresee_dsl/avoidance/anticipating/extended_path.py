"""The path that the ego took in a run, continued along its route beyond the end of the run."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.avoidance.replay import RecordedPath
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

_ON_M = 80.0
"""Length by which the way is extended after the run's end, m. Ours: more than the ego drives within the assessed
seconds."""
_JOINS_M = 12.0
"""Length over which a lateral distance to the route's line decays, m. Ours: at 10 m/s about 1 s."""
_NEAR_M, _NEAR_RAD = 3.0, 0.6
"""If the run ends farther than this from the route's line, m, or at a larger angle to it, rad, the way is extended
straight on instead. Ours.
"""
_SPACING_M = 1.0


class ExtendedPath(RecordedPath):
    """A recorded path with its extension along the route and its recorded speeds.

    Attributes:
        along: [T] distance driven at each frame, m.
    """

    def __init__(self, trace: Trace, line: RouteLine | None = None) -> None:
        super().__init__(trace)
        states = trace.states[:, 0]
        self.recorded_mps: FloatArray = np.array(states[:, SPEED])
        if line is not None:
            self._continue(states[-1], line, trace.actors[0].wheelbase_m)
        grid = np.arange(0.0, float(self._marks[-1]) + _SPACING_M, _SPACING_M)
        self._grid, self._grid_poses = grid, self.at(grid)
        # At a place where the ego stood, its speed counts as that with which it drove on.
        self._fastest = _widened(self.along, self.recorded_mps)

    def _continue(self, last: FloatArray, line: RouteLine, wheelbase_m: float) -> None:
        x, y, heading = float(last[X]), float(last[Y]), float(last[HEADING])
        start, aside = line.project(x, y)
        turned = wrap(heading - line.at(start)[2])
        if abs(aside) > _NEAR_M or abs(turned) > _NEAR_RAD or not 0 <= start < line.length_m:
            return
        more = np.arange(_SPACING_M, min(_ON_M, line.length_m - start), _SPACING_M)
        rows = np.array([line.at(start + m, aside * math.exp(-m / _JOINS_M)) for m in more.tolist()]).reshape(-1, 3)
        if not len(rows):
            return
        rows[:, 2] -= aside / _JOINS_M * np.exp(-more / _JOINS_M)
        before = self._poses[-1, 2]
        headings = np.unwrap(np.r_[before, rows[:, 2]])[1:]
        curvature = np.interp(start + more, line.s, line.curvature)
        steps = np.hypot(np.diff(np.r_[x, rows[:, 0]]), np.diff(np.r_[y, rows[:, 1]]))
        self._marks = np.r_[self._marks, self._marks[-1] + np.cumsum(steps)]
        self._poses = np.vstack([self._poses, np.column_stack([rows[:, :2], headings])])
        self._steer = np.r_[self._steer, np.arctan(wheelbase_m * curvature)]

    def along_at(self, time_s: float) -> float:
        """Return the distance that the recorded ego had driven at a time, m; after the end of the run, it goes on with
        its last speed.
        """
        frame = time_s / STEP_S
        beyond_s = max(time_s - (len(self.along) - 1) * STEP_S, 0.0)
        return float(np.interp(frame, np.arange(len(self.along)), self.along) + beyond_s * self.recorded_mps[-1])

    def recorded_at(self, along_m: float) -> float:
        """Return the recorded ego's speed at a length of the way, m/s."""
        return float(np.interp(along_m, self.along, self._fastest))

    def beside(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return, for points [N, 2], their lengths along the way and distances to its left, m, and the way's heading
        there, rad."""
        dx = points[:, None, 0] - self._grid_poses[None, :, 0]
        dy = points[:, None, 1] - self._grid_poses[None, :, 1]
        k = np.argmin(np.where(np.isnan(dx), np.inf, dx * dx + dy * dy), axis=1)
        rows = np.arange(len(points))
        heading = self._grid_poses[k, 2]
        dx, dy = dx[rows, k], dy[rows, k]
        ahead = dx * np.cos(heading) + dy * np.sin(heading)
        return self._grid[k] + ahead, dy * np.cos(heading) - dx * np.sin(heading), heading


def _widened(along_m: FloatArray, speeds_mps: FloatArray) -> FloatArray:
    """Return for each place the largest recorded speed within a metre of it, m/s."""
    low = np.searchsorted(along_m, along_m - 1.0)
    high = np.searchsorted(along_m, along_m + 1.0, side="right")
    return np.array([speeds_mps[a:b].max() for a, b in zip(low.tolist(), high.tolist(), strict=True)])
