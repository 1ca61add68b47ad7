"""What a mutation would do, without a simulation: the target's recorded track, changed, against the recorded ego.

The ego's reaction is left out: the roll-out says which of many drawn mutations are worth a simulation, not how they
end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.lateral_offset import LINE_OVER_M
from foresee_dsl.forecast.geometry import FloatArray, footprints
from foresee_dsl.kernels.boxes import pairwise_box_distance
from foresee_dsl.kernels.sumo_traffic import SIDEWAYS_MPS, SIDEWAYS_SHARE
from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace

RECOVERS_S = 1.0
"""How fast a lane-recovering vehicle takes back an error of its heading. Ours: the time in which the simulated one
looks ahead."""


def predicted_gap_m(
    trace: Trace, actor: int, changes: Iterable[Change], models: Mapping[str, ModelSpec]
) -> tuple[float, float]:
    """Return how near an actor to which changes are done comes to the recorded ego: footprints, and centres, m.

    Args:
        trace: the clip's run, unmutated.
        actor: the column of the actor. changes: of it. models: by name.
    """
    boxes = footprints(trace, actor)
    for change in changes:
        value = change.now
        if isinstance(value, str):
            boxes = _with_model(boxes, models[value])
        elif change.property == "timing":
            boxes = _retimed(boxes, value.si, 0.0)
        elif change.property == "delay" and isinstance(change.was, Quantity):
            boxes = _retimed(boxes, 1.0, value.si - change.was.si)
        elif change.property == "moving" and isinstance(change.was, Quantity):
            boxes = _retimed(boxes, 1.0, 0.0, value.si - change.was.si)
        elif change.property == "line" and isinstance(change.was, Quantity):
            boxes = _aside(trace, actor, boxes, value.si - change.was.si)
        elif change.property == "steer":
            boxes = _steered(trace, actor, boxes, change, value.si, models)
    ego = footprints(trace, 0)
    present = ~np.isnan(boxes[:, 0]) & ~np.isnan(ego[:, 0])
    if not present.any():
        return math.inf, math.inf
    gaps = pairwise_box_distance(ego[present], boxes[present])
    return float(gaps.min()), float(np.hypot(*(ego[present, :2] - boxes[present, :2]).T).min())


def _with_model(boxes: FloatArray, spec: ModelSpec) -> FloatArray:
    changed = boxes.copy()
    back = 0.0 if spec.kind == "pedestrian" else (spec.length_m - boxes[0, 3]) / 2
    changed[:, 0] -= back * np.cos(boxes[:, 2])
    changed[:, 1] -= back * np.sin(boxes[:, 2])
    changed[:, 3:] = (spec.length_m, spec.width_m)
    return changed


def _retimed(boxes: FloatArray, factor: float, delay_s: float, ahead_m: float = 0.0) -> FloatArray:
    """Move along the recorded track `factor` times as fast, so much later and so far ahead; straight on at its end."""
    here = ~np.isnan(boxes[:, 0])
    track = boxes[here]
    if len(track) < 2:
        return boxes
    gone = np.r_[0.0, np.cumsum(np.hypot(*np.diff(track[:, :2], axis=0).T))]
    time_s = np.arange(len(boxes)) * STEP_S
    wanted = ahead_m + factor * np.interp(np.maximum(time_s - delay_s, 0.0), time_s[: len(gone)], gone)
    # A little is added to each step, for places at which the actor stood to have an order.
    marks = gone + np.arange(len(gone)) * 1e-9
    beyond = np.maximum(wanted - gone[-1], 0.0)
    changed = np.column_stack([np.interp(wanted, marks, column) for column in _unwrapped(track).T])
    changed[:, 0] += beyond * np.cos(changed[:, 2])
    changed[:, 1] += beyond * np.sin(changed[:, 2])
    return changed


def _aside(trace: Trace, actor: int, boxes: FloatArray, left_m: float) -> FloatArray:
    """Move the recorded track sideways as the simulation does: along a path over some metres, on a lane at a rate."""
    speed = np.nan_to_num(trace.states[:, actor, SPEED])
    if trace.actors[actor].path:
        share = np.cumsum(speed) * STEP_S / LINE_OVER_M
    else:
        share = np.cumsum(np.minimum(SIDEWAYS_MPS, SIDEWAYS_SHARE * speed)) * STEP_S / abs(left_m or 1.0)
    left = left_m * np.minimum(share, 1.0)
    changed = boxes.copy()
    changed[:, 0] -= left * np.sin(boxes[:, 2])
    changed[:, 1] += left * np.cos(boxes[:, 2])
    return changed


def _unwrapped(track: FloatArray) -> FloatArray:
    track = track.copy()
    track[:, 2] = np.unwrap(track[:, 2])
    return track


def _steered(
    trace: Trace, actor: int, boxes: FloatArray, change: Change, share: float, models: Mapping[str, ModelSpec]
) -> FloatArray:
    """Turn the recorded steps by what the offset adds to the heading while it is held; then the error decays."""
    spec = models[trace.actors[actor].model]
    onset = round((change.start.si if isinstance(change.start, Quantity) else 0.0) / STEP_S)
    held = round(change.duration.si / STEP_S) if isinstance(change.duration, Quantity) else len(boxes)
    speed = np.nan_to_num(trace.states[:, actor, SPEED])
    rate = speed / spec.wheelbase_m * math.tan(share * spec.max_steer_rad)
    frames = np.arange(len(boxes))
    rate[(frames < onset) | (frames >= onset + held)] = 0.0
    turned = np.cumsum(rate) * STEP_S
    after = np.maximum(frames - onset - held, 0) * STEP_S
    turned *= np.exp(-after / RECOVERS_S)
    steps = np.diff(boxes[:, :2], axis=0)
    cos, sin = np.cos(turned[:-1]), np.sin(turned[:-1])
    changed = boxes.copy()
    changed[1:, 0] = boxes[0, 0] + np.cumsum(cos * steps[:, 0] - sin * steps[:, 1])
    changed[1:, 1] = boxes[0, 1] + np.cumsum(sin * steps[:, 0] + cos * steps[:, 1])
    changed[:, 2] = boxes[:, 2] + turned
    return changed
