"""The learned drivers in SUMO, with networks made by hand: they arrive, stop, creep, say why, and are the same to the
bit."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foresee_learned import settings as cfg
from foresee_learned.weights import FOLDER_VARIABLE
from training.small_networks import write_networks

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import Explaining
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S
from tests.support.command import program

DRIVERS = ("fusion", "fusion_safe")
DRIVEN = ("street.foresee::free", "street.foresee::blocked")
TEXT = """foresee 1

# A street for the ego alone; in some cases something lies in its lane.
scenario street {
  network street {
    junction west at (0 m, 0 m)
    junction east at (200 m, 0 m)
    road street from west to east { lanes 1; speed 30 km/h }
  }
  param aside: length = 0 m in -9 m..0 m step 1 m
  param crate_at: length = 45 m in 20 m..60 m step 1 m
  param begin: speed = 18 km/h in 0 km/h..30 km/h step 1 km/h
  param lasts: time = 8 s in 5 s..30 s step 1 s

  ego: car.sedan {
    route [street]
    start at 20 m along street
    start speed begin
    goal 60 m along street
  }
  obstacle crate: obstacle.crate {
    start at crate_at along street offset aside
  }
  expect eventually within lasts arrived(ego)
  end after lasts

  case free { aside = -9 m }
  case blocked { aside = 0 m }
  case stands_free { aside = -9 m; crate_at = 24 m; begin = 0 km/h; lasts = 21 s }
  case stands_blocked { aside = 0 m; crate_at = 24 m; begin = 0 km/h; lasts = 21 s }
}
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("street")
    write_networks(folder / "weights")
    (folder / "street.foresee").write_text(TEXT)
    return folder


@pytest.fixture(scope="module")
def results(project: Path) -> dict[tuple[str, str], RunResult]:
    """Each driver's run of each case, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(project / "weights"))
        cases = load_test_cases([str(project / address) for address in DRIVEN])
        return {
            (name, case.id.partition("::")[2]): run(compile_test_case(case), load_driver(name))
            for name in DRIVERS
            for case in cases
        }


@pytest.mark.parametrize("name", DRIVERS)
def test_it_arrives_on_a_free_street_and_stops_before_what_lies_on_it(
    results: dict[tuple[str, str], RunResult], name: str
) -> None:
    assert results[name, "free"].verdict is Verdict.PASS
    blocked = results[name, "blocked"]
    assert blocked.verdict in (Verdict.TIMEOUT, Verdict.STUCK), blocked.reason
    assert "crate" in blocked.reason


def test_other_processes_and_two_workers_drive_the_same_bits(
    project: Path, results: dict[tuple[str, str], RunResult]
) -> None:
    ours = {key: result.trace.digest for key, result in results.items()}
    assert assessed(project, "2") == ours


def assessed(project: Path, jobs: str) -> dict[tuple[str, str], str]:
    command = [program(), "assess", *DRIVEN, "--jobs", jobs, "--json", "--exit-zero"]
    command += [word for name in DRIVERS for word in ("--driver", name)]
    environment = os.environ | {FOLDER_VARIABLE: str(project / "weights")}
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    runs: list[dict[str, Any]] = json.loads(done.stdout)["runs"]
    return {(one["driver"], one["case"].partition("::")[2]): one["digest"] for one in runs}


@pytest.mark.parametrize("name", DRIVERS)
def test_it_says_what_it_stops_for(project: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(project / "weights"))
    asked: list[tuple[float, list[str]]] = []
    inner = load_driver(name)
    assert isinstance(inner, Explaining)

    class Asked:
        name = inner.name
        version = inner.version
        reset = inner.reset

        def step(self, observation: Any) -> Any:
            answer = inner.step(observation)
            reasons = inner.explain()
            known = {seen.track for seen in observation.actors} | {None}
            assert {reason.track for reason in reasons} <= known
            asked.append((observation.ego.speed_mps, [reason.rule for reason in reasons]))
            return answer

    (case,) = load_test_cases([str(project / "street.foresee::blocked")])
    result = run(compile_test_case(case), Asked())
    assert result.verdict is not Verdict.PASS
    speeds = np.array([speed for speed, _ in asked])
    braking = asked[int(np.flatnonzero(np.diff(speeds) < -0.1)[0])][1]
    assert braking[:2] == ["object", "plan"]
    assert asked[5][1][0] == "plan"


def test_a_network_that_wants_to_stand_for_ever_gets_on_unless_something_is_in_the_way(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(write_networks(project / "stands", speed_mps=0.0)))
    came = {}
    for name in ("stands_free", "stands_blocked"):
        (case,) = load_test_cases([str(project / f"street.foresee::{name}")])
        trace = run(compile_test_case(case), load_driver("fusion_safe")).trace
        came[name] = np.hypot(*(trace.states[:, 0, :2] - trace.states[0, 0, :2]).T)
    creeps = round((cfg.CREEPS_AFTER_S - 0.5) / STEP_S)
    assert came["stands_free"][creeps] < 0.5
    assert 4.0 < came["stands_free"][-1] < 2 * cfg.CREEPS_MPS * (cfg.CREEPS_FOR_S + 2.0)
    assert came["stands_blocked"][-1] < 0.5
