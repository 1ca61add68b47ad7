"""Manoeuvres that could prevent a failure: braking or evading, which are screened, and then driven in a confirming run.

The screening moves the ego by thousands of manoeuvres in milliseconds. The others move as recorded, and keep their last
motion after the run's end. The manoeuvres that pass it are then driven in the real simulation, where others react: the
driver replays the failing run, then brakes or evades along the recorded path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.extended_path import ExtendedPath
from foresee_dsl.avoidance.anticipating.settings import (
    BUILDS_UP_S,
    EASES_MPS2,
    FIRM_MPS2,
    LATERAL_JERK_MPS3,
    LATERAL_MPS2,
    LOOKS_ON_S,
    MARGIN_ASIDE_M,
    MARGIN_M,
    PASSES_S,
    SIDESTEPS_M,
)
from foresee_dsl.avoidance.replay import Replay
from foresee_dsl.compile.bundle import Scene, SumoBundle
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import gaps_to_first
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2, HARDEST_BRAKING_MPS2
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, limits_of
from foresee_dsl.simulate.results.outcome import off_road_points, squares_of
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, Trace, X, Y

_PEAK, _JERK = 10 / math.sqrt(3), 30.0
"""A step to the side is the polynomial 10 u^3 - 15 u^4 + 6 u^5. `_PEAK` is the largest value of its second derivative,
`_JERK` the value of its third derivative in the middle, where the steering changes sides."""


@dataclass(frozen=True)
class ManoeuvrePlan:
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

    def __init__(self, trace: Trace, way: ExtendedPath, plan: ManoeuvrePlan, scene: Scene) -> None:
        super().__init__(trace, plan.begins_s, scene, way)
        self._plan = plan

    def _brake(self, bicycle: Bicycle) -> Control:
        now = (self._frame + 1) * STEP_S
        aside, rate, bend = (float(value[0]) for value in self._plan.aside_at(np.array([now])))
        return self._on_path(bicycle, self._plan.braking_at(now, self._least_mps2), (aside, rate, bend))


_NEAR_M = 40.0
"""Distance to the recorded ego beyond which an actor is ignored, m. Ours: no manoeuvre deviates that far from the
recorded way."""
_WITHIN_M = 5.0
_SHOWN_EVERY = 4
"""Frames between the checks that a step to the side stays on the road."""


@dataclass(frozen=True)
class ScreenedManoeuvre:
    """A manoeuvre, and its smallest distance to any actor, m."""

    plan: ManoeuvrePlan
    least_m: float


class Screening:
    """Moves the ego along its path by a manoeuvre, among the recorded other actors."""

    def __init__(self, trace: Trace, way: ExtendedPath, bundle: SumoBundle) -> None:
        self._trace, self._way, self._bundle = trace, way, bundle
        self._more = round(LOOKS_ON_S / STEP_S)
        self.contact_s = (trace.frames - 1) * STEP_S
        ego = trace.states[:, 0]
        self._speeds, self._before = ego[:, SPEED], np.maximum(-ego[:, ACCELERATION], 0.0)
        near = [
            k
            for k in range(1, len(trace.actors))
            if np.nanmin(np.hypot(*(trace.states[:, k, [X, Y]] - ego[:, [X, Y]]).T), initial=np.inf) < _NEAR_M
        ]
        self._others: FloatArray = np.stack([self._extended(k) for k in near]) if near else np.empty((0, 0, 3))
        sizes = [(trace.actors[k].length_m, trace.actors[k].width_m) for k in (0, *near)]
        self._sizes = np.array(sizes, dtype=np.float64)
        self._within = np.full(len(near), _WITHIN_M)

    def _extended(self, actor: int) -> FloatArray:
        """Return the poses of an actor, [T + more, 3]; after the run's end it continues straight on."""
        poses = self._trace.states[:, actor][:, [X, Y, HEADING]]
        step = poses[-1, :2] - poses[-2, :2] if len(poses) > 1 else np.zeros(2)
        more = np.empty((self._more, 3))
        more[:, :2] = poses[-1, :2] + np.arange(1, self._more + 1)[:, None] * step
        more[:, 2] = poses[-1, 2]
        return np.ascontiguousarray(np.vstack([poses, more]))

    def least_m(self, plan: ManoeuvrePlan) -> float:
        """Return the ego's smallest distance to any actor from the plan's beginning on, m; at most 5."""
        first, poses, _ = self._rolled(plan)
        if not len(self._others):
            return _WITHIN_M
        cube = np.ascontiguousarray(np.concatenate([poses[None], self._others[:, first : first + len(poses)]]))
        gaps = gaps_to_first(cube, self._sizes, self._within)
        return float(min(gaps.min(initial=_WITHIN_M), _WITHIN_M))

    def _rolled(self, plan: ManoeuvrePlan) -> tuple[int, FloatArray, FloatArray]:
        """Return the plan's first frame, the ego's poses [N, 3] from there to the end, and its speeds, m/s."""
        first = min(round(plan.begins_s / STEP_S), len(self._speeds) - 1)
        total = len(self._speeds) + self._more
        times: FloatArray = np.arange(first, total, dtype=np.float64) * STEP_S
        speed, along, before = float(self._speeds[first]), float(self._way.along[first]), float(self._before[first])
        speeds, alongs = np.empty(len(times)), np.empty(len(times))
        for k, now in enumerate(times.tolist()):
            speeds[k], alongs[k] = speed, along
            speed = max(speed - plan.braking_at(now + STEP_S, before) * STEP_S, 0.0)
            along += speed * STEP_S
        poses = self._way.at(alongs)
        if plan.sideways_m:
            aside, rate, _ = plan.aside_at(times)
            poses[:, 0] -= aside * np.sin(poses[:, 2])
            poses[:, 1] += aside * np.cos(poses[:, 2])
            poses[:, 2] += np.arctan2(rate, np.maximum(speeds, 1.0))
        return first, poses, speeds

    def braking(self, begins_s: float) -> ScreenedManoeuvre:
        """Return the gentlest braking from a time on that keeps the margin; the hardest if none does."""
        for strength in (COMFORTABLE_MPS2, FIRM_MPS2, HARDEST_BRAKING_MPS2):
            plan = ManoeuvrePlan(begins_s, strength)
            least = self.least_m(plan)
            if least >= MARGIN_M:
                break
        return ScreenedManoeuvre(plan, least)

    def hardest(self, begins_s: float) -> ScreenedManoeuvre:
        """Return the hardest braking from a time on."""
        plan = ManoeuvrePlan(begins_s, HARDEST_BRAKING_MPS2)
        return ScreenedManoeuvre(plan, self.least_m(plan))

    def latest_s(self, begins_s: float) -> float:
        """Return the latest time at which the hardest braking may begin and still keep the margin, s.

        At `begins_s` the hardest braking must keep the margin.
        """
        low, high = round(begins_s / STEP_S), len(self._speeds) - 1
        while high - low > 1:
            middle = (low + high) // 2
            if self.least_m(ManoeuvrePlan(middle * STEP_S, HARDEST_BRAKING_MPS2)) >= MARGIN_M:
                low = middle
            else:
                high = middle
        return low * STEP_S

    def evading(self, begins_s: float) -> list[ScreenedManoeuvre]:
        """Return the steps to the side that keep the margin and the road, the smallest and gentlest first."""
        sidesteps = []
        stops_s = self.contact_s + PASSES_S
        for far in SIDESTEPS_M:
            if begins_s + 0.3 * sidestep_s(far) > self.contact_s:
                break  # a larger step takes even longer
            for strength in (0.0, EASES_MPS2, COMFORTABLE_MPS2):
                for side in (far, -far):
                    plan = ManoeuvrePlan(begins_s, strength, side, stops_s)
                    least = self.least_m(plan)
                    if least >= MARGIN_ASIDE_M and self._on_road(plan):
                        sidesteps.append(ScreenedManoeuvre(plan, least))
                if sidesteps:
                    return sidesteps
        return sidesteps

    def _on_road(self, plan: ManoeuvrePlan) -> bool:
        squares = squares_of(self._bundle.network)
        bicycle = Bicycle(limits_of(self._bundle.scene.ego.model, self._bundle.scene.friction))
        _, poses, speeds = self._rolled(plan)
        last = int(np.searchsorted(-speeds, -0.1))  # first frame at which the ego stands
        for x, y, heading in poses[: last + 1 : _SHOWN_EVERY].tolist():
            if not squares.hold(off_road_points(bicycle, BicycleState(x, y, heading, 0.0))):
                return False
        return True


def sideways(metres: float) -> str:
    """Return a lateral distance in words, with its side."""
    return f"{abs(metres):.1f} m to the {'left' if metres > 0 else 'right'}" if not math.isclose(metres, 0.0) else ""
