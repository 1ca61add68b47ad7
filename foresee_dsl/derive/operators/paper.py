"""The paper's operators (section 3.4): model swap and steering.

A new model must fit where the old one stood. When an actor is steered, its front wheels get an offset for a time;
afterwards the actor returns to its lane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.derive.operators.ours import retimed
from foresee_dsl.derive.operators.situation import (
    ActorsRun,
    BuiltIn,
    Numeric,
    Situation,
    boxes_at,
    multiples,
    others_at,
)
from foresee_dsl.derive.presets import MutationPreset, SteerSettings
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_dsl.simulate.results.criticality import SAME_WAY_RAD
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace

LEAST_GAP_M = 0.5
"""Smallest gap to a neighbour on the lane after a swap, m. Ours: SUMO's queues keep 2.5 m, real ones 1 m."""


class ModelSwap(BuiltIn):
    """Replaces an actor's model by another one of the same class that fits in its place.

    The paper also lets a bicycle become a pedestrian. Here it cannot: SUMO applies other rules to pedestrians, so the
    child would differ in more than the model.
    """

    name, property = "model_swap", "model"

    def changes(self, situation: Situation, target: str, preset: MutationPreset, rng: Generator) -> tuple[Change, ...]:
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
    gaps = box_distance(then, others)
    wanted = np.where(_in_line(then, others), np.minimum(LEAST_GAP_M, box_distance(now, others)), 0.0)
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


RECOVERS_S = 1.0
"""Time constant with which a vehicle that returns to its lane corrects its heading, s. Ours: the look-ahead time of the
simulated vehicle."""


class Steer(Numeric):
    """Adds a steering offset for a time; afterwards the actor returns to its lane. Only actors on lanes can be
    steered."""

    name = property = "steer"

    def values(self, situation: Situation, target: str, preset: MutationPreset) -> Sequence[float]:
        """Return the offsets that friction, comfort and the steering rate allow, as shares of the largest angle."""
        settings = preset.steer
        if not situation.on_lanes(target):
            return ()
        speed = situation.speed_mps(target, situation.trace.frame_at(_onset_s(situation, settings)))
        # A target that stands when the steering begins is steered only if the preset requires no speed, as the paper's
        # wording does.
        if speed < settings.least_speed_mps:
            return ()
        bound = largest_share(situation.spec(target), speed, settings)
        low, high = max(settings.low, -bound), min(settings.high, bound)
        return multiples(low, high, settings.step, centre=0.0, dead=max(settings.least_share * bound, settings.step))

    def to(self, situation: Situation, target: str, preset: MutationPreset, value: float) -> tuple[Change, ...]:
        """Return the change to an allowed offset, which begins at the onset and lasts for the preset's `hold_s`."""
        settings, onset_s = preset.steer, _onset_s(situation, preset.steer)
        begins = onset_s > 0 or settings.before_point_s is not None
        when = {
            "start": Quantity.of(onset_s, "time", 2) if begins else None,
            "duration": None if settings.hold_s is None else Quantity.of(settings.hold_s, "time", 2),
        }
        return tuple(change.model_copy(update=when) for change in self.changed(situation, target, value))

    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Return the track in which each recorded step is turned by the heading that the offset has added so far; once
        the offset is over, this added heading decays.
        """
        trace, actor, models = run
        spec, share = models[trace.actors[actor].model], change.now.si if isinstance(change.now, Quantity) else 0.0
        onset = round((change.start.si if isinstance(change.start, Quantity) else 0.0) / STEP_S)
        held = round(change.duration.si / STEP_S) if isinstance(change.duration, Quantity) else len(boxes)
        rate = np.nan_to_num(trace.states[:, actor, SPEED]) / spec.wheelbase_m * math.tan(share * spec.max_steer_rad)
        frames = np.arange(len(boxes))
        rate[(frames < onset) | (frames >= onset + held)] = 0.0
        turned = np.cumsum(rate) * STEP_S
        turned *= np.exp(-np.maximum(frames - onset - held, 0) * STEP_S / RECOVERS_S)
        steps = np.diff(boxes[:, :2], axis=0)
        cos, sin = np.cos(turned[:-1]), np.sin(turned[:-1])
        changed = boxes.copy()
        changed[1:, 0] = boxes[0, 0] + np.cumsum(cos * steps[:, 0] - sin * steps[:, 1])
        changed[1:, 1] = boxes[0, 1] + np.cumsum(sin * steps[:, 0] + cos * steps[:, 1])
        changed[:, 2] = boxes[:, 2] + turned
        return changed

    def letter_target(self, situation: Situation) -> str:
        """Return the vehicle that is closest to the ego at the clip's beginning; "" for none."""
        steerable = [actor for actor in situation.columns if situation.on_lanes(actor)]
        return next(iter(situation.closest(0, steerable)), "")


def _onset_s(situation: Situation, settings: SteerSettings) -> float:
    """Return the time at which the steering begins, s: the proposed one; if none is proposed, the preset's (by default
    0).
    """
    if situation.onset_s is not None:
        return situation.onset_s
    before_s = settings.before_point_s
    return 0.0 if before_s is None else max(0.0, situation.frame * STEP_S - before_s)


def largest_share(spec: ModelSpec, speed_mps: float, settings: SteerSettings) -> float:
    """Return the largest share of the steering angle that friction, comfort and the steering rate allow at a speed."""
    angle = spec.max_steer_rad
    if angle <= 0:
        return 0.0
    if settings.lateral_g is not None and speed_mps > 0:
        lateral = min(settings.lateral_g * GRAVITY_MPS2, lateral_limit_mps2(spec.name, DRY_FRICTION))
        angle = min(angle, math.atan(lateral / speed_mps**2 * spec.wheelbase_m))
    if settings.rate_rad_s is not None and settings.hold_s is not None:
        angle = min(angle, settings.rate_rad_s * settings.hold_s / 2)
    return angle / spec.max_steer_rad
