"""The driver of a confirming run: it replays the failing run, then brakes or evades along the recorded path."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.settings import BUILDS_UP_S, COMFORTABLE_MPS2, LATERAL_JERK_MPS3, LATERAL_MPS2
from foresee_dsl.avoidance.anticipating.way import Way
from foresee_dsl.avoidance.replay import Replay
from foresee_dsl.compile.bundle import Scene
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.actors.dynamics import Bicycle
from foresee_dsl.simulate.trace import STEP_S, Trace

_PEAK, _JERK = 10 / math.sqrt(3), 30.0
"""A step to the side is the polynomial 10 u^3 - 15 u^4 + 6 u^5. `_PEAK` is the largest value of its second derivative,
`_JERK` the value of its third derivative in the middle, where the steering changes sides."""


@dataclass(frozen=True)
class Plan:
    """A manoeuvre of the ego: when it begins, how hard it brakes, how far it evades.

    Attributes:
        begins_s: until then the ego drives as recorded. braking_mps2: its braking from then on; 0 for none.
        sideways_m: how far it evades, left positive. stops_s: time from which it brakes comfortably to a stop.
    """

    begins_s: float
    braking_mps2: float
    sideways_m: float = 0.0
    stops_s: float = math.inf

    def braking_at(self, time_s: float, before_mps2: float) -> float:
        """Return the braking at a time, m/s^2; it builds up gradually from the braking before the manoeuvre."""
        built = min(max((time_s - self.begins_s) / BUILDS_UP_S, 0.0), 1.0)
        if not self.sideways_m:
            least = max(self.braking_mps2, before_mps2)  # never less than the recorded driver
            return before_mps2 + (least - before_mps2) * built
        stops = min(max((time_s - self.stops_s) / BUILDS_UP_S, 0.0), 1.0)
        braking = before_mps2 + (self.braking_mps2 - before_mps2) * built
        return braking + (max(COMFORTABLE_MPS2, braking) - braking) * stops

    def aside_at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the wanted lateral offset at times [N], m, and its first and second derivatives."""
        takes = sidestep_s(self.sideways_m)
        u = np.clip((time_s - self.begins_s) / takes, 0.0, 1.0)
        d = self.sideways_m
        return (
            d * u**3 * (10 - 15 * u + 6 * u**2),
            d * 30 * u**2 * (1 - u) ** 2 / takes,
            d * 60 * u * (1 - u) * (1 - 2 * u) / takes**2,
        )


def sidestep_s(sideways_m: float) -> float:
    """Return the duration of a sideways step within the limits of comfort, s."""
    far = max(abs(sideways_m), 1e-3)
    return max(math.sqrt(_PEAK * far / LATERAL_MPS2), math.cbrt(_JERK * far / LATERAL_JERK_MPS3))


class Manoeuvre(Replay):
    """Drives a recorded run again and carries out a plan once the plan begins."""

    name = "anticipating"
    version = "1"

    def __init__(self, trace: Trace, way: Way, plan: Plan, scene: Scene) -> None:
        super().__init__(trace, plan.begins_s, scene, way)
        self._plan = plan

    def _brake(self, bicycle: Bicycle) -> Control:
        now = (self._frame + 1) * STEP_S
        aside, rate, bend = (float(value[0]) for value in self._plan.aside_at(np.array([now])))
        return self._on_path(bicycle, self._plan.braking_at(now, self._least_mps2), (aside, rate, bend))
