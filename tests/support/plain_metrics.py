"""Near-miss measures of a single pair by their plain definitions, to compare the fast ones with."""

from __future__ import annotations

from math import inf

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance, box_overlap
from foresee_dsl.simulate.trace import STEP_S


def pet(a: FloatArray, b: FloatArray, *, step_s: float = STEP_S, horizon_s: float = 10.0) -> float:
    """Return the post-encroachment time: the time between one leaving a spot and the other coming to the same spot.

    It is the smallest time by which one of the two trajectories would have to be shifted for the footprints to touch,
    to the nearest step above.

    Args:
        a, b: [T, 5] footprints (x, y, heading, length, width) at the same frames, NaN where absent.
        step_s: time between frames.
        horizon_s: the longest time looked for. Ours: nobody calls two passages 10 s apart a conflict.

    Returns:
        s: 0 when they touch, infinity when there is no common spot within the horizon.
    """
    frames = min(len(a), len(b))
    for lag in range(min(frames, round(horizon_s / step_s) + 1)):
        early, late = slice(0, frames - lag), slice(lag, frames)
        if box_overlap(a[early], b[late]).any() or box_overlap(b[early], a[late]).any():
            return lag * step_s
    return inf


def minimum_distance(a: FloatArray, b: FloatArray) -> tuple[float, int]:
    """Return the smallest distance (m) between two footprints and the first frame where it occurs.

    Args:
        a, b: [T, 5] footprints at the same frames, NaN where absent.

    Returns:
        (infinity, -1) when they are never there together.
    """
    distance = box_distance(a, b)
    if not len(distance) or np.isnan(distance).all():
        return inf, -1
    frame = int(np.nanargmin(distance))
    return float(distance[frame]), frame
