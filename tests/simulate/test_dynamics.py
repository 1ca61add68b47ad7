"""The kinematic bicycle: circles, stops, limits, and what it refuses."""

from __future__ import annotations

import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.drivers.protocol import Control, VehicleLimits
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, centre_of_front, checked, limits_of

DT = 0.05
SEDAN = VehicleLimits(
    model="car.sedan",
    length_m=4.7,
    width_m=1.85,
    wheelbase_m=2.8,
    front_overhang_m=0.9,
    max_speed_mps=50.0,
    acceleration_mps2=3.0,
    braking_mps2=4.5,
    emergency_braking_mps2=8.0,
    steer_max_rad=math.radians(35),
    steer_rate_rad_s=math.radians(400),
)
GRIP = 0.9 * 9.81


def drive(bicycle: Bicycle, state: BicycleState, control: Control, seconds: float) -> list[BicycleState]:
    states = [state]
    for _ in range(round(seconds / DT)):
        states.append(bicycle.step(states[-1], control, DT))
    return states


def test_straight_at_constant_speed() -> None:
    end = drive(Bicycle(SEDAN), BicycleState(1.0, 2.0, math.pi / 2, 10.0), Control(0, 0, 0), 5.0)[-1]
    assert (end.x, end.y) == pytest.approx((1.0, 52.0))
    assert (end.speed, end.acceleration, end.yaw_rate) == (10.0, 0.0, 0.0)


@pytest.mark.parametrize("side", [1, -1])
def test_the_rear_axle_runs_on_the_circle_of_its_steering_angle(side: int) -> None:
    # wheelbase 2.8 m, radius 20 m: steer = atan(2.8 / 20). At 5 m/s the lateral acceleration is 1.25 m/s^2.
    bicycle = Bicycle(SEDAN)
    steer = side * math.atan(2.8 / 20)
    control = Control(steer / SEDAN.steer_max_rad, 0, 0)
    start = BicycleState(bicycle.rear_axle_m, 0.0, 0.0, 5.0, steer=steer)
    lap = 2 * math.pi * 20 / 5
    for state in drive(bicycle, start, control, lap):
        x, y = bicycle.rear_axle(state)
        assert math.hypot(x, y - side * 20) == pytest.approx(20, abs=1e-9)
    quarter = drive(bicycle, start, control, lap / 4)[-1]
    assert quarter.yaw_rate == pytest.approx(side * 0.25)
    # Steps of 0.05 s: 125.66 steps in a quarter, 126 driven.
    assert quarter.heading == pytest.approx(side * 126 * DT * 0.25)


def test_braking_to_rest_is_exact_and_stays() -> None:
    states = drive(Bicycle(SEDAN), BicycleState(0, 0, 0.3, 10.0), Control(0.5, 0, 1), 4.0)
    rest = [s for s in states if s.speed == 0]
    assert len(rest) > 20
    assert all(astuple(s)[:6] == astuple(rest[0])[:6] for s in rest)
    assert (rest[0].acceleration, rest[0].yaw_rate) == (0.0, 0.0)


def test_stopping_distance_has_the_lag_and_the_braking() -> None:
    # 10 m/s at 8 m/s^2: 6.25 m, plus 10 m/s times the lag of 0.1 s, less 8 * 0.1^2 / 2 for what the lag gives back.
    limits = replace(SEDAN, friction=1.5)
    end = drive(Bicycle(limits), BicycleState(0, 0, 0, 10.0), Control(0, 0, 1), 3.0)[-1]
    # The lag is held over each step, which brakes half a step late on average less than continuously.
    assert end.x == pytest.approx(6.25 + 1.0 - 0.04, abs=0.3)


def test_throttle_reaches_its_acceleration_after_the_lag() -> None:
    states = drive(Bicycle(SEDAN), BicycleState(0, 0, 0, 0.0), Control(0, 1, 0), 1.0)
    assert states[4].acceleration == pytest.approx(3.0 * (1 - math.exp(-1)), rel=0.03)  # one time constant: 0.2 s
    assert states[-1].acceleration == pytest.approx(3.0, rel=0.07)  # it fades with the speed, 2.4 of 50 m/s


def test_full_throttle_ends_at_the_largest_speed() -> None:
    states = drive(Bicycle(replace(SEDAN, max_speed_mps=10.0)), BicycleState(0, 0, 0, 9.0), Control(0, 1, 0), 60.0)
    assert max(s.speed for s in states) <= 10.0
    assert states[-1].speed == pytest.approx(10.0, abs=1e-3)


def test_steering_turns_at_its_rate() -> None:
    bicycle = Bicycle(SEDAN)
    state = bicycle.step(BicycleState(0, 0, 0, 1.0), Control(1, 0, 0), DT)
    assert state.steer == pytest.approx(math.radians(20))  # 400 deg/s for 0.05 s
    state = bicycle.step(state, Control(1, 0, 0), DT)
    assert state.steer == pytest.approx(SEDAN.steer_max_rad)


def test_braking_leaves_some_grip_for_steering() -> None:
    limits = replace(SEDAN, friction=0.5)
    start = BicycleState(0, 0, 0, 20.0, acceleration=-8.0, steer=0.2)
    state = Bicycle(limits).step(start, Control(0.5, 0, 1), DT)
    grip = 0.5 * 9.81
    assert abs(state.yaw_rate) * 20.0 == pytest.approx(0.3 * grip, rel=0.05)
    assert state.acceleration == pytest.approx(-math.sqrt(1 - 0.09) * grip)


share = st.floats(-2, 2)


@given(
    controls=st.lists(st.tuples(share, share, share), min_size=1, max_size=40),
    speed=st.floats(0, 40),
    friction=st.floats(0.1, 1.2),
)
def test_no_control_leaves_the_friction_circle(
    controls: list[tuple[float, float, float]], speed: float, friction: float
) -> None:
    bicycle = Bicycle(replace(SEDAN, friction=friction))
    state = BicycleState(0, 0, 0, speed)
    for values in controls:
        before, state = state, bicycle.step(state, Control(*values), DT)
        assert all(math.isfinite(v) for v in astuple(state))
        assert state.speed >= 0
        assert math.hypot(state.acceleration, state.speed * state.yaw_rate) <= friction * 9.81 * (1 + 1e-9)
        assert abs(state.steer) <= SEDAN.steer_max_rad
        assert abs(state.steer - before.steer) <= SEDAN.steer_rate_rad_s * DT + 1e-12
        assert math.hypot(state.x - before.x, state.y - before.y) <= max(before.speed, state.speed) * DT * 1.3


@given(values=st.tuples(share, share, share), speed=st.floats(0, 30), steer=st.floats(-0.6, 0.6))
def test_left_and_right_are_mirror_images(values: tuple[float, float, float], speed: float, steer: float) -> None:
    bicycle = Bicycle(SEDAN)
    left = bicycle.step(BicycleState(0, 0, 0, speed, 0.5, 0, steer), Control(*values), DT)
    right = bicycle.step(BicycleState(0, 0, 0, speed, 0.5, 0, -steer), Control(-values[0], *values[1:]), DT)
    assert (left.x, -left.y, -left.heading, left.speed, -left.steer) == (
        right.x,
        right.y,
        right.heading,
        right.speed,
        right.steer,
    )


def test_out_of_range_means_the_nearest_allowed() -> None:
    bicycle, start = Bicycle(SEDAN), BicycleState(0, 0, 0, 5.0)
    assert bicycle.step(start, Control(7, 3, -1), DT) == bicycle.step(start, Control(1, 1, 0), DT)


@pytest.mark.parametrize("field", ["steer", "throttle", "brake"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_nan_or_an_infinite_value_is_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match="a value is NaN or infinite"):
        Bicycle(SEDAN).step(BicycleState(0, 0, 0, 5.0), replace(Control(0, 0, 0), **{field: value}), DT)


def test_numbers_of_numpy_are_numbers() -> None:
    control = Control(np.array(0.5), np.float32(2), np.int64(0))  # type: ignore[arg-type]  # what a driver may do
    assert checked(control) == (0.5, 1.0, 0.0)


@pytest.mark.parametrize("answer", [None, Control("0.1", 0.5, 0.0), Control(7, "0.5", 0.0), Control(7, 0.5, "0")])  # type: ignore[arg-type]
def test_what_is_no_control_is_refused(answer: object) -> None:
    with pytest.raises(ValueError, match="it must answer a Control"):
        Bicycle(SEDAN).step(BicycleState(0, 0, 0, 5.0), answer, DT)  # type: ignore[arg-type]  # what a driver may do


def test_a_vehicle_without_wheelbase_is_refused() -> None:
    with pytest.raises(ValueError, match="wheelbase_m"):
        Bicycle(replace(SEDAN, wheelbase_m=0.0))


def test_front_and_centre_are_inverse() -> None:
    state = BicycleState(3.0, -2.0, 2.1, 0.0)
    front = centre_of_front(state.x, state.y, state.heading, -4.7)
    assert math.dist(front, (3.0, -2.0)) == pytest.approx(2.35)
    assert centre_of_front(*front, 2.1, 4.7) == pytest.approx((3.0, -2.0))


def test_wheels_stand_on_the_axles() -> None:
    # Front axle 0.9 m behind the front bumper at x = 2.35, rear axle 2.8 m behind that; sides at 0.925 m less 0.3 m.
    wheels = Bicycle(SEDAN).wheels(BicycleState(0, 0, 0, 0), 0.3)
    expected = [(1.45, 0.625), (-1.35, 0.625), (-1.35, -0.625), (1.45, -0.625)]
    assert [v for w in wheels for v in w] == pytest.approx([v for w in expected for v in w])


def test_limits_come_from_the_model() -> None:
    spec = ModelSpec("van", "van", 5.0, 2.0, 3.0, 1.0, 2000.0, 40.0, 2.0, 4.0, 7.5, 0.6, 5.0)
    limits = limits_of(spec, 0.5)
    assert (limits.length_m, limits.emergency_braking_mps2, limits.steer_max_rad, limits.friction) == (
        5.0,
        7.5,
        0.6,
        0.5,
    )
    assert Bicycle(limits).grip_mps2 == pytest.approx(0.5 * 9.81)


# ------------------------------------------------------------------------------------------ the friction ellipse


def kind(name: str, friction: float) -> Bicycle:
    return Bicycle(replace(SEDAN, model=name, friction=friction))


# Dry 0.9 x 9.81 = 8.83, wet 0.5 x 9.81 = 4.905; a truck tips at 0.4 g = 3.92, a bicycle too; a bus at 0.5 g = 4.905.
@pytest.mark.parametrize(
    ("name", "friction", "expected"),
    [
        ("car.sedan", 0.9, 8.829),
        ("car.sedan", 0.5, 4.905),
        ("truck.rigid", 0.9, 3.924),
        ("truck.rigid", 0.5, 3.924),
        ("bus.city", 0.9, 4.905),
        ("bicycle.city", 0.9, 3.924),
        ("bicycle.city", 0.3, 2.943),
    ],
)
def test_a_step_steer_at_15_mps_turns_with_what_the_vehicle_holds(name: str, friction: float, expected: float) -> None:
    states = drive(kind(name, friction), BicycleState(0, 0, 0, 15.0), Control(1, 0, 0), 3.0)
    lateral = [abs(s.speed * s.yaw_rate) for s in states]
    assert max(lateral) == pytest.approx(expected, abs=1e-9)
    assert states[-1].speed == pytest.approx(15.0)


@pytest.mark.parametrize("friction", [0.9, 0.5])
@pytest.mark.parametrize("name", ["car.sedan", "truck.rigid"])
@pytest.mark.parametrize("pedal", [Control(1, 0, 1), Control(0.1, 0, 0.5), Control(-0.3, 0, 1), Control(1, 1, 0)])
def test_braking_in_the_turn_stays_in_the_ellipse(name: str, friction: float, pedal: Control) -> None:
    bicycle = kind(name, friction)
    along, across = friction * 9.81, bicycle.lateral_mps2
    shares = [
        math.hypot(s.acceleration / along, s.speed * s.yaw_rate / across)
        for s in drive(bicycle, BicycleState(0, 0, 0, 15.0), pedal, 3.0)
    ]
    assert max(shares) <= 1 + 1e-9
    assert max(shares) > 0.3


def test_a_truck_that_may_not_turn_hard_still_brakes_with_all_its_tyres() -> None:
    # Straight on nothing is lost: 8 m/s^2 of brakes on a dry road; the wet road holds 4.905.
    for friction, expected in ((0.9, 8.0), (0.5, 4.905)):
        states = drive(kind("truck.rigid", friction), BicycleState(0, 0, 0, 15.0), Control(0, 0, 1), 1.0)
        assert min(s.acceleration for s in states) == pytest.approx(-expected, abs=0.01)
