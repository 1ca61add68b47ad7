"""The bundled driver in a closed loop: hand-built roads, scripted others, the project's own vehicle dynamics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.protocol import (
    Control,
    Driver,
    EgoState,
    JunctionPassage,
    Mission,
    Observation,
    SeenActor,
    SignalColour,
    VehicleLimits,
)
from foresee_dsl.drivers.tracking import SignalMemory
from foresee_dsl.errors import DriverError
from foresee_dsl.simulate.actors.dynamics import BicycleState
from tests.support.driving import (
    SEDAN,
    STEP_S,
    Run,
    Script,
    crossing_foe,
    drive,
    line,
    mission,
    moving,
    standing,
)
from tests.support.senses import Sensed

STRAIGHT = math.inf
LIMIT = 50 / 3.6


def start(speed: float, x: float = 5.0, y: float = 0.0) -> BicycleState:
    return BicycleState(x, y, 0.0, speed)


def left_turn() -> tuple[Mission, np.ndarray]:
    """A permissive left turn (stop line at 90 m, radius 8 m), and the lane of the oncoming traffic, 260 m before it."""
    points = line((95, STRAIGHT), (4 * math.pi, 8), (60, STRAIGHT))
    oncoming = line((120, STRAIGHT), start=(173, 3.5, math.pi))
    foe = crossing_foe(points, oncoming, entry_s=60, has_priority=True)
    junction = JunctionPassage("j", 90.0, 112.0, "left", "j", (foe,))
    return mission(points, junctions=[junction]), line((400, STRAIGHT), start=(373, 3.5, math.pi))


def oncoming_cars(lane: np.ndarray) -> list[Script]:
    """Seven cars with gaps of 1.5 s to 3 s: none to be taken."""
    return [moving(k, lane, 12.0, along_m=a) for k, a in enumerate((30.0, 60.0, 90.0, 120.0, 150.0, 175.0, 200.0))]


def drive_left_turn(driver: Driver) -> Run:
    task, lane = left_turn()
    return drive(
        driver,
        task,
        start=start(12.0),
        seconds=40,
        others=oncoming_cars(lane),
        signals=lambda _t: {"j": "green"},
        after=lambda s: s.y > 40,
    )


def test_is_a_driver_and_says_when_it_was_not_reset() -> None:
    driver = PdmDriver()
    assert isinstance(driver, Driver)
    assert (driver.name, driver.version) == ("pdm", "2")
    with pytest.raises(DriverError, match="before reset"):
        driver.step(Observation(0.0, EgoState(0, 0, 0, 0, 0, 0, 0), (), {}))


def test_cruises_at_the_limit_in_the_middle_of_the_lane() -> None:
    points = line((420, STRAIGHT))
    run = drive(PdmDriver(), mission(points), start=start(10.0, y=0.5), seconds=25)
    assert run.speed[-1] == pytest.approx(LIMIT, abs=0.4)
    assert run.speed.max() < LIMIT + 0.1
    assert abs(run.lateral_error(points)[100:]).max() < 0.1
    assert run.acceleration.max() < 2.4  # nuPlan's bound of comfort


@pytest.mark.parametrize("radius", [6.0, 10.0, -6.0, -10.0, 40.0])
def test_slows_down_for_a_turn_and_keeps_to_the_line(radius: float) -> None:
    points = line((60, STRAIGHT), (abs(radius) * math.pi / 2, radius), (50, STRAIGHT))
    end = points[-1]
    run = drive(
        PdmDriver(),
        mission(points),
        start=start(12.0),
        seconds=30,
        after=lambda s: math.hypot(s.x - end[0], s.y - end[1]) < 10,
    )
    assert run.along(points)[-1] > len(points) * 0.5 - 15
    assert abs(run.lateral_error(points)).max() < 0.3
    assert max(abs(s.yaw_rate * s.speed) for s in run.states) < 3.0  # UN R79's bound for lane keeping
    assert run.acceleration.min() > -2.5
    assert run.speed.min() > 0.8 * min(math.sqrt(2.5 * abs(radius)), LIMIT)  # not slower than comfort asks for


def test_a_line_with_corners_is_driven_smoothly() -> None:
    # A right angle of radius 8 m in five straight pieces, as netconvert draws internal lanes.
    points = line((60, STRAIGHT))
    for _ in range(5):
        x, y = points[-1]
        heading = math.atan2(*(points[-1] - points[-2])[::-1]) + math.pi / 10
        points = np.vstack([points, line((8 * math.pi / 2 / 5, STRAIGHT), start=(x, y, heading))[1:]])
    points = np.vstack([points, line((50, STRAIGHT), start=(*points[-1], math.pi / 2))[1:]])
    run = drive(PdmDriver(), mission(points), start=start(12.0), seconds=14)
    assert abs(run.lateral_error(points)).max() < 0.35
    assert run.states[-1].y > 25


def test_stops_at_red_and_starts_at_green() -> None:
    task = mission(line((250, STRAIGHT)), junctions=[JunctionPassage("j", 100.0, 120.0, "straight", "j")])
    run = drive(
        PdmDriver(), task, start=start(LIMIT), seconds=18, signals=lambda t: {"j": "red" if t < 13 else "green"}
    )
    waiting = run.states[round(12.9 / STEP_S)]
    assert waiting.speed < 0.05
    assert 97.5 < waiting.x + SEDAN.length_m / 2 < 100.0
    assert run.acceleration.min() > -3.0
    assert run.states[-1].x > 105.0
    assert run.speed[-1] > 4.0


@pytest.mark.parametrize(("distance", "stops"), [(60.0, True), (40.0, True), (25.0, False), (12.0, False)])
def test_at_amber_it_stops_where_that_is_comfortable(distance: float, stops: bool) -> None:
    task = mission(line((300, STRAIGHT)), junctions=[JunctionPassage("j", 100.0, 120.0, "straight", "j")])
    run = drive(
        PdmDriver(),
        task,
        start=start(LIMIT, x=100.0 - distance - SEDAN.length_m / 2),
        seconds=9,
        signals=lambda t: {"j": "amber" if t < 3 else "red"},
    )
    front = run.states[-1].x + SEDAN.length_m / 2
    assert (front < 100.0 and run.speed[-1] < 0.1) == stops
    assert run.acceleration.min() > -4.5
    if not stops:
        assert run.speed.min() > LIMIT - 1.0


def test_follows_a_leader_through_a_stop() -> None:
    points = line((600, STRAIGHT))

    def speed(t: float) -> float:
        return 8.0 if t < 8 else max(0.0, 8.0 - 3.0 * (t - 8)) if t < 16 else 6.0

    leader = moving(1, points, speed, along_m=40.0)
    run = drive(PdmDriver(), mission(points), start=start(LIMIT), seconds=24, others=[leader])
    assert run.gap_m > 1.5
    assert run.acceleration.min() > -4.0
    assert run.speed[round(15.5 / STEP_S)] < 0.3
    assert run.speed[-1] > 3.0


def test_a_slower_car_close_ahead_does_not_make_it_panic() -> None:
    points = line((600, STRAIGHT))
    run = drive(
        PdmDriver(), mission(points), start=start(LIMIT), seconds=10, others=[moving(1, points, 8.0, along_m=20.0)]
    )
    assert run.gap_m > 2.0
    assert run.acceleration.min() > -4.0


def test_yields_on_a_permissive_left_then_goes() -> None:
    run = drive_left_turn(PdmDriver())
    passed = next(
        o.time_s for o in run.observations if not any(a.x > 95 for a in o.actors)
    )  # the last oncoming car has left the junction
    in_conflict = next(o.time_s for s, o in zip(run.states, run.observations, strict=True) if s.y > 0.5)
    assert run.gap_m > 0.8
    assert in_conflict > passed - 2.0
    assert run.states[-1].y > 40  # and it goes, once they are gone
    assert run.observations[-1].time_s < passed + 13.0


def test_goes_when_the_oncoming_car_stands_still() -> None:
    task, _ = left_turn()
    run = drive(
        PdmDriver(),
        task,
        start=start(12.0),
        seconds=30,
        others=[standing(1, 116.5, 3.5, math.pi)],
        signals=lambda _t: {"j": "green"},
        after=lambda s: s.y > 40,
    )
    assert run.states[-1].y > 40
    assert run.gap_m > 0.5


@pytest.mark.parametrize("at", [45.0, 60.0, 75.0])
@pytest.mark.parametrize("begins_s", [0.0, 0.7, 1.4])
def test_brakes_for_a_pedestrian_who_steps_out(at: float, begins_s: float) -> None:
    # From a kerb 2.5 m beside the middle of the lane, at 1.5 m/s: seen walking, there are 18 m or more left.
    walk = line((20, STRAIGHT), start=(at, -2.5, math.pi / 2))
    walker = moving(
        1, walk, lambda t: 1.5 if t >= begins_s else 0.0, kind="pedestrian", size=(0.5, 0.5), gone_at_end=False
    )
    room = at - 5.0 - SEDAN.length_m / 2 - LIMIT * begins_s
    assert room > LIMIT**2 / (2 * SEDAN.emergency_braking_mps2) + 0.15 * LIMIT  # physically possible
    run = drive(PdmDriver(), mission(line((250, STRAIGHT))), start=start(LIMIT), seconds=14, others=[walker])
    assert run.gap_m > 0.3
    assert run.states[-1].x > at + 10.0  # and it drives on


def test_waits_for_somebody_on_the_crossing() -> None:
    points = line((250, STRAIGHT))
    crossing = line((14, STRAIGHT), start=(100.0, -7.0, math.pi / 2))
    foe = crossing_foe(points, crossing, entry_s=2.0, has_priority=True, pedestrian=True, width_m=1.75)
    task = mission(points, junctions=[JunctionPassage("j", 95.0, 105.0, "straight", None, (foe,))])
    backwards = crossing[::-1].copy()
    walkers = [
        moving(1, crossing, lambda t: 1.2 if t > 4.0 else 0.0, kind="pedestrian", size=(0.5, 0.5)),
        moving(2, backwards, lambda t: 1.2 if t > 6.0 else 0.0, kind="pedestrian", size=(0.5, 0.5)),
    ]
    run = drive(PdmDriver(), task, start=start(LIMIT), seconds=25, others=walkers)
    assert run.gap_m > 1.0
    assert run.acceleration.min() > -6.0
    assert run.states[-1].x > 120.0


@pytest.mark.parametrize(("left_m", "y"), [(1.75, -1.9), (5.25, 0.0), (5.25, -0.8)])
def test_passes_a_parked_car(left_m: float, y: float) -> None:
    points = line((250, STRAIGHT))
    run = drive(
        PdmDriver(),
        mission(points, left_m=left_m),
        start=start(LIMIT),
        seconds=20,
        others=[standing(1, 100.0, y)],
        after=lambda s: s.x > 180,
    )
    assert run.states[-1].x > 180
    assert run.gap_m > 0.3
    assert run.lateral_error(points).max() < left_m - SEDAN.width_m / 2 + 0.05  # within its lanes
    assert abs(run.lateral_error(points)[-1]) < 0.2  # and back
    assert max(abs(s.yaw_rate * s.speed) for s in run.states) < 3.0


@pytest.mark.parametrize("gap", [4.0, 6.0, 9.0])
def test_steers_out_from_behind_a_parked_car(gap: float) -> None:
    task = mission(line((250, STRAIGHT)), left_m=5.25)
    run = drive(
        PdmDriver(),
        task,
        start=start(0.0, x=100.0 - 4.6 - gap),
        seconds=15,
        others=[standing(1, 100.0, 0.0)],
        after=lambda s: s.x > 125,
    )
    assert run.states[-1].x > 125
    assert run.gap_m > 0.2


def test_does_not_overtake_a_queue_at_a_red_light() -> None:
    points = line((250, STRAIGHT))
    task = mission(points, left_m=5.25, junctions=[JunctionPassage("j", 120.0, 140.0, "straight", "j")])
    run = drive(
        PdmDriver(),
        task,
        start=start(LIMIT),
        seconds=15,
        others=[standing(1, 116.0, 0.0), standing(2, 109.0, 0.1)],
        signals=lambda _t: {"j": "red"},
    )
    assert run.speed[-1] < 0.1
    assert abs(run.lateral_error(points)).max() < 0.3
    assert run.gap_m > 1.5


def test_stops_for_a_full_block_without_room_to_pass() -> None:
    run = drive(
        PdmDriver(), mission(line((250, STRAIGHT))), start=start(LIMIT), seconds=15, others=[standing(1, 100.0, 0.0)]
    )
    assert run.speed[-1] < 0.1
    assert run.gap_m > 1.0
    assert run.acceleration.min() > -4.0


def cross_traffic(speed: float, away_m: float) -> tuple[Mission, Script]:
    """A crossing where the ego goes first; one car from the right, `away_m` before its line when the ego starts."""
    points, other = line((250, STRAIGHT)), line((120, STRAIGHT), start=(100, -60, math.pi / 2))
    foe = crossing_foe(points, other, entry_s=50, has_priority=False)
    task = mission(points, junctions=[JunctionPassage("j", 90.0, 115.0, "straight", "j", (foe,))])
    longer = line((320, STRAIGHT), start=(100, -260, math.pi / 2))
    return task, moving(1, longer, speed, along_m=250 - away_m)


@pytest.mark.parametrize("away_m", [75.0, 85.0, 95.0, 105.0])
def test_avoids_a_red_light_runner(away_m: float) -> None:
    task, runner = cross_traffic(15.0, away_m)
    run = drive(PdmDriver(), task, start=start(LIMIT), seconds=14, others=[runner], signals=lambda _t: {"j": "green"})
    assert run.gap_m > 0.5
    assert run.states[-1].x > 110.0


def test_is_not_alarmed_by_cross_traffic_that_stops() -> None:
    points, other = line((250, STRAIGHT)), line((120, STRAIGHT), start=(100, -60, math.pi / 2))
    foe = crossing_foe(points, other, entry_s=52, has_priority=False)
    task = mission(points, junctions=[JunctionPassage("j", 90.0, 115.0, "straight", "j", (foe,))])
    # Brakes with 3 m/s^2 from 2 s on, and stands half a metre before its line.
    way = 52 - 2.25 - 0.5 - 2 * LIMIT - LIMIT**2 / 6
    stopper = moving(1, other, lambda t: max(0.0, min(LIMIT, LIMIT - 3.0 * (t - 2))), along_m=way)
    run = drive(PdmDriver(), task, start=start(LIMIT), seconds=10, others=[stopper], signals=lambda _t: {"j": "green"})
    assert run.speed.min() > LIMIT - 0.5


def test_oncoming_traffic_in_a_bend_is_no_alarm() -> None:
    points = line((40, STRAIGHT), (40, 50), (80, STRAIGHT))
    normals = np.column_stack([-np.gradient(points[:, 1]), np.gradient(points[:, 0])])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    lane = (points + 3.5 * normals)[::-1].copy()
    alone = drive(PdmDriver(), mission(points), start=start(10.0), seconds=11)
    met = drive(PdmDriver(), mission(points), start=start(10.0), seconds=11, others=[moving(1, lane, 10.0)])
    assert met.gap_m > 0.8
    assert abs(met.speed - alone.speed).max() < 1.0


def parted(again: Run, first: Run, frame: int) -> float:
    """How far a run that began at a frame of another one is from it at most, m."""
    return float(np.hypot(*(again.xy - first.xy[frame : frame + len(again.states)]).T).max())


def drive_left_turn_again(driver: Driver, first: Run, from_s: float, seconds: float) -> Run:
    """The same drive, taken up in the middle."""
    task, lane = left_turn()
    return drive(
        driver,
        task,
        start=first.states[round(from_s / STEP_S)],
        seconds=seconds,
        from_s=from_s,
        others=oncoming_cars(lane),
        signals=lambda _t: {"j": "green"},
        after=lambda s: s.y > 40,
    )


def test_a_restart_in_the_middle_goes_on_exactly_as_before() -> None:
    first = drive_left_turn(PdmDriver())
    again = drive_left_turn_again(PdmDriver(), first, 5.0, 5.0)
    assert parted(again, first, round(5.0 / STEP_S)) < 1e-9


@pytest.mark.parametrize("seed", [1, 2])
def test_with_noise_a_restart_in_the_middle_goes_on_nearly_as_before(seed: int) -> None:
    # The restarted one's tracker is fresh, and sees the same noise from there on.
    first = drive_left_turn(Sensed(PdmDriver(), seed))
    apart = []
    for from_s in (2.0, 5.0, 7.0):
        again = drive_left_turn_again(Sensed(PdmDriver(), seed), first, from_s, 6.0)
        apart.append(parted(again, first, round(from_s / STEP_S)))
    assert sorted(apart)[1] < 0.3


def test_the_seed_and_the_past_change_nothing() -> None:
    run = drive_left_turn(PdmDriver())
    task, _ = left_turn()
    fresh = PdmDriver()
    fresh.reset(task, SEDAN, seed=99)
    for k in (300, 20, 150):
        told, answered = fresh.step(run.observations[k]), run.controls[k]
        assert (told.steer, told.throttle, told.brake) == pytest.approx(
            (answered.steer, answered.throttle, answered.brake), abs=1e-9
        )


def test_noise_makes_no_chatter_behind_a_leader() -> None:
    points = line((600, STRAIGHT))
    runs = [
        drive(driver, mission(points), start=start(9.0), seconds=25, others=[moving(1, points, 9.0, along_m=40.0)])
        for driver in (PdmDriver(), Sensed(PdmDriver(), 1))
    ]
    calm, noisy = (run.acceleration[100:] for run in runs)
    assert abs(noisy).max() < 0.8  # nobody in the car notices: lifts and buses are allowed 1 m/s^2
    assert np.sqrt(np.mean(np.diff(noisy) ** 2)) / STEP_S < 1.5
    assert abs(noisy.mean() - calm.mean()) < 0.1
    assert abs(runs[1].lateral_error(points)).max() < 0.05


def test_noise_beside_the_lane_is_no_alarm() -> None:
    # Parked cars, somebody who waits at the kerb, and oncoming traffic at 0.9 m of air.
    points = line((300, STRAIGHT))
    others = [standing(k, 60.0 + 9 * k, -2.9) for k in range(6)]
    others += [standing(10, 140.0, -2.6, math.pi / 2, "pedestrian", (0.5, 0.5))]
    others += [moving(11, line((300, STRAIGHT), start=(290, 3.0, math.pi)), 12.0)]
    run = drive(Sensed(PdmDriver(), 2), mission(points), start=start(12.0), seconds=14, others=others)
    assert run.acceleration.min() > -1.0
    assert run.speed.min() > 11.5
    assert abs(run.lateral_error(points)).max() < 0.4


@pytest.mark.parametrize(("shows_at", "least_mps"), [(60.0, LIMIT - 0.3), (25.0, 6.0)])
def test_a_signal_that_is_not_seen_yet_is_approached_ready_to_stop(shows_at: float, least_mps: float) -> None:
    # Comfortable braking from 50 km/h begins 48 m before the line: a green that shows before costs nothing.
    task = mission(line((300, STRAIGHT)), junctions=[JunctionPassage("j", 150.0, 170.0, "straight", "j")])
    colours: tuple[SignalColour, ...] = ("green", "red")
    for colour in colours:
        run = drive_while(task, shows_at, 150.0, colour)
        assert run.acceleration.min() > -3.0
        if colour == "green":
            assert run.speed.min() > least_mps
            assert run.states[-1].x > 170
        else:
            assert run.states[-1].x + SEDAN.length_m / 2 < 150.0


def drive_while(task: Mission, shows_at: float, stop_x: float, colour: SignalColour) -> Run:
    """A drive along x in which the signal shows from a distance on."""

    class Late:
        name, version = "late", "1"

        def __init__(self) -> None:
            self.inner = PdmDriver()

        def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
            self.inner.reset(mission, vehicle, seed)

        def step(self, observation: Observation) -> Control:
            shows = stop_x - observation.ego.x < shows_at
            return self.inner.step(replace(observation, signals={"j": colour} if shows else {}))

    return drive(Late(), task, start=start(LIMIT), seconds=20, after=lambda s: s.x > 175)


def test_a_green_that_a_lorry_hides_for_a_moment_stays_green() -> None:
    task = mission(line((300, STRAIGHT)), junctions=[JunctionPassage("j", 100.0, 120.0, "straight", "j")])
    hidden = drive(
        PdmDriver(),
        task,
        start=start(LIMIT),
        seconds=8,
        signals=lambda t: {} if 3.0 < t < 3.8 else {"j": "green"},  # 48 m before the line, for 0.8 s
    )
    assert hidden.speed.min() > LIMIT - 0.1


def test_the_colours_are_kept_for_a_second() -> None:
    memory = SignalMemory()
    ego = EgoState(0, 0, 0, 0, 0, 0, 0)
    assert memory.update(Observation(1.0, ego, (), {"a": "green", "b": "red"})) == {"a": "green", "b": "red"}
    assert memory.update(Observation(1.5, ego, (), {"b": "amber"})) == {"a": "green", "b": "amber"}
    assert memory.update(Observation(2.2, ego, (), {})) == {"b": "amber"}
    assert memory.update(Observation(2.6, ego, (), {})) == {}


def test_a_kink_in_the_line_is_rounded_off() -> None:
    # A roundabout drawn with few points has corners of 45 degrees.
    points = line((40, STRAIGHT))
    for turn in (1, 2):
        points = np.vstack([points, line((14, STRAIGHT), start=(*points[-1], turn * math.pi / 4))[1:]])
    end_x = points[-1][0]  # the last part runs straight up
    after = points[-1][1] - 5.0
    run = drive(PdmDriver(), mission(points), start=start(8.0), seconds=12, after=lambda s: s.y > after)
    assert run.states[-1].x == pytest.approx(end_x, abs=0.3)
    assert abs(run.lateral_error(points)).max() < 0.75  # a lane of 3.3 m leaves as much beside the car
    assert max(abs(s.yaw_rate * s.speed) for s in run.states) < 3.5  # in the corners; 3 in a bend
    front = np.array([(s.x + 1.4 * math.cos(s.heading), s.y + 1.4 * math.sin(s.heading)) for s in run.states])
    away = np.hypot(front[:, :1] - points[:, 0], front[:, 1:] - points[:, 1]).min(axis=1)
    assert away.max() < 0.75


def test_the_same_observation_again_gets_the_same_answer() -> None:
    task, _ = left_turn()
    rng = np.random.default_rng(1)
    actors = tuple(
        SeenActor(
            k,
            "car",
            *rng.uniform((20, -30), (170, 40)),
            float(rng.choice([0, 1.57, 3.14])),
            rng.uniform(0, 13),
            4.5,
            1.8,
        )
        for k in range(20)
    )
    driver = PdmDriver()
    driver.reset(task, SEDAN, seed=0)
    ego = EgoState(60.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0)
    observation = Observation(0.0, ego, actors, {"j": "green"})
    assert len({driver.step(observation) for _ in range(20)}) == 1


def test_a_mission_is_put_on_its_grid_once() -> None:
    task, _ = left_turn()
    same = replace(left_turn()[0], goal_s=1.0)  # other arrays with the same numbers; where it ends changes no route
    other = replace(task, speed_limit_mps=task.speed_limit_mps - 1.0)
    foe = task.junctions[0].foes[0]
    yields = replace(task, junctions=(replace(task.junctions[0], foes=(replace(foe, has_priority=False),)),))
    route = build_route(task, SEDAN)
    assert build_route(same, SEDAN) is route
    for changed in (
        build_route(other, SEDAN),
        build_route(yields, SEDAN),
        build_route(task, replace(SEDAN, friction=0.2)),
    ):
        assert changed is not route
    assert build_route(other, SEDAN).points["profile"].max() == pytest.approx(route.points["profile"].max() - 1.0)
    assert build_route(yields, SEDAN).foes["has_priority"].tolist() == [False]


def test_junctions_and_foes_are_kept_in_their_order() -> None:
    points = line((95, STRAIGHT), (4 * math.pi, 8), (60, STRAIGHT))
    oncoming, crossing = (
        line((120, STRAIGHT), start=(173, 3.5, math.pi)),
        line((14, STRAIGHT), start=(40.0, -7.0, math.pi / 2)),
    )
    walkers = crossing_foe(points, crossing, entry_s=2.0, has_priority=True, pedestrian=True, width_m=1.75)
    cars = crossing_foe(points, oncoming, entry_s=60, has_priority=False)
    first = JunctionPassage("a", 35.0, 45.0, "straight", None, (walkers,))
    second = JunctionPassage("b", 90.0, 112.0, "left", "b", (cars, walkers))
    route = build_route(mission(points, junctions=[first, second]), SEDAN)
    assert route.foes["junction"].tolist() == [0, 1, 1]
    assert route.junctions["crossed"].tolist() == [False, True]  # cars cross only the second one
    assert route.foes["walking"].tolist() == [True, False, True]
    assert route.foes["has_priority"].tolist() == [True, False, True]
    assert route.foes["first"].tolist() == [0, *route.foes["end"][:-1]]
    assert len(route.paths) == route.foes["end"][-1]
