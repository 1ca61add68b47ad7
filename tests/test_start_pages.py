"""The pages for beginners are followed as they are written, in one project: commands, files, outputs, Python."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.command import foresee, quick_path
from tests.support.first_project import copy_first_runs

BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)
FIRST_CAMPAIGN = "foresee campaign campaign.foresee --exit-zero"
FILE = re.compile(r"Save this as `([^`]+)`:\s*$")


@pytest.fixture(scope="module")
def project(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project of the first page after all its commands, which every later page begins with."""
    folder = tmp_path_factory.mktemp("start")
    follow(root, "start/first-finding", folder)
    return folder / "crossroads"


def follow(root: Path, page: str, folder: Path) -> None:
    """Do what a page says; a block without a language right after commands is part of what they print."""
    text = (root / "docs" / f"{page}.md").read_text(encoding="utf-8")
    author = {f"GIT_{who}_{what}": "a@b.c" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    environment = {**os.environ, **author, "PATH": quick_path(), "COLUMNS": "200"}
    printed = ""
    for block in BLOCK.finditer(text):
        language, content = block.groups()
        if name := FILE.search(text[: block.start()]):
            (folder / name[1]).write_text(content, encoding="utf-8")
        elif language == "sh":
            printed = ""
            for command in content.splitlines():
                if command.startswith("cd "):
                    folder /= command[3:]
                    continue
                if command == FIRST_CAMPAIGN:
                    copy_first_runs(folder)
                done = subprocess.run(
                    command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
                )
                assert done.returncode == 0, f"{page}: {command}\n{done.stdout}\n{done.stderr}"
                printed += done.stdout
        elif not language and printed and "error FS" not in content and "foresee " not in content:
            shown = content.strip("\n")
            listed = all((folder / line.split()[0]).exists() for line in shown.splitlines()[1:])
            assert shown in printed or listed, f"{page} shows\n{content}\nbut the commands print\n{printed}"


def test_the_first_finding(root: Path, project: Path) -> None:
    assert (project / "out/report.html").is_file()
    kept = (project / "regressions/main_street_steps_out_p1_m1.foresee").read_text(encoding="utf-8")
    page = (root / "docs/guide/ci.md").read_text(encoding="utf-8")
    failure, sentence, _, _, place = page.partition("came back: ")[2].splitlines()[:5]
    assert f'found "{failure}"' in kept and f"# {sentence}" in kept
    assert kept.splitlines()[4].strip() in place, "the page shows the failure of the kept mutant"


def test_the_first_scenario_and_its_mistake(root: Path, project: Path) -> None:
    follow(root, "start/first-scenario", project)
    file = project / "scenarios/cyclist.foresee"
    scenario = file.read_text(encoding="utf-8")
    file.write_text(scenario.replace("start speed 36 km/h", "start speed 36 kmh"), encoding="utf-8")
    done = foresee("check", "scenarios/cyclist.foresee", cwd=project, expect=1)
    file.write_text(scenario, encoding="utf-8")
    text = (root / "docs/start/first-scenario.md").read_text(encoding="utf-8")
    (mistake,) = (content for _, content in BLOCK.findall(text) if "error FS" in content)
    assert done.stderr.strip() == mistake.strip()


def test_the_own_driver(root: Path, tmp_path: Path) -> None:
    follow(root, "start/own-driver", tmp_path)
    text = (root / "docs/start/own-driver.md").read_text(encoding="utf-8")
    (protocol,) = (content for language, content in BLOCK.findall(text) if language == "python")
    assert protocol in (tmp_path / "mine/my_driver.py").read_text(encoding="utf-8")


def test_python(root: Path, project: Path) -> None:
    pages = [(root / page).read_text(encoding="utf-8") for page in ("README.md", "docs/guide/python.md")]
    program = "\n".join(content for page in pages for language, content in BLOCK.findall(page) if language == "python")
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("scenarios/main_street.foresee::car_just_after pass arrived")
    assert "pass arrived at 17.70 s 17.7" in lines
    assert sum(line.startswith("steps_out_p1_m") for line in lines) == 4
    assert "3 test cases, 3 clips, 2 findings" in lines
    assert any(line.startswith("1 the driver's fault 'passenger' (pedestrian) steps onto the road") for line in lines)
    assert "<script" in (project / "finding.html").read_text(encoding="utf-8")
