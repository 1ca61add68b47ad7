"""Drivers that answer trajectories: the tracker on the vehicle's dynamics, whole runs in SUMO, clips and mutants."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.mutate_file import mutate_file
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.consent import allow, allowing
from foresee_dsl.drivers.external import ExternalDriver, map_line, read_answer, read_ready
from foresee_dsl.drivers.following import Course, Deviation, Follower
from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.protocol import (
    Control,
    EgoState,
    Mission,
    Observation,
    Trajectory,
    VehicleLimits,
)
from foresee_dsl.errors import DriverError
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.ground_truth import control_for
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from tests.support.driving import SEDAN, STEP_S, line

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = f"external:{sys.executable} {ROOT / 'docs' / 'examples' / 'planning_driver.py'}"


def trajectory(*parts: tuple[float, float], speed_mps: float, spacing: int = 1) -> Trajectory:
    """A drive along straights and arcs (length, radius) at one speed; one point in `spacing` half metres."""
    points = line(*parts)[::spacing]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return Trajectory(along / speed_mps, points)


def follow(
    plan: Trajectory, start: BicycleState, seconds: float, *, at_once: bool = False
) -> tuple[Deviation, list[BicycleState]]:
    """Drive a sedan along a trajectory with the project's own dynamics."""
    body, follower, state, states = Bicycle(SEDAN), Follower(SEDAN, at_once=at_once), start, []
    for frame in range(round(seconds / STEP_S)):
        now_s = frame * STEP_S
        follower.measure(state.x, state.y, now_s)
        states.append(state)
        seen = EgoState(state.x, state.y, state.heading, state.speed, state.acceleration, state.yaw_rate, state.steer)
        motion = follower.motion(plan, seen, now_s)
        state = body.step(state, control_for(motion, SEDAN, state.speed), STEP_S)
    return follower.deviation, states


# ---- the tracker ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spacing", [1, 6])
@pytest.mark.parametrize(
    ("radius_m", "speed_mps"), [(math.inf, 14.0), (200.0, 14.0), (-60.0, 12.0), (25.0, 7.0), (-10.0, 4.0)]
)
def test_it_stays_on_straights_and_bends(radius_m: float, speed_mps: float, spacing: int) -> None:
    plan = trajectory((30, math.inf), (20, radius_m), (30, math.inf), speed_mps=speed_mps, spacing=spacing)
    deviation, _ = follow(plan, BicycleState(0, 0, 0, speed_mps), 60 / speed_mps)
    assert deviation.lateral_m < 0.3 and abs(deviation.along_m) < 0.3, deviation.sentence
    assert not deviation.is_large


def test_it_returns_to_the_path_without_overshooting() -> None:
    plan = trajectory((120, math.inf), speed_mps=10)
    deviation, states = follow(plan, BicycleState(-1.0, 0.8, 0.05, 9.0), 9)
    assert deviation.lateral_m == pytest.approx(0.8, abs=0.1)
    assert min(state.y for state in states) > -0.1
    assert abs(states[-1].y) < 0.05 and states[-1].x == pytest.approx(states[-1].speed * 8.95, abs=0.2)


def test_after_the_end_it_brakes_comfortably_along_the_end() -> None:
    plan = trajectory((20, math.inf), speed_mps=10)
    _, states = follow(plan, BicycleState(0, 0, 0, 10.0), 7)
    assert states[-1].speed == 0
    assert states[-1].x == pytest.approx(20 + 10**2 / (2 * COMFORTABLE_MPS2), abs=0.7)
    assert min(state.acceleration for state in states) > -1.5 * COMFORTABLE_MPS2
    assert abs(states[-1].y) < 0.01


def test_it_stands_where_the_trajectory_stands() -> None:
    stays = Trajectory(np.array([0.0, 3.0]), np.zeros((2, 2)))
    _, states = follow(stays, BicycleState(0.1, 0.1, 0.3, 0.0), 2)
    assert {(state.x, state.y) for state in states} == {(0.1, 0.1)}


def test_ideal_control_follows_closer() -> None:
    plan = trajectory((20, math.inf), (20, 20.0), (20, math.inf), speed_mps=7)
    usual, _ = follow(plan, BicycleState(0, 0, 0, 7.0), 8)
    ideal, _ = follow(plan, BicycleState(0, 0, 0, 7.0), 8, at_once=True)
    assert ideal.lateral_m < usual.lateral_m


def test_a_sparse_arc_is_not_cut() -> None:
    angles = np.linspace(0, 1.5, 7)  # 5 m apart on a radius of 20 m
    course = Course(Trajectory(angles * 3, 20 * np.column_stack([np.cos(angles), np.sin(angles)])), 0.0)
    radii = [math.hypot(*course.place_at(s)) for s in np.linspace(0, course.length_m, 50)]
    assert max(radii) - min(radii) < 0.05


@pytest.mark.parametrize(
    ("times", "points", "more", "why"),
    [
        ([0, 1], [[0, 0]], {}, r"shape \(2,\) and points of shape \(1, 2\)"),
        ([0], [[0, 0]], {}, r"with 1 point\(s\)"),
        ([0, 2, 1], [[0, 0], [1, 0], [2, 0]], {}, "do not ascend: 2 s is followed by 1 s"),
        ([0, 1], [[0, 0], [math.nan, 0]], {}, "in whose points a value is not a finite number"),
        ([0, 1], [[0, 0], [1, 0]], {"speed_mps": np.array([1.0, -1.0])}, "speed -1 m/s; the ego cannot reverse"),
        ([0, 1], [[0, 0], [1, 0]], {"heading_rad": np.zeros(3)}, r"heading_rad has the shape \(3,\)"),
        ([-2, -1], [[0, 0], [1, 0]], {}, "ended at -1 s, and it is 0 s; its times must be on the clock"),
        ([5, 6], [[0, 0], [1, 0]], {}, "begins at 5 s, and it is 0 s"),
    ],
)
def test_what_is_wrong_with_a_trajectory_is_the_reason_of_the_crash(
    scenarios: Path, times: list[float], points: list[list[float]], more: dict[str, np.ndarray], why: str
) -> None:
    answer = Trajectory(np.array(times, float), np.array(points, float), **more)
    result = run(compile_test_case(load_test_case(f"{scenarios}/scenario3.foresee::r01")), Fixed(answer))
    assert result.verdict is Verdict.CRASH
    assert "the driver raised ValueError: the driver answered a Trajectory" in result.reason
    with pytest.raises(ValueError, match=why):
        Follower(SEDAN).motion(answer, EgoState(0, 0, 0, 0, 0, 0, 0), 0.0)


@dataclass
class Fixed:
    answer: Trajectory
    name: str = "fixed"
    version: str = "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Nothing to do."""

    def step(self, observation: Observation) -> Trajectory:
        return self.answer


# ---- whole runs -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", autouse=True)
def _consent() -> None:
    allow(EXAMPLE)


@pytest.mark.parametrize("case", ["scenario3.foresee::r01", "scenario9.foresee::r01"])
def test_a_planner_drives_bends_and_junctions(scenarios: Path, case: str) -> None:
    test_case = load_test_case(f"{scenarios}/{case}")
    result = run_test_case(test_case, EXAMPLE, 0)
    assert result.verdict is not Verdict.CRASH, result.reason
    assert result.tracking is not None
    assert result.tracking.lateral_m < 0.3 and abs(result.tracking.along_m) < 0.5, result.tracking.sentence
    assert result.trace.meta["tracking"]["lateral_m"] == result.tracking.lateral_m
    assert "did not follow" not in result.reason
    assert run_test_case(test_case, EXAMPLE, 0).trace.digest == result.trace.digest


def test_a_control_has_no_deviation(scenarios: Path) -> None:
    result = run_test_case(load_test_case(f"{scenarios}/scenario3.foresee::r01"), "idm", 0)
    assert result.tracking is None and "tracking" not in result.trace.meta


def test_a_plan_that_no_car_can_drive_is_not_blamed_on_the_planner_alone(scenarios: Path) -> None:
    class Jumps:
        name, version = "jumps", "1"
        plan: Trajectory | None = None

        def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
            self.plan = None

        def step(self, observation: Observation) -> Trajectory:
            if self.plan is None:  # 40 m in the first second
                ego = observation.ego
                direction = np.array([math.cos(ego.heading_rad), math.sin(ego.heading_rad)])
                ahead = np.array([[0.0], [40.0], [80.0]]) * direction
                self.plan = Trajectory(np.array([0.0, 1.0, 2.0]), ahead + np.array([ego.x, ego.y]))
            return self.plan

    result = run(compile_test_case(load_test_case(f"{scenarios}/scenario3.foresee::r01")), Jumps())
    assert result.tracking is not None and result.tracking.along_m < -20
    assert "the ego did not follow its driver's plan: it was at most" in result.reason


def test_ideal_control_leaves_nearly_no_deviation(scenarios: Path) -> None:
    bundle = compile_test_case(load_test_case(f"{scenarios}/scenario3.foresee::r01"))
    allow(EXAMPLE)
    result = run(bundle, ExternalDriver(EXAMPLE.partition(":")[2]), ideal=frozenset([DriverPart.CONTROL]))
    assert result.tracking is not None and result.tracking.lateral_m < 0.15


def test_a_clip_and_a_mutant_of_a_planner(scenarios: Path, tmp_path: Path) -> None:
    case = load_test_case(f"{scenarios}/scenario3.foresee::r01")
    with allowing([EXAMPLE]):
        trace = run_test_case(case, EXAMPLE, 0).trace
        point = load_ranker("proximity").rank(trace)[0]
        file = tmp_path / "p1.foresee"
        draft = clip_around(case, trace, point, file, before_s=2.0, after_s=2.0)
        clip, _, _, fidelity = measure_clip(draft, case, trace, file, DriverSetup(EXAMPLE))
        assert fidelity.largest_m < 0.3
        file.write_text(print_model(clip), encoding="utf-8")
        (child,) = mutate_file(file, preset="focused", count=1, driver=EXAMPLE, seed=0)
    assert child.verdict is not Verdict.CRASH, child.reason
    assert f'driver "planner 1 via {EXAMPLE}"' in child.text


# ---- the protocol ---------------------------------------------------------------------------------------------------


def test_a_program_answers_trajectories_and_keeps_them() -> None:
    line = b'{"trajectory": {"time_s": [0, 1], "x": [0, 5], "y": [0, 1], "speed_mps": [5, 5]}}'
    first = read_answer(line)
    assert isinstance(first, Trajectory)
    assert first.points.tolist() == [[0, 0], [5, 1]] and first.heading_rad is None
    assert read_answer(b'{"keep": true}', first) is first
    assert isinstance(read_answer(b'{"steer": 0, "throttle": 0, "brake": 1}', first), Control)


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (b'{"keep": true}', "has not answered a trajectory"),
        (b'{"keep": 1}', "`keep` must be true"),
        (b'{"trajectory": []}', "must be an object with lists"),
        (b'{"trajectory": {"time_s": [0, 1], "x": [0], "y": [0, 1]}}', "1 numbers in `x` and 2 in `y`"),
        (b'{"trajectory": {"x": [0], "y": [0]}}', "`time_s` of its trajectory must be a list of numbers, not None"),
        (b'{"trajectory": {"time_s": [true], "x": [0], "y": [0]}}', "must be a list of numbers"),
        (b'{"trajectory": {"time_s": [0, 1], "x": "ab", "y": [0, 1]}}', "`x` of its trajectory must be a list"),
    ],
)
def test_what_is_not_a_trajectory_is_a_driver_error(answer: bytes, why: str) -> None:
    with pytest.raises(DriverError, match=why):
        read_answer(answer)


def test_a_program_gets_the_map_if_it_wants_it(scenarios: Path, tmp_path: Path) -> None:
    program = tmp_path / "wants.py"
    program.write_text(
        """import json, sys
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "reset":
        answer = {"type": "ready", "name": "wants", "version": "1", "wants": ["map"]}
    elif message["type"] == "map":
        answer = {"type": "ready", "name": "wants", "version": str(len(message["map"]["lanes"]))}
    elif message["type"] == "step":
        answer = {"steer": 0, "throttle": 0, "brake": 1}
    else:
        break
    print(json.dumps(answer), flush=True)
""",
        encoding="utf-8",
    )
    address = f"external:{sys.executable} -S {program}"
    allow(address)
    bundle = compile_test_case(load_test_case(f"{scenarios}/scenario3.foresee::r01"))
    driver = ExternalDriver(address.partition(":")[2])
    result = run(bundle, driver)
    lanes = [lane for lane in bundle.network.lanes.values() if lane.edge not in bundle.network.walking_areas]
    crossings = bundle.network.crossings
    assert result.trace.meta["driver_version"] == f"wants {len([ln for ln in lanes if ln.edge not in crossings])}"
    with pytest.raises(DriverError, match="`wants` must be a list"):
        read_ready(b'{"type": "ready", "name": "a", "version": "1", "wants": ["all"]}')


def test_a_mission_without_a_map_sends_null() -> None:
    empty = np.zeros((0, 2)), *(np.zeros(0) for _ in range(4))
    assert json.loads(map_line(Mission(*empty, 0.0, 0.0))) == {"type": "map", "map": None}
