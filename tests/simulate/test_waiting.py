"""A run that does not arrive says what the ego waited for."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult, Verdict

TEXT = """foresee 1

scenario waits {
  network road {
    junction a at (0 m, 0 m)
    junction b at (300 m, 0 m)
    road main from a to b { lanes 1; back 0; speed 50 km/h }
  }

  ego: car.sedan {
    route [main]
    start at 20 m along main
    start speed 36 km/h
    goal 200 m along main
  }
  WHO
  expect eventually within 14 s arrived(ego)
  end after 14 s
}
"""
WALKER = """pedestrian walker: pedestrian.adult {
    path [(90 m, -8 m), (90 m, 0 m)]
    speed 1.5 m/s
  }"""
BARRIER = "obstacle barrier: obstacle.barrier { start at 80 m along main }"
END = (
    "behind walker (pedestrian), which came to the end of its path in the ego's way after 5.70 s and stays there: "
    "extend its path in the scenario beyond the lane"
)


@pytest.mark.parametrize(
    ("who", "why"),
    [(WALKER, END), (BARRIER, "behind barrier (obstacle), which the scenario parks there")],
    ids=["walker", "barrier"],
)
def test_who_is_in_the_way_is_named(who: str, why: str, tmp_path: Path) -> None:
    result = drive(who, tmp_path)
    assert result.verdict is Verdict.TIMEOUT
    begins, _, waits = result.reason.partition("; ")
    assert begins == "timeout: did not arrive within 14.00 s"
    assert waits.startswith("the ego stands since ") and "m before its goal" in waits and waits.endswith(why)


def test_an_ego_that_drives_waits_for_nobody(tmp_path: Path) -> None:
    result = drive("", tmp_path, "goal 290 m along main")
    assert result.verdict is Verdict.TIMEOUT and "; the ego still drives at " in result.reason


def drive(who: str, folder: Path, goal: str = "goal 200 m along main") -> RunResult:
    file = folder / "waits.foresee"
    file.write_text(TEXT.replace("  WHO\n", f"  {who}\n" if who else "").replace("goal 200 m along main", goal))
    return run_test_case(load_test_case(file), "idm", 0)
