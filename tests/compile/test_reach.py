"""Conditions about places and junctions that their actor never comes near."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.compile import placement_lints
from foresee_dsl.language.checked_files import check_paths

TEXT = """foresee 1

scenario s {
  use network "%s/networks/town.foresee"

  ego: car.sedan {
    route from mill_west straight over mill_oak straight over mill_elm
  }
  pedestrian walker: pedestrian.adult {
    path [(-40 m, -8 m), (-40 m, 10 m)]
  }
  obstacle crate: obstacle.crate {
    start at 30 m along ego.route offset -3 m
  }

  when CONDITION {
    walker starts
  }

  expect never collision(ego)
}
"""


@pytest.mark.parametrize(
    ("condition", "dead"),
    [
        ("ego within 5 m of (-40 m, 90 m)", True),
        ("ego within 80 m of (-40 m, 90 m)", False),
        ("ego within 5 m of 20 m before mill_oak on ego.route offset 4 m", False),
        ("ego within 5 m of king_oak", True),
        ("ego within 1 m of mill_oak", False),
        ("walker within 1 m of (-43 m, 0 m)", True),
        ("walker within 1 m of (-41 m, 0 m)", False),
        ("crate within 2 m of 40 m along ego.route or time > 3 s", True),
        ("ego within 2 m of 900 m ahead of walker", False),
        ("ego within 5 m of walker", False),
        ("ego within 5 m of (-40 m, 90 m) {  # foresee: allow FS330", False),
    ],
)
def test_a_place_that_an_actor_never_comes_near(scenarios: Path, tmp_path: Path, condition: str, dead: bool) -> None:
    file = tmp_path / "s.foresee"
    whole = condition if "{" in condition else f"{condition} {{"
    file.write_text((TEXT % scenarios).replace("CONDITION {", whole))
    checked = check_paths([str(file)])
    assert not checked.diagnostics
    found = placement_lints(checked.cases)
    assert [d.code for d in found] == ["FS330"] * dead
    assert all(d.severity == "warning" and d.span is not None and d.span.line == 16 for d in found)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("ignores signals at king_oak", "runner never passes king_oak, so this has no effect"),
        ("ignores priority at mill_oak", ""),
        ("ignores priority at mill_elm", ""),  # its route ends there
        ("ignores priority at king_oak  # foresee: allow FS333", ""),
    ],
)
def test_a_rule_at_a_junction_that_an_actor_never_passes(
    scenarios: Path, tmp_path: Path, lines: str, message: str
) -> None:
    assert never_passed(scenarios, tmp_path, statement=lines) == [message] * bool(message)
    action = f"runner {lines}"
    assert never_passed(scenarios, tmp_path, action=action) == [message] * bool(message)
    assert never_passed(scenarios, tmp_path, action=f"runner follows [(0 m, 0 m), (9 m, 9 m)]\n{action}") == []


def test_a_meeting_at_a_junction_that_a_walker_never_passes(scenarios: Path, tmp_path: Path) -> None:
    meets = "walker meets ego at mill_oak after 1 s"
    message = "walker never passes mill_oak, so this has no effect"
    assert never_passed(scenarios, tmp_path, action=meets) == [message]


def never_passed(scenarios: Path, folder: Path, *, statement: str = "", action: str = "walker starts") -> list[str]:
    file = folder / "s.foresee"
    route = "route [mill_west, mill_mid]\n    start at 20 m along runner.route"
    runner = f"  vehicle runner: car.compact {{\n    {route}\n    {statement}\n  }}\n  when"
    text = (TEXT % scenarios).replace("CONDITION", "time > 1 s").replace("  when", runner)
    file.write_text(text.replace("walker starts", action))
    checked = check_paths([str(file)])
    assert not checked.diagnostics
    found = placement_lints(checked.cases)
    assert {d.code for d in found} <= {"FS333"}
    return [d.message for d in found]
