"""`foresee init --driver NAME` for bridges: what is written completes its scenarios."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from foresee_dsl.exchange.driver_kinds import DRIVER_KINDS, driver_kinds
from tests.support.command import pytest_program
from tests.support.first_project import foresee


@pytest.mark.parametrize("name", [entry.name for entry in DRIVER_KINDS.entries() if "foresee_bridges" in entry.value])
def test_a_written_driver_completes_its_scenarios(name: str, tmp_path: Path) -> None:
    kind = driver_kinds()[name]
    foresee("init", tmp_path / "project", "--driver", name)
    command = [pytest_program(), "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path / "project", capture_output=True, text=True, check=False)
    assert "4 passed" in done.stdout, f"{kind.driver}\n{done.stdout}"
