"""Kills at random moments: every finished run is kept, none is done twice, and the report comes out the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.chaos import check
from tests.support.small_campaign import write_project


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="it looks for processes in /proc")
def test_a_campaign_that_is_killed_again_and_again_ends_as_if_nothing_had_happened(tmp_path: Path) -> None:
    found = check(write_project(tmp_path / "project"), tmp_path, kills=3, seed=5, more=("--allocation", "stories"))
    assert sum(found.killed.values()) == 3
    assert found.ends["0"] >= 1
