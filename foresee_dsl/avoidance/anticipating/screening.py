"""Screens thousands of manoeuvres in milliseconds.

It finds those that would prevent a failure if the others moved as recorded.

The others move as recorded, and keep their last motion after the run's end. The manoeuvres that pass the screening are
then driven in the real simulation, where others react.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.avoidance.anticipating.manoeuvre import Plan, sidestep_s
from foresee_dsl.avoidance.anticipating.settings import (
    COMFORTABLE_MPS2,
    EASES_MPS2,
    FIRM_MPS2,
    LOOKS_ON_S,
    MARGIN_ASIDE_M,
    MARGIN_M,
    PASSES_S,
    SIDESTEPS_M,
)
from foresee_dsl.avoidance.anticipating.way import Way
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import gaps_to_first
from foresee_dsl.kernels.constants import HARDEST_BRAKING_MPS2
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, limits_of
from foresee_dsl.simulate.results.drivable_area import squares_of
from foresee_dsl.simulate.results.outcome import off_road_points
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, Trace, X, Y

_NEAR_M = 40.0
"""Distance to the recorded ego beyond which an actor is ignored, m. Ours: no manoeuvre deviates that far from the
recorded way."""
_WITHIN_M = 5.0
_SHOWN_EVERY = 4
"""Frames between the checks that a step to the side stays on the road."""


@dataclass(frozen=True)
class ScreenedManoeuvre:
    """A manoeuvre, and its smallest distance to any actor, m."""

    plan: Plan
    least_m: float


class Screening:
    """Moves the ego along its path by a manoeuvre, among the recorded other actors."""

    def __init__(self, trace: Trace, way: Way, bundle: SumoBundle) -> None:
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

    def least_m(self, plan: Plan) -> float:
        """Return the ego's smallest distance to any actor from the plan's beginning on, m; at most 5."""
        first, poses, _ = self._rolled(plan)
        if not len(self._others):
            return _WITHIN_M
        cube = np.ascontiguousarray(np.concatenate([poses[None], self._others[:, first : first + len(poses)]]))
        gaps = gaps_to_first(cube, self._sizes, self._within)
        return float(min(gaps.min(initial=_WITHIN_M), _WITHIN_M))

    def _rolled(self, plan: Plan) -> tuple[int, FloatArray, FloatArray]:
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
            plan = Plan(begins_s, strength)
            least = self.least_m(plan)
            if least >= MARGIN_M:
                break
        return ScreenedManoeuvre(plan, least)

    def hardest(self, begins_s: float) -> ScreenedManoeuvre:
        """Return the hardest braking from a time on."""
        plan = Plan(begins_s, HARDEST_BRAKING_MPS2)
        return ScreenedManoeuvre(plan, self.least_m(plan))

    def latest_s(self, begins_s: float) -> float:
        """Return the latest time at which the hardest braking may begin and still keep the margin, s.

        At `begins_s` the hardest braking must keep the margin.
        """
        low, high = round(begins_s / STEP_S), len(self._speeds) - 1
        while high - low > 1:
            middle = (low + high) // 2
            if self.least_m(Plan(middle * STEP_S, HARDEST_BRAKING_MPS2)) >= MARGIN_M:
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
                    plan = Plan(begins_s, strength, side, stops_s)
                    least = self.least_m(plan)
                    if least >= MARGIN_ASIDE_M and self._on_road(plan):
                        sidesteps.append(ScreenedManoeuvre(plan, least))
                if sidesteps:
                    return sidesteps
        return sidesteps

    def _on_road(self, plan: Plan) -> bool:
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
