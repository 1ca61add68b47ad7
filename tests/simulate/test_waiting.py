"""A run that does not arrive says what the ego waited for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.drivers.consent import allowing
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.story import tell

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


WAITING = """from foresee_dsl.drivers.protocol import Control

class Waits:
    name, version, waits_for = "waits", "1", ""

    def reset(self, mission, vehicle, seed):
        pass

    def step(self, observation):
        self.waits_for = 'waits for "track 7"'
        return Control(0.0, 0.0, 1.0)
"""


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


def test_the_story_of_a_stuck_ego_names_the_same_actor_as_its_reason(tmp_path: Path) -> None:
    """The box beside the road is nearer to the ego than the skip, but it is not in its way."""
    file = tmp_path / "waits.foresee"
    skip = "obstacle skip: obstacle.skip { start at 100 m along main }"
    box = "obstacle box: obstacle.crate { start at 96.5 m along main offset -2.6 m }"
    file.write_text(TEXT.replace("WHO", f"{skip}\n  {box}").replace("14 s", "45 s"))
    case = load_test_case(file)
    result = run_test_case(case, "idm", 0)
    assert result.verdict is Verdict.STUCK
    gap = re.search(r"before its goal, ([0-9.]+ m) behind skip", result.reason)
    assert gap is not None and tell(result.trace, case).sentence.endswith(f"with 'skip' {gap[1]} in front of it")


def test_the_reason_has_the_words_of_a_driver_that_says_what_it_waits_for(tmp_path: Path) -> None:
    (tmp_path / "waiting.py").write_text(WAITING)
    file = tmp_path / "waits.foresee"
    file.write_text(TEXT.replace("  WHO\n", ""))
    driver = f"python:{tmp_path / 'waiting.py'}:Waits"
    with allowing((driver,)):
        result = run_test_case(load_test_case(file), driver, 0)
    assert result.verdict is Verdict.TIMEOUT
    assert result.reason.endswith("and no actor is ahead on its route (the driver: waits for 'track 7')")


def drive(who: str, folder: Path, goal: str = "goal 200 m along main") -> RunResult:
    file = folder / "waits.foresee"
    file.write_text(TEXT.replace("  WHO\n", f"  {who}\n" if who else "").replace("goal 200 m along main", goal))
    return run_test_case(load_test_case(file), "idm", 0)
