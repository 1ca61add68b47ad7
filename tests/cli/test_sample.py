"""`foresee sample`, and `--allow-outside`, as a user meets them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from foresee_dsl.cli import app
from foresee_dsl.cli.options.common import explain_error

NETWORK = """foresee 1

network town {
  junction a at (0 m, 0 m)
  junction b at (200 m, 0 m)
  road main from a to b
}
"""
SCENARIO = """foresee 1

scenario s {
  use network "town.foresee"
  param gap: length = 40 m in 10 m..80 m step 1 m
  param pace: speed = 20 km/h in [20 km/h, 30 km/h] as grid
  require gap > 20 m
  ego: car.sedan { route [main]; start at gap along main; speed pace }
  expect never collision(ego)
  cases 4 from seed 7
}
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("town.foresee").write_text(NETWORK)
    Path("s.foresee").write_text(SCENARIO)
    return "s.foresee"


def foresee(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def test_the_scenarios_own_cases_and_what_they_reach(file: str) -> None:
    done = foresee("sample", file)
    assert done.exit_code == 0
    lines = done.output.splitlines()
    assert lines[0].split() == ["case", "gap", "pace"]
    assert [line.split()[0] for line in lines[1:5]] == ["seed7_01", "seed7_02", "seed7_03", "seed7_04"]
    assert lines[-2:] == ["pace: 2 of 2 options (100%)", "pairs of values: 4 of 20 occur together (20%)"]
    assert max(map(len, lines)) <= 80


def test_json_and_lines_to_paste_are_the_same_cases(file: str) -> None:
    data = json.loads(foresee("sample", file, "--format", "json", "--count", "3", "--seed", "9").output)
    assert [case["name"] for case in data["cases"]] == ["seed9_01", "seed9_02", "seed9_03"]
    assert data["parameters"][1] == {
        "name": "pace", "smallest": "20 km/h", "largest": "30 km/h", "reached": 2, "bins": 2, "of": "options"
    }  # fmt: skip
    pasted = foresee("sample", file, "--format", "cases", "--count", "3", "--seed", "9").output
    Path("pasted.foresee").write_text(SCENARIO.replace("  cases 4 from seed 7\n", pasted))
    again = json.loads(foresee("sample", "pasted.foresee", "--format", "json").output)
    assert again["cases"] == data["cases"]


def test_wide_tables_are_cut_into_blocks(file: str) -> None:
    more = "".join(f"  param some_long_name_{k}: time = 1 s in 0 s..9 s\n" for k in range(6))
    Path(file).write_text(SCENARIO.replace("  require", f"{more}  require"))
    lines = foresee("sample", file).output.splitlines()
    assert max(map(len, lines)) <= 80
    assert sum(line.startswith("case ") for line in lines) == 2


def test_nothing_to_draw(file: str) -> None:
    Path(file).write_text(SCENARIO.replace(" in 10 m..80 m step 1 m", "").replace(" in [20 km/h, 30 km/h] as grid", ""))
    done = foresee("sample", file, "--count", "3")
    assert isinstance(done.exception, Exception)
    assert "no parameter with a range or options" in str(done.exception)


@pytest.mark.parametrize("command", ["check", "expand"])
def test_files_outside_need_a_word(file: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("work").mkdir()
    text = SCENARIO.replace('"town', '"../town').replace("  cases 4 from seed 7\n", "  case a\n")
    Path("work", file).write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir("work")
        address = f"{file}::a" if command == "expand" else file
        refused = foresee(command, address)
        assert refused.exit_code == 1
        if isinstance(refused.exception, Exception):
            explain_error(refused.exception)  # what `main` does with it
        assert "FS138" in refused.output + capsys.readouterr().err
        assert foresee(command, address, "--allow-outside").exit_code == 0
