"""Whether the ego's driver can see somebody past the others. Buildings hide nothing: a trace does not hold them."""

from __future__ import annotations

import numpy as np

from foresee_dsl.forecast.geometry import BoolArray, FloatArray
from foresee_dsl.simulate.collision import corners
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

SEEN_OVER = frozenset({"pedestrian", "bicycle", "motorcycle", "obstacle"})
"""Kinds that hide nobody. Ours: narrow, or low (cones, crates, barriers)."""


def in_view(trace: Trace, other: int, frame: int) -> bool:
    """Say whether a corner or the middle of an actor is in view from the middle of the ego.

    Args:
        trace: a run. other: the actor's column. frame: when.
    """
    hiding = [
        k
        for k, info in enumerate(trace.actors)
        if k not in (0, other) and info.kind not in SEEN_OVER and not np.isnan(trace.states[frame, k, X])
    ]
    if not hiding:
        return True
    body = _boxes(trace, frame, [other])[0]
    marks = np.vstack([corners(body), body[:2]])
    eye = trace.states[frame, 0, [X, Y]]
    return bool((~_cut(eye, marks, _boxes(trace, frame, hiding))).all(axis=1).any())


def _boxes(trace: Trace, frame: int, actors: list[int]) -> FloatArray:
    sizes = [(trace.actors[k].length_m, trace.actors[k].width_m) for k in actors]
    boxes: FloatArray = np.column_stack([trace.states[frame, actors][:, [X, Y, HEADING]], sizes])
    return boxes


def _cut(eye: FloatArray, marks: FloatArray, boxes: FloatArray) -> BoolArray:
    """Say which lines from an eye [2] to marks [M, 2] run through which boxes [K, 5]: [M, K].

    In a box's own axes it is the set of points within half its length and half its width; a line is inside both over
    one stretch each, and runs through the box where the stretches meet.
    """
    cos, sin = np.cos(boxes[:, 2]), np.sin(boxes[:, 2])
    ex, ey = eye[:, None] - boxes[:, :2].T
    start = np.stack([ex * cos + ey * sin, ey * cos - ex * sin], axis=-1)
    dx, dy = (marks - eye).T[:, :, None]
    way = np.stack([dx * cos + dy * sin, dy * cos - dx * sin], axis=-1)
    way = np.where(np.abs(way) < 1e-12, 1e-12, way)
    half = boxes[:, 3:] / 2
    one, two = (-half - start) / way, (half - start) / way
    begin = np.minimum(one, two).max(axis=-1).clip(min=0.0)
    end = np.maximum(one, two).min(axis=-1).clip(max=1.0)
    hidden: BoolArray = begin < end
    return hidden
