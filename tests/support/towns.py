"""Short scenarios on the bundled town, for drivers to be run through by the real simulator."""

from __future__ import annotations

import shutil
from pathlib import Path

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run

_HEAD = """foresee 1

scenario {name} {{
  use network "networks/town.foresee"

  ego: car.sedan {{
    route from king_west straight over king_oak
    start at {start} m along ego.route
    start speed 40 km/h
    goal {goal} m past king_oak on ego.route
  }}
  signal king_oak stage {stage} elapsed 1 s
{body}
  expect eventually within {end} s arrived(ego)
  end after {end} s
}}
"""


def town(
    folder: Path,
    scenarios: Path,
    *,
    body: str = "",
    stage: str = "ew_go",
    start: int = 60,
    goal: int = 30,
    end: int = 40,
) -> Path:
    """Write a scenario: along a street with one signalised crossing (stop line some 150 m along), and what `body`
    adds."""
    if not (folder / "networks").exists():
        shutil.copytree(scenarios / "networks", folder / "networks")
        shutil.copy(scenarios / "models.foresee", folder)
    name = f"town_{len(list(folder.glob('*.foresee')))}"
    file = folder / f"{name}.foresee"
    file.write_text(_HEAD.format(name=name, body=body, stage=stage, start=start, goal=goal, end=end), encoding="utf-8")
    return file


def drive_through(file: Path, driver: str, case: str = "") -> RunResult:
    """Run a test case with a fresh driver."""
    bundle = compile_test_case(load_test_case(f"{file}::{case}" if case else str(file)))
    return run(bundle, load_driver(driver))
