"""A team's fortnight, with real git: a driver that changes, a red build, edits of parents, a folder that is moved."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.support.command import quick_path

yaml = pytest.importorskip("yaml", reason="PyYAML reads the workflow that the build server runs")

DRIVER = '''"""The team's driver: PDM, and a brake of its own for people on foot."""

import math
from dataclasses import replace

from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Control

BRAKES_WITHIN_M = 0.0


class TeamDriver:
    """PDM, and a brake of its own for people on foot."""

    name = "team"
    version = "1"

    def __init__(self):
        self._pdm = PdmDriver()

    def reset(self, mission, vehicle, seed):
        self._pdm.reset(mission, vehicle, seed)

    def step(self, seen):
        walkers = [one for one in seen.actors if one.kind == "pedestrian" and one.speed_mps > 0.3]
        near = any(math.dist((one.x, one.y), (seen.ego.x, seen.ego.y)) < BRAKES_WITHIN_M for one in walkers)
        control = self._pdm.step(seen)
        return Control(control.steer, 0.0, 1.0) if near else control
'''
# Brakes for walkers as it should, and no longer looks at cars.
SECOND = (
    ("BRAKES_WITHIN_M = 0.0", "BRAKES_WITHIN_M = 20.0"),
    ('version = "1"', 'version = "2"'),
    ("self._pdm.step(seen)", "self._pdm.step(replace(seen, actors=tuple(walkers)))"),
)
RED = {"car_first": "came_back", "hurries_out_p1_m1": "fixed", "steps_out_p1_m1": "fixed"}
CASE = "  case car_first { gap = -0.4 s; notice = 8 s }\n"


class Team:
    """A repository and the commands that a team calls in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = {
            **os.environ,
            "PATH": quick_path(),
            "PYTHONPATH": str(folder / "driver"),
            "COLUMNS": "200",
        }

    def call(self, *command: str | Path, expect: int = 0) -> str:
        done = subprocess.run(
            [*map(str, command)], cwd=self.folder, capture_output=True, text=True, check=False, env=self.environment
        )
        assert done.returncode == expect, (command, done.returncode, done.stdout, done.stderr)
        return done.stdout

    def foresee(self, *arguments: str | Path, expect: int = 0) -> str:
        return self.call("foresee", *arguments, expect=expect)

    def git(self, *arguments: str) -> str:
        names = ("-c", "user.name=Someone", "-c", "user.email=someone@example.com", "-c", "commit.gpgsign=false")
        return self.call("git", *names, *arguments)

    def commit(self, message: str) -> None:
        self.git("add", ".")
        self.git("commit", "-qm", message)

    def edit(self, file: str, *changes: tuple[str, str]) -> None:
        text = (self.folder / file).read_text()
        for old, new in changes:
            assert text.count(old) == 1, (file, old)
            text = text.replace(old, new)
        (self.folder / file).write_text(text)


@pytest.fixture
def team(tmp_path: Path) -> Team:
    """A repository with a driver of its own, installed as a package is."""
    folder = tmp_path / "team"
    info = folder / "driver" / "team-1.dist-info"
    info.mkdir(parents=True)
    (folder / "driver" / "team.py").write_text(DRIVER)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: team\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[foresee_dsl.drivers]\nteam = team:TeamDriver\n")
    return Team(folder)


@pytest.mark.slow
def test_a_fortnight(team: Team) -> None:
    # Monday: a project, and a case of their own beside the first three.
    team.foresee("init", "--driver", "team")
    team.git("init", "-q")
    team.git("config", "diff.foresee.textconv", "foresee textconv")
    scenario = "scenarios/main_street.foresee"
    team.edit(scenario, ("  case car_just_after", f"{CASE}  case car_just_after"))
    team.foresee("fmt", "--check", ".")
    team.foresee("check", "--strict", ".")
    team.commit("First scenarios")

    # A campaign finds failures. Three are kept, and the case, which passes.
    team.foresee("campaign", "campaign.foresee", "--children", "1", "--jobs", "2", "--quiet", "--exit-zero")
    cases = ("car_just_after", "hurries_out", "steps_out")
    found = [f"out/children/main_street/main_street_{case}_p1_m1.foresee" for case in cases]
    team.foresee("keep", *found, f"{scenario}::car_first")
    team.foresee("verify", "regressions", "--driver", "team", "--update", "--jobs", "2")
    team.foresee("check", "regressions")
    assert "regressions/main_street_car_first.foresee" in team.git("status", "--porcelain", "-uall")
    team.commit("Keep what the first campaign found")

    # The second week: the driver brakes for walkers, and overlooks cars. The build is red, at the right line.
    team.edit("driver/team.py", *SECOND)
    team.commit("Brake for walkers")
    workflow = yaml.safe_load((team.folder / ".github/workflows/scenarios.yml").read_text())
    (gate,) = [step["run"] for step in workflow["jobs"]["scenarios"]["steps"] if "verify" in step.get("run", "")]
    told = team.call("bash", "-eo", "pipefail", "-c", gate, expect=1).splitlines()
    lines = {line.split("file=")[1].split(",line=")[0]: line for line in told if line.startswith("::error ")}
    assert set(lines) == {f"regressions/main_street_{name}.foresee" for name in RED}
    red = lines["regressions/main_street_car_first.foresee"]
    assert "came back" in red and "F4 lateral collision with crosser" in red
    number = int(red.split(",line=")[1].split(",")[0])
    kept = (team.folder / "regressions/main_street_car_first.foresee").read_text().splitlines()
    assert kept[number - 1].strip() == "expected team passes"
    tests = ElementTree.parse(team.folder / "junit.xml").iter("testcase")
    failed = {test.get("name"): test.find("failure").get("type") for test in tests if test.find("failure") is not None}
    assert failed == {f"main_street_{name}": status for name, status in RED.items()}

    # What was broken is repaired; what is fixed is written down, and the diff is only that.
    team.edit("driver/team.py", (SECOND[2][1], SECOND[2][0]), ('version = "2"', 'version = "3"'))
    team.foresee("verify", "regressions", "--update", "--jobs", "2")
    diff = team.git("diff", "--no-textconv", "-U0", "--", "*.foresee").splitlines()
    changed = [line for line in diff if line[:1] in "+-" and line[:3] not in ("+++", "---")]
    assert sorted(changed) == sorted(2 * ["-  expected team fails F2 with passenger", "+  expected team passes"])
    assert "expected team passes" in team.git("diff", "--", "*.foresee"), "and git shows it by meaning too"
    team.commit("Walkers are no longer hit")

    # An edit of a parent that does not reach the children, and the folder moved: everything is verified.
    parent = "regressions/parents/main_street.foresee"
    team.edit(parent, ("    speed 30 km/h", "    speed 31 km/h"))
    team.commit("A parent is edited")
    (team.folder / "tests").mkdir()
    team.git("mv", "regressions", "tests/regressions")
    team.commit("Regressions are tests")
    told = team.foresee("verify", "tests/regressions", "--jobs", "2").splitlines()
    assert told[-1] == "4 as expected", told
    assert sum("does not change this test" in line for line in told) == 3

    # An edit that reaches them: the road is slower now. The build says so.
    team.edit(
        "tests/regressions/parents/crossroads.foresee", ("to middle { speed 50 km/h", "to middle { speed 40 km/h")
    )
    told = team.foresee("verify", "tests/regressions", "--jobs", "2", expect=1)
    assert told.count("stale ") == 3 and "the edit reaches it" in told
    team.git("checkout", "-q", ".")
    assert team.git("status", "--porcelain") == ""
