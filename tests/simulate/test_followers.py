"""Path-followers and the way back to the lane."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.compile.bundle import TimedValue
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.drivers.protocol import VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import Mover
from foresee_dsl.simulate.actors.dynamics import BicycleState
from foresee_dsl.simulate.actors.lane_recovery import LaneRecovery
from tests.support.paths import Walk

DT = 0.05
CAR = VehicleLimits("car.compact", 4.2, 1.8, 2.6, 0.85, 45.0, 2.6, 4.5, 8.0, math.radians(35), math.radians(400), 0.9)
BUS = VehicleLimits("bus.city", 12.0, 2.5, 6.0, 2.7, 28.0, 1.2, 4.0, 6.5, math.radians(45), math.radians(300), 0.9)


def follower(path: list[tuple[float, float]], **values: float) -> Walk:
    return Walk(path, **{"pace_mps": 1.4, "acceleration_mps2": 1.5, "braking_mps2": 2.0, **values})


# ---------------------------------------------------------------------------------------------- path-followers


def test_it_takes_up_its_pace_and_stops_at_the_end() -> None:
    walker = follower([(0, 0), (0, 10)])
    poses = [walker.step(DT) for _ in range(300)]
    assert max(p.speed for p in poses) == pytest.approx(1.4)
    # 1.4 m/s after 1.4 / 1.5 = 0.93 s and 0.65 m; then 0.05 s a step.
    assert poses[39].y == pytest.approx(1.4 * 2.0 - 1.4**2 / 1.5 / 2, abs=0.01)
    assert (poses[-1].x, poses[-1].y, poses[-1].speed) == (pytest.approx(0), 10.0, 0.0)
    assert poses[-1].heading == pytest.approx(math.pi / 2)
    assert walker.arrived


@given(
    pace=st.floats(0.3, 8),
    stop=st.floats(20, 60),
    braking=st.floats(1, 6),
    acceleration=st.floats(0.5, 4),
    speed=st.floats(0, 8),
)
def test_it_stops_exactly_where_it_must_and_goes_on_when_it_may(
    pace: float, stop: float, braking: float, acceleration: float, speed: float
) -> None:
    rider = follower(
        [(0, 0), (30, 0), (30, 50)],
        pace_mps=pace,
        braking_mps2=braking,
        acceleration_mps2=acceleration,
        speed_mps=min(speed, math.sqrt(2 * braking * 18)),
    )
    rider.stop_m = stop
    seen = [(rider.along_m, rider.speed_mps)]
    for _ in range(5000):
        pose = rider.step(DT)
        assert -braking - 1e-6 <= pose.acceleration <= acceleration + 1e-6 or rider.speed_mps == 0
        assert rider.along_m >= seen[-1][0]
        seen.append((rider.along_m, rider.speed_mps))
        if rider.speed_mps == 0:
            break
    assert seen[-1] == (stop, 0.0)
    rider.step(DT)
    assert rider.along_m == stop
    rider.stop_m = None
    assert rider.step(DT).speed > 0


@given(frame=st.integers(0, 250), stop=st.one_of(st.none(), st.floats(1, 40)), pace=st.floats(0.5, 6))
def test_restored_at_any_frame_it_continues_on_the_same_positions(frame: int, stop: float | None, pace: float) -> None:
    path = [(0.0, 0.0), (12.0, 3.0), (12.0, 20.0), (-5.0, 31.0)]
    parent = follower(path, pace_mps=pace, length_m=1.8)
    parent.stop_m = stop
    for _ in range(frame):
        parent.step(DT)
    child = follower(path, pace_mps=pace, length_m=1.8, along_m=parent.along_m, speed_mps=parent.speed_mps)
    child.stop_m = stop
    assert child.pose() == parent.pose()
    for _ in range(100):
        assert child.step(DT) == parent.step(DT)


def test_a_stop_behind_or_too_near_does_not_hold_it() -> None:
    rider = follower([(0, 0), (100, 0)], pace_mps=6.0, speed_mps=6.0)
    rider.stop_m = 0.5  # needs 9 m
    for _ in range(100):
        rider.step(DT)
    assert rider.along_m > 20
    assert rider.speed_mps == pytest.approx(6.0)


def test_a_long_body_turns_gradually_at_a_corner() -> None:
    rider = follower([(0, 0), (10, 0), (10, 10)], pace_mps=2.0, speed_mps=2.0, length_m=1.8, along_m=8.0)
    headings = [rider.step(DT).heading for _ in range(40)]
    steps = np.diff(headings)
    assert headings[-1] == pytest.approx(math.pi / 2)
    assert (steps >= -1e-12).all()
    assert steps.max() < math.radians(10)


@pytest.mark.parametrize("path", [[(1, 1)], [(1, 1), (1, 1)], [(0, 0), (math.nan, 1)], []])
def test_a_path_without_length_is_refused(path: list[tuple[float, float]]) -> None:
    with pytest.raises(ValueError, match="two different points"):
        follower(path)


def test_rates_must_be_positive() -> None:
    with pytest.raises(ValueError, match="positive"):
        follower([(0, 0), (1, 0)], braking_mps2=0.0)


# ---------------------------------------------------------------------------------------------- lane recovery


@dataclass(frozen=True, eq=False)
class Line(Polyline):
    """A centreline with limits."""

    speed_limit: FloatArray

    @classmethod
    def through(cls, points: FloatArray, limit: float = 20.0) -> Line:
        base = Polyline.of(points)
        return cls(base.xy, base.marks, base.angles, np.full(len(base.s), limit))


STRAIGHT = Line.through(np.array([[0.0, 0.0], [600.0, 0.0]]))
_ANGLES = np.linspace(-math.pi / 2, 0, 30)
# 60 m east, a left turn of radius 20 m, 100 m north.
LEFT_TURN = Line.through(
    np.concatenate(
        [[[0.0, 0.0]], np.column_stack([60 + 20 * np.cos(_ANGLES), 20 + 20 * np.sin(_ANGLES)]), [[80.0, 120.0]]]
    ),
    limit=8.0,
)


def drive(
    actor: LaneRecovery, state: BicycleState, seconds: float, others: tuple[Mover, ...] = ()
) -> list[BicycleState]:
    states = [state]
    for k in range(round(seconds / DT)):
        states.append(actor.step(states[-1], k * DT, others, DT))
    return states


@pytest.mark.parametrize("limits", [CAR, BUS], ids=lambda limit: limit.model)
@pytest.mark.parametrize("value", [-1.0, -0.1, 0.1, 1.0])
@pytest.mark.parametrize("speed", [5.0, 14.0, 20.0])
def test_after_the_offset_it_comes_back_to_its_lane(limits: VehicleLimits, value: float, speed: float) -> None:
    actor = LaneRecovery(limits, STRAIGHT, cruise_mps=speed, offset=TimedValue(value, 1.0, 2.0))
    states = drive(actor, actor.take_over(50, 0, 0, speed), 15.0)
    assert all(s.y == pytest.approx(0, abs=1e-9) for s in states[:21])
    left = states[20:41]
    assert math.copysign(1, left[-1].y) == math.copysign(1, value)
    assert abs(left[-1].y) > 0.2
    assert max(abs(s.speed * s.yaw_rate) for s in left) <= actor.bicycle.lateral_mps2 * 1.001
    assert max(abs(s.speed * s.yaw_rate) for s in states[60:]) <= 4.0 * 1.02
    # Back within 0.3 m of the lane's centre 8 s after the offset, and it stays there.
    assert max(abs(s.y) for s in states[-100:]) < 0.3
    assert max(abs(s.heading) for s in states[-100:]) < math.radians(2)
    # It swings past its lane by less than half of what it had left it.
    overshoot = max((-s.y * math.copysign(1, value) for s in states), default=0.0)
    assert overshoot < 0.5 * max(abs(s.y) for s in states)


def test_the_offset_is_a_share_of_the_largest_angle() -> None:
    actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=5.0, offset=TimedValue(0.2, 0.0, math.inf))
    states = drive(actor, actor.take_over(50, 0, 0, 5.0), 1.0)
    assert states[-1].steer == pytest.approx(0.2 * CAR.steer_max_rad)


def test_by_default_friction_limits_the_offset() -> None:
    actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=18.0, offset=TimedValue(1.0, 0.0, 1.0))
    states = drive(actor, actor.take_over(50, 0, 0, 18.0), 1.0)
    lateral = max(abs(s.speed * s.yaw_rate) for s in states)
    assert 0.9 * 0.9 * 9.81 < lateral <= 0.9 * 9.81 + 1e-9


@pytest.mark.parametrize("limits", [CAR, BUS], ids=lambda limit: limit.model)
def test_thrown_far_off_its_lane_it_hardly_swings_past_it(limits: VehicleLimits) -> None:
    actor = LaneRecovery(limits, STRAIGHT, cruise_mps=20.0, offset=TimedValue(1.0, 1.0, 2.0))
    offs = [s.y for s in drive(actor, actor.take_over(50, 0, 0, 20.0), 12.0)]
    assert max(offs) > 5
    assert min(offs) > -0.9
    assert max(abs(y) for y in offs[-40:]) < 0.3


def test_without_offset_it_keeps_its_lane_through_a_turn() -> None:
    actor = LaneRecovery(CAR, LEFT_TURN, cruise_mps=14.0)
    for state in drive(actor, actor.take_over(5, 0, 0, 8.0), 14.0):
        _, left = LEFT_TURN.project(state.x, state.y)
        assert abs(left) < 0.35
        assert state.speed < 8.3
    assert state.y > 40


def test_in_a_bend_the_wheels_keep_the_bend_and_add_the_offset() -> None:
    bend = LaneRecovery(CAR, LEFT_TURN, cruise_mps=6.0)
    x, y, heading = LEFT_TURN.at(75.0)
    state = bend.take_over(x, y, heading, 6.0)
    assert state.steer == pytest.approx(math.atan(2.6 / 20), rel=0.1)
    actor = LaneRecovery(CAR, LEFT_TURN, cruise_mps=6.0, offset=TimedValue(0.1, 0.0, 1.0))
    after = drive(actor, state, 0.2)[-1]
    assert after.steer - state.steer == pytest.approx(0.1 * CAR.steer_max_rad, abs=0.02)


def test_it_brakes_for_the_limit_ahead() -> None:
    limit = np.where(STRAIGHT.s < 200, 15.0, 5.0)
    line = Line(STRAIGHT.points, STRAIGHT.s, STRAIGHT.heading, limit)
    actor = LaneRecovery(CAR, line, cruise_mps=20.0)
    states = drive(actor, actor.take_over(10, 0, 0, 15.0), 30.0)
    assert max(s.speed for s in states if s.x < 150) == pytest.approx(15.0, abs=0.5)
    assert all(s.speed < 5.5 for s in states if s.x > 200)
    assert states[-1].speed == pytest.approx(5.0, abs=0.2)
    assert min(s.acceleration for s in states) > -CAR.emergency_braking_mps2


def test_it_stops_behind_what_stands_in_its_lane() -> None:
    actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0)
    parked = Mover(150, 0.3, 0, 0.0, 4.5, 1.8)
    end = drive(actor, actor.take_over(50, 0, 0, 14.0), 25.0, (parked,))[-1]
    gap = 150 - 2.25 - (end.x + 2.1)
    assert end.speed < 0.1
    assert 1.5 < gap < 4.0


def test_it_follows_who_drives_ahead_and_minds_nobody_beside_or_absent() -> None:
    actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0)
    state = actor.take_over(50, 0, 0, 14.0)
    beside = Mover(80, 3.3, math.pi, 14.0, 4.5, 1.8)
    absent = Mover(math.nan, math.nan, math.nan, math.nan, 4.5, 1.8)
    assert drive(actor, state, 3.0, (beside, absent))[-1].speed == pytest.approx(14.0, abs=0.05)
    for k in range(400):
        state = actor.step(state, k * DT, (Mover(80 + 7 * k * DT, 0, 0, 7.0, 4.5, 1.8),), DT)
    assert state.speed == pytest.approx(7.0, abs=0.3)
    gap = 80 + 7 * 20 - 2.25 - (state.x + 2.1)
    assert 7.0 < gap < 12.0  # 2.5 m and 1 s at 7 m/s, and what the model adds


def test_before_a_turn_it_does_not_brake_for_what_waits_straight_on() -> None:
    # 20 m before the turn; the oncoming lane's first car stands beyond the junction, straight ahead.
    waits = Mover(100, 0, math.pi, 0.0, 4.5, 1.8)
    actor = LaneRecovery(CAR, LEFT_TURN, cruise_mps=8.0)
    states = drive(actor, actor.take_over(40, 0, 0, 8.0), 6.0, (waits,))
    assert min(s.speed for s in states) > 7.8
    # In its lane behind the turn it does.
    waits = Mover(80, 60, -math.pi / 2, 0.0, 4.5, 1.8)
    assert drive(actor, actor.take_over(40, 0, 0, 8.0), 20.0, (waits,))[-1].speed < 0.1


def test_on_its_swerve_it_brakes_for_what_the_wheels_point_at() -> None:
    # SteeredVehicle into the oncoming lane; there a car stands that is not in its own lane.
    stands = Mover(85, 3.3, math.pi, 0.0, 4.5, 1.8)
    offset = TimedValue(0.03, 0.0, 2.0)

    def speed_after(*others: Mover) -> float:
        actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0, offset=offset)
        return drive(actor, actor.take_over(50, 0, 0, 14.0), 1.5, others)[-1].speed

    assert speed_after(stands) < 12.0
    assert speed_after() > 13.5


def test_on_its_swerve_it_minds_the_arc_and_not_the_bonnet() -> None:
    # On a radius of 40 m it is 20^2 / 80 = 5 m to the left 20 m further on.
    steer = math.atan(CAR.wheelbase_m / 40)
    state = BicycleState(50, 0, 0, 10.0, steer=steer)
    offset = TimedValue(steer / CAR.steer_max_rad, 0.0, 2.0)

    def slows_for(x: float, y: float) -> bool:
        actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=10.0, offset=offset)
        return actor.step(state, 1.0, (Mover(x, y, 0, 0.0, 4.5, 1.8),), DT).speed < 9.95

    assert slows_for(70, 5)
    assert not slows_for(70, 0)
    assert not slows_for(30, 0)


def test_it_halts_at_a_stop_line_and_ignores_one_behind_or_too_near() -> None:
    actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0)
    state = actor.take_over(50, 0, 0, 14.0)
    for k in range(500):
        state = actor.step(state, k * DT, (), DT, stop_s=130.0)
    assert state.speed < 0.05
    assert 129.0 < state.x + 2.1 < 130.05
    for stop in (40.0, 60.0):  # behind; 7.9 m ahead where 12 m are needed
        start = actor.take_over(50, 0, 0, 14.0)
        assert LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0).step(start, 0.0, (), DT, stop_s=stop).speed > 13.9


def test_it_is_a_function_of_state_and_time() -> None:
    offset = TimedValue(0.3, 0.5, 1.5)
    whole = LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0, offset=offset)
    states = drive(whole, whole.take_over(50, 0, 0, 12.0), 6.0)
    for frame in (0, 7, 15, 40, 80):
        state, fresh = states[frame], LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0, offset=offset)
        for k in range(frame, frame + 20):
            state = fresh.step(state, k * DT, (), DT)
        assert astuple(state) == pytest.approx(astuple(states[frame + 20]), abs=1e-9)


def test_it_knows_the_end_of_its_route() -> None:
    actor = LaneRecovery(CAR, STRAIGHT, cruise_mps=14.0)
    assert not actor.done(BicycleState(599.0, 0.5, 0, 10.0))
    assert actor.done(BicycleState(600.5, 0.5, 0, 10.0))
