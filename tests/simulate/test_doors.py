"""An open door is a thing that the ego can run into."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from tests.support.scenes import LaneKeeper

SCENARIO = """foresee 1

scenario dooring {
  network {
    junction a at (0 m, 0 m)
    junction b at (200 m, 0 m)
    road main from a to b { parking 2.2 m }
  }

  ego: car.compact {
    route [main]
    start at 20 m along main
    start speed 30 km/h
  }
  obstacle parked: obstacle.parked_car {
    start at 80 m along main offset -2.7 m
  }

  when ego within 40 m of parked {
    door of parked opens SIDE
  }

  expect room: always distance(ego, parked) > 0.5 m
  end after 12 s anywhere
}
"""


def test_the_ego_runs_into_a_door_on_its_side_and_passes_one_on_the_other(tmp_path: Path) -> None:
    found = {}
    for side in ("left", "right"):
        file = tmp_path / "dooring.foresee"
        file.write_text(SCENARIO.replace("SIDE", side))
        result = run(compile_test_case(load_test_case(str(file))), LaneKeeper(8.0))
        assert result.expectations[0].held  # the car itself is far enough away
        found[side] = result
    assert (found["left"].verdict, found["left"].with_) == (Verdict.F1, "parked_door")
    assert found["right"].verdict is Verdict.PASS
