"""Tracking a plan: a PID controller for the speed, a law with feed-forward curvature for the wheels."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.drivers.frenetix import settings as cfg
from foresee_dsl.drivers.frenetix.plan import Plan, Pose, angle_between
from foresee_dsl.drivers.pdm import settings as pdm_settings
from foresee_dsl.drivers.pdm.situation import to_centre
from foresee_dsl.drivers.pdm.steps import control, tracking_length
from foresee_dsl.drivers.protocol import Control, EgoState, VehicleLimits


class TrackingController:
    """Follows plans at 20 Hz; between steps it keeps the integral of the speed's error."""

    def __init__(self, vehicle: VehicleLimits, step_s: float) -> None:
        self._vehicle, self._step_s = vehicle, step_s
        self._integral = 0.0

    def follow(self, plan: Plan, state: EgoState, time_s: float) -> Control:
        """Return the control that keeps the car on the plan."""
        here = plan.pose(time_s)
        ahead = plan.pose(time_s + cfg.LAG_S)
        along, side, turned = deviation(here, state, self._vehicle)
        angle = self._steering(ahead, side, turned, state)
        return control(angle, self._acceleration(plan, here, ahead, along, state), state, self._vehicle)

    def _acceleration(self, plan: Plan, here: Pose, ahead: Pose, along: float, state: EgoState) -> float:
        if plan.emergency:
            self._integral = 0.0
            return min(here.acceleration, 0.0) if here.speed > 0.0 else -1.0
        wanted = here.speed - state.speed_mps
        moving = state.speed_mps > pdm_settings.COAST_MPS or ahead.speed > pdm_settings.COAST_MPS
        if not moving:
            self._integral = 0.0
            return -1.0  # stands and shall stand
        most = cfg.INTEGRAL_LIMIT_MPS2
        self._integral = max(-most, min(most, self._integral + cfg.INTEGRAL_GAIN * wanted * self._step_s))
        place = max(-cfg.OFF_PLAN_M, min(cfg.OFF_PLAN_M, -along))
        return ahead.acceleration + cfg.SPEED_GAIN * wanted + cfg.PLACE_GAIN * place + self._integral

    def _steering(self, ahead: Pose, side: float, turned: float, state: EgoState) -> float:
        """Return the front-wheel angle, rad: the error decays critically damped over the way travelled."""
        car = self._vehicle
        length = float(tracking_length(state.speed_mps, np.array(side), car))
        slope = math.tan(max(-1.0, min(1.0, turned)))
        curvature = ahead.curvature - side / length**2 - 2.0 * slope / length
        grip = pdm_settings.FRICTION_SHARE * car.friction * pdm_settings.GRAVITY_MPS2 / max(state.speed_mps, 1.0) ** 2
        angle = math.atan(car.wheelbase_m * max(-grip, min(grip, curvature)))
        return max(-car.steer_max_rad, min(car.steer_max_rad, angle))


def deviation(wanted: Pose, state: EgoState, vehicle: VehicleLimits) -> tuple[float, float, float]:
    """Return how far the rear axle is ahead of its place (m), left of it (m), and turned to the left (rad)."""
    back = to_centre(vehicle)
    dx = state.x - back * math.cos(state.heading_rad) - wanted.x
    dy = state.y - back * math.sin(state.heading_rad) - wanted.y
    cos, sin = math.cos(wanted.heading), math.sin(wanted.heading)
    return dx * cos + dy * sin, dy * cos - dx * sin, angle_between(state.heading_rad, wanted.heading)
