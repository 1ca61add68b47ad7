"""Decides whether anything that can still happen in a run would make it fail; if not, the run may end before its end.

The ego and the others may do in the remaining time whatever their models allow. The run goes on if in any such way the
ego could touch another actor, leave the road, break a traffic rule or be stuck, or if an expectation is open. So a run
that ends here would have passed; only an exception of the driver in the rest of the run is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, inf, pi, sin, sqrt, tan
from typing import Self

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.kernels.arrays import BoolArray, FloatArray
from foresee_dsl.kernels.boxes import Box, corner_points, hits
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.kernels.sumo_traffic import SIDEWAYS_SHARE
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.results.outcome import WHEEL_INSET_M, OutcomeJudge, squares_of
from foresee_dsl.simulate.rules.watch import RuleWatch
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, X, Y
from foresee_dsl.simulate.triggers.condition_history import Expectations

LOOKS_S = (2.0, 1.5, 1.2, 1.0, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""Times before a run's end at which its rest is examined, s. Ours: a driver can leave a road within 0.5 s to 0.7 s at
any time, a slow one within 2 s (docs/background/performance.md)."""
SPEEDS_UP_MPS2 = GRAVITY_MPS2
"""Largest acceleration of another actor in any direction, m/s^2: that of tyres on dry asphalt is below 1 g."""
INSIDE_OF_BEND = 1.5
"""Largest ratio of the progress along the ego's line to the way that the ego drives. Ours: 2 m from the line on the
inside of a bend with a radius of 6 m."""


class EgoReach:
    """Where a vehicle can be within a while, whatever its driver does.

    Its acceleration is bounded by its motor and its tyres, its yaw rate by the turning rate of its wheels and by the
    tyres (`kernels.bicycle`). Speeds and angles are bounded separately, so the bounds are wider than the true set.

    Attributes:
        way_m: the longest way of the rear axle, m. top_mps: the highest speed, m/s.
    """

    def __init__(self, state: BicycleState, motion: Bicycle, within_s: float) -> None:
        self._rear_axle, self._heading = motion.rear_axle(state), state.heading
        limits, grip, sideways = motion.limits, motion.grip_mps2, motion.lateral_mps2
        speeds_up = min(grip, max(limits.acceleration_mps2, state.acceleration, 0.0))
        fast = slow = state.speed
        left_rad = right_rad = state.steer
        self._left_rad = self._right_rad = self._left_m = self._right_m = self.way_m = 0.0
        for _ in range(round(within_s / STEP_S)):
            fast, slow = fast + speeds_up * STEP_S, max(slow - grip * STEP_S, 0.0)
            left_rad = min(left_rad + limits.steer_rate_rad_s * STEP_S, limits.steer_max_rad)
            right_rad = max(right_rad - limits.steer_rate_rad_s * STEP_S, -limits.steer_max_rad)
            self._left_rad += _turns(left_rad, limits.wheelbase_m, slow, fast, sideways) * STEP_S
            self._right_rad += _turns(-right_rad, limits.wheelbase_m, slow, fast, sideways) * STEP_S
            self.way_m += fast * STEP_S
            self._left_m += fast * sin(min(self._left_rad, pi / 2)) * STEP_S
            self._right_m += fast * sin(min(self._right_rad, pi / 2)) * STEP_S
        self.top_mps = fast

    @property
    def turns_round(self) -> bool:
        """Whether the vehicle could turn by a right angle or more; then its points have no bounds here."""
        return max(self._left_rad, self._right_rad) >= pi / 2

    def of(self, rear_m: float, front_m: float, beside_m: float) -> Box:
        """Return a box that contains, at any time within the while, all points of the vehicle that lie up to `rear_m`
        behind its rear axle, up to `front_m` ahead of it, and up to `beside_m` beside its middle line.
        """
        left, right = sin(self._left_rad), sin(self._right_rad)
        turned = beside_m * max(left, right)
        # Bounds along the present heading, and to the left of it, from the present rear axle.
        low, high = -rear_m - turned, self.way_m + front_m + turned
        rightmost = -self._right_m - max(front_m * right, rear_m * left) - beside_m
        leftmost = self._left_m + max(front_m * left, rear_m * right) + beside_m
        ahead, aside = (low + high) / 2, (rightmost + leftmost) / 2
        (x, y), c, s = self._rear_axle, cos(self._heading), sin(self._heading)
        return Box(
            x + c * ahead - s * aside, y + s * ahead + c * aside, self._heading, high - low, leftmost - rightmost
        )


def _turns(wheels_rad: float, wheelbase_m: float, slow: float, fast: float, sideways: float) -> float:
    """Return the highest yaw rate (rad/s) to the side to which wheels are turned, at speeds from `slow` to `fast`."""
    if wheels_rad <= 0.0:
        return 0.0  # to the other side; but sliding tyres and a standing vehicle may not turn at all
    curvature = tan(wheels_rad) / wheelbase_m
    return min(fast * curvature, sqrt(sideways * curvature), sideways / slow if slow > 0.0 else inf)


@dataclass(frozen=True)
class OthersReach:
    """The bodies of the other actors, and how they may move: [K] each.

    Attributes:
        sizes: [K, 2] length, width, m. stand: the actor never moves. turn: it may turn at once into any direction, as
            actors on paths may. least_mps: a speed that it may have at once; 0 except for an actor on a recorded track.
    """

    sizes: FloatArray
    stand: BoolArray
    turn: BoolArray
    least_mps: FloatArray

    @classmethod
    def of(cls, actors: Sequence[PlacedActor]) -> Self:
        """Return those of a scene's actors."""
        return cls(
            sizes=np.array([(a.model.length_m, a.model.width_m) for a in actors], dtype=np.float64).reshape(-1, 2),
            stand=np.array([a.control == "static" for a in actors], dtype=np.bool_),
            turn=np.array([a.control == "path" or a.guided or a.joins for a in actors], dtype=np.bool_),
            least_mps=np.array([a.model.max_speed_mps if a.playback is not None else 0.0 for a in actors]),
        )

    def reach(self, states: FloatArray, within_s: float) -> tuple[FloatArray, FloatArray]:
        """Return boxes that contain the actors at any time within a while: [K, 3] x, y, heading; [K, 2] length, width.

        Each may speed up by `SPEEDS_UP_MPS2` in any direction, brake at any rate, and turn its body.

        `states`: [K, 7] the columns of `Trace.states`, NaN where absent.
        """
        headings, speeds = states[:, HEADING], states[:, SPEED]
        around = np.hypot(self.sizes[:, 0], self.sizes[:, 1])
        spare, way = SPEEDS_UP_MPS2 * within_s**2 / 2, np.maximum(np.abs(speeds), self.least_mps) * within_s
        ahead = np.where(self.turn, 0.0, speeds * within_s)
        beside = np.where(self.turn, way, SIDEWAYS_SHARE * way) + spare
        length = around + np.where(self.turn, 2 * beside, way + 2 * spare)
        sizes = np.where(self.stand[:, None], self.sizes, np.stack([length, around + 2 * beside], axis=-1))
        middle = np.where(self.stand, 0.0, ahead / 2)
        x, y = states[:, X] + middle * np.cos(headings), states[:, Y] + middle * np.sin(headings)
        return np.stack([x, y, headings], axis=-1), sizes


class RestOfRun:
    """Examines the rest of a run at the times `LOOKS_S` before its end.

    Args:
        simulation: the run. judge: decides how it ends. rules: watches the rules that the ego must keep; None if they
            are not examined. expectations: those of the scenario.
    """

    def __init__(
        self, simulation: Simulation, judge: OutcomeJudge, rules: RuleWatch | None, expectations: Expectations
    ) -> None:
        self._simulation, self._judge, self._rules, self._expectations = simulation, judge, rules, expectations
        scene, ego = simulation.scene, simulation.ego
        others = [actor.placed for actor in simulation.actors[1:]]
        self._others = OthersReach.of(others)
        self._comes_later = np.array([actor.comes_later for actor in others], dtype=np.bool_)
        rear_m = ego.length / 2 - ego.motion.rear_axle_m
        self._body = rear_m, ego.length - rear_m, ego.width / 2
        front_axle, rear_axle, beside_m = ego.motion.axles(WHEEL_INSET_M)
        self._wheels = 0.0, front_axle - rear_axle, beside_m
        recorded = scene.ego.recorded
        driven_from_s = recorded[-1].time_s if recorded else 0.0
        # A door may open beside the ego at any time.
        examined = not scene.must_arrive and all(actor.door is None for actor in others)
        frames = (round((scene.end_s - before_s) / STEP_S) for before_s in LOOKS_S)
        self._looks = [frame for frame in frames if examined and frame * STEP_S > driven_from_s]

    def can_only_pass(self, states: FloatArray) -> bool:
        """Return whether a run that has not failed can only pass; to be called at every frame.

        `states`: [1 + K, 7] the columns of `Trace.states` at this frame.
        """
        frame, end_s = self._simulation.frame, self._simulation.scene.end_s
        if not self._looks or frame < self._looks[0]:
            return False
        self._looks.pop(0)
        within_s = end_s - self._simulation.time_s
        if not self._expectations.wait_for_contact_only or self._judge.may_be_stuck(end_s):
            return False
        if (np.isnan(states[1:, X]) & self._comes_later).any():
            return False
        reach = EgoReach(self._simulation.ego.bicycle(), self._simulation.ego.motion, within_s)
        return (
            not reach.turns_round
            and self._touches_none(states[1:], reach, within_s)
            and self._breaks_no_rule(reach, within_s)
            and squares_of(self._simulation.network).hold_area(corner_points(reach.of(*self._wheels)))
        )

    def _touches_none(self, states: FloatArray, reach: EgoReach, within_s: float) -> bool:
        box = np.array(reach.of(*self._body))
        return not hits(box, *self._others.reach(states, within_s)).size

    def _breaks_no_rule(self, reach: EgoReach, within_s: float) -> bool:
        if self._rules is None:
            return True
        centre = reach.of(0.0, max(self._simulation.ego.motion.rear_axle_m, 0.0), 0.0)
        ahead_m = reach.way_m * INSIDE_OF_BEND
        return not self._rules.may_break(within_s, ahead_m=ahead_m, top_mps=reach.top_mps, place=centre)
