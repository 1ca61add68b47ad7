"""The paper's operators (section 3.4): model swap and steering."""

from __future__ import annotations

import math

from numpy.random import Generator

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.scene import DRY_FRICTION
from foresee_dsl.derive.operators.situation import Situation, drawn
from foresee_dsl.derive.presets import Preset, SteerSettings
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.language.model import Change, Quantity, Steers
from foresee_dsl.simulate.actors.dynamics import GRAVITY_MPS2, lateral_limit_mps2
from foresee_dsl.simulate.trace import STEP_S


class ModelSwap:
    """Another model of the same class, checked to fit.

    The paper also lets a bicycle become a pedestrian; here not: the two follow different rules in SUMO, so that the
    child would differ by more than a model.
    """

    name = "model_swap"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw one of the models that fit."""
        del preset
        now = situation.trace.actors[situation.columns[target]].model
        others = situation.fitting(target)
        if not others:
            return ()
        return (Change(actor=target, property="model", was=now, now=others[int(rng.integers(len(others)))]),)

    def letter_target(self, situation: Situation) -> str:
        """Of the close actors whose closest frame lies in the window, the closest."""
        settings = ForeseeSettings()
        best = {actor: int(gaps.argmin()) for actor, gaps in situation.gaps.items()}
        relevant = [
            actor
            for actor, frame in best.items()
            if 0 < frame < situation.trace.frames - 1  # at an edge of the window, its closest frame lies outside
            and situation.gaps[actor][frame] <= settings.radius_m(situation.kind(actor))
            and situation.kind(actor) != "obstacle"
        ]
        return min(relevant, key=lambda a: (float(situation.gaps[a].min()), situation.columns[a]), default="")


class Steer:
    """A steering offset; afterwards the actor recovers its lane. Only actors on lanes can be steered."""

    name = "steer"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw an offset that friction, comfort and the steering rate allow."""
        settings = preset.steer
        if not situation.on_lanes(target):
            return ()
        onset_s = self._onset_s(situation, settings)
        frame = situation.trace.frame_at(onset_s)
        speed = situation.speed_mps(target, frame)
        # Whoever stands at the onset is steered only where the preset does not ask for a speed (the paper's letter).
        if speed < settings.least_speed_mps:
            return ()
        bound = _largest_share(situation.spec(target), speed, settings)
        low, high = max(settings.low, -bound), min(settings.high, bound)
        value = drawn(rng, low, high, settings.step, centre=0.0, dead=max(settings.least_share * bound, settings.step))
        if value is None:
            return ()
        steers = situation.stated(target, Steers)
        was = steers.value if steers and isinstance(steers.value, Quantity) else Quantity.of(0.0, "ratio", 2)
        return (
            Change(
                actor=target,
                property="steer",
                was=was,
                now=Quantity.of(value, "ratio", 2),
                start=Quantity.of(onset_s, "time", 2) if settings.before_point_s is not None else None,
                duration=None if settings.hold_s is None else Quantity.of(settings.hold_s, "time", 2),
            ),
        )

    def letter_target(self, situation: Situation) -> str:
        """The vehicle that is closest to the ego at the clip's beginning."""
        steerable = [actor for actor in situation.columns if situation.on_lanes(actor)]
        return next(iter(situation.closest(0, steerable)), "")

    @staticmethod
    def _onset_s(situation: Situation, settings: SteerSettings) -> float:
        if settings.before_point_s is None:
            return 0.0
        return max(0.0, situation.frame * STEP_S - settings.before_point_s)


def _largest_share(spec: ModelSpec, speed_mps: float, settings: SteerSettings) -> float:
    """Return the largest share of the steering angle that comfort and the steering rate allow at a speed."""
    angle = spec.max_steer_rad
    if angle <= 0:
        return 0.0
    if settings.lateral_g is not None and speed_mps > 0:
        lateral = min(settings.lateral_g * GRAVITY_MPS2, lateral_limit_mps2(spec.name, DRY_FRICTION))
        angle = min(angle, math.atan(lateral / speed_mps**2 * spec.wheelbase_m))
    if settings.rate_rad_s is not None and settings.hold_s is not None:
        angle = min(angle, settings.rate_rad_s * settings.hold_s / 2)
    return angle / spec.max_steer_rad
