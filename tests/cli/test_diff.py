"""`foresee diff` and what git calls. Real processes, a real git repository."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import command

BIN = Path(sys.executable).parent
CHECKOUT = Path(__file__).parents[2]

NETWORK = """foresee 1

network town {
  junction a at (0 m, 0 m)
  junction b at (400 m, 0 m)
  road main from a to b { lanes 2; back 0 }
}
"""

SCENARIO = """foresee 1

scenario base {
  use network "town.foresee"

  ego: car.sedan {
    route [main]
    start speed 36 km/h
  }
  vehicle runner: car.compact {
    route [main]
    start at 50 m along runner.route
    speed 50 km/h
  }

  when ego.speed > 10 m/s {
    runner stops
  }

  end after 20 s
}
"""


def run(*arguments: str | Path, cwd: Path, expect: int = 0) -> str:
    """Run a program; git as nobody in particular, whatever the machine's configuration."""
    done = subprocess.run(
        list(map(str, arguments)),
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env={
            **os.environ,
            "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}",
            "NO_COLOR": "1",
            "GIT_CONFIG_GLOBAL": os.devnull,
            "GIT_CONFIG_SYSTEM": os.devnull,
        },
    )
    assert done.returncode == expect, f"{arguments}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr
    return done.stdout


def foresee(*arguments: str | Path, cwd: Path, expect: int = 0) -> str:
    return command.foresee(*arguments, cwd=cwd, expect=expect).stdout


def git(*arguments: str | Path, cwd: Path) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
    return run("git", *who, *arguments, cwd=cwd)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "town.foresee").write_text(NETWORK)
    (tmp_path / "a.foresee").write_text(SCENARIO)
    (tmp_path / "b.foresee").write_text(SCENARIO.replace("speed 50 km/h", "speed 60 km/h"))
    return tmp_path


def test_formats_and_exit_codes(folder: Path) -> None:
    text = foresee("diff", "a.foresee", "b.foresee", cwd=folder)
    assert text == "Stimulus\n  ~ runner.speed: 50 km/h => 60 km/h (+10 km/h)\n"
    marked = foresee("diff", "a.foresee", "b.foresee", "--format", "markdown", "--exit-code", cwd=folder, expect=1)
    assert "| changed | `runner.speed` | `50 km/h` | `60 km/h` | +10 km/h |" in marked
    told = json.loads(foresee("diff", "a.foresee", "b.foresee", "--format", "json", cwd=folder))
    assert (told["schema"], told["groups"], told["changes"][0]["note"]) == (1, ["stimulus"], "+10 km/h")
    assert foresee("diff", "a.foresee", "a.foresee", "--exit-code", cwd=folder) == "no difference in meaning\n"


def test_textconv(folder: Path) -> None:
    (folder / "c.foresee").write_text(SCENARIO.replace("50 km/h", "13.888888889 m/s  # as fast"))
    assert foresee("textconv", "c.foresee", cwd=folder) == foresee("textconv", "a.foresee", cwd=folder)
    broken = b"foresee 1\r\nscenario base {\r\n<<<<<<< ours \xff\n"
    (folder / "broken.foresee").write_bytes(broken)
    done = subprocess.run([BIN / "foresee", "textconv", folder / "broken.foresee"], capture_output=True, check=True)
    assert done.stdout == broken


def repository(folder: Path) -> None:
    (folder / ".gitattributes").write_bytes((CHECKOUT / ".gitattributes").read_bytes())
    git("init", "--quiet", cwd=folder)
    git("add", "--all", cwd=folder)
    git("commit", "--quiet", "--message", "x", cwd=folder)


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_git_shows_meaning_only(folder: Path) -> None:
    repository(folder)
    git("config", "diff.foresee.textconv", "foresee textconv", cwd=folder)
    edit(folder / "a.foresee", "start speed 36 km/h", "start speed 10 m/s  # as fast")
    assert git("diff", cwd=folder) == ""
    edit(folder / "a.foresee", "speed 50 km/h", "speed 55 km/h")
    changed = [
        line for line in git("diff", cwd=folder).splitlines() if line[:1] in "+-" and line[:3] not in ("+++", "---")
    ]
    assert changed == ["-    speed 50 km/h", "+    speed 55 km/h"]
    (folder / "a.foresee").write_text("half a file")
    assert "+half a file" in git("diff", cwd=folder)


def test_hunks_are_headed_by_their_block(folder: Path) -> None:
    repository(folder)
    pattern = r"^[ \t]*((ego|vehicle|when|scenario)[ :].*)$"
    git("config", "diff.foresee.xfuncname", pattern, cwd=folder)
    edit(folder / "a.foresee", "runner stops", "runner stops for 2 s")
    assert "@@ when ego.speed > 10 m/s {" in git("diff", "--unified=0", cwd=folder)


def test_git_asks_for_the_difference_in_words(folder: Path) -> None:
    repository(folder)
    git("config", "diff.foresee.command", "foresee git-diff", cwd=folder)
    edit(folder / "a.foresee", "speed 50 km/h", "speed 55 km/h")
    (folder / "b.foresee").unlink()
    shown = git("diff", cwd=folder)
    assert "foresee diff a.foresee\n\nStimulus\n  ~ runner.speed: 50 km/h => 55 km/h (+5 km/h)\n" in shown
    assert "--- a/b.foresee" in shown and "-scenario base {" in shown
    (folder / "a.foresee").write_text("half a file")
    assert "+half a file" in git("diff", "a.foresee", cwd=folder)
    assert foresee("git-diff", "a.foresee", cwd=folder) == "* Unmerged path a.foresee\n"


def test_git_names_both_paths_of_a_renamed_file(folder: Path) -> None:
    (folder / "two words.foresee").write_text((folder / "a.foresee").read_text())
    repository(folder)
    git("config", "diff.foresee.command", "foresee git-diff", cwd=folder)
    git("mv", "two words.foresee", "c d.foresee", cwd=folder)
    shown = git("diff", "--cached", "-M", cwd=folder)
    assert shown == "foresee diff 'two words.foresee' 'c d.foresee'\n\nno difference in meaning\n\n"
    edit(folder / "c d.foresee", "speed 50 km/h", "speed 55 km/h")
    shown = git("diff", "HEAD", "-M", cwd=folder)
    assert shown.startswith("foresee diff 'two words.foresee' 'c d.foresee'\n\nStimulus\n")
    assert "runner.speed: 50 km/h => 55 km/h" in shown
