"""`foresee repin`: real processes, a real git repository, real SUMO."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import foresee
from tests.support.repin_project import Repository


def repin(*arguments: str | Path, cwd: Path, expect: int = 0) -> str:
    return foresee("repin", *arguments, cwd=cwd, expect=expect).stdout


@pytest.fixture
def project(tmp_path: Path) -> Repository:
    return Repository(tmp_path)


def test_dry_run_then_write(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather wetness 0.5")
    before = project.clip.read_bytes()
    shown = repin("children", cwd=project.root)
    assert "children/lead_brakes_p1.foresee: lead_brakes.foresee::near changed" in shown
    assert "+ weather.wetness: 0.5" in shown and shown.endswith("3 to re-pin (`--write` does it)\n")
    assert project.clip.read_bytes() == before
    assert repin("children", "--write", cwd=project.root).endswith("3 re-pinned\n")
    assert repin("children", cwd=project.root) == "3 up to date\n"
    changed = project.git("diff", "--numstat", "--no-ext-diff").split("\n")
    assert [line.split("\t")[:2] for line in changed if "children" in line] == [["1", "1"]] * 3


def test_a_road_that_ends_under_a_clip_is_a_conflict(project: Repository) -> None:
    project.edit(project.network, "junction b at (400 m, 0 m)", "junction b at (55 m, 0 m)")
    before = project.clip.read_bytes()
    told = json.loads(repin("children", "--write", "--json", cwd=project.root, expect=1))
    assert [child["state"] for child in told["children"]] == ["conflict", "blocked", "blocked"]
    assert told["children"][0]["mistakes"][0]["code"].startswith("FS2")
    assert told["written"] == [] and project.clip.read_bytes() == before


def test_the_verdicts_before_and_after(project: Repository) -> None:
    project.edit(project.scenario, "weather rain 0.3", "weather rain 0.4")
    told = json.loads(repin(project.clip, "--run", "--json", cwd=project.root))
    was, now = told["children"][0]["verdict"]
    assert was == now and now
    assert "Error" not in now
