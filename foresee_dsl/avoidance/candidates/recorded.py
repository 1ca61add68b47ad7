"""Converts a trace into the arrays that roll-outs (predictions without simulation) read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from foresee_dsl.compile.catalogue import USUAL_HEIGHTS_M
from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """The recorded run as the arrays that roll-outs read.

    Attributes:
        tracks: [A, T, 4] x, y (m), heading (rad, continuous), distance to the next frame (m); NaN before an actor
            appears; after it has left, it continues straight on. sizes: [A, 3] length, width, height (m). there: [A, T]
            whether it is present.
    """

    trace: Trace
    tracks: FloatArray
    sizes: FloatArray
    there: BoolArray

    @classmethod
    def of(cls, trace: Trace, heights_m: Mapping[str, float] | None = None) -> Self:
        """Return the arrays of a run.

        `heights_m`: heights of models by name, m; other models have the default of their class.
        """
        states = trace.states
        tracks = np.ascontiguousarray(states[:, :, [X, Y, HEADING, SPEED]].transpose(1, 0, 2))
        there = ~np.isnan(tracks[:, :, 0])
        for track, present in zip(tracks, there, strict=True):
            frames = np.flatnonzero(present)
            if not len(frames):
                continue
            first, last = int(frames[0]), int(frames[-1])
            track[first : last + 1, 2] = np.unwrap(track[first : last + 1, 2])
            steps = np.hypot(*np.diff(track[first : last + 1, :2], axis=0).T)
            track[first:last, 3] = steps
            track[last, 3] *= STEP_S
            beyond = np.arange(1, trace.frames - last)
            track[last + 1 :, 0] = track[last, 0] + beyond * track[last, 3] * np.cos(track[last, 2])
            track[last + 1 :, 1] = track[last, 1] + beyond * track[last, 3] * np.sin(track[last, 2])
            track[last + 1 :, 2:] = track[last, 2:]
        heights = heights_m or {}
        sizes = np.array([(i.length_m, i.width_m, heights.get(i.model, USUAL_HEIGHTS_M[i.kind])) for i in trace.actors])
        return cls(trace, tracks, sizes, there)

    def mps(self, actor: int, frame: int) -> float:
        """Return an actor's recorded speed, m/s; 0 when it is absent."""
        speed = float(self.trace.states[frame, actor, SPEED])
        return 0.0 if np.isnan(speed) else speed
