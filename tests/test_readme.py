"""Every command of the README's first scenario works, in the order written."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from foresee_dsl.language.parser import parse


def test_the_first_scenario_of_the_readme(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    shutil.copytree(root / "scenarios", tmp_path / "scenarios")
    scenario = re.search(r"```foresee\n(foresee 1\n.*?scenario first .*?)```", text, re.S)
    assert scenario
    (tmp_path / "first.foresee").write_text(scenario.group(1), encoding="utf-8")
    commands = [line for block in re.findall(r"```sh\n(.*?)```", text, re.S) for line in block.splitlines() if line]
    assert commands[0] == ". .venv/bin/activate"
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    outputs = {}
    for command in commands[1:]:
        done = subprocess.run(
            command, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        # 1: these commands look for failures, and may find some here
        finds = command.split()[1] in ("mutate", "campaign")
        assert done.returncode in ((0, 1) if finds else (0,)), f"{command}\n{done.stdout}\n{done.stderr}"
        outputs[command] = done.stdout
    assert "::close: pass" in outputs["foresee run first.foresee::close --out runs"]
    # What the README shows is in the one layout: formatting changes nothing.
    assert (tmp_path / "first.foresee").read_text(encoding="utf-8") == scenario.group(1)


def test_the_mistake_that_is_shown_is_shown_so(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    scenario, shown = (re.search(p, text, re.S) for p in (r"```foresee\n(.*?)```", r"```\n(first.foresee:.*?)```"))
    assert scenario and shown
    (tmp_path / "first.foresee").write_text(scenario[1].replace("speed 40 km/h", "speed 40 kmh"), encoding="utf-8")
    command = [sys.executable, "-c", "from foresee_dsl.cli import main; main()", "check", "first.foresee"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert shown[1] in done.stderr


def test_the_other_snippets_parse(root: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    snippets = re.findall(r"```foresee\n(.*?)```", text, re.S)
    assert len(snippets) >= 2
    for snippet in snippets:
        parse(snippet, "README.md")
