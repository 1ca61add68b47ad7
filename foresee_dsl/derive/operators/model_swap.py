"""The paper's model swap (section 3.4), and its validity check: the new model fits where the old one stood."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.derive.operators.ours import retimed
from foresee_dsl.derive.operators.situation import ActorsRun, BuiltIn, Situation, boxes_at, others_at
from foresee_dsl.derive.presets import Preset
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import pairwise_box_distance
from foresee_dsl.language.model import Change
from foresee_dsl.simulate.trace import SPEED, Trace

LEAST_GAP_M = 0.5
"""Smallest gap to a neighbour on the lane after a swap, m. Ours: SUMO's queues keep 2.5 m, real ones 1 m."""
SAME_WAY_RAD = math.radians(45)
"""Two vehicles whose headings differ by at most this may follow each other, rad. Ours: with more, their lanes cross."""


class ModelSwap(BuiltIn):
    """Replaces an actor's model by another one of the same class that fits in its place.

    The paper also lets a bicycle become a pedestrian. Here it cannot: SUMO applies other rules to pedestrians, so the
    child would differ in more than the model.
    """

    name, property = "model_swap", "model"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw one of the models that fit."""
        del preset
        others = self.fitting(situation, target)
        if not others:
            return ()
        now = others[int(rng.integers(len(others)))]
        return (Change(actor=target, property=self.property, was=situation.info(target).model, now=now),)

    def fitting(self, situation: Situation, target: str) -> tuple[str, ...]:
        """Return the names of the other models that fit in the place of a target's at the clip's first frame, sorted;
        all are equally likely.
        """
        fitting = situation.fitting_models
        if target not in fitting:
            others = sorted(name for name in situation.swappable if name != situation.info(target).model)
            trace, column = situation.trace, situation.columns[target]
            fitting[target] = tuple(name for name in others if fits(trace, column, 0, situation.models[name]))
        return fitting[target]

    def tracks(self, boxes: FloatArray, specs: Sequence[ModelSpec], now: ModelSpec) -> FloatArray:
        """Return an actor's track with each of N other models: [N, T, 5] footprints.

        A swap keeps the ratio of the actor's cruise speed to that of its model, so the actor drives faster or slower.
        """
        paces = np.array([s.cruise_mps / now.cruise_mps if s.cruise_mps and now.cruise_mps else 1.0 for s in specs])
        paced = retimed(boxes, factor=paces)
        return np.array([_with_model(track, spec) for track, spec in zip(paced, specs, strict=True)])

    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Give the footprints the new model's size."""
        return _with_model(boxes, run.models[str(change.now)])

    def letter_target(self, situation: Situation) -> str:
        """Return the near actor that comes closest to the ego, among those that come closest inside the clip and not at
        one of its ends; "" if there is none.
        """
        settings = ForeseeSettings()
        best = {actor: int(gaps.argmin()) for actor, gaps in situation.gaps.items()}
        relevant = [
            actor
            for actor, frame in best.items()
            # A minimum at an edge of the window means that the closest frame lies outside.
            if 0 < frame < situation.trace.frames - 1
            and situation.gaps[actor][frame] <= settings.radius_m(situation.kind(actor))
            and situation.kind(actor) != "obstacle"
        ]
        return min(relevant, key=lambda a: (float(situation.gaps[a].min()), situation.columns[a]), default="")


def fits(trace: Trace, actor: int, frame: int, spec: ModelSpec) -> bool:
    """Return whether an actor (a column) of the parent's run can have another model at a frame, the clip's first.

    The new model must be of the same class and reach the actor's speed and cruise speed. Its body must not overlap
    another, and must leave `LEAST_GAP_M`, or the present gap if that is smaller, to the neighbours before and behind
    it."""
    info = trace.actors[actor]
    if spec.kind != info.kind or max(trace.states[frame, actor, SPEED], info.cruise_mps) > spec.max_speed_mps:
        return False
    others = others_at(trace, actor, frame)
    if not len(others):
        return True
    now = boxes_at(trace, frame)[actor]
    then = _with_model(now[None], spec)[0]
    gaps = pairwise_box_distance(then, others)
    wanted = np.where(_in_line(then, others), np.minimum(LEAST_GAP_M, pairwise_box_distance(now, others)), 0.0)
    return bool(((gaps > 0) & (gaps >= wanted - 1e-9)).all())


def _with_model(boxes: FloatArray, spec: ModelSpec) -> FloatArray:
    """Return footprints, [N, 5], with another model; a vehicle keeps its front, a pedestrian its middle."""
    changed = boxes.copy()
    back = 0.0 if spec.kind == "pedestrian" else (spec.length_m - boxes[0, 3]) / 2
    changed[:, 0] -= back * np.cos(boxes[:, 2])
    changed[:, 1] -= back * np.sin(boxes[:, 2])
    changed[:, 3:] = (spec.length_m, spec.width_m)
    return changed


def _in_line(box: FloatArray, others: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which of the others drive before or behind a box: they overlap its track and share its direction."""
    dx, dy = others[:, 0] - box[0], others[:, 1] - box[1]
    sideways = np.abs(dy * math.cos(box[2]) - dx * math.sin(box[2]))
    turned = np.abs(np.angle(np.exp(1j * (others[:, 2] - box[2]))))
    in_line: np.ndarray[tuple[int], np.dtype[np.bool_]] = (sideways < (others[:, 4] + box[4]) / 2) & (
        turned < SAME_WAY_RAD
    )
    return in_line
