"""Waypoints to pedals, and what binds along them, by hand and in a closed loop of the project's own dynamics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from foresee_learned import settings as cfg
from foresee_learned.decisions import Pilot, laid_down
from foresee_learned.free_way import free_way, rules_of
from foresee_learned.fusion_safe import (
    Creeping,
    FusionSafeState,
    Objects,
    along_the_route,
    planned_speed,
)
from foresee_learned.outputs import FUSION_SAFE_TIMES_S, FUSION_TIMES_S, Occupied, square_middle
from foresee_learned.session import Network
from training.small_networks import fusion_safe

from foresee_dsl.drivers.protocol import EgoState, FloatArray, Mission, Observation
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from tests.support.driving import SEDAN, STEP_S, line, mission

STRAIGHT = np.array([(8.0 * t, 0.0) for t in FUSION_SAFE_TIMES_S])
RULES = rules_of(SEDAN)
FRONT_M = SEDAN.length_m / 2


def ego_of(state: BicycleState) -> EgoState:
    return EgoState(
        state.x, state.y, state.heading, state.speed, state.acceleration, state.yaw_rate, state.steer
    )  # fmt: skip


def seen_ahead(points: FloatArray, state: BicycleState, speed: float) -> FloatArray:
    """The waypoints that a perfect network would give: on a line, at a speed, in the ego's frame."""
    nearest = int(np.hypot(*(points - (state.x, state.y)).T).argmin())
    chosen = points[np.minimum(nearest + np.round(np.array(FUSION_TIMES_S) * speed / 0.5).astype(int), len(points) - 1)]
    dx, dy = (chosen - (state.x, state.y)).T
    cos, sin = math.cos(state.heading), math.sin(state.heading)
    return np.column_stack([dx * cos + dy * sin, dy * cos - dx * sin])


@pytest.mark.parametrize(("radius", "speed"), [(math.inf, 13.0), (30.0, 8.0), (-12.0, 5.0), (8.0, 4.0)])
def test_the_pilot_keeps_to_the_line_and_to_the_speed(radius: float, speed: float) -> None:
    points = line((20, math.inf), (min(abs(radius), 20) * 1.5, radius), (80, math.inf))
    body, pilot, state = Bicycle(SEDAN), Pilot(SEDAN), BicycleState(2.0, 0.3, 0.0, speed)
    path, off = laid_down(seen_ahead(points, state, speed), ego_of(state)), []
    for frame in range(round(60 / speed / STEP_S)):
        if frame % 2 == 0:
            path = laid_down(seen_ahead(points, state, speed), ego_of(state))
        state = body.step(state, pilot.follow(path, speed, 1.0, ego_of(state)), STEP_S)
        off.append(float(np.hypot(*(points - (state.x, state.y)).T).min()))
    assert state.speed == pytest.approx(speed, abs=0.1)
    assert max(off) < 0.65  # it cuts the sharpest bend a little
    assert off[-1] < 0.3


def test_the_pilot_reaches_a_speed_stops_and_then_stands() -> None:
    body, pilot, state = Bicycle(SEDAN), Pilot(SEDAN), BicycleState(0.0, 0.0, 0.0, 0.0)
    path = np.array([(0.0, 0.0), (100.0, 0.0)])
    for _ in range(160):
        state = body.step(state, pilot.follow(path, 8.0, 1.0, ego_of(state)), STEP_S)
    assert state.speed == pytest.approx(8.0, abs=0.1)
    for _ in range(160):
        state = body.step(state, pilot.follow(path, 0.0, 1.0, ego_of(state)), STEP_S)
    assert state.speed == 0.0
    answer = pilot.follow(path, 0.0, 1.0, ego_of(state))
    assert (answer.throttle, answer.brake > 0.3) == (0.0, True)
    assert pilot.follow(path, 8.0, 1.0, ego_of(state), hardest=True).brake == 1.0


def test_waypoints_that_stand_say_nothing_about_the_wheels() -> None:
    ego = EgoState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.2)
    path = laid_down(np.array([(0.05, 0.04), (-0.02, 0.06)]), ego)
    assert Pilot(SEDAN).follow(path, 0.0, 1.0, ego).steer == pytest.approx(0.2 / SEDAN.steer_max_rad)


def standing(ahead_m: float, left_m: float = 0.0, heading: float = 0.0, speed: float = 0.0) -> Occupied:
    return Occupied(0.9, ahead_m, left_m, 4.0, 2.0, heading, speed)


def test_the_way_ends_before_what_stands_in_it() -> None:
    way = free_way(STRAIGHT, [standing(20.0)], RULES)
    to_it = 20.0 - 2.0 - FRONT_M
    assert way.free_m == pytest.approx(to_it - cfg.MARGIN_M, abs=cfg.SAMPLE_M)
    assert (way.first, way.first_m) == (standing(20.0), way.free_m[0])


def test_what_is_beside_the_way_or_behind_or_crosses_later_does_not_bind() -> None:
    crossing = standing(20.0, -30.0, math.pi / 2, 10.0)  # in the way after 3 s
    for other in (standing(20.0, 3.0), standing(-5.0), crossing):
        way = free_way(STRAIGHT, [other], RULES)
        assert (way.first, np.isinf(way.free_m).all()) == (None, True)


def test_what_the_ego_passes_does_not_hold_it_and_what_it_touches_does() -> None:
    beside = Occupied(0.9, 1.0, -1.6, 4.0, 1.0, 0.0, 0.0)  # 0.3 m into the wider footprint
    assert free_way(STRAIGHT, [beside], RULES).first is None
    touched = Occupied(0.9, 4.0, -0.8, 4.0, 2.0, 0.0, 0.0)
    assert free_way(STRAIGHT, [touched], RULES).free_m[0] == 0.0


def test_what_stands_close_to_the_way_leaves_room_for_less_air_but_not_for_none() -> None:
    close = rules_of(SEDAN, cfg.CLOSE_SIDE_M, cfg.CLOSE_SMALL_MARGIN_M)
    for air, usual, slowly in ((0.7, True, True), (0.4, False, True), (0.1, False, False)):
        barrier = Occupied(0.9, 8.0, -SEDAN.width_m / 2 - air - 0.25, 1.0, 0.5, 0.0, 0.0)
        assert (free_way(STRAIGHT, [barrier], RULES).first is None) is usual
        assert (free_way(STRAIGHT, [barrier], close).first is None) is slowly


def test_it_passes_slowly_what_stands_close_to_its_way_and_brakes_for_it_when_it_is_fast() -> None:
    state = FusionSafeState(Network(fusion_safe()), mission(line((200, math.inf))), SEDAN)
    density = np.zeros((8, 24, 24), np.float32)
    ahead_m, left_m = square_middle(17, 12)
    barrier = (0.9, 4.0 - ahead_m, -SEDAN.width_m / 2 - 0.65 - left_m, 1.0, 0.5, 1.0, 0.0, 0.0)
    density[:, 17, 12] = barrier
    answer = {
        "waypoints": STRAIGHT.astype(np.float32),
        "density": density,
        "stop_line": np.zeros(1, np.float32),
        "signal": np.zeros(4, np.float32),
    }
    slow, fast = (
        state.decide(Observation(0.0, EgoState(0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0), (), {}), answer)
        for speed in (2.0, 8.0)
    )
    assert (slow.target_mps, slow.hardest) == (cfg.CREEPS_MPS, False)
    assert fast.hardest


def test_a_leader_binds_less_from_step_to_step_and_one_that_crosses_soon_until_it_is_gone() -> None:
    leader = free_way(STRAIGHT, [standing(14.0, speed=6.0)], RULES).free_m
    assert np.diff(leader[:-1]).min() >= 0.0
    assert leader[-1] > leader[0] + 6.0
    crossing = free_way(STRAIGHT, [standing(14.0, -5.0, math.pi / 2, 6.0)], RULES).free_m
    assert np.isfinite(crossing[0])
    assert np.isinf(crossing[4:]).all()


def test_an_object_that_is_lost_for_a_moment_is_remembered_where_it_has_come() -> None:
    objects = Objects()
    child = Occupied(0.9, 10.0, 2.0, 0.1, 0.1, -math.pi / 2, 1.0)
    ego = EgoState(100.0, 50.0, 0.5, 8.0, 0.0, 0.0, 0.0)
    (first,) = objects.update([child], ego, 5.0)
    assert (first.length_m, first.width_m) == (cfg.LEAST_M, cfg.LEAST_M)
    on = EgoState(100.0 + 1.6 * math.cos(0.5), 50.0 + 1.6 * math.sin(0.5), 0.5, 8.0, 0.0, 0.0, 0.0)
    (lost,) = objects.update([], on, 5.2)
    assert (lost.ahead_m, lost.left_m) == (pytest.approx(8.4), pytest.approx(1.8))
    # Seen again it is one object, and after a while it is forgotten; so is one that was doubtful from the beginning.
    assert objects.update([lost], on, 5.2) == [lost]
    assert objects.update([], on, 5.8) == []
    objects.update([replace(child, probability=0.5)], on, 6.0)
    assert objects.update([], on, 6.1) == []


def test_the_speed_of_waypoints() -> None:
    assert planned_speed(STRAIGHT) == pytest.approx(8.0)
    assert planned_speed(STRAIGHT * 0.0) == 0.0


def test_who_stands_long_enough_creeps_for_a_moment_and_then_waits_again() -> None:
    creeping = Creeping()
    times = [0.1 * k for k in range(300)]
    told = [creeping.begins_or_goes_on(time, 0.0, held=False) for time in times]
    (begin, _), (end, _), (again, _) = [
        (t, on) for t, on, before in zip(times[1:], told[1:], told, strict=False) if on != before
    ][:3]
    assert begin == pytest.approx(cfg.CREEPS_AFTER_S)
    assert end == pytest.approx(cfg.CREEPS_AFTER_S + cfg.CREEPS_FOR_S, abs=0.11)
    assert again == pytest.approx(end + cfg.CREEPS_AFTER_S, abs=0.11)


def test_neither_who_moves_nor_whom_a_stop_line_holds_creeps() -> None:
    creeping = Creeping()
    assert not any(creeping.begins_or_goes_on(0.1 * k, 0.0 if k % 70 else 1.0, held=False) for k in range(300))
    assert not any(creeping.begins_or_goes_on(30.0 + 0.1 * k, 0.0, held=True) for k in range(300))
    assert not creeping.begins_or_goes_on(60.0, 0.0, held=False)
    assert creeping.begins_or_goes_on(60.0 + cfg.CREEPS_AFTER_S, 0.0, held=False)
    assert not creeping.begins_or_goes_on(60.1 + cfg.CREEPS_AFTER_S, 1.0, held=True)  # the light turned red
    assert not creeping.begins_or_goes_on(60.2 + cfg.CREEPS_AFTER_S, 1.0, held=False)


def test_it_creeps_along_the_route() -> None:
    centreline = np.column_stack([np.full(51, 3.0), np.arange(51.0)])
    ones = np.ones(51)
    mission = Mission(centreline, np.arange(51.0), 10.0 * ones, ones, ones, 0.0, 50.0)
    ego = EgoState(3.5, 10.0, math.pi / 2, 0.0, 0.0, 0.0, 0.0)
    waypoints = along_the_route(mission, 10.0, ego, (0.5, 1.0))
    assert waypoints == pytest.approx(np.array([(0.5 * cfg.CREEPS_MPS, 0.5), (cfg.CREEPS_MPS, 0.5)]))
