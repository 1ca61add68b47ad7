"""Converts waypoints and a target speed to pedals, 20 times a second: pure pursuit for the steering, a PID controller
for the speed.

Waypoints are converted to world coordinates when they are decided, so that they stay in place between two decisions
while the ego moves along them.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from foresee_dsl.drivers.protocol import Control, EgoState, FloatArray, VehicleLimits
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_learned import settings as cfg
from foresee_learned.kernels.waypoints import aim


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
