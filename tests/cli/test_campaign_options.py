"""What `campaign` and `plan` say of their options: a goal and the first test cases, reference drivers, an early end."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support import command
from tests.support.first_project import foresee
from tests.support.small_campaign import SMALL, TEXT, copy_runs, write_project

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


def test_two_drivers_or_rankers_are_refused(file: Path) -> None:
    for options in (("--driver", "pdm", "--driver", "idm"), ("--driver=pdm", "--driver", "pdm")):
        for name in ("plan", "run"):
            said = " ".join(foresee(name, file, *options, expect=2).output.replace("│", "").split())
            assert f"{options[0].partition('=')[0]} is given more than once, but it takes one value." in said
    done = foresee("plan", file, "--only", "nothing", "--only", "nobody", "--out", file.parent / "out", expect=2)
    assert "no test case has the family or tag" in " ".join(done.output.split())
    foresee("plan", file, "--seed", "1", "--seed", "2", "--out", file.parent / "out", expect=0)  # the last one counts


def test_with_all_results_stored_an_early_end_changes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    copy_runs(out)
    options = ("--driver", "idm", *SMALL, "--before", "3", "--after", "3", "--risky-points", "2", "--against", "none")
    line = ("campaign", write_project(tmp_path / "project"), *options, "--jobs", "1", "--out", out)
    first = command.foresee(*line, expect=1).stdout
    second = command.foresee(*line, "--fail-fast", expect=1).stdout
    assert "interrupted" not in second and "Stopped at the first failure" not in second
    assert "\n12 mutated children" not in second and first.split("Next:")[0] == second.split("Next:")[0]
    assert command.foresee(*line, "--budget", "0", expect=1).stdout.split("Next:")[0] == first.split("Next:")[0]


def test_a_driver_cannot_be_its_own_reference(file: Path) -> None:
    out = ("--out", file.parent / "out")
    done = foresee("plan", file, "--driver", "idm", "--against", "idm", *out, expect=2)
    said = " ".join(done.output.replace("│", "").split())
    assert "idm is the driver under test, which cannot be its own reference: name another, or `none`" in said
    nightly = file.with_name("nightly.foresee")
    nightly.write_text('foresee 1\n\ncampaign nightly {\n  seeds "a.foresee"\n  drivers [idm]\n  against [idm]\n}\n')
    said = str(foresee("plan", nightly, *out, expect=1).exception)
    assert said.startswith(f"{nightly}: `against`: idm is the driver under test")
    foresee("plan", nightly, "--driver", "pdm", *out)
    foresee("plan", nightly, "--against", "none", *out)
    nightly.write_text(nightly.read_text().replace("[idm]\n  against", "[pdm, idm]\n  against"))
    said = foresee("plan", nightly, *out).output
    assert "\nidm has no reference driver: `against` names only idm itself\n" in said and "pdm has no" not in said


def test_a_part_is_named_and_an_empty_one_too(tmp_path: Path) -> None:
    file, out = write_project(tmp_path / "project"), tmp_path / "out"
    line = (f"{file}::after", "--driver", "idm", "--jobs", "1", "--out", out, "--children", "0", "--against", "none")
    said = {k: foresee("plan", *line, "--shard", f"{k}/2").output for k in (1, 2)}
    empty = next(k for k in (1, 2) if "no test case" in said[k])
    told = f"--shard {empty}/2: no test case belongs to part {empty}/2: the key of a test case decides its part\n"
    assert said[empty] == told
    assert "no test case" not in said[3 - empty]
    done = command.foresee("campaign", *line, "--shard", f"{empty}/2")
    assert told in done.stdout and f", seed 0, shard {empty}/2; 0 clips" in done.stdout
    assert "no failures" not in done.stdout and "0 test cases" not in done.stdout
