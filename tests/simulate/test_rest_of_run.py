"""A run may end before its end only if it would have passed, whatever its ego and the others do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import ModelSpec, SumoBundle
from foresee_dsl.drivers.protocol import Control, Observation
from foresee_dsl.kernels.boxes import Box, corner_points, corners
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, limits_of
from foresee_dsl.simulate.rest_of_run import LOOKS_S, EgoReach, OthersReach
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S
from tests.simulate.test_rules import ALONE, EGO, EMPTY_STREET, PRIORITY, SIGNALS, STREET, WALKER
from tests.support.scenes import LaneKeeper
from tests.support.worlds import COMPACT, VAN

NO_END = "no failure is possible any more before the end"
STREET_ALONE = EMPTY_STREET + ALONE


class Swerving(LaneKeeper):
    """Follows its lane; from a time on (s) it accelerates and steers to one side as far as it can."""

    def __init__(self, speed_mps: float, from_s: float = math.inf, side: float = 1.0) -> None:
        super().__init__(speed_mps)
        self._from_s, self._side = from_s, side

    def step(self, observation: Observation) -> Control:
        control = super().step(observation)
        return Control(self._side, 1.0, 0.0) if observation.time_s >= self._from_s else control


def compiled(folder: Path, text: str, end_s: float, ends: str = "anywhere") -> SumoBundle:
    file = folder / "small.foresee"
    last = f"  expect safe: never collision(ego)\n  end after {end_s:.2f} s {ends}\n"
    file.write_text(f"foresee 1\n\nscenario small {{\n{text}\n{last}}}\n", encoding="utf-8")
    return compile_test_case(load_test_case(str(file)))


def drive(bundle: SumoBundle, driver: LaneKeeper, *, ends_early: bool = True, goal: str = "") -> RunResult:
    result = run(bundle, driver, ends_early=ends_early, goal=goal)
    assert result.verdict is not Verdict.CRASH, result.reason
    return result


def test_a_run_ends_when_it_can_only_pass(tmp_path: Path) -> None:
    bundle = compiled(tmp_path, STREET_ALONE, 5.0)
    whole = drive(bundle, LaneKeeper(10.0), ends_early=False)
    result = drive(bundle, LaneKeeper(10.0))
    assert (whole.verdict, whole.reason, whole.duration_s) == (Verdict.PASS, "drove to the end at 5.00 s", 5.0)
    assert result.passed
    assert result.reason == f"drove to {result.time_s:.2f} s: {NO_END} at 5.00 s"
    assert 4.0 < result.duration_s < 5.0
    assert result.trace.meta["reason"] == result.reason
    np.testing.assert_array_equal(result.trace.states, whole.trace.states[: result.trace.frames])


def test_a_standing_ego_ends_sooner(tmp_path: Path) -> None:
    stands = drive(compiled(tmp_path, STREET_ALONE.replace("36 km/h", "0 km/h"), 5.0), LaneKeeper(0.0))
    drives = drive(compiled(tmp_path, STREET_ALONE, 5.0), LaneKeeper(10.0))
    assert stands.duration_s < drives.duration_s


@pytest.mark.parametrize(
    "more",
    [
        "expect always ego.speed < 200 km/h",
        "expect eventually within 4.9 s ego.speed > 100 km/h",
        "expect never ego.speed > 1 km/h",  # broken at the first frame
    ],
)
def test_an_open_or_broken_expectation_lets_the_run_go_on(tmp_path: Path, more: str) -> None:
    assert drive(compiled(tmp_path, f"{STREET_ALONE}  {more}\n", 5.0), LaneKeeper(10.0)).duration_s == 5.0


def test_a_goal_lets_the_run_go_on(tmp_path: Path) -> None:
    assert drive(compiled(tmp_path, STREET_ALONE, 5.0), LaneKeeper(10.0), goal="safe").duration_s == 5.0


def test_a_run_that_must_arrive_goes_on(tmp_path: Path) -> None:
    result = drive(compiled(tmp_path, STREET_ALONE, 5.0, ends=""), LaneKeeper(10.0))
    assert (result.verdict, result.duration_s) == (Verdict.TIMEOUT, 5.0)


NEAR = EGO.replace("40 m", "100 m")
CROSSING = """
  vehicle other: car.compact { route from south straight over middle; start at 122 m along south; start speed 36 km/h }
"""
AHEAD = "  vehicle other: car.compact { route from west; start at 130 m along west; speed 2 km/h }\n"
WALKS = STREET + ALONE.replace("40 m", "100 m") + WALKER.replace("SIDE", "-9").replace("END", "8")
RED = SIGNALS + NEAR + "  signal middle stage ns_go elapsed 2 s"


@pytest.mark.parametrize(
    ("text", "speed_mps", "ends_s", "fails"),
    [
        pytest.param(STREET_ALONE, 10.0, (2.0, 3.0), None, id="alone"),
        pytest.param(STREET_ALONE, 20.0, (2.0, 3.0), None, id="faster than the limit"),
        pytest.param(RED, 10.0, (4.0, 6.0), Verdict.RULE, id="runs red"),
        pytest.param(PRIORITY + NEAR + CROSSING, 10.0, (3.5, 6.5), Verdict.RULE, id="takes the right of way"),
        pytest.param(WALKS, 10.0, (3.5, 5.5), Verdict.F2, id="strikes a pedestrian"),
        pytest.param(STREET_ALONE.replace("40 m", "100 m") + AHEAD, 10.0, (1.5, 3.5), Verdict.F5, id="strikes a car"),
    ],
)
def test_no_verdict_changes_wherever_the_run_ends(
    tmp_path: Path, text: str, speed_mps: float, ends_s: Sequence[float], fails: Verdict | None
) -> None:
    """The run's end moves over the moment of the failure; at each end, the driver may also swerve shortly before it."""
    bundle, verdicts, early_ones = compiled(tmp_path, text, 20.0), set(), 0
    for end_s in np.arange(*ends_s, 0.15).tolist():
        ending = replace(bundle, scene=replace(bundle.scene, end_s=end_s))
        for before_s, side in ((-math.inf, 1.0), (0.75, 1.0), (0.6, -1.0), (0.5, 1.0), (0.5, -1.0)):
            driver = Swerving(speed_mps, end_s - before_s, side)
            whole, early = (drive(ending, driver, ends_early=ends) for ends in (False, True))
            assert early.verdict is whole.verdict, (end_s, before_s, side, whole.reason, early.reason)
            verdicts.add(whole.verdict)
            early_ones += early.duration_s < whole.duration_s
    assert verdicts >= {Verdict.PASS, Verdict.F1, fails or Verdict.PASS}
    assert early_ones > 0


@pytest.mark.parametrize("spec", [COMPACT, VAN], ids=lambda spec: spec.name)
def test_the_ego_stays_within_its_reach(spec: ModelSpec) -> None:
    rng, motion, examined = np.random.default_rng(0), Bicycle(limits_of(spec)), 0
    overhang = spec.length_m / 2 - motion.rear_axle_m
    for _ in range(300):
        speed, steer = rng.uniform(0, 20), rng.uniform(-1, 1) * spec.max_steer_rad * rng.integers(2)
        state = BicycleState(*rng.uniform(-9, 9, 2), rng.uniform(-3, 3), speed, rng.uniform(-8, 3), 0.0, steer)
        within_s = float(rng.choice(LOOKS_S))
        reach = EgoReach(state, motion, within_s)
        if reach.turns_round:
            continue
        examined += 1
        body = reach.of(overhang, spec.length_m - overhang, spec.width_m / 2)
        control = Control(rng.choice([-1.0, 0.0, 1.0]), rng.choice([0.0, 1.0]), rng.choice([0.0, 0.0, 1.0]))
        for _ in range(round(within_s / STEP_S)):
            if rng.random() < 0.1:
                control = Control(rng.uniform(-1, 1), rng.uniform(), 0.0)
            state = motion.step(state, control, STEP_S)
            box = Box(state.x, state.y, state.heading, spec.length_m, spec.width_m)
            assert all(_holds(body, *point) for point in corner_points(box))
    assert examined > 200


def test_the_others_stay_within_their_reach(scenarios: Path) -> None:
    """In every tenth frame of real runs, for each time ahead."""
    cases = [case for k, case in enumerate(load_test_cases([str(scenarios)])) if k % 12 == 0]
    assert {case.family for case in cases} >= set("34789")
    for case in cases:
        trace, others = run_test_case(case, "pdm", 0).trace, compile_test_case(case).scene.actors[1:]
        bodies = OthersReach.of(others)
        for first in range(0, trace.frames, 10):
            for within_s in LOOKS_S[2:]:
                poses, sizes = bodies.reach(trace.states[first, 1:], within_s)
                later = trace.states[first : first + round(within_s / STEP_S) + 1, 1:, :3]
                boxes = np.concatenate([later, np.broadcast_to(bodies.sizes, (*later.shape[:2], 2))], axis=-1)
                points = corners(boxes) - poses[:, None, :2]
                c, s = np.cos(poses[:, None, 2]), np.sin(poses[:, None, 2])
                ahead, left = points[..., 0] * c + points[..., 1] * s, points[..., 1] * c - points[..., 0] * s
                out = np.maximum(np.abs(ahead) - sizes[:, None, 0] / 2, np.abs(left) - sizes[:, None, 1] / 2)
                assert np.nanmax(out, initial=-1.0) < 1e-6, (case.id, first, within_s)


def _holds(box: Box, x: float, y: float) -> bool:
    c, s = math.cos(box.heading), math.sin(box.heading)
    ahead, left = (x - box.x) * c + (y - box.y) * s, (y - box.y) * c - (x - box.x) * s
    return abs(ahead) <= box.length / 2 + 1e-9 and abs(left) <= box.width / 2 + 1e-9
