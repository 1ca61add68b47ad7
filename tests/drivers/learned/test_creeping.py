"""Who stands for long creeps: when, along what, and never into what stands there."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.learned import settings as cfg
from foresee_dsl.drivers.learned.fusion_safe import Creeping, along_the_route
from foresee_dsl.drivers.learned.weights import FOLDER_VARIABLE
from foresee_dsl.drivers.protocol import EgoState, Mission
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S
from tests.support.small_networks import write_networks

TEXT = """foresee 1

scenario stands {
  network street {
    junction west at (0 m, 0 m)
    junction east at (200 m, 0 m)
    road street from west to east { lanes 1; speed 30 km/h }
  }
  param aside: length = 0 m in -9 m..0 m step 1 m

  ego: car.sedan {
    route [street]
    start at 20 m along street
    start speed 0 km/h
    goal 60 m along street
  }
  obstacle crate: obstacle.crate {
    start at 24 m along street offset aside
  }
  expect never collision(ego)
  end after 21 s

  case free { aside = -9 m }
  case blocked { aside = 0 m }
}
"""


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


def test_a_network_that_wants_to_stand_for_ever_gets_on_unless_something_is_in_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(write_networks(tmp_path / "weights", speed_mps=0.0)))
    (tmp_path / "stands.foresee").write_text(TEXT)
    came = {}
    for case in load_test_cases([str(tmp_path / "stands.foresee")]):
        trace = run(compile_test_case(case), load_driver("fusion_safe")).trace
        came[case.id.partition("::")[2]] = np.hypot(*(trace.states[:, 0, :2] - trace.states[0, 0, :2]).T)
    creeps = round((cfg.CREEPS_AFTER_S - 0.5) / STEP_S)
    assert came["free"][creeps] < 0.5
    assert 4.0 < came["free"][-1] < 2 * cfg.CREEPS_MPS * (cfg.CREEPS_FOR_S + 2.0)
    assert came["blocked"][-1] < 0.5
