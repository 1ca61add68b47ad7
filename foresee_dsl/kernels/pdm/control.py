"""From the chosen proposal to steering, throttle and brake."""

from __future__ import annotations

import math

import numpy as np

from foresee_dsl.kernels.compiling import FLOAT, TABLE, compiled, inner
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.records import EGOS, ROUTE, FloatArray, Records
from foresee_dsl.kernels.pdm.rollout import decay_length
from foresee_dsl.kernels.pdm.route import curvature_at
from foresee_dsl.kernels.pdm.situation import place_ego


@compiled(EGOS, ROUTE, FLOAT)
def steer(egos: Records, route: Records, offset: float) -> float:
    """Return the front-wheel angle, rad, that lets the error decay critically damped over the way travelled.

    In the route's coordinates, d'' = -2 d' / l - (d - offset) / l^2 with l from `decay_length`; the curvature of the
    route is fed forward. The rear axle is held to the inside of bends by as much as the middle of the car swings out.
    """
    ego = egos[0]
    speed, s = ego["forward"], ego["s"]
    bend = curvature_at(route, s + speed * cfg.CURVATURE_PREVIEW_S)
    inwards = curvature_at(route, s) * ego["centre"] ** 2 / 2
    error = ego["d"] - offset - inwards
    length = decay_length(speed, error, ego["sharpest"])
    slope = math.tan(max(-1.0, min(1.0, ego["heading_error"])))
    curvature = bend - error / length**2 - 2.0 * slope / length
    grip = ego["grip"] / max(speed, 1.0) ** 2
    curvature = max(-grip, min(grip, curvature))
    angle = math.atan(ego["wheelbase"] * curvature)
    return float(max(-ego["steer_max"], min(ego["steer_max"], angle)))


@inner
def _smoothed(ego: np.void, acceleration: float) -> float:
    """Hold the wish near the acceleration that the car has now (its drivetrain's lag does the rest), save for hard
    braking."""
    if acceleration < -cfg.BRAKING_MPS2:
        return acceleration
    now = ego["acceleration"] if ego["speed"] > cfg.COAST_MPS else 0.0
    return float(max(now - cfg.SMOOTHING_MPS2, min(now + cfg.SMOOTHING_MPS2, acceleration)))


@compiled(EGOS, FLOAT, FLOAT)
def pedals(egos: Records, angle: float, acceleration: float) -> tuple[float, float, float]:
    """Return the shares of steering, throttle and brake for a wheel angle and an acceleration; a car that shall stand
    is held."""
    ego = egos[0]
    steering_share = angle / ego["steer_max"]
    if ego["speed"] < cfg.COAST_MPS and acceleration <= 0.0:
        return steering_share, 0.0, cfg.HOLD_BRAKE
    if acceleration >= 0.0:
        return steering_share, min(acceleration / ego["motor"], 1.0), 0.0
    return steering_share, 0.0, min(-acceleration / ego["brakes"], 1.0)


@inner
def follow(egos: Records, route: Records, offset: float, acceleration: float) -> tuple[float, float, float]:
    """Return steering, throttle and brake that hold an offset, m, and an acceleration."""
    angle = steer(egos, route, offset)
    return pedals(egos, angle, _smoothed(egos[0], acceleration))


@compiled(EGOS, ROUTE, TABLE, FLOAT, FLOAT)
def go_on(
    egos: Records, route: Records, coarse: FloatArray, offset: float, acceleration: float
) -> tuple[float, float, float]:
    """Return steering, throttle and brake that hold what was decided before; the ego's place is filled in."""
    place_ego(egos, route, coarse)
    return follow(egos, route, offset, acceleration)
