"""One step of a kinematic bicycle with a steering rate, a drivetrain lag and a friction ellipse."""

from __future__ import annotations

from math import cos, exp, sin, sqrt, tan
from typing import NamedTuple

from foresee_dsl.kernels.arrays import Record, Records
from foresee_dsl.kernels.compiling import FLOAT, compiled, inner
from foresee_dsl.kernels.records import array_of

THROTTLE_LAG_S = 0.2
"""Time constant of the drivetrain, s. Ours: between an electric motor (0.05-0.1 s) and a petrol engine (0.3-0.5 s)."""
BRAKE_LAG_S = 0.1
"""Time constant of the brakes, s. Ours: electro-hydraulic boosters build up full pressure in 0.15-0.2 s, about two time
constants."""
STEERABLE_SHARE = 0.3
"""Share of the grip that braking leaves for steering when the wheels are turned. Ours: an anti-lock system keeps the
car steerable; reserving 0.3 of the grip sideways costs 4.6 % of the braking (sqrt(1 - 0.3^2))."""


class VehicleState(NamedTuple):
    """The columns of `Trace.states`: centre (m), heading (rad), speed (m/s), acceleration (m/s^2), yaw rate (rad/s),
    angle of the front wheels (rad)."""

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    yaw_rate: float
    steer: float


class BicycleLimits(NamedTuple):
    """The limits of a vehicle; the units of the fields are rad, rad/s, m/s, m/s^2 and m.

    Attributes:
        rear_axle: distance of the rear axle behind the centre of the footprint. grip: largest acceleration of the
            tyres, m/s^2. lateral: largest lateral acceleration of the vehicle, m/s^2.
    """

    steer_max: float
    steer_rate: float
    max_speed: float
    acceleration: float
    braking: float
    wheelbase: float
    rear_axle: float
    grip: float
    lateral: float


STATES, LIMITS = array_of(VehicleState), array_of(BicycleLimits)


@inner
def _within_grip(speed: float, acceleration: float, steer: float, dt: float, limits: Record) -> tuple[float, float]:
    """Return the acceleration (m/s^2) and the curvature (1/m) that the tyres can hold together.

    The wheel angle does not change; beyond the grip the vehicle drives a wider curve than that of its wheels
    (understeer).
    """
    grip, side = limits["grip"], limits["lateral"]
    acceleration = max(-grip, min(grip, acceleration))
    curvature = tan(steer) / limits["wheelbase"]
    fastest = speed + max(0.0, acceleration) * dt
    demand = fastest * fastest * abs(curvature)
    left_over = side * sqrt(1.0 - (acceleration / grip) ** 2)
    lateral = max(left_over, STEERABLE_SHARE * side)
    if demand <= left_over:
        return acceleration, curvature
    if demand > lateral:
        curvature *= lateral / demand
        demand = lateral
    most = grip * sqrt(max(0.0, 1.0 - (demand / side) ** 2))
    return max(-most, min(most, acceleration)), curvature


@compiled(STATES, LIMITS, FLOAT, FLOAT, FLOAT, FLOAT)
def step(states: Records, limits_of: Records, wheel: float, throttle: float, brake: float, dt: float) -> None:
    """Advance the first state of an array by `dt` seconds.

    `wheel`: share of the largest steering angle, left positive; `throttle`, `brake`: shares.
    """
    state, limits = states[0], limits_of[0]
    heading, before, top = state["heading"], state["speed"], limits["max_speed"]
    most = limits["steer_rate"] * dt
    steer = state["steer"] + max(-most, min(most, wheel * limits["steer_max"] - state["steer"]))
    state["steer"] = steer
    # The acceleration that motor and brakes give, before the tyres limit it.
    fade = max(0.0, 1.0 - before / top)
    target = throttle * limits["acceleration"] * fade - brake * limits["braking"]
    lag = BRAKE_LAG_S if brake > 0 else THROTTLE_LAG_S
    wanted = target + (state["acceleration"] - target) * exp(-dt / lag)
    acceleration, curvature = _within_grip(before, wanted, steer, dt, limits)
    speed = before + acceleration * dt
    if speed <= 0.0:  # the vehicle stops within the step, and does not reverse
        distance = before * before / (-2.0 * acceleration) if acceleration < 0 else 0.0
        speed = acceleration = 0.0
    else:
        fastest = max(before, top)
        if acceleration > 0.0 and speed > fastest:  # the drivetrain responds late, and would exceed the top speed
            speed, acceleration = fastest, (fastest - before) / dt
        distance = (before + speed) / 2 * dt
    state["speed"], state["acceleration"], state["yaw_rate"] = speed, acceleration, 0.0
    if distance == 0.0:  # a standing vehicle keeps its exact position; computing it again would add rounding errors
        return
    half_turn = distance * curvature / 2
    # The rear axle moves along an arc, whose chord has the mean heading.
    chord = distance * (sin(half_turn) / half_turn if abs(half_turn) > 1e-9 else 1.0)
    mean, after, behind = heading + half_turn, heading + 2 * half_turn, limits["rear_axle"]
    state["x"] += chord * cos(mean) + behind * (cos(after) - cos(heading))
    state["y"] += chord * sin(mean) + behind * (sin(after) - sin(heading))
    state["heading"], state["yaw_rate"] = after, speed * curvature
