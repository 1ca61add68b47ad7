"""The command line's contract: names, exit codes, JSON, what users see of their mistakes. Real processes and SUMO."""

from __future__ import annotations

import inspect
import json
import os
import re
import subprocess
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer

from foresee_dsl import cli
from tests.support.command import foresee

VERDICTS = {"pass", "F1", "F2", "F3", "F4", "F5", "stuck", "timeout", "crash", "invalid"}


def test_every_command_is_there_and_explains_itself() -> None:
    text = foresee("--help").stdout
    names = [
        "check",
        "fmt",
        "compile",
        "run",
        "forecast",
        "clip",
        "mutate",
        "expand",
        "campaign",
        "verify",
        "diff",
        "doctor",
        "drivers",
        "models",
    ]
    for name in names:
        assert name in text
        assert "Usage" in foresee(name, "--help").stdout


def test_the_help_has_the_first_line_of_each_command() -> None:
    text = foresee("--help").stdout
    for _, name, function in cli.COMMANDS:
        module, _, attribute = f"foresee_dsl.cli.{function}".rpartition(".")
        command = getattr(import_module(module), attribute)
        meant = command.info.help if isinstance(command, typer.Typer) else inspect.getdoc(command)
        assert meant and " ".join(meant.split()[:3]) in text, name


def test_wrong_usage_is_2(scenarios: Path) -> None:
    foresee("nonsense", expect=2)
    foresee("run", expect=2)
    foresee("run", scenarios / "scenario3.foresee", "--seed", "x", expect=2)


def test_one_run_through_all_steps(scenarios: Path, tmp_path: Path) -> None:
    address = f"{scenarios / 'scenario7.foresee'}::r01"
    run = json.loads(
        foresee("run", address, "--driver", "pdm", "--seed", "0", "--out", tmp_path / "runs", "--json").stdout
    )
    assert next(iter(run)) == "schema"
    assert run["schema"] == 1
    assert {
        "test_case",
        "driver",
        "seed",
        "verdict",
        "time_s",
        "with",
        "duration_s",
        "steps",
        "trace",
        "digest",
    } <= set(run)
    assert run["verdict"] == "pass"
    again = json.loads(foresee("run", address, "--json").stdout)
    assert again["digest"] == run["digest"]

    points = json.loads(foresee("forecast", run["trace"], "--ranker", "foresee", "--json").stdout)["risky_points"]
    assert [p["rank"] for p in points] == list(range(1, len(points) + 1))
    assert {"rank", "time_s", "frame", "actor", "group", "distance_m", "why"} <= set(points[0])

    clip = json.loads(foresee("clip", run["trace"], "--rank", "1", "--out", tmp_path / "clips", "--json").stdout)
    text = Path(clip["clip"]).read_text()
    assert text.startswith("foresee 1\n\nclip red_light_runner_r01_p1 of ")
    assert len(text.splitlines()) < 200
    assert clip["fidelity_m"] < 0.1

    junit = tmp_path / "mutants.xml"
    options = ("--children", "3", "--json", "--junit", junit, "--exit-zero")
    mutants = json.loads(foresee("mutate", clip["clip"], *options).stdout)["children"]
    assert len(mutants) == 3
    tests = ElementTree.parse(junit).findall(".//testcase")
    assert [test.get("name") for test in tests] == [Path(mutant["file"]).stem for mutant in mutants]
    assert [not len(test) for test in tests] == [mutant["verdict"] == "pass" for mutant in mutants]
    for mutant in mutants:
        assert mutant["verdict"] in VERDICTS
        expanded = foresee("expand", mutant["file"]).stdout
        assert expanded.startswith("foresee 1\n\n# The mutant ") and "\nscenario " in expanded
        child = json.loads(foresee("run", mutant["file"], "--json", "--exit-zero").stdout)
        assert child["digest"] == mutant["digest"]
        # The expanded text is a scenario of its own, and it means the same.
        whole = Path(clip["clip"]).with_name("whole.foresee")
        whole.write_text(expanded)
        assert json.loads(foresee("run", whole, "--json", "--exit-zero").stdout)["verdict"] == mutant["verdict"]
    assert re.search(
        r"^  .*\b\w+\.(model|steer|timing|delay|line|moving)\b",
        foresee("diff", clip["clip"], mutants[0]["file"]).stdout,
        re.M,
    )


def test_one_number_changed_by_hand_still_runs(scenarios: Path, tmp_path: Path) -> None:
    address = f"{scenarios / 'scenario8.foresee'}::r01"
    run = json.loads(foresee("run", address, "--out", tmp_path, "--json").stdout)
    clip = Path(json.loads(foresee("clip", run["trace"], "--out", tmp_path, "--json").stdout)["clip"])
    lines = clip.read_text().splitlines()
    k = next(i for i, line in enumerate(lines) if line.startswith("  vehicle ") and " speed " in line)
    head, _, tail = lines[k].partition(" speed ")
    lines[k] = f"{head} speed 5.5 {tail.partition(' ')[2]}"
    clip.write_text("\n".join(lines) + "\n")
    assert json.loads(foresee("run", clip, "--json", "--exit-zero").stdout)["verdict"] in VERDICTS


GOOD = """foresee 1

scenario s {
  use network "NETWORK"

  ego: car.sedan {
    route from mill_west straight over mill_oak
  }
  vehicle other: car.compact {
    route from oak_south straight over mill_oak
  }

  expect never collision(ego)
  end after 5 s
}
"""


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("car.sedan", "car.sedann", "car.sedan"),
        ("expect never", "expct never", "expect"),
        ("end after 5 s", "end after 5 m", "time"),
        ("end after 5 s", "end after 5 sec", "s"),
        ("  end after 5 s\n}", "  end after 5 s\n", "}"),
        ("route from oak_south straight", "route from oak_south left over king_oak straight", "king_oak"),
        ("from oak_south", "from oak_suoth", "oak_south"),
        (
            "    route from oak_south straight over mill_oak\n",
            "    start at (4000 m, 4000 m)\n    route [oak_south]\n",
            "off its route",
        ),
        (
            "    route from oak_south straight over mill_oak\n",
            "    route [mill_west]\n    start at 2 m along mill_west\n",
            "ego",
        ),
        ('"NETWORK"', '"missing.foresee"', "missing.foresee"),
        ('"NETWORK"', '"s.foresee"', "s.foresee"),
    ],
    ids=[
        "model",
        "keyword",
        "dimension",
        "unit",
        "brace",
        "unreachable",
        "arm",
        "off_road",
        "on_top",
        "no_network",
        "itself",
    ],
)
def test_a_mistake_is_shown_where_it_is(old: str, new: str, says: str, scenarios: Path, tmp_path: Path) -> None:
    assert old in GOOD
    file = tmp_path / "s.foresee"
    network = os.path.relpath(scenarios / "networks" / "town.foresee", tmp_path)
    if "itself" not in new:
        file.write_text(GOOD.replace("NETWORK", network) if "NETWORK" not in old else GOOD.replace(old, new))
    if "NETWORK" not in old:
        assert foresee("check", file).returncode == 0
        file.write_text(GOOD.replace("NETWORK", network).replace(old, new))
    before = sorted(tmp_path.iterdir())
    for command in (
        ("check", file),
        ("run", file, "--out", tmp_path / "out"),
        ("campaign", file, "--out", tmp_path / "out"),
    ):
        done = foresee(*command, expect=1)
        assert says in done.stderr
        assert f"{file.name}:" in done.stderr
        assert "^" in done.stderr
        assert "help:" in done.stderr
    assert sorted(tmp_path.iterdir()) == before, "nothing is written"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "empty"),
        (bytes(range(256)) * 40, "text"),
        (b"foresee 1\n\nscenario s {\n" + b"a" * 1_000_000 + b"\n}\n", "statement"),
        (b"foresee 9\n\nscenario s {\n}\n", "version"),
    ],
    ids=["empty", "binary", "long_line", "version"],
)
def test_files_that_are_no_scenario(content: bytes, says: str, tmp_path: Path) -> None:
    file = tmp_path / "s.foresee"
    file.write_bytes(content)
    done = foresee("check", file, expect=1)
    assert says in done.stderr.lower()
    assert len(done.stderr) < 2000


def test_a_file_or_folder_that_is_not_there(tmp_path: Path) -> None:
    assert "no file" in foresee("run", tmp_path / "x.foresee", expect=1).stderr.lower()
    assert foresee("check", tmp_path / "x", expect=1).stderr


def test_unknown_names_on_the_command_line(scenarios: Path) -> None:
    address = f"{scenarios / 'scenario3.foresee'}::r01"
    assert "pdm" in foresee("run", address, "--driver", "pdn", expect=1).stderr
    assert "foresee" in foresee("campaign", address, "--ranker", "forsee", expect=1).stderr
    assert "focused" in foresee("campaign", address, "--preset", "focussed", expect=1).stderr
    assert "r01" in foresee("run", f"{scenarios / 'scenario3.foresee'}::r99", expect=1).stderr


def test_check_and_fmt_of_the_bundled_scenarios(scenarios: Path) -> None:
    data = json.loads(foresee("check", scenarios, "--json").stdout)
    assert data["ok"]
    assert data["test_cases"] >= 20
    foresee("fmt", "--check", scenarios)


def test_drivers_models_and_doctor() -> None:
    assert "pdm" in foresee("drivers").stdout
    assert "car.sedan" in foresee("models").stdout
    report = json.loads(foresee("doctor", "--json").stdout)
    assert report["ok"]


def test_compile_gives_something_that_sumo_runs(scenarios: Path, tmp_path: Path) -> None:
    import sumo

    foresee("compile", f"{scenarios / 'scenario9.foresee'}::r01", "--out", tmp_path / "c")
    config = next((tmp_path / "c").glob("*.sumocfg"))
    program = Path(sumo.SUMO_HOME) / "bin" / "sumo"
    done = subprocess.run([program, "-c", config, "--end", "20"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_trace_that_is_none_or_damaged(scenarios: Path, tmp_path: Path) -> None:
    assert "is not a trace" in foresee("forecast", scenarios / "scenario3.foresee", expect=1).stderr
    (tmp_path / "cut.npz").write_bytes(b"PK\x03\x04 and then nothing")
    assert "damaged" in foresee("forecast", tmp_path / "cut.npz", expect=1).stderr
    assert "No such file" in foresee("clip", tmp_path / "none.npz", expect=1).stderr


def test_a_folder_without_recorded_failures(scenarios: Path, tmp_path: Path) -> None:
    assert "there are no tests" in foresee("verify", tmp_path).stdout  # a project begins with an empty suite
    refused = foresee("verify", scenarios, expect=1).stderr
    assert "FS132: the scenarios in this folder have no expected results" in refused
    assert "the folder that `foresee keep` writes" in refused
    foresee("verify", tmp_path, scenarios, "--json", expect=1)
