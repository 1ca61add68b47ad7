"""From the chosen proposal to steering, throttle and brake."""

from __future__ import annotations

import math

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.pdm_proposals import decay_length
from foresee_dsl.drivers.pdm_route import Route
from foresee_dsl.drivers.pdm_situation import EgoPose, to_centre
from foresee_dsl.drivers.protocol import Control, EgoState, VehicleLimits


def steering(route: Route, pose: EgoPose, offset: float, vehicle: VehicleLimits) -> float:
    """Return the front-wheel angle, rad, that lets the error decay critically damped over the way travelled.

    In the route's coordinates, d'' = -2 d' / l - (d - offset) / l^2 with l from `decay_length`; the curvature of the
    route is fed forward. The rear axle is held to the inside of bends by as much as the middle of the car swings out.
    """
    bend = route.at(route.curvature, pose.s + pose.speed * cfg.CURVATURE_PREVIEW_S)
    inwards = route.at(route.curvature, pose.s) * to_centre(vehicle) ** 2 / 2
    error = pose.d - offset - inwards
    length = decay_length(pose.speed, error, vehicle)
    slope = math.tan(max(-1.0, min(1.0, pose.heading_error)))
    curvature = bend - error / length**2 - 2.0 * slope / length
    grip = cfg.FRICTION_SHARE * vehicle.friction * cfg.GRAVITY_MPS2 / max(pose.speed, 1.0) ** 2
    curvature = max(-grip, min(grip, curvature))
    angle = math.atan(vehicle.wheelbase_m * curvature)
    return max(-vehicle.steer_max_rad, min(vehicle.steer_max_rad, angle))


def smoothed(acceleration: float, state: EgoState) -> float:
    """Hold the wish near the acceleration that the car has now (its drivetrain's lag does the rest), save for hard
    braking."""
    if acceleration < -cfg.BRAKING_MPS2:
        return acceleration
    most = cfg.SMOOTHING_MPS2
    now = state.acceleration_mps2 if state.speed_mps > cfg.COAST_MPS else 0.0
    return max(now - most, min(now + most, acceleration))


def control(angle_rad: float, acceleration: float, state: EgoState, vehicle: VehicleLimits) -> Control:
    """Turn wheel angle and acceleration into the protocol's shares; a car that shall stand is held."""
    steer = angle_rad / vehicle.steer_max_rad
    if state.speed_mps < cfg.COAST_MPS and acceleration <= 0.0:
        return Control(steer=steer, throttle=0.0, brake=cfg.HOLD_BRAKE)
    if acceleration >= 0.0:
        return Control(steer=steer, throttle=min(acceleration / vehicle.acceleration_mps2, 1.0), brake=0.0)
    return Control(steer=steer, throttle=0.0, brake=min(-acceleration / vehicle.emergency_braking_mps2, 1.0))
