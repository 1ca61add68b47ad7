"""The floor: the IDM's formula by hand, what it makes of others, and whole runs in SUMO."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import read_situation
from foresee_dsl.drivers.protocol import Driver, EgoState, JunctionPassage, Observation, SeenActor
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.idm import (
    ACTOR_ON_ROUTE,
    EMERGENCY_TTC_S,
    ActorOnRoute,
    actors_on_route,
    gap_to_yield,
    idm_acceleration,
    leader_of,
    time_to_collision,
)
from foresee_dsl.simulate.actors.dynamics import BicycleState
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import SPEED
from tests.support.driving import SEDAN, crossing_foe, drive, line, mission, moving, standing
from tests.support.senses import Sensed
from tests.support.towns import drive_through, town

STRAIGHT = math.inf
LIMIT = 50 / 3.6


def start(speed: float, x: float = 5.0) -> BicycleState:
    return BicycleState(x, 0.0, 0.0, speed)


# ---- the formula ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("speed", "desired", "gap", "ahead", "by_hand"),
    [
        (0.0, 10.0, math.inf, 0.0, 1.0),  # a
        (10.0, 10.0, math.inf, 0.0, 0.0),
        (5.0, 10.0, math.inf, 0.0, 0.9375),  # 1 - (1/2)^4
        (20.0, 10.0, math.inf, 0.0, -15.0),  # 1 - 2^4
        (0.0, 10.0, 2.0, 0.0, 0.0),  # at s0 behind a standing car: s* = s, and v = 0
        (0.0, 10.0, 4.0, 0.0, 0.75),  # 1 - (2/4)^2
        (5.0, 10.0, 7.0, 5.0, -0.0625),  # s* = 2 + 5 * 1 = s: 1 - 1/16 - 1
        (10.0, 20.0, 12.0, 10.0, -0.0625),  # the same at twice the speeds
        # v = 10, dv = 10: s* = 2 + 10 + 100 / (2 sqrt(1.5)) = 52.8248; (s*/50)^2 = 1.11619
        (10.0, 20.0, 50.0, 0.0, 1 - 0.0625 - (52.824829 / 50) ** 2),
        (4.0, 20.0, 10.0, 8.0, 1 - 0.2**4 - 0.04),  # who pulls away: 4 * (1 - 4 / 2.449) < 0, so s* = s0 = 2
    ],
)
def test_the_formula_by_hand(speed: float, desired: float, gap: float, ahead: float, by_hand: float) -> None:
    assert idm_acceleration(speed, desired, gap, ahead) == pytest.approx(by_hand, abs=1e-6)


def test_a_gap_of_nothing_is_no_division_by_zero() -> None:
    assert idm_acceleration(1.0, 10.0, 0.0, 0.0) < -100
    assert idm_acceleration(1.0, 10.0, -3.0, 0.0) < -100


# ---- the others -----------------------------------------------------------------------------------------------------


def others(**more: float) -> Records:
    car = ActorOnRoute(ahead=20.0, far=30.0, d=0.0, speed_s=0.0, speed_d=0.0, side=1.8, pedestrian=False)
    return np.array([car._replace(**more)], ACTOR_ON_ROUTE)


@pytest.mark.parametrize(
    ("who", "ttc"),
    [
        ({}, 2.0),  # 20 m at 10 m/s
        ({"speed_s": 5.0}, 4.0),
        ({"speed_s": 10.0}, math.inf),  # as fast
        ({"speed_s": 15.0}, math.inf),
        ({"speed_s": -10.0}, 1.0),  # comes towards it
        ({"d": 3.0}, math.inf),  # beside
        ({"d": 5.95, "speed_d": -2.0}, 2.0),  # level from 2 s to 3 s; in the corridor from (5.95 - 1.95) / 2 = 2 s
        ({"d": 6.95, "speed_d": -2.0}, 2.5),
        ({"d": 13.95, "speed_d": -2.0}, math.inf),  # comes after it has passed
        ({"d": -0.5, "speed_d": 2.0}, math.inf),  # is out of the way after 1.2 s
        ({"ahead": -30.0, "far": -25.0, "speed_s": 15.0}, math.inf),  # comes from behind
    ],
)
def test_time_to_collision_by_hand(who: dict[str, float], ttc: float) -> None:
    assert time_to_collision(others(**who), 10.0) == pytest.approx(ttc)


def test_the_leader_is_the_nearest_in_the_corridor() -> None:
    seen = (
        SeenActor(1, "car", 60.0, 3.3, 0.0, 9.0, 4.0, 1.8),  # the next lane
        SeenActor(2, "car", 70.0, 0.4, 0.0, 8.0, 4.0, 1.8),
        SeenActor(3, "car", 90.0, 0.0, 0.0, 7.0, 4.0, 1.8),
        SeenActor(4, "car", 10.0, 0.0, 0.0, 6.0, 4.0, 1.8),  # behind
        SeenActor(5, "car", 66.0, -2.2, 0.0, 0.0, 4.0, 1.8),  # parked at the kerb: 0.4 m of air
    )
    route = build_route(mission(line((300, STRAIGHT))), SEDAN)
    situation = read_situation(route, SEDAN, Observation(0.0, EgoState(40, 0, 0, 10, 0, 0, 0), seen, {}))
    gap, speed = leader_of(actors_on_route(situation.egos, situation.actors, route.points))
    assert gap == pytest.approx(70 - 2 - 40 - SEDAN.length_m / 2, abs=1e-3)
    assert speed == pytest.approx(8.0)


@pytest.mark.parametrize(("away_m", "waits"), [(30.0, False), (45.0, True), (80.0, True), (95.0, False)])
def test_a_gap_is_taken_when_it_is_long_enough(away_m: float, waits: bool) -> None:
    # A major road from the left, at 12 m/s. From a stand with 1 m/s^2 the ego's front is at the conflict (7.4 m) after
    # 3.9 s, its rear out of it (16.6 m) after 5.8 s; with 1.5 s of air it takes a gap of 7.3 s. The car arrives 4.5 m
    # before its middle is there, so after 2.1, 3.4, 6.3 and 7.5 s; the first has left after 2.9 s.
    points, other = line((250, STRAIGHT)), line((140, STRAIGHT), start=(100, 120, -math.pi / 2))
    foe = crossing_foe(points, other, entry_s=110, has_priority=True)
    task = mission(points, junctions=[JunctionPassage("j", 92.0, 110.0, "straight", None, (foe,))])
    car = SeenActor(1, "car", 100.0, away_m, -math.pi / 2, 12.0, 4.5, 1.8)
    observation = Observation(0.0, EgoState(88.0, 0, 0, 0, 0, 0, 0), (car,), {})
    route = build_route(task, SEDAN)
    now = read_situation(route, SEDAN, observation)
    assert (gap_to_yield(now.egos, now.actors, route.foes, route.paths, route.junctions) < math.inf) == waits


# ---- closed loop ----------------------------------------------------------------------------------------------------


def test_is_a_driver_whose_decisions_keep_nothing() -> None:
    driver = load_driver("idm")
    assert isinstance(driver, Driver) and isinstance(driver, IdmDriver)
    with pytest.raises(DriverError, match="before reset"):
        driver.step(Observation(0.0, EgoState(0, 0, 0, 0, 0, 0, 0), (), {}))
    points = line((300, STRAIGHT))
    run = drive(driver, mission(points), start=start(10), seconds=6, others=[moving(1, points, 7.0, along_m=40)])
    fresh = IdmDriver()
    fresh.reset(mission(points), SEDAN, seed=7)
    for k in (100, 3, 50):
        told, answered = fresh.step(run.observations[k]), run.controls[k]
        assert (told.throttle, told.brake) == pytest.approx((answered.throttle, answered.brake), abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2])
def test_with_noise_it_follows_calmly_and_stops_for_who_walks(seed: int) -> None:
    points = line((600, STRAIGHT))
    run = drive(
        Sensed(IdmDriver(), seed),
        mission(points),
        start=start(9.0),
        seconds=25,
        others=[moving(1, points, 9.0, along_m=40)],
    )
    assert abs(run.acceleration[100:]).max() < 0.8
    walk = line((20, STRAIGHT), start=(80.0, -6.0, math.pi / 2))
    walker = moving(1, walk, 1.4, kind="pedestrian", size=(0.5, 0.5))
    met = drive(Sensed(IdmDriver(), seed), mission(points), start=start(LIMIT), seconds=14, others=[walker])
    assert met.gap_m > 0.5


def test_a_signal_that_is_not_seen_is_approached_ready_to_stop() -> None:
    task = mission(line((300, STRAIGHT)), junctions=[JunctionPassage("j", 100.0, 120.0, "straight", "j")])
    run = drive(IdmDriver(), task, start=start(LIMIT), seconds=25)
    assert run.speed[-1] < 0.1
    assert 90.0 < run.states[-1].x + SEDAN.length_m / 2 < 100.0
    assert run.acceleration.min() > -3.5
    at_line = drive(IdmDriver(), task, start=start(LIMIT, x=85.0), seconds=4)  # too late to stop in comfort
    assert at_line.states[-1].x > 120.0


def test_follows_with_its_gap() -> None:
    points = line((900, STRAIGHT))
    run = drive(
        IdmDriver(), mission(points), start=start(LIMIT), seconds=50, others=[moving(1, points, 8.0, along_m=60)]
    )
    # In equilibrium s = (s0 + v T) / sqrt(1 - (v / v0)^4).
    by_hand = (2.0 + 8.0) / math.sqrt(1 - (8.0 / LIMIT) ** 4)
    last = run.observations[-1]
    gap = last.actors[0].x - 4.5 / 2 - last.ego.x - SEDAN.length_m / 2
    assert run.speed[-1] == pytest.approx(8.0, abs=0.1)
    assert gap == pytest.approx(by_hand, abs=0.5)
    assert run.acceleration.min() > -4.0


def test_brakes_as_hard_as_it_can_when_time_is_short() -> None:
    gap = LIMIT * EMERGENCY_TTC_S - 1.0
    task = mission(line((250, STRAIGHT)))
    car = standing(1, 50.0 + SEDAN.length_m / 2 + gap + 2.25, 0.0)
    run = drive(IdmDriver(), task, start=start(LIMIT, x=50.0), seconds=5, others=[car])
    assert run.controls[0].brake == pytest.approx(1.0, abs=0.01)
    assert run.gap_m > 0.5
    assert run.speed[-1] < 0.1


@pytest.mark.parametrize("radius", [8.0, -8.0, 30.0])
def test_keeps_to_its_line_in_a_turn(radius: float) -> None:
    points = line((60, STRAIGHT), (abs(radius) * math.pi / 2, radius), (50, STRAIGHT))
    end = points[-1]
    run = drive(
        IdmDriver(),
        mission(points),
        start=start(12.0),
        seconds=30,
        after=lambda s: math.hypot(s.x - end[0], s.y - end[1]) < 10,
    )
    assert run.along(points)[-1] > len(points) * 0.5 - 15
    assert abs(run.lateral_error(points)).max() < 0.4
    assert max(abs(s.yaw_rate * s.speed) for s in run.states) < 3.5


def test_a_busy_junction_is_no_emergency() -> None:
    points = line((95, STRAIGHT), (4 * math.pi, 8), (60, STRAIGHT))
    foes = [
        crossing_foe(points, line((120, STRAIGHT), start=(173, y, math.pi)), entry_s=60, has_priority=True)
        for y in (3.5, 3.6, 3.7, 3.8)
    ]
    rng = np.random.default_rng(1)
    actors = tuple(
        SeenActor(
            k, "car" if k % 4 else "pedestrian", *rng.uniform((20, -30), (170, 40)), 1.57 * (k % 3), 5.0, 4.5, 1.8
        )
        for k in range(20)
    )
    driver = IdmDriver()
    driver.reset(
        mission(points, junctions=[JunctionPassage("j", 90.0, 112.0, "left", "j", tuple(foes))]), SEDAN, seed=0
    )
    observation = Observation(0.0, EgoState(60.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0), actors, {"j": "green"})
    assert driver.step(observation).brake < 1.0


# ---- in SUMO --------------------------------------------------------------------------------------------------------


def test_arrives_on_an_empty_road(tmp_path: Path, scenarios: Path) -> None:
    result = drive_through(town(tmp_path, scenarios), "idm")
    assert result.verdict is Verdict.PASS, result.reason
    assert result.trace.states[:, 0, SPEED].max() > 12.0


def test_waits_at_red_and_goes_at_green(tmp_path: Path, scenarios: Path) -> None:
    result = drive_through(town(tmp_path, scenarios, stage="ns_go", end=60), "idm")
    speed = result.trace.states[:, 0, SPEED]
    assert result.verdict is Verdict.PASS, result.reason
    assert (speed < 0.1).sum() * 0.05 > 5.0  # some 20 s of red are left
    assert np.diff(speed).min() / 0.05 > -4.0


def test_stands_behind_a_standing_car(tmp_path: Path, scenarios: Path) -> None:
    car = "  obstacle broken_down: obstacle.parked_car { start at 120 m along ego.route }\n"
    result = drive_through(town(tmp_path, scenarios, body=car), "idm")
    assert result.verdict is Verdict.STUCK, result.reason  # it is the floor: it passes nobody
    ego, other = result.trace.states[-1, 0], result.trace.states[-1, 1]
    lengths = [info.length_m for info in result.trace.actors[:2]]
    assert 1.0 < math.hypot(*(ego[:2] - other[:2])) - sum(lengths) / 2 < 3.0


def test_brakes_for_somebody_who_crosses(tmp_path: Path, scenarios: Path) -> None:
    body = """  pedestrian walker: pedestrian.adult {
    path [115 m along ego.route offset -5 m, 115 m along ego.route offset 8 m]
    speed 1.4 m/s
  }
  when distance(ego, walker) < 35 m { walker starts }
"""
    result = drive_through(town(tmp_path, scenarios, body=body), "idm")
    assert result.verdict is Verdict.PASS, result.reason
    assert result.trace.states[:, 0, SPEED].min() < 6.0
