"""The paper's steering (section 3.4): the front wheels get an offset for a time; afterwards the actor returns to its
lane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.derive.operators.situation import ActorsRun, Numeric, Situation, multiples
from foresee_dsl.derive.presets import Preset, SteerSettings
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_dsl.simulate.trace import SPEED, STEP_S

RECOVERS_S = 1.0
"""Time constant with which a vehicle that returns to its lane corrects its heading, s. Ours: the look-ahead time of the
simulated vehicle."""


class Steer(Numeric):
    """Adds a steering offset for a time; afterwards the actor returns to its lane. Only actors on lanes can be
    steered."""

    name = property = "steer"

    def values(self, situation: Situation, target: str, preset: Preset) -> Sequence[float]:
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

    def to(self, situation: Situation, target: str, preset: Preset, value: float) -> tuple[Change, ...]:
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
