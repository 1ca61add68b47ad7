"""Every row of the table in docs/reference/exit-codes.md is a real command with that exit code."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

from foresee_dsl import cli
from foresee_dsl.cli.added import ADDED
from tests.support.small_campaign import TEXT, copy_runs, write_project

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "exit-codes.md").read_text(encoding="utf-8")
ROWS = [(command, int(code)) for command, code in re.findall(r"^\| `(foresee [^`]*)` \| (\d+) \|", PAGE, re.M)]


def test_every_command_has_a_row() -> None:
    named = {command.split()[1] for command, _ in ROWS}
    assert {*(name for _, name, _ in cli.COMMANDS), *ADDED.names()} - named == {"lsp"}


def test_every_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    write_project(tmp_path)
    copy_runs(tmp_path / "out")
    late = re.sub(r"\n  case later.*?\n}", "\n}", TEXT.replace("scenario crosser", "scenario late"), flags=re.S)
    late = late.replace("end after 12 s", "expect eventually within 3 s arrived(ego)\n  end after 3 s")
    (tmp_path / "late.foresee").write_text(late)
    (tmp_path / "wrong.foresee").write_text(TEXT.replace("speed 40 km/h", "speed 40 kmh"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    wrong = []
    for command, expected in ROWS:
        monkeypatch.setattr(sys, "argv", shlex.split(command))
        with pytest.raises(SystemExit) as ended:
            cli.main()
        shown = capfd.readouterr()
        code = ended.value.code or 0
        if code != expected:
            wrong.append(f"{command}: {code}, not {expected}\n{shown.out[-1500:]}{shown.err[-1500:]}")
    assert not wrong, "\n".join(wrong)
