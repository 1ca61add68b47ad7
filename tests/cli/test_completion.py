"""Shell completion, asked for by a real bash as a user types."""

from __future__ import annotations

import os
import pty
import select
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from foresee_dsl.cli import COMMANDS
from tests.support.first_project import foresee

SCENARIO = """foresee 1

scenario street {
  network n {
    junction a at (0 m, 0 m)
    junction b at (90 m, 0 m)
    road r from a to b
  }
  param v: speed = 20 km/h
  ego: car.sedan {
    route [r]
    start speed v
  }
  expect never collision(ego)
  end after 5 s
  case slow { v = 20 km/h }
  case slower { v = 10 km/h }
  case quick { v = 40 km/h }
}
"""
HALF = "foresee 1\n\nscenario s {\n"


@pytest.fixture
def bash(tmp_path: Path):
    """A shell on a terminal of its own: what is typed, and what stands in the line then."""
    (tmp_path / "street.foresee").write_text(SCENARIO)
    (tmp_path / "half.foresee").write_text(HALF)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ours, theirs = pty.openpty()
    shell = subprocess.Popen(
        ["bash", "--norc", "--noprofile", "-i"], cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs,
        start_new_session=True, env={**os.environ, "PATH": path, "PS1": "", "TERM": "dumb", "HISTFILE": ""},
    )  # fmt: skip

    def until(said: str) -> str:
        text = ""
        while said not in text:
            assert select.select([ours], [], [], 60)[0], f"bash does not say {said!r}: {text!r}"
            text += os.read(ours, 4096).decode(errors="replace")
        return text

    def typed(line: str, says: str) -> str:
        os.write(ours, line.encode())
        text = until(says)
        os.write(ours, b"\x15")  # Ctrl-U: the line is emptied
        return text

    os.write(ours, b"source <(foresee completion bash); echo rea''dy\n")
    until("ready")
    yield typed
    os.close(theirs)
    shell.kill()
    shell.wait()
    os.close(ours)


def test_bash_completes_commands_and_test_cases(bash) -> None:
    bash("foresee camp\t", "foresee campaign ")
    bash("foresee run street.foresee::q\t", "street.foresee::quick ")
    bash("foresee run street.foresee::slow\t\t", "street.foresee::slower")
    bash("foresee run x --driver pd\t", "--driver pdm ")
    bash("foresee run stre\t", "street.foresee")  # files are the shell's own


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_has_its_script(shell: str, tmp_path: Path) -> None:
    script = foresee("completion", shell).stdout
    assert f"_FORESEE_COMPLETE=complete_{shell}" in script.replace("%(autocomplete_var)s", "")
    if shutil.which(shell):
        file = tmp_path / "script"
        file.write_text(script)
        subprocess.run([shell, "-n", file], check=True)
    foresee("completion", "csh", expect=2)


def test_what_fish_and_zsh_are_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "street.foresee").write_text(SCENARIO)
    (tmp_path / "half.foresee").write_text(HALF)
    program = Path(sys.executable).parent / "foresee"

    def asked(line: str, instruction: str) -> str:
        settings = {**os.environ, "_FORESEE_COMPLETE": instruction, "_TYPER_COMPLETE_ARGS": line,
                    "_TYPER_COMPLETE_FISH_ACTION": "get-args"}  # fmt: skip
        return subprocess.run([program], cwd=tmp_path, capture_output=True, text=True, check=False, env=settings).stdout

    assert asked("foresee run street.foresee::s", "complete_fish").split() == [
        "street.foresee::slow",
        "street.foresee::slower",
    ]
    assert r"street.foresee\\:\\:quick" in asked("foresee check street.foresee::q", "complete_zsh")
    assert asked("foresee run half.foresee::", "complete_fish").strip() == ""
    offered = asked("foresee ", "complete_fish")
    assert all(f"{name}\t" in offered for _, name, _ in COMMANDS)
