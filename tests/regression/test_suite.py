"""A team's suite: failures kept, verified with a driver that changes, moved, pruned. Real git, SUMO and programs."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from foresee_dsl.campaign.regression.expectations import Status
from foresee_dsl.campaign.regression.verify import verify_files
from foresee_dsl.language.project.loading import load_test_case
from tests.support.first_project import checked
from tests.support.kept_suite import CLIP, COASTS, CREEPS, HURRIES, MUTANT, Project, program


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A project with a finished campaign, and a suite of its finding, the finding's clip, and a test case."""
    project = Project.new(tmp_path_factory.mktemp("team") / "project")
    project.write_driver(COASTS)
    clip = f"out/children/crosser/{CLIP}.foresee"
    project.foresee("keep", MUTANT, clip, "crosser.foresee::last")
    assert "expected  no result is recorded for keeper 1 via external:" in verify(
        project, "regressions", "--update", expect=0
    )
    project.commit()
    return project


@pytest.fixture
def project(finished: Project, tmp_path: Path) -> Project:
    """A copy of it, with its history."""
    shutil.copytree(finished.root, tmp_path / "project")
    return Project(tmp_path / "project")


def verified(project: Project, *options: str, folder: str = "regressions", expect: int = 1) -> dict[str, Any]:
    """What `verify` says, and the status of each test."""
    data: dict[str, Any] = checked(verify(project, folder, "--json", *options, expect=expect))
    assert sum(data["counts"].values()) == len(data["tests"])
    return data | {"status": {Path(one["file"]).stem: one["status"] for one in data["tests"]}}


def verify(project: Project, folder: str, *options: str, expect: int = 1) -> str:
    return project.foresee("verify", folder, "--driver", project.driver, "--jobs", "1", *options, expect=expect)


def test_a_kept_suite_stands_on_its_own(project: Project, tmp_path: Path) -> None:
    kept = sorted(file.relative_to(project.root).as_posix() for file in (project.root / "regressions").rglob("*.*"))
    assert kept == [
        "regressions/README.md",
        "regressions/crosser_after_p1.foresee",
        "regressions/crosser_after_p1_m2.foresee",
        "regressions/crosser_last.foresee",
        "regressions/parents/crosser.foresee",
        "regressions/parents/crosser_after_p1.foresee",
    ]
    assert "no errors found" in project.foresee("check", "regressions")
    assert "formatted already" in project.foresee("fmt", "--check", "regressions")
    shutil.copytree(project.root / "regressions", tmp_path / "elsewhere")
    other = Project(tmp_path / "elsewhere")
    assert "no errors found" in other.foresee("check", ".")
    small = load_test_case(project.root / f"out/findings/{MUTANT}/{MUTANT}.foresee")
    assert load_test_case(other.root / f"{MUTANT}.foresee", allow_outside=False).meaning == small.meaning
    last = load_test_case(f"{project.root / 'crosser.foresee'}::last")
    assert load_test_case(other.root / "crosser_last.foresee").meaning == last.meaning


def test_a_parent_that_is_edited_between_two_calls_is_read_again(project: Project) -> None:
    mutant, clip = (project.root / "regressions" / name for name in (f"{MUTANT}.foresee", f"parents/{CLIP}.foresee"))
    (before,) = verify_files([mutant], driver="idm")
    assert before.status is Status.AS_EXPECTED
    text = clip.read_text()
    edited = re.sub(r"(ego: .* speed )[\d.]+", r"\g<1>5.0000", text)
    assert edited != text
    clip.write_text(edited)
    (after,) = verify_files([mutant], driver="idm")
    assert after.status is Status.STALE and "ego" in after.note


def test_the_index_is_for_people(project: Project) -> None:
    file = project.root / "regressions" / "README.md"
    (row,) = [line for line in file.read_text().splitlines() if f"[{MUTANT}]" in line]
    assert f"({MUTANT}.foresee)" in row and "`other.timing: 1.00 => " in row
    assert "`idm fails F4 with other`<br>`keeper fails F4 with other`" in row
    assert "comes from the right without giving way" in row  # the finding's sentence
    file.write_text("# Ours\n\nAsk Ana.\n\n" + file.read_text().partition("\n\n")[2] + "\nThanks.\n")
    before = file.read_text()
    project.foresee("keep", "--prune")
    assert file.read_text() == before
    project.foresee("keep", "crosser.foresee::later")
    text = file.read_text()
    assert text.startswith("# Ours\n\nAsk Ana.\n") and text.endswith("\nThanks.\n") and "[crosser_later]" in text


def test_a_test_case_that_failed_unmutated_is_a_finding_too(project: Project) -> None:
    file = project.root / "out/campaign.json"
    data = json.loads(file.read_text())
    (case,) = [one for one in data["test_cases"] if one["test_case"].endswith("::later")]
    case["reason"] = "F4 lateral collision with other (car) at 3.00 s, 5.0 m/s"
    told = data["findings"][0] | {"name": "crosser_later", "sentence": 'other is "hit"', "file": case["test_case"]}
    file.write_text(json.dumps(data | {"findings": [told]}))
    project.foresee("keep", "crosser_later")
    text = (project.root / "regressions/crosser_later.foresee").read_text()
    assert "doc \"other is 'hit'\"" in text and "expected idm fails F4 with other" in text and "param" not in text


def test_keeping_again_changes_nothing(project: Project) -> None:
    told = project.foresee("keep", MUTANT, "crosser.foresee::last")
    assert told.count("kept already") == 2 and "copied" not in told
    assert project.git("status", "--short") == ""


def test_names_that_clash_are_told(project: Project) -> None:
    told = project.foresee("keep", MUTANT, "--full", expect=1)  # as it failed first: another clip, so another meaning
    assert "exists already and is another test case: `--as NAME`" in told
    assert project.git("status", "--short") == ""
    data = checked(project.foresee("keep", MUTANT, "--full", "--as", "as_it_failed", "--json"))
    assert data["copied"] == [f"regressions/parents/{CLIP}_2.foresee"] and data["tests"][0]["new"]
    text = (project.root / "regressions/as_it_failed.foresee").read_text()
    assert f'mutant as_it_failed of "parents/{CLIP}_2.foresee"' in text
    assert "did you mean 'crosser_after_p1_m2'?" in project.foresee("keep", "crosser_after_p1_m3", expect=1)
    assert "no errors found" in project.foresee("check", "regressions")


def test_a_parent_of_the_same_name_with_another_meaning_gets_a_number(project: Project) -> None:
    project.edit("crosser.foresee", "start speed 36 km/h", "start speed 35 km/h")
    clip = project.root / "out/children/crosser" / f"{CLIP}.foresee"
    (was,) = re.findall(r"sha256:\w+", clip.read_text())
    now = load_test_case(f"{project.root / 'crosser.foresee'}::after").meaning
    assert "foresee repin" in project.foresee("keep", clip, "--as", "another", expect=1)  # it is stale
    clip.write_text(clip.read_text().replace(was, now))
    told = project.foresee("keep", clip, "--as", "another")
    assert "parents/crosser_2.foresee: the suite already has another crosser.foresee with a different meaning" in told
    assert "no errors found" in project.foresee("check", "regressions")


def test_a_driver_that_fixes_one_and_breaks_another(project: Project) -> None:
    project.write_driver(HURRIES)
    told = verify(project, "regressions", "--exit-zero", expect=0)
    assert told.index("came back") < told.index("fixed ") and "expected  passes (keeper 2 via external:" in told
    assert project.git("status", "--short") == " M driver.py\n"
    found = verified(project, "--update", expect=0)
    assert found["status"] == {MUTANT: "fixed", CLIP: "came_back", "crosser_last": "came_back"}
    assert len(found["written"]) == 3
    assert sorted(project.changed_lines()) == sorted(
        [
            *("-  expected keeper fails F4 with other", "+  expected keeper passes"),
            *(["-  expected keeper passes", "+  expected keeper fails F4 with other"] * 2),
        ]
    )
    assert "`keeper fails F4 with other`" in project.git("diff", "--", "*.md")


def test_a_line_for_one_version_goes_first_and_comments_stay(project: Project) -> None:
    name = f"regressions/{MUTANT}.foresee"
    fails = "expected keeper fails F4 with other"
    project.edit(name, fails, f'{fails}  # until issue 7\n  expected "keeper 2" passes')
    project.commit()
    project.write_driver(HURRIES)
    found = verified(project)
    assert found["status"][MUTANT] == "as_expected"
    assert [one["line"] for one in found["tests"] if MUTANT in one["file"]] == [
        next(k for k, line in enumerate((project.root / name).read_text().splitlines(), 1) if '"keeper 2"' in line)
    ]
    project.write_driver(CREEPS)
    assert verified(project, "--update", expect=0)["status"][MUTANT] == "fixed"
    assert project.changed_lines() == [f"-  {fails}  # until issue 7", "+  expected keeper passes  # until issue 7"]


def test_a_crash_is_never_fixed(project: Project) -> None:
    (project.root / "driver.py").write_text("raise SystemExit('no weights')\n")
    found = verified(project, "--update")
    assert set(found["status"].values()) == {"crashed"} and not found["ok"] and not found["written"]
    assert all("no weights" in one["now"] for one in found["tests"])
    assert project.git("status", "--short") == " M driver.py\n"


def test_a_driver_that_is_not_there(project: Project) -> None:
    assert "'nobody'" in project.foresee("verify", "regressions", "--driver", "nobody", expect=1)


def test_an_edit_of_a_parent_that_reaches_its_children(project: Project) -> None:
    parent = "regressions/parents/crosser.foresee"
    project.edit(parent, "start speed 36 km/h", "start speed 38 km/h")  # a clip has its own
    road = "road in from west to middle { lanes 1; speed"
    project.edit(parent, f"{road} 60", f"{road} 50")
    found = verified(project)
    assert found["status"] == {MUTANT: "stale", CLIP: "stale", "crosser_last": "as_expected"}
    notes = {one["note"] for one in found["tests"]}
    assert notes == {"", "the edit reaches it: road in.speed: 60 km/h => 50 km/h (-10 km/h)"}


def test_a_folder_is_moved_its_parent_edited_harmlessly_and_it_is_pruned(project: Project) -> None:
    (project.root / "tests").mkdir()
    project.git("mv", "regressions", "tests/suite")
    project.commit()
    project.edit("tests/suite/parents/crosser.foresee", "start speed 36 km/h", "start speed 38 km/h")
    found = verified(project, folder="tests/suite", expect=0)
    assert found["ok"] and set(found["status"].values()) == {"as_expected"}
    notes = {Path(one["file"]).stem: one["note"] for one in found["tests"]}
    assert (
        "does not change this test" in notes[MUTANT]
        and "does not change this test" in notes[CLIP]
        and not notes["crosser_last"]
    )
    assert "no file was removed" in project.foresee("keep", "--prune", "--to", "tests/suite")
    (project.root / f"tests/suite/{MUTANT}.foresee").unlink()
    told = project.foresee("keep", "--prune", "--to", "tests/suite")
    assert told.split() == ["removed", f"tests/suite/parents/{CLIP}.foresee"]
    (project.root / f"tests/suite/{CLIP}.foresee").unlink()
    assert "parents/crosser.foresee" in project.foresee("keep", "--prune", "--to", "tests/suite")
    left = sorted(file.name for file in (project.root / "tests/suite").rglob("*"))
    assert left == ["README.md", "crosser_last.foresee"]
    assert MUTANT not in (project.root / "tests/suite/README.md").read_text()


def test_two_drivers_compared_on_the_suite(project: Project) -> None:
    (project.root / "hurries.py").write_text(program(HURRIES))
    drivers = f"{project.driver},{project.driver.replace('driver.py', 'hurries.py')}"
    data = checked(project.foresee("compare", "regressions", "--drivers", drivers, "--jobs", "1", "--json", expect=1))
    names = {
        key: [Path(one["test_case"]).stem for one in data[key]] for key in ("new_failures", "fixed", "still_failing")
    }
    assert names == {"new_failures": [CLIP, "crosser_last"], "fixed": [MUTANT], "still_failing": []}
    assert (data["pairs"], data["ok"], data["base"].split()[:2]) == (3, False, ["keeper", "1"])
    total, kind = data["rows"]
    assert (total["base_failed"], total["new_failed"], total["p"]) == (1, 2, 1.0) and kind["label"] == "F4"


def test_two_campaigns_compared(project: Project) -> None:
    told = project.foresee("compare", "out", "out")
    assert "0 new failures, 0 fixed: the same test cases pass" in told and "Still failing (1)" in told
    shutil.copytree(project.root / "out", project.root / "new", ignore=shutil.ignore_patterns("store"))
    file = project.root / "new/campaign.json"
    data = json.loads(file.read_text())
    first, second = data["test_cases"]
    first |= {"verdict": "crash", "reason": "the driver raised"}
    second["near_misses"]["ttc_s"] = {"value": 0.2, "time_s": 3.0, "with": "other"}
    data["clip_runs"][0]["children"][0]["meaning"] = "sha256:000000000000"
    file.write_text(json.dumps(data))
    told = project.foresee("compare", "out", "new", expect=1)
    assert told.index("New failures (1)") < told.index("Still failing (1)") < told.index("came nearer (1)")
    assert "now the driver raised" in told and "time to collision " in told and "=> 0.20 s, with other" in told
    assert "5 test cases on both sides, 1 with another meaning there" in told
    assert project.foresee("compare", "out", "new", "--exit-zero") == told
    project.foresee("compare", "out", "new", "--format", "markdown", "--output", "comment.md", expect=1)
    comment = (project.root / "comment.md").read_text()
    assert comment.startswith("### 1 new failure, 0 fixed: it may be chance") and "| crash | " in comment
    del first["meaning"]
    file.write_text(json.dumps(data))
    assert "run the campaign again" in project.foresee("compare", "out", "new", expect=1)
