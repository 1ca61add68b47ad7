"""A pupil drives, the expert's labels are kept: it is helped where it stands and where it leaves its lanes."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from training.dagger import seed_of
from training.driving import HELD_UP_S, record
from training.evaluate import row
from training.samples import RecordedRun

from foresee_dsl.campaign.assessment import DriverRun
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import SPEED


class _Pupil:
    """Answers with one control, whatever it sees."""

    name, version = "pupil", "1"

    def __init__(self, control: Control) -> None:
        self._control, self.steps = control, 0

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self.steps = 0

    def step(self, observation: Observation) -> Control:
        self.steps += 1
        return self._control


@pytest.fixture(scope="module")
def bundle(scenarios: Path) -> SumoBundle:
    made = compile_test_case(load_test_case(f"{scenarios}/scenario3/behind_the_bus.foresee::schoolchild"))
    return replace(made, scene=replace(made.scene, end_s=16.0))


@pytest.fixture(scope="module")
def braked(bundle: SumoBundle) -> tuple[_Pupil, RecordedRun, RunResult]:
    """A run of a pupil that brakes whatever it sees."""
    pupil = _Pupil(Control(0.0, 0.0, 1.0))
    found, result = record(bundle, 3, {}, pupil=pupil, easy=100.0)
    assert found is not None
    return pupil, found, result


def test_a_pupil_that_stands_for_no_reason_is_helped(braked: tuple[_Pupil, RecordedRun, RunResult]) -> None:
    pupil, found, result = braked
    speeds = result.trace.states[:, 0, SPEED]
    stood = int(np.flatnonzero(speeds < 0.1)[0])
    assert speeds[stood : stood + round(HELD_UP_S / 0.05) - 2].max() < 0.3
    assert speeds[stood + round(HELD_UP_S / 0.05) :].max() > 2.0
    drives = found.label_rows[:, -1]
    assert 0 < drives.sum() < len(drives)
    assert pupil.steps == result.steps  # it sees every step, also while the expert drives


def test_the_labels_are_the_experts(braked: tuple[_Pupil, RecordedRun, RunResult]) -> None:
    _, found, _ = braked
    standing = [k for k in found.labelled.tolist() if found.ego[k, 3] < 0.1]
    assert len(standing) > 10
    assert all(found.labels(k).acceleration_mps2 > 0.5 for k in standing)


def test_a_pupil_that_leaves_its_lanes_is_helped_back_or_its_run_ends(bundle: SumoBundle) -> None:
    ends: Counter[bool] = Counter()
    for seed in (1, 2, 4):
        found, result = record(bundle, seed, {}, pupil=_Pupil(Control(-0.03, 0.3, 0.0)))
        assert found is not None
        helped = bool(found.label_rows[:, -1].any())
        ends[helped] += 1
        assert (result.verdict is Verdict.F1) != helped
    assert ends[True] and ends[False]


def test_every_round_of_every_driver_has_its_own_seed() -> None:
    seeds = [seed_of(number, name) for number in range(1, 6) for name in ("fusion", "fusion_safe", "pdm")]
    assert len(set(seeds)) == len(seeds)


def test_figures_of_an_evaluation() -> None:
    def made(verdict: Verdict, reason: str, way_m: float) -> DriverRun:
        return DriverRun("a.foresee", "3", "pdm", "1", way_m, 0, 2.0, verdict=verdict, reason=reason, duration_s=10.0)

    runs = [
        made(Verdict.PASS, "arrived at 10.00 s", 100.0),
        made(Verdict.F1, "F1 left the drivable area at 10.00 s", 60.0),
        made(Verdict.F1, "F1 collision with parked (obstacle) at 10.00 s, 6.3 m/s", 60.0),
        made(Verdict.TIMEOUT, "did not arrive within 10.00 s", 20.0),
    ]
    found = row("plain", runs)
    assert (found["arrived"], found["failed"], found["off_road"]) == (0.25, 0.5, 0.25)
    assert (found["mean_mps"], found["step_ms"]) == (6.0, 2.0)
