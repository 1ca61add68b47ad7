"""A project in a git repository with a finished campaign, and a driver of its own: what tests of `keep` begin with."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.errors import ForeseeError
from tests.support.small_campaign import SETTINGS, finished, write_project

MUTANT, CLIP = "crosser_after_p1_m2", "crosser_after_p1"
"""The one finding of the small campaign, and the clip that it was made from."""

DRIVER = """import json, sys

for message in map(json.loads, sys.stdin):
    if message["type"] == "end":
        break
    ready = {"type": "ready", "name": "keeper", "version": "VERSION"}
    control = {"steer": 0, "throttle": THROTTLE, "brake": 0}
    print(json.dumps(ready if message["type"] == "reset" else control), flush=True)
"""
COASTS, HURRIES, CREEPS = ("1", 0), ("2", 1), ("3", 0.3)
"""Versions of the driver, with their throttle: the first fails in the mutant alone, the second in all but the mutant,
the third nowhere."""


def program(version: tuple[str, float]) -> str:
    """The text of the driver's program."""
    return DRIVER.replace("VERSION", version[0]).replace("THROTTLE", str(version[1]))


class Project:
    """The files, git, and the command line."""

    def __init__(self, root: Path) -> None:
        self.root = root

    @classmethod
    def new(cls, root: Path) -> Project:
        """Make the project with its campaign in `out`."""
        file = write_project(root)
        cases = [Path(f"{file}::{case}") for case in ("after", "later")]
        finished(cases, root / "out", replace(SETTINGS, risky_points=1, children=2))
        project = cls(root)
        (root / ".gitignore").write_text("out/\n")
        project.git("init", "--quiet")
        project.commit()
        return project

    @property
    def driver(self) -> str:
        """The address of the driver."""
        return f"external:{sys.executable} {self.root / 'driver.py'}"

    def write_driver(self, version: tuple[str, float]) -> None:
        (self.root / "driver.py").write_text(program(version))

    def foresee(self, *arguments: str | Path, expect: int = 0) -> str:
        """Run a command in the project's folder; return what it prints, or says is wrong."""
        before = Path.cwd()
        os.chdir(self.root)
        try:
            done = CliRunner().invoke(app, list(map(str, arguments)))
        finally:
            os.chdir(before)
        assert done.exit_code == expect, f"{arguments}: {done.exit_code}\n{done.output}\n{done.exception!r}"
        wrong = done.exception if isinstance(done.exception, ForeseeError) else ""
        return f"{done.output}{wrong}"

    def git(self, *arguments: str) -> str:
        """Run git as nobody in particular, whatever the machine's configuration."""
        who = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        env = {**os.environ, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}
        done = subprocess.run(
            ["git", *who, *arguments], cwd=self.root, capture_output=True, text=True, check=True, env=env
        )
        return done.stdout

    def commit(self) -> None:
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", "x")

    def edit(self, name: str, old: str, new: str) -> None:
        file = self.root / name
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))

    def changed_lines(self) -> list[str]:
        """The lines that git shows as removed or added, the index left out."""
        shown = self.git("diff", "--no-ext-diff", "--", "*.foresee").splitlines()
        return [line for line in shown if line[:1] in "+-" and line[:3] not in ("+++", "---")]
