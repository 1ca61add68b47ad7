"""The model swap (paper, section 3.4)."""

from __future__ import annotations

from numpy.random import Generator

from foresee_dsl.derive.operators.situation import Situation
from foresee_dsl.derive.presets import Preset
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.language.model import Change


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
