"""From the chosen proposal to steering, throttle and brake."""

from __future__ import annotations

import math

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.rollout import decay_length
from foresee_dsl.drivers.pdm.route import CURVATURE, at
from foresee_dsl.drivers.pdm.situation import Car, EgoNow, EgoPose, car_from, pose_of
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, TABLE, compiled, inner


@inner
def steer(pose: EgoPose, offset: float, car: Car, route: FloatArray, origin_s: float) -> float:
    """Return the front-wheel angle, rad, that lets the error decay critically damped over the way travelled.

    In the route's coordinates, d'' = -2 d' / l - (d - offset) / l^2 with l from `decay_length`; the curvature of the
    route is fed forward. The rear axle is held to the inside of bends by as much as the middle of the car swings out.
    """
    bend = at(route, CURVATURE, origin_s, pose.s + pose.speed * cfg.CURVATURE_PREVIEW_S)
    inwards = at(route, CURVATURE, origin_s, pose.s) * car.back**2 / 2
    error = pose.d - offset - inwards
    length = decay_length(pose.speed, error, car.sharpest)
    slope = math.tan(max(-1.0, min(1.0, pose.heading_error)))
    curvature = bend - error / length**2 - 2.0 * slope / length
    grip = car.grip / max(pose.speed, 1.0) ** 2
    curvature = max(-grip, min(grip, curvature))
    angle = math.atan(car.wheelbase * curvature)
    return max(-car.steer_max, min(car.steer_max, angle))


@inner
def smoothed(acceleration: float, speed: float, now: float) -> float:
    """Hold the wish near the acceleration that the car has `now` (its drivetrain's lag does the rest), save for hard
    braking."""
    if acceleration < -cfg.BRAKING_MPS2:
        return acceleration
    most = cfg.SMOOTHING_MPS2
    if not speed > cfg.COAST_MPS:
        now = 0.0
    return max(now - most, min(now + most, acceleration))


@inner
def pedals(angle: float, acceleration: float, speed: float, car: Car) -> tuple[float, float, float]:
    """Return the shares of steering, throttle and brake."""
    steering_share = angle / car.steer_max
    if speed < cfg.COAST_MPS and acceleration <= 0.0:
        return steering_share, 0.0, cfg.HOLD_BRAKE
    if acceleration >= 0.0:
        return steering_share, min(acceleration / car.acceleration, 1.0), 0.0
    return steering_share, 0.0, min(-acceleration / car.braking, 1.0)


@inner
def follow(
    ego: EgoNow, pose: EgoPose, car: Car, route: FloatArray, origin_s: float, offset: float, acceleration: float
) -> tuple[float, float, float]:
    """Return steering, throttle and brake that hold an offset, m, and an acceleration."""
    angle = steer(pose, offset, car, route, origin_s)
    return pedals(angle, smoothed(acceleration, ego.speed, ego.acceleration), ego.speed, car)


@compiled(*(FLOAT,) * 5, FLOATS, TABLE, TABLE, FLOAT, FLOAT, FLOAT)
def go_on(
    x: float,
    y: float,
    heading: float,
    speed: float,
    acceleration: float,
    car: FloatArray,
    coarse: FloatArray,
    route: FloatArray,
    origin_s: float,
    offset: float,
    wish: float,
) -> tuple[float, float, float]:
    """Return steering, throttle and brake that hold what was decided before.

    Args:
        x, y, heading, speed, acceleration: of the ego. car: a `Car` as an array.
        coarse, route: of the route, from `origin_s` on. offset: to steer for, m. wish: the acceleration.
    """
    ego, known = EgoNow(x, y, heading, speed, acceleration), car_from(car)
    pose = pose_of(ego, known, coarse, route, origin_s)
    return follow(ego, pose, known, route, origin_s, offset, wish)
