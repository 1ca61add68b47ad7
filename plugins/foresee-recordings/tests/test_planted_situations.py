"""Planted situations are found, and little else; `python -m evaluation.planted` does the same with 100 of each kind."""

from __future__ import annotations

import pytest
from evaluation.planted import score
from evaluation.scenes import MAKERS


@pytest.mark.parametrize("kind", MAKERS)
def test_planted_situations_are_found(kind: str) -> None:
    result = score(kind, each=10, seed=1)
    assert result.planted == 10
    assert result.recall >= 0.9, result.missed
    assert result.precision >= 0.9, [s.sentence for s in result.wrong]
