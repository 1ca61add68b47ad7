"""The ego's way in a recorded run, by length instead of time, so that it can be driven at another speed."""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.lines import FloatArray
from foresee_dsl.simulate.trace import HEADING, STEER, Trace, X, Y


class RecordedPath:
    """Where the ego drove in a run; straight on beyond its end.

    Attributes:
        along: [T] m, how far the ego has come at each frame.
    """

    def __init__(self, trace: Trace) -> None:
        states = trace.states[:, 0]
        steps = np.hypot(*np.diff(states[:, [X, Y]], axis=0).T) if len(states) > 1 else np.empty(0)
        self.along: FloatArray = np.r_[0.0, np.cumsum(steps)]
        # A little is added to each step, for places at which the ego stood to have an order.
        self._marks = self.along + np.arange(len(self.along)) * 1e-9
        self._poses = np.column_stack([states[:, X], states[:, Y], np.unwrap(states[:, HEADING])])
        self._steer = np.array(states[:, STEER])

    def at(self, along_m: FloatArray) -> FloatArray:
        """Return x, y, heading at lengths [N] of the way, [N, 3]."""
        poses = np.column_stack([np.interp(along_m, self._marks, column) for column in self._poses.T])
        beyond = np.maximum(along_m - self._marks[-1], 0.0)
        poses[:, 0] += beyond * np.cos(poses[:, 2])
        poses[:, 1] += beyond * np.sin(poses[:, 2])
        return poses

    def steer(self, along_m: float) -> float:
        """Return the angle of the front wheels (rad) that was steered at a length; the last one beyond the end."""
        return float(np.interp(along_m, self._marks, self._steer))
