"""How a slippery patch is written: in a scenario, in one that extends it, and where it is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SlipperyPatch
from foresee_dsl.errors import InputError
from foresee_dsl.language.project.loading import load_test_case

BASE = """foresee 1

scenario base {
  network {
    junction a at (0 m, 0 m)
    junction b at (200 m, 0 m)
    road main from a to b
  }

  slippery oil at 20 m ahead of ego radius 2 m friction 0.2

  ego: car.sedan {
    route [main]
    start at 20 m along main
  }

  end after 2 s
}
"""
EXTENSION = """foresee 1

scenario more extends "base.foresee" {
  LINE
}
"""


def patches(folder: Path, line: str) -> tuple[SlipperyPatch, ...]:
    """The patches of an extension with one line."""
    (folder / "base.foresee").write_text(BASE)
    file = folder / "more.foresee"
    file.write_text(EXTENSION.replace("LINE", line))
    return compile_test_case(load_test_case(str(file))).scene.slippery


def test_a_patch_is_added_changed_and_dropped_by_its_name(tmp_path: Path) -> None:
    added = patches(tmp_path, "add slippery ice at (80 m, -1.65 m) radius 3 m friction 0.1")
    assert [patch.name for patch in added] == ["oil", "ice"]
    assert (added[1].x, added[1].y, added[1].radius_m, added[1].friction) == (80.0, -1.65, 3.0, 0.1)
    assert round(added[0].x, 2) == 40.0
    (changed,) = patches(tmp_path, "change slippery oil at 30 m along main radius 50 cm friction 0.4")
    assert (round(changed.x, 2), changed.radius_m, changed.friction) == (30.0, 0.5, 0.4)
    assert patches(tmp_path, "drop slippery oil") == ()


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("add slippery oil at (1 m, 2 m) radius 1 m friction 0.1", "FS127"),
        ("add slippery ice at (1 m, 2 m) radius 1 m friction 0", "FS050"),
        ("add slippery ice at (1 m, 2 m) radius 1 s friction 0.1", "FS010"),
        ("add slippery ice at 500 m along main radius 1 m friction 0.1", "FS252"),
        ("add slippery ice at 2 m ahead of nobody radius 1 m friction 0.1", "FS037"),
        ("drop slippery ice", "FS126"),
    ],
)
def test_what_cannot_be_has_its_code(tmp_path: Path, line: str, code: str) -> None:
    with pytest.raises(InputError) as caught:
        patches(tmp_path, line)
    assert caught.value.diagnostics[0].code == code
