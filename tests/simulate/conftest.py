"""The town that the simulation tests share."""

from __future__ import annotations

import pytest

from tests.support.nets import build_grid
from tests.support.scenes import Town


@pytest.fixture(scope="session")
def town(tmp_path_factory: pytest.TempPathFactory) -> Town:
    """A grid of 4 x 4 junctions with signals at n11 and n22."""
    return Town(*build_grid(tmp_path_factory.mktemp("town")))
