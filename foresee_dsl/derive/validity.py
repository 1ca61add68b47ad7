"""The paper's validity check (section 3.4): a swapped model fits where the old one stood."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.kernels.boxes import FloatArray, box_distances
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

LEAST_GAP_M = 0.5
"""What must stay free to a neighbour on the lane. Ours: standing queues in SUMO keep 2.5 m, crowded real ones 1 m."""
SAME_WAY_RAD = math.radians(45)
"""Neighbours drive in about the same direction; with more between them they are on crossing ways."""


def fits(trace: Trace, actor: int, frame: int, spec: ModelSpec) -> bool:
    """Say whether an actor can have another model at a frame.

    Its class must be the same, its speed and what it is to drive within the new model's. The new body must overlap
    nobody, and must leave `LEAST_GAP_M` to the neighbours before and behind it (or what there was, where it was less).

    Args:
        trace: the parent's run.
        actor: its column.
        frame: the clip's first.
        spec: the new model.
    """
    info = trace.actors[actor]
    if spec.kind != info.kind or max(trace.states[frame, actor, SPEED], info.cruise_mps) > spec.max_speed_mps:
        return False
    now, then = boxes(trace, frame)[actor], swapped_box(trace, actor, frame, spec)
    others = np.delete(boxes(trace, frame), actor, axis=0)
    others = others[~np.isnan(others[:, 0])]
    if not len(others):
        return True
    gaps = box_distances(then, others)
    wanted = np.where(_in_line(then, others), np.minimum(LEAST_GAP_M, box_distances(now, others)), 0.0)
    return bool(((gaps > 0) & (gaps >= wanted - 1e-9)).all())


def touches_nobody(trace: Trace, actor: int, frame: int, box: FloatArray) -> bool:
    """Say whether an actor's footprint, [5], could be elsewhere at a frame without touching anybody."""
    others = np.delete(boxes(trace, frame), actor, axis=0)
    others = others[~np.isnan(others[:, 0])]
    return not len(others) or bool((box_distances(box, others) > 0).all())


def boxes(trace: Trace, frame: int) -> FloatArray:
    """Return all footprints at a frame, [A, 5]: x, y, heading, length, width; NaN where absent."""
    sizes = np.array([(info.length_m, info.width_m) for info in trace.actors])
    return np.hstack([trace.states[frame][:, [X, Y, HEADING]], sizes])


def swapped_box(trace: Trace, actor: int, frame: int, spec: ModelSpec) -> FloatArray:
    """Return the footprint, [5], that another model would have: a vehicle's front stays, a pedestrian's middle."""
    x, y, heading = trace.states[frame, actor, [X, Y, HEADING]]
    back = 0.0 if spec.kind == "pedestrian" else spec.length_m / 2 - trace.actors[actor].front_m
    return np.array([x - back * math.cos(heading), y - back * math.sin(heading), heading, spec.length_m, spec.width_m])


def _in_line(box: FloatArray, others: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which of the others drive before or behind a box on its lane: in its track, and its way."""
    dx, dy = others[:, 0] - box[0], others[:, 1] - box[1]
    aside = np.abs(dy * math.cos(box[2]) - dx * math.sin(box[2]))
    turned = np.abs(np.angle(np.exp(1j * (others[:, 2] - box[2]))))
    found: np.ndarray[tuple[int], np.dtype[np.bool_]] = (aside < (others[:, 4] + box[4]) / 2) & (turned < SAME_WAY_RAD)
    return found
