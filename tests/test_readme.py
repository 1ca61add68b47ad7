"""Every command of the README works, in the order written, and what it shows is so."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

from foresee_dsl.language.parser import parse
from tests.support.command import foresee, quick_path
from tests.support.first_project import copy_first_runs


def test_five_minutes_end_with_a_finding_that_is_kept(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    commands = [line for block in re.findall(r"```sh\n(.*?)```", text, re.S) for line in block.splitlines() if line]
    assert commands[0] == ". .venv/bin/activate"
    environment = {**os.environ, "PATH": quick_path()}
    folder, outputs = tmp_path, {}
    for command in commands[1:]:
        if command.startswith("cd "):
            folder /= command[3:]
            continue
        if command.startswith("foresee campaign "):
            copy_first_runs(folder)
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        outputs[command] = done.stdout
    assert "::steps_out: pass" in outputs["foresee run scenarios/main_street.foresee::steps_out"]
    assert "0.71 m" in outputs["foresee run scenarios/main_street.foresee::steps_out"]
    assert "2 findings" in outputs["foresee campaign campaign.foresee --exit-zero"]
    assert (folder / "out/report.html").is_file()
    assert outputs["foresee verify regressions"].endswith("1 as expected\n")
    _walk_on(folder, environment)


def _walk_on(folder: Path, environment: dict[str, str]) -> None:
    """A reviewer's walk through what the campaign left: report, a finding of it, minimised, and the difference."""

    def ask(*words: str) -> str:
        done = subprocess.run(
            ["foresee", *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    (folder / "out/report.html").unlink()
    ask("report", "out")
    assert (folder / "out/report.html").is_file()
    finding = next(f for f in json.loads((folder / "out/campaign.json").read_text())["findings"] if f["count"] > 1)
    name, sentence = finding["name"], finding["sentence"]
    assert sentence in ask("report", "out", "--format", "text")
    assert sentence in ask("show", name) and sentence not in ask("show", name, "--full")
    assert ask("minimise", name, "--out", "small")
    mutant = folder / "out" / finding["minimised"]["file"]
    told = [line for line in mutant.read_text().splitlines() if not line.startswith("    avoided ")]
    assert (folder / "small" / mutant.name).read_text().splitlines() == told
    changes = [line.strip() for line in mutant.read_text().splitlines() if line.strip().startswith("change ")]
    assert len(changes) == 1
    assert changes[0] in ask("review", name)
    subject = changes[0].removeprefix("change ").partition(":")[0]
    assert subject.partition(".")[0] in ask("diff", str(mutant))


def test_the_first_scenario_of_the_readme(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    shutil.copytree(root / "scenarios", tmp_path / "scenarios")
    scenario = re.search(r"```foresee\n(foresee 1\n.*?scenario first .*?)```", text, re.S)
    assert scenario
    (tmp_path / "first.foresee").write_text(scenario.group(1), encoding="utf-8")
    for command in ("fmt --check first.foresee", "check first.foresee", "run first.foresee"):
        foresee(*command.split(), cwd=tmp_path)


def test_the_mistake_that_is_shown_is_shown_so(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    scenario, shown = (re.search(p, text, re.S) for p in (r"```foresee\n(.*?)```", r"```\n(first.foresee:.*?)```"))
    assert scenario and shown
    (tmp_path / "first.foresee").write_text(scenario[1].replace("speed 40 km/h", "speed 40 kmh"), encoding="utf-8")
    assert shown[1] in foresee("check", "first.foresee", cwd=tmp_path, expect=1).stderr


def test_the_other_snippets_parse(root: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    snippets = re.findall(r"```foresee\n(.*?)```", text, re.S)
    assert len(snippets) >= 2
    for snippet in snippets:
        parse(snippet, "README.md")
