"""Helps use the names of the author's text where they show an example; names that an example declares stay."""

from __future__ import annotations

import pytest

from foresee_dsl.errors import Diagnostic
from foresee_dsl.helps import Write
from foresee_dsl.language.messages.own_names import with_own_names

_TEXT = """
  # junction commented at (0 m, 0 m)
  junction end at (-9 m, 0 m)
  junction middle at (0 m, 0 m)
  road north from end to middle
  vehicle rude: van.delivery { route from north over middle }
"""


@pytest.mark.parametrize(
    ("help", "said"),
    [
        ("write `ego in junction j4`", "write `ego in junction middle`"),
        ("like `runner meets lead at j4`", "like `rude meets lead at middle`"),
        ("such as `runner`", "such as `runner`"),
        ("write it like `junction j4 at (0 m, 0 m)`", "write it like `junction j4 at (0 m, 0 m)`"),
        ("write it like `vehicle runner: car.sedan`", "write it like `vehicle runner: car.sedan`"),
        ("the runner waits", "the runner waits"),
        ("like `walker starts`", "like `walker starts`"),
    ],
)
def test_examples_have_the_names_of_the_text(help: str, said: str) -> None:
    (found,) = with_own_names([Diagnostic("FS001", "x", help)], _TEXT)
    assert found.help == said


def test_what_a_fix_writes_has_them_too() -> None:
    given = Diagnostic("FS001", "x", "write `ego.eta(j4)`", fixes=(Write("ego.eta(j4)"),))
    (found,) = with_own_names([given], _TEXT)
    assert (found.help, found.fixes) == ("write `ego.eta(middle)`", (Write("ego.eta(middle)"),))
    (same,) = with_own_names([given], _TEXT + "junction j4 at (5 m, 5 m)")
    assert same == given
