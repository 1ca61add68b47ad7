"""Obstacles that are moved: files of others have such things as a camera on a cart."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import X
from tests.support.small_campaign import TEXT

MODELS = """foresee 1

models things {
  model obstacle.cart {
    length 1 m
    width 1 m
    max_speed 5 m/s
    source "made for this test"
  }
}
"""
CART = """  use models "things.foresee"

  obstacle cart: obstacle.cart at (20 m, 20 m) heading 0 deg speed 0 m/s {
    path [(20 m, 20 m), (60 m, 20 m)]
    speed 2 m/s
  }

  when ego"""


def test_an_obstacle_with_a_path_is_pushed_along(tmp_path: Path) -> None:
    """Its model cannot speed up or brake, so it is moved with rates of its own."""
    file = tmp_path / "pushed.foresee"
    (tmp_path / "things.foresee").write_text(MODELS)
    file.write_text(TEXT.replace("  when ego", CART, 1))
    result = run_test_case(load_test_case(f"{file}::later"), "idm", 0)
    assert result.verdict is not Verdict.CRASH, result.reason
    moved = result.trace.states[:, result.trace.index("cart"), X]
    assert moved[0] == pytest.approx(20.0) and moved[-1] > 25.0
