"""Pictures of a recorded run, frame by frame, as one who trains or shows something from traces needs them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.simulate.rasters.birdseye import Pose
from foresee_dsl.simulate.rasters.layout import GROUP_OF, HEIGHTS_M
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

FloatArray = NDArray[np.float64]


class RecordedFrames:
    """The arrays that a `Canvas` takes, from a trace: where everybody really was."""

    def __init__(self, trace: Trace) -> None:
        """Know the run's actors; heights are those usual for their kind, which a trace does not hold."""
        self._states = trace.states
        others = trace.actors[1:]
        self._sizes = np.array([(a.length_m, a.width_m) for a in others]).reshape(-1, 2)
        self._heights = np.array([HEIGHTS_M[a.kind] for a in others], dtype=np.float64)
        self.groups = np.array([GROUP_OF[a.kind] for a in others], dtype=np.int64)
        """[A - 1] index into `layout.GROUPS`, the ego left out."""

    def pose(self, frame: int) -> Pose:
        """Return the ego's x, y (m) and heading (rad)."""
        x, y, heading = self._states[frame, 0, [X, Y, HEADING]].tolist()
        return x, y, heading

    def actors(self, frame: int) -> FloatArray:
        """Return [A - 1, 6] x, y, heading, speed, length, width: for `Canvas.birds_eye`."""
        return np.hstack((self._states[frame, 1:][:, [X, Y, HEADING, SPEED]], self._sizes))

    def bodies(self, frame: int) -> FloatArray:
        """Return [A - 1, 6] x, y, heading, length, width, height: for `Canvas.forward`."""
        return np.column_stack((self._states[frame, 1:][:, [X, Y, HEADING]], self._sizes, self._heights))
