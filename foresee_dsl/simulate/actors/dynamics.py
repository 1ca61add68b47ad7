"""Motion of a driven vehicle: a kinematic bicycle with a steering rate, a drivetrain lag and a friction ellipse.

The motion is that of the rear axle's centre, which follows the front wheels without slip (Rajamani, Vehicle Dynamics
and Control, 2nd ed., section 2.2); states refer to the centre of the footprint, as everywhere else. The state holds
everything that the next step needs, so a run restored from a state continues exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan, cos, inf, isfinite, sin
from types import MappingProxyType

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.drivers.protocol import Control, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.bicycle import BicycleLimits, VehicleState, step
from foresee_dsl.kernels.boxes import wheels
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.kernels.records import dtype_of

_STATE = dtype_of(VehicleState)


TIPS_AT_G: Mapping[str, float] = MappingProxyType(
    {"van": 0.7, "truck": 0.4, "bus": 0.5, "motorcycle": 0.8, "bicycle": 0.4}
)
"""Lateral acceleration, in g, above which a class of vehicle tips over or a rider does not lean further; a car slides
before it tips. Ours, within measured ranges: large trucks roll over from 0.2 g, light trucks and vans at 0.8 to 1.2 g,
cars above 1 g (Winkler and Ervin, Rollover of Heavy Commercial Vehicles, UMTRI-99-19); tank trucks must hold 0.4 g. A
motorcyclist leans up to 39 deg (0.8 g), a cyclist up to 22 deg (0.4 g)."""


@dataclass(slots=True)
class BicycleState:
    """The state of a vehicle at one moment; its fields are the columns of `Trace.states`.

    Attributes:
        x, y: centre of the footprint (m). heading: rad, counter-clockwise from east. speed: m/s, never negative.
        acceleration: along the heading, m/s^2. yaw_rate: rad/s. steer: angle of the front wheels (rad, left positive).
    """

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float = 0.0
    yaw_rate: float = 0.0
    steer: float = 0.0

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, y, heading."""
        return self.x, self.y, self.heading


def limits_of(model: ModelSpec, friction: float = 0.9) -> VehicleLimits:
    """Return the limits of a vehicle model on a road with this friction coefficient."""
    return VehicleLimits(
        model=model.name,
        length_m=model.length_m,
        width_m=model.width_m,
        wheelbase_m=model.wheelbase_m,
        front_overhang_m=model.front_overhang_m,
        max_speed_mps=model.max_speed_mps,
        acceleration_mps2=model.acceleration_mps2,
        braking_mps2=model.braking_mps2,
        emergency_braking_mps2=model.emergency_braking_mps2,
        steer_max_rad=model.max_steer_rad,
        steer_rate_rad_s=model.steer_rate_rad_s,
        friction=friction,
    )


def lateral_limit_mps2(model: str, friction: float) -> float:
    """Return the largest lateral acceleration of a model (`class.variant`): what its tyres hold at this friction, or
    less if the vehicle would tip over before they slide.
    """
    return min(friction, TIPS_AT_G.get(model.partition(".")[0], inf)) * GRAVITY_MPS2


class Bicycle:
    """Moves vehicles of one model.

    The acceleration stays within an ellipse: lengthwise up to friction times gravity (motor and brakes may give less),
    sideways up to `lateral_limit_mps2`.

    Args:
        limits: the limits of the vehicle model.

    Raises: ValueError: a limit that must be positive is zero or negative.
    """

    def __init__(self, limits: VehicleLimits) -> None:
        for name in ("wheelbase_m", "max_speed_mps", "friction"):
            if not getattr(limits, name) > 0:
                raise ValueError(f"{limits.model}: {name} is {getattr(limits, name)}, and it must be positive")
        self.limits = limits
        self.rear_axle_m = limits.rear_axle_m
        """Distance of the rear axle behind the centre of the footprint, m."""
        self.grip_mps2 = limits.friction * GRAVITY_MPS2
        self.lateral_mps2 = lateral_limit_mps2(limits.model, limits.friction)
        record = BicycleLimits(
            steer_max=limits.steer_max_rad,
            steer_rate=limits.steer_rate_rad_s,
            max_speed=limits.max_speed_mps,
            acceleration=limits.acceleration_mps2,
            braking=limits.emergency_braking_mps2,
            wheelbase=limits.wheelbase_m,
            rear_axle=self.rear_axle_m,
            grip=self.grip_mps2,
            lateral=self.lateral_mps2,
        )
        self._limits = np.array([record], dtype_of(BicycleLimits))

    def hold(self, friction: float) -> None:
        """Use this tyre-road friction coefficient from now on.

        `limits`, which the driver receives, stay unchanged: a driver knows the road's friction, but not that of a
        slippery patch.
        """
        self._limits["grip"] = friction * GRAVITY_MPS2
        self._limits["lateral"] = lateral_limit_mps2(self.limits.model, friction)

    def step(self, state: BicycleState, control: Control, dt: float) -> BicycleState:
        """Return the state `dt` seconds later; `state` does not change.

        A control value out of range counts as the nearest allowed value; a NaN, an infinite value or one that is not
        a number raises a `ValueError`.
        """
        row = np.array((state.x, state.y, state.heading, state.speed, state.acceleration, state.yaw_rate, state.steer))
        self.move(row.view(_STATE), Control(*checked(control)), dt)
        return BicycleState(*row.tolist())

    def move(self, state: Records, control: Control, dt: float) -> None:
        """Advance a state by `dt` seconds in place; the state is an array of one `VehicleState`.

        `control` must be within its ranges (see `checked`).
        """
        step(state, self._limits, control.steer, control.throttle, control.brake, dt)

    def steer_for(self, curvature: float) -> float:
        """Return the front wheel angle (rad) that moves the rear axle along a curvature (1/m), limited to the largest
        angle.
        """
        limit = self.limits.steer_max_rad
        return max(-limit, min(limit, atan(self.limits.wheelbase_m * curvature)))

    def rear_axle(self, state: BicycleState) -> tuple[float, float]:
        """Return the centre of the rear axle (m)."""
        return (
            state.x - self.rear_axle_m * cos(state.heading),
            state.y - self.rear_axle_m * sin(state.heading),
        )

    def wheels(self, state: BicycleState, inset_m: float) -> FloatArray:
        """Return one point for each wheel, [4, 2] m, which lies on the wheel's axle, `inset_m` inside the vehicle's
        side.

        The order is front left, rear left, rear right, front right.
        """
        points: FloatArray = wheels(state.x, state.y, state.heading, *self.axles(inset_m))
        return points

    def axles(self, inset_m: float) -> tuple[float, float, float]:
        """Return how far the front and the rear axle are ahead of the vehicle's centre, and how far a wheel's point is
        from its middle line, m.
        """
        rear = -self.rear_axle_m
        return self.limits.wheelbase_m + rear, rear, max(self.limits.width_m / 2 - inset_m, 0.0)


def checked(control: Control) -> tuple[float, float, float]:
    """Return steer, throttle and brake as floats, each moved to the nearest allowed value; a value that is NaN,
    infinite or not a number, such as the text `0.1`, raises a `ValueError`.
    """
    try:
        steer, throttle, brake = control.steer, control.throttle, control.brake
        # The values are compared before `float` reads them, because a text can be read but not compared.
        if -1.0 <= steer <= 1.0 and 0.0 <= throttle <= 1.0 and 0.0 <= brake <= 1.0:
            # The sum of -0.0 and 0.0 is 0.0, as for values that are moved.
            return float(steer), float(throttle) + 0.0, float(brake) + 0.0
        finite = isfinite(steer) and isfinite(throttle) and isfinite(brake)
    except (TypeError, ValueError, AttributeError) as err:
        raise ValueError(
            f"the driver answered {control!r}; it must answer a Control with the numbers steer, throttle and brake, "
            "or a Trajectory"
        ) from err
    if not finite:
        raise ValueError(f"the driver answered {control!r}, in which a value is NaN or infinite")
    steer, throttle, brake = float(steer), float(throttle), float(brake)
    return max(-1.0, min(1.0, steer)), max(0.0, min(1.0, throttle)), max(0.0, min(1.0, brake))


def centre_of_front(x: float, y: float, heading: float, length: float) -> tuple[float, float]:
    """Return the centre of a footprint, x and y (m), from the middle of its front bumper, which is SUMO's reference
    point.
    """
    return x - length / 2 * cos(heading), y - length / 2 * sin(heading)
