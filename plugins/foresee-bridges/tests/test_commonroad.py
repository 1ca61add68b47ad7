"""Planners for CommonRoad: the driver's errors; with FORESEE_COMMONROAD_PYTHON, real planners in their environment.

The packages of CommonRoad pin versions that foresee cannot share, so `make test` skips the runs. By hand:
FORESEE_COMMONROAD_PYTHON=planners/bin/python pytest plugins/foresee-bridges/tests/test_commonroad.py
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
from pathlib import Path

import pytest
from foresee_bridges.commonroad.driver import CommonRoadDriver

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.drivers.consent import allowing
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict

PLUGIN = Path(__file__).resolve().parents[1]
PYTHON = os.environ.get("FORESEE_COMMONROAD_PYTHON", "")
with_planners = pytest.mark.skipif(not PYTHON, reason="FORESEE_COMMONROAD_PYTHON names no environment with CommonRoad")

OWN = """
import numpy as np
from commonroad.scenario.state import CustomState

class Creeps:
    version = "7"

    def __call__(self, scenario, problem, route):
        start = problem.initial_state
        assert scenario.lanelet_network.lanelets and route.lanelets and len(scenario.obstacles) >= 0
        assert scenario.lanelet_network.find_lanelet_by_position([start.position])[0]
        assert not problem.goal.is_reached(CustomState(time_step=0, position=start.position, velocity=0.0))
        near = np.hypot(*(route.path - start.position).T).argmin()
        return [
            CustomState(time_step=5 * k, position=route.path[near + k], orientation=0.0, velocity=2.0)
            for k in range(8)
        ]
"""


def test_an_address_without_a_planner_says_what_to_write() -> None:
    with pytest.raises(DriverError, match="commonroad names no planner; write commonroad:reactive"):
        CommonRoadDriver.from_argument("")


@pytest.mark.skipif(importlib.util.find_spec("commonroad") is not None, reason="commonroad-io is installed here")
def test_a_missing_package_is_named() -> None:
    with (
        allowing(["commonroad:reactive"]),
        pytest.raises(DriverUnavailableError, match=r"foresee-bridges\[commonroad\]"),
    ):
        load_driver("commonroad:reactive")


def test_a_program_starts_only_with_consent() -> None:
    with pytest.raises(DriverError, match="starts only with your consent"):
        load_driver("commonroad:reactive")


@pytest.fixture
def planners(monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the start of an address with the planners' environment."""
    monkeypatch.setenv("PYTHONPATH", str(PLUGIN))
    monkeypatch.setenv("FORESEE_RESET_DEADLINE_S", "120")
    monkeypatch.setenv("FORESEE_STEP_DEADLINE_S", "30")
    return f"external:{PYTHON} -m foresee_bridges.commonroad"


@with_planners
@pytest.mark.parametrize("planner", ["idm", "fiss", "reactive"])
def test_a_planner_arrives_and_repeats_itself(scenarios: Path, planners: str, planner: str) -> None:
    case, address = load_test_case(f"{scenarios}/scenario3.foresee::r01"), f"{planners} {planner}"
    with allowing([address]):
        first, second = run_test_case(case, address, 0), run_test_case(case, address, 0)
    assert first.verdict is Verdict.PASS, first.reason
    assert first.tracking is not None and first.tracking.lateral_m < 0.3
    assert first.trace.digest == second.trace.digest


@with_planners
def test_a_function_of_ones_own_plans(scenarios: Path, planners: str, tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(OWN, encoding="utf-8")
    address = f"{planners} {file}:Creeps"
    with allowing([address]):
        result = run_test_case(load_test_case(f"{scenarios}/scenario3.foresee::r01"), address, 0)
    assert result.verdict is not Verdict.CRASH, result.reason
    assert str(result.trace.meta["driver_version"]).endswith(" 7")
    assert result.tracking is not None


@with_planners
def test_a_planner_that_does_not_exist_is_named(planners: str) -> None:
    command = [PYTHON, "-m", "foresee_bridges.commonroad", "nothing"]
    done = subprocess.run(command, input="", capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    assert "there is no planner 'nothing': write reactive, idm, fiss" in done.stderr
