"""One mistake of several test cases is reported once: by its key, with the first case's numbers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foresee_dsl.compile import placement_mistakes
from foresee_dsl.errors import Diagnostic, Message, Span, measured
from foresee_dsl.language.project.loading import load_test_cases

TEXT = """foresee 1

scenario apart {
  network {
    junction a at (0 m, 0 m)
    junction b at (100 m, 0 m)
    junction c at (100 m, 100 m)
    road main from a to b
    road side from b to c
  }
  param off: length = 20 m
  param road: arm = main
  ego: car.sedan { route [main] }
  vehicle other: car.sedan { route [main]; start at off along road }
  expect never collision(ego)
  case near { road = side }
  case far { off = 40 m; road = side }
  case beyond { off = 400 m }
  case farther { off = 300 m }
}
"""


def test_a_key_leaves_out_measured_numbers_and_nothing_else() -> None:
    place = Span(3, 1, 3, 5)

    def key(name: str, length: str) -> object:
        return Diagnostic.of("FS252", f"{name} starts " + measured(length) + " m off", "", "a.foresee", place).key

    assert key("lead", "1.5") == key("lead", "12.0") != key("other", "1.5")
    message = f"{'lead'} starts " + measured("1.5") + " m off"
    assert message == Message("lead starts 1.5 m off", "lead starts  m off")
    assert Diagnostic.of("FS252", "lane 2", "", "a").key != Diagnostic.of("FS252", "lane 3", "", "a").key
    with pytest.raises(TypeError, match="add messages"):
        _ = f"{measured('3')} m"


def test_cases_that_differ_in_a_number_have_one_mistake_and_in_a_name_two(tmp_path: Path) -> None:
    file = tmp_path / "apart.foresee"
    file.write_text(TEXT)
    found = [re.sub(r"-?\d+\.\d", "N", one.message) for one in placement_mistakes(load_test_cases([str(file)]))]
    assert found == [
        "in case 'near' (and 1 more), other starts on side, off its route",
        "in case 'beyond' (and 1 more), main is only N m long, so it has no place at 400 m",
    ]
