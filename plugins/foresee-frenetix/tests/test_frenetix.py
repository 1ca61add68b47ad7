"""The driver `frenetix`: its parts by hand, closed loops on hand-built roads, and runs with SUMO."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from foresee_frenetix import FrenetixDriver
from foresee_frenetix.plan import TIMES_S, Frenet, braking_plan
from foresee_frenetix.planner import make_window, window_number

from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.protocol import Driver, EgoState, JunctionPassage, Mission, Observation
from foresee_dsl.drivers.registry import describe_drivers, load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.simulate.actors.dynamics import BicycleState
from foresee_dsl.simulate.results.verdict import Verdict
from tests.support.driving import SEDAN, STEP_S, Run, Script, drive, line, mission, moving, standing
from tests.support.towns import drive_through, town

pytest.importorskip("frenetix", reason="the package frenetix has no wheel for this platform")

STRAIGHT = math.inf
LIMIT = 50 / 3.6


def start(speed: float, x: float = 5.0, y: float = 0.0) -> BicycleState:
    return BicycleState(x, y, 0.0, speed)


def signalised() -> Mission:
    return mission(line((250, STRAIGHT)), junctions=[JunctionPassage("j", 100.0, 120.0, "straight", "j")])


def wall_that_appears(at: float, from_s: float) -> Script:
    """A wall across both lanes that nobody saw coming."""
    wall = standing(1, at, 0.0, kind="obstacle", size=(0.5, 12.0))
    return lambda t: wall(t) if t >= from_s else None


def test_is_a_driver_that_says_what_it_is_and_when_it_was_not_reset() -> None:
    driver = load_driver("frenetix")
    assert isinstance(driver, Driver)
    assert driver.version == "1 (library 0.4.0)"
    with pytest.raises(DriverError, match="before reset"):
        driver.step(Observation(0.0, EgoState(0, 0, 0, 0, 0, 0, 0), (), {}))


def test_without_its_package_it_is_listed_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "frenetix", None)
    with pytest.raises(DriverError, match=r"pip install ./plugins/foresee-frenetix in a checkout"):
        load_driver("frenetix")
    row = next(d for d in describe_drivers() if d.name == "frenetix")
    assert row.version == ""
    assert "not installed" in row.doc
    assert next(d for d in describe_drivers() if d.name == "pdm").version  # the rest works


# --- parts, by hand -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("v", "a", "way", "by_hand"),
    [
        (10.0, 0.0, 20.0, 4.0),  # T v / 2
        (10.0, 3.0, 24.0, 4.0),  # T v / 2 + T^2 a / 12
        (6.0, -3.0, 8.0, 4.0),  # the same, braking already
        (6.0, -3.0, 9.5, None),  # would have to reverse: more than T = 6 gives
        (6.0, 0.0, -1.0, None),
        (0.0, 0.0, 5.0, None),
    ],
)
def test_how_long_a_stop_takes(v: float, a: float, way: float, by_hand: float | None) -> None:
    from foresee_frenetix.planner import stop_time, travel

    state = Frenet(0.0, v, a, 0.0, 0.0, 0.0)
    time = stop_time(state, way)
    assert time == (None if by_hand is None else pytest.approx(by_hand))
    if time is not None:
        assert travel(state, np.array([time]), np.array([0.0]))[0] == pytest.approx(way)


def test_braking_along_a_straight_line_by_hand() -> None:
    route = build_route(mission(line((200, STRAIGHT))), SEDAN)
    plan = braking_plan(route, 1.0, Frenet(50.0, 12.0, 0.0, 0.5, 0.0, 0.0), 6.0, None, emergency=True)
    assert plan.s[-1] - plan.s[0] == pytest.approx(12.0)  # 12^2 / (2 * 6)
    assert plan.pose(2.0).speed == pytest.approx(6.0)
    assert plan.pose(2.0).acceleration == -6.0
    assert plan.pose(3.5).speed == 0.0
    assert plan.d == pytest.approx(0.5)
    assert plan.y == pytest.approx(0.5)


def test_lengths_of_the_library_and_of_the_route_name_the_same_points() -> None:
    route = build_route(mission(line((80, STRAIGHT), (3 * math.pi, 6), (80, STRAIGHT))), SEDAN)
    window = make_window(route, window_number(route, 70.0))
    assert window.route_s[0] < 70.0 < window.route_s[-1] - 50.0
    for s in (75.0, 85.0, 100.0):
        own = float(np.interp(s, window.route_s, window.own_s))
        k = int(np.searchsorted(window.system.ref_pos, own))
        point = route.points[route.index(s)]
        assert math.hypot(*(window.system.ref_line[k] - (point["x"], point["y"]))) < 1.1  # one spacing
        assert float(window.to_route(np.array(own))) == pytest.approx(s)


@pytest.mark.parametrize("speed", [2.0, 10.0])
def test_a_plan_is_of_one_piece(speed: float) -> None:
    # Its derivatives belong to its positions: those of the library's filled samples do not (0.4.0 halves the second).
    task = mission(line((30, STRAIGHT), (40, 25), (100, STRAIGHT)), left_m=5.0)
    driver = FrenetixDriver()
    drive(driver, task, start=start(speed, x=20.0, y=0.8), seconds=1.0)
    plan = driver.stack.plan
    assert plan is not None
    inner = slice(1, -1)
    assert plan.s_ddot[inner] == pytest.approx(np.gradient(plan.s_dot, TIMES_S)[inner], abs=0.15)
    assert plan.d_ddot[inner] == pytest.approx(np.gradient(plan.d_dot, TIMES_S)[inner], abs=0.15)
    assert plan.d_dot[inner] == pytest.approx(np.gradient(plan.d, TIMES_S)[inner], abs=0.15)
    assert plan.speed[inner] == pytest.approx(
        np.hypot(np.gradient(plan.x, TIMES_S), np.gradient(plan.y, TIMES_S))[inner], abs=0.1
    )
    direction = np.arctan2(np.gradient(plan.y), np.gradient(plan.x))
    assert np.cos(plan.heading - direction)[inner] == pytest.approx(1.0, abs=2e-3)


# --- closed loops ---------------------------------------------------------------------------------------------------


def test_cruises_at_the_limit_in_the_middle_of_the_lane() -> None:
    points = line((300, STRAIGHT))
    driver = FrenetixDriver()
    run = drive(driver, mission(points), start=start(10.0, y=0.5), seconds=16)
    assert run.speed[-1] == pytest.approx(LIMIT, abs=0.4)
    assert run.speed.max() < LIMIT + 0.5
    assert abs(run.lateral_error(points)[160:]).max() < 0.15
    assert run.acceleration.max() < 2.4  # nuPlan's bound of comfort
    assert driver.stack.state == "cruise"
    assert (driver.stack.count.plans, driver.stack.count.emergencies) == (160, 0)  # 10 plans a second


@pytest.mark.parametrize(("radius", "heading"), [(10.0, 0.0), (-6.0, 0.0), (10.0, math.pi / 2 + 0.4)])
def test_slows_down_for_a_turn_and_keeps_to_the_line(radius: float, heading: float) -> None:
    # With the last heading the turn goes through pi, where the library's own headings jump.
    points = line((50, STRAIGHT), (abs(radius) * math.pi / 2, radius), (40, STRAIGHT), start=(0, 0, heading))
    end, x, y = points[-1], *(8.0 * np.array([math.cos(heading), math.sin(heading)]))
    run = drive(
        FrenetixDriver(),
        mission(points),
        start=BicycleState(x, y, heading, 11.0),
        seconds=20,
        after=lambda s: math.hypot(s.x - end[0], s.y - end[1]) < 10,
    )
    assert math.hypot(*(run.xy[-1] - end)) < 10.5  # it got there
    assert abs(run.lateral_error(points)).max() < 0.45
    assert max(abs(s.yaw_rate * s.speed) for s in run.states) < 4.0
    assert run.acceleration.min() > -3.0
    assert run.speed.min() > 0.75 * math.sqrt(2.5 * abs(radius))


def test_stops_at_red_and_starts_at_green() -> None:
    driver = FrenetixDriver()
    seen: list[str] = []
    run = drive(
        driver,
        signalised(),
        start=start(LIMIT, x=30.0),
        seconds=17,
        signals=lambda t: {"j": "red" if t < 13 else "green"},
        after=lambda _s: seen.append(driver.stack.state.value) or False,
    )
    waiting = run.states[round(12.9 / STEP_S)]
    assert waiting.speed < 0.05
    assert 97.0 < waiting.x + SEDAN.length_m / 2 < 100.0
    assert run.acceleration.min() > -3.0
    assert run.states[-1].x > 104.0
    assert set(seen[: round(12 / STEP_S)]) <= {"cruise", "stop"}
    assert seen[round(12 / STEP_S)] == "stop"


def test_a_signal_that_is_not_seen_is_no_green_one() -> None:
    run = drive(FrenetixDriver(), signalised(), start=start(LIMIT, x=20.0), seconds=17)
    assert run.speed[-1] < 0.1
    assert run.states[-1].x + SEDAN.length_m / 2 < 100.0


def test_follows_a_leader_through_a_stop() -> None:
    points = line((600, STRAIGHT))
    driver = FrenetixDriver()

    def speed(t: float) -> float:
        return 8.0 if t < 6 else max(0.0, 8.0 - 3.0 * (t - 6)) if t < 12 else 6.0

    run = drive(
        driver, mission(points), start=start(LIMIT), seconds=17, others=[moving(1, points, speed, along_m=40.0)]
    )
    assert run.gap_m > 1.0
    assert run.acceleration.min() > -5.0
    assert run.speed[round(11.9 / STEP_S)] < 0.6
    assert run.speed[-1] > 2.5
    assert driver.stack.state == "follow"


@pytest.mark.parametrize(("left_m", "y"), [(1.75, -1.9), (5.25, 0.0)])
def test_passes_a_parked_car(left_m: float, y: float) -> None:
    points = line((250, STRAIGHT))
    run = drive(
        FrenetixDriver(),
        mission(points, left_m=left_m),
        start=start(LIMIT, x=30.0),
        seconds=20,
        others=[standing(1, 100.0, y)],
        after=lambda s: s.x > 150,
    )
    assert run.states[-1].x > 150
    assert run.gap_m > 0.25
    assert run.lateral_error(points).max() < left_m - SEDAN.width_m / 2 + 0.1  # within its lanes
    assert abs(run.lateral_error(points)[-1]) < 0.3  # and back


def test_steers_out_from_behind_a_parked_car() -> None:
    run = drive(
        FrenetixDriver(),
        mission(line((250, STRAIGHT)), left_m=5.25),
        start=start(0.0, x=100.0 - 4.6 - 6.0),
        seconds=12,
        others=[standing(1, 100.0, 0.0)],
        after=lambda s: s.x > 115,
    )
    assert run.states[-1].x > 115
    assert run.gap_m > 0.1


@pytest.mark.parametrize("at", [60.0, 75.0])
def test_brakes_for_a_pedestrian_who_steps_out(at: float) -> None:
    walk = line((20, STRAIGHT), start=(at, -2.5, math.pi / 2))
    walker = moving(1, walk, 1.5, kind="pedestrian", size=(0.5, 0.5), gone_at_end=False)
    run = drive(
        FrenetixDriver(),
        mission(line((250, STRAIGHT))),
        start=start(LIMIT),
        seconds=13,
        others=[walker],
        after=lambda s: s.x > at + 10,
    )
    assert run.gap_m > 0.3
    assert run.states[-1].x > at + 10.0  # and it drives on


# --- no feasible trajectory -----------------------------------------------------------------------------------------


def drive_at_wall(driver: FrenetixDriver, away_m: float) -> Run:
    wall_x = 5.0 + SEDAN.length_m / 2 + 2.0 * LIMIT + away_m
    return drive(
        driver,
        mission(line((250, STRAIGHT))),
        start=start(LIMIT),
        seconds=6,
        others=[wall_that_appears(wall_x + 0.25, 2.0)],
    )


def test_a_wall_too_near_for_any_sample_is_met_by_an_emergency_stop() -> None:
    # 16.5 m: full braking takes LIMIT^2 / 16 = 12.1 m and the brakes' lag, a quartic's peak is 1.5 times its mean.
    driver = FrenetixDriver()
    run = drive_at_wall(driver, 16.5)
    assert driver.stack.count.emergencies > 0
    assert run.acceleration.min() < -7.0
    assert run.speed[-1] < 0.05
    assert run.gap_m > 0.0


def test_a_wall_farther_away_is_met_by_a_planned_stop() -> None:
    driver = FrenetixDriver()
    run = drive_at_wall(driver, 60.0)
    assert driver.stack.count.emergencies == 0
    assert run.acceleration.min() > -4.0


def test_off_the_road_it_stops_instead_of_failing() -> None:
    driver = FrenetixDriver()
    run = drive(driver, mission(line((250, STRAIGHT))), start=BicycleState(60.0, 30.0, 2.0, 8.0), seconds=3)
    assert driver.stack.count.emergencies > 0
    assert run.speed[-1] < 0.05


# --- the same again, and with SUMO ----------------------------------------------------------------------------------


def test_the_same_again_and_nothing_of_an_earlier_run() -> None:
    used = FrenetixDriver()
    drive_at_wall(used, 16.5)
    assert drive_at_wall(used, 30.0).controls == drive_at_wall(FrenetixDriver(), 30.0).controls


def test_waits_at_red_and_arrives_twice_in_the_same_way(tmp_path: Path, scenarios: Path) -> None:
    file = town(tmp_path, scenarios, stage="ns_go", end=60)
    first, second = drive_through(file, "frenetix"), drive_through(file, "frenetix")
    assert first.verdict is Verdict.PASS, first.reason
    assert first.trace.digest == second.trace.digest
