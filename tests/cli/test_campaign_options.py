"""What `campaign` and `plan` say of their options: a goal and the first test cases, reference drivers, an early end."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support import command
from tests.support.first_project import foresee
from tests.support.small_campaign import TEXT

NEVER = "expect never collision(ego)"
WITH_GOAL = TEXT.replace(NEVER, f"{NEVER}\n  expect fast: always ego.speed > 100 km/h")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "a.foresee").write_text(TEXT)
    (tmp_path / "b.foresee").write_text(WITH_GOAL)
    return tmp_path / "b.foresee"


def test_the_first_test_cases_are_those_with_the_goal(file: Path) -> None:
    options = ("--goal", "fast", "--first", "1", "--driver", "idm", "--jobs", "1", "--out", file.parent / "out")
    said = foresee("plan", file.with_name("a.foresee"), file, *options).output
    assert "3 of 6 test cases have no `expect fast: always ...`" in said and "\n1 run, and at most " in said


def test_the_time_of_a_plan_is_an_estimate(file: Path) -> None:
    said = foresee("plan", file, "--driver", "idm", "--jobs", "1", "--out", file.parent / "out").output
    assert "\nabout " in said and "on 1 worker, by usual times" in said


def test_no_reference_driver_stands_alone(file: Path) -> None:
    done = foresee("plan", file, "--against", "none,idm", "--out", file.parent / "out", expect=2)
    assert "`none` stands alone: remove it, or write only `none`" in " ".join(done.output.replace("│", "").split())


def test_after_the_first_failure_the_command_without_the_option_continues(file: Path) -> None:
    options = ("--driver", "idm", "--jobs", "1", "--fail-fast", "--out", file.parent / "out")
    said = command.foresee("campaign", file, *options, expect=1).stdout
    assert "Stopped at the first failure. The same command without --fail-fast continues from there." in said


def test_an_option_of_one_value_is_given_once(file: Path) -> None:
    for options in (("--driver", "pdm", "--driver", "idm"), ("--seed=1", "--seed", "1")):
        for name in ("plan", "run"):
            said = " ".join(foresee(name, file, *options, expect=2).output.replace("│", "").split())
            assert f"{options[0].partition('=')[0]} is given more than once, but it takes one value." in said
    options = ("--only", "nothing", "--only", "nobody", "--out", file.parent / "out")
    assert "no test case has the family or tag" in " ".join(foresee("plan", file, *options, expect=2).output.split())
