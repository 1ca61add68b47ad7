"""Ours: beside which line an actor walks or rides."""

from __future__ import annotations

from numpy.random import Generator

from foresee_dsl.derive.operators.situation import Situation, drawn
from foresee_dsl.derive.presets import Preset
from foresee_dsl.language.model import Change, Line, Quantity


class LineShift:
    """Somebody on a path or a bicycle goes over to a line beside its own.

    Not for cars and the like: in their lanes they have a hand's breadth, and what leaves the lane is `steer`.
    """

    name = "line"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw how far to the left of its own way (negative: to the right)."""
        settings = preset.line
        rides = situation.kind(target) == "bicycle" and situation.on_lanes(target)
        if not (situation.follows_path(target) or rides) or situation.way_m(target) < preset.timing.least_way_m:
            return ()
        value = drawn(rng, -settings.high_m, settings.high_m, settings.step_m, centre=0.0, dead=settings.least_m)
        if value is None:
            return ()
        line = situation.said(target, Line)
        was = line.left if line and isinstance(line.left, Quantity) else Quantity.of(0.0, "length", 2)
        return (Change(actor=target, property="line", was=was, now=Quantity.of(was.si + value, "length", 2)),)

    def letter_target(self, situation: Situation) -> str:
        """None: the paper has no such operator."""
        del situation
        return ""
