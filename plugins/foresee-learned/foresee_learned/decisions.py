"""The common part of the learned drivers: ten decisions a second, and steering along the last one in between.

Between decisions, 20 times a second, waypoints and a target speed are converted to pedals: pure pursuit for the
steering, a PID controller for the speed. Waypoints are converted to world coordinates when they are decided, so that
they stay in place between two decisions while the ego moves along them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import Control, EgoState, FloatArray, Mission, Observation, Reason, VehicleLimits
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_learned import settings as cfg
from foresee_learned.inputs import InputMaker, LearnedInputs
from foresee_learned.kernels.waypoints import aim
from foresee_learned.session import Answer, Network


class Decision(NamedTuple):
    """What the driver has decided to do until the next decision.

    Attributes:
        waypoints: [N, 2] m ahead and to the left of the ego at the time of the decision.
        target_mps: speed to reach within `within_s`.
        hardest: whether to brake as hard as the vehicle can, whatever `target_mps` is.
    """

    waypoints: FloatArray
    target_mps: float
    within_s: float
    hardest: bool = False


class _Last(NamedTuple):
    """The last decision, the input from which it was computed, and its waypoints in world coordinates."""

    observation: Observation
    inputs: LearnedInputs
    decision: Decision
    path: FloatArray


class Decisions(ABC):
    """The memory of a driver since `reset`: the others' past places, the last decision, and the pilot, which controls
    the vehicle.
    """

    def __init__(self, network: Network, mission: Mission, vehicle: VehicleLimits) -> None:
        self._network, self.mission, self.vehicle = network, mission, vehicle
        self.maker, self._pilot = InputMaker(mission, vehicle), Pilot(vehicle)
        self._measured_s: float | None = None
        self._last: _Last | None = None

    @abstractmethod
    def decide(self, observation: Observation, answer: Answer) -> Decision:
        """Return the decision for the network's answer."""

    @abstractmethod
    def reasons(self, observation: Observation, inputs: LearnedInputs, decision: Decision) -> Sequence[Reason]:
        """Return the reasons for the last decision."""

    def step(self, observation: Observation) -> Control:
        """Decide if the object list is new (see `DECIDES_S`), and follow the last decision."""
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        if self._last is None or self._measured_s is None or measured_s - self._measured_s > cfg.DECIDES_S:
            self._measured_s = measured_s
            inputs = self.maker.make(observation)
            decision = self.decide(observation, self.answer_to(inputs))
            self._last = _Last(observation, inputs, decision, laid_down(decision.waypoints, observation.ego))
        decision = self._last.decision
        return self._pilot.follow(
            self._last.path, decision.target_mps, decision.within_s, observation.ego, hardest=decision.hardest
        )

    def answer_to(self, inputs: LearnedInputs) -> Answer:
        """Return the network's answer."""
        pictures: dict[str, NDArray[Any]] = {
            "birds_eye": inputs.birds_eye,
            "forward": inputs.forward,
            "vector": inputs.vector,
        }
        return self._network.answer(pictures)

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for its last decision."""
        return () if self._last is None else self.reasons(*self._last[:3])


# ---- steering along a decision ---------------------------------------------------------------------------------------


def laid_down(waypoints: FloatArray, ego: EgoState) -> FloatArray:
    """Return waypoints ([N, 2] m ahead and to the left) in world coordinates, after the ego's own place: [N + 1, 2]
    m."""
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    turn = np.array([[cos, sin], [-sin, cos]])
    path: FloatArray = np.concatenate([np.zeros((1, 2)), waypoints]) @ turn + (ego.x, ego.y)
    return path


class Pilot:
    """Controls a vehicle along waypoints; it stores the speed errors of the last second."""

    def __init__(self, vehicle: VehicleLimits) -> None:
        self._vehicle = vehicle
        self._axle_m = vehicle.rear_axle_m
        self._errors: deque[float] = deque(maxlen=cfg.INTEGRAL_STEPS)

    def follow(
        self, path: FloatArray, target_mps: float, within_s: float, ego: EgoState, *, hardest: bool = False
    ) -> Control:
        """Return the control that keeps the ego on a path in world coordinates ([N, 2] m, from `laid_down`) and brings
        it to a speed.

        `within_s`: time to reach the speed. `hardest`: whether to brake as hard as the vehicle can, whatever the speed
        to reach is.
        """
        car = self._vehicle
        steer = self._angle(path, ego) / car.steer_max_rad
        acceleration = self._acceleration(target_mps, within_s, ego)
        if hardest or acceleration < -cfg.HARD_MPS2:
            acceleration = -math.inf
        if acceleration >= 0.0:
            return Control(steer, min(acceleration / car.acceleration_mps2, 1.0), 0.0)
        return Control(steer, 0.0, min(-acceleration / car.emergency_braking_mps2, 1.0))

    def _acceleration(self, target_mps: float, within_s: float, ego: EgoState) -> float:
        """Return the acceleration for a target speed; with a target of 0 the brake holds a standing car."""
        if target_mps < cfg.TARGET_STANDS_MPS and ego.speed_mps < cfg.TARGET_STANDS_MPS:
            self._errors.clear()
            return -self._vehicle.braking_mps2
        error = target_mps - ego.speed_mps
        self._errors.append(error)
        integral = sum(self._errors) / cfg.INTEGRAL_STEPS
        wanted = error / within_s + cfg.INTEGRAL_GAIN * integral - cfg.DAMPING_GAIN * ego.acceleration_mps2
        return min(wanted, cfg.ACCELERATION_MPS2)

    def _angle(self, path: FloatArray, ego: EgoState) -> float:
        """Return the front wheel angle, rad, that moves the rear axle along a circle through the point ahead."""
        car, ahead_m = self._vehicle, max(cfg.AIM_LEAST_M, cfg.AIM_S * ego.speed_mps)
        x, y, length_m = aim(path, ego.x, ego.y, ahead_m).tolist()
        if length_m < cfg.WAY_LEAST_M:
            return ego.steer_rad
        cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
        dx, dy = x - ego.x, y - ego.y
        ahead, left = dx * cos + dy * sin + self._axle_m, dy * cos - dx * sin
        curvature = 2.0 * left / max(ahead * ahead + left * left, 1.0)
        grip = cfg.FRICTION_SHARE * car.friction * GRAVITY_MPS2 / max(ego.speed_mps, 1.0) ** 2
        angle = math.atan(car.wheelbase_m * max(-grip, min(grip, curvature)))
        return max(-car.steer_max_rad, min(car.steer_max_rad, angle))
