"""Golden cases: `tests/cases/campaign/NAME/` holds a scenario file and what a small campaign on it publishes.

Everything is run: SUMO, the driver idm, forecast, clips, mutants, children. `pytest --rewrite-goldens` writes the
campaign's figures and its children anew.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.goldens import Golden, readable
from tests.support.small_campaign import campaign, published

CASES = sorted((Path(__file__).parents[1] / "cases" / "campaign").iterdir())


@pytest.mark.parametrize("folder", CASES, ids=lambda folder: folder.name)
def test_golden(folder: Path, golden: Golden, tmp_path: Path) -> None:
    file = tmp_path / folder.name / "scenario.foresee"
    file.parent.mkdir()
    file.write_bytes((folder / "scenario.foresee").read_bytes())
    campaign(file, tmp_path / "out")
    found = published(tmp_path / "out")
    assert found["files"]
    figures = re.sub(r'"sha256:\w+"', '"sha256:..."', readable(found["json"]))  # the last bits depend on the processor
    golden(figures.replace(str(tmp_path), "PROJECT"), folder / "campaign.json")
    children = "\n".join(f"==> {name}\n{text.decode()}" for name, text in found["files"].items())
    golden(children, folder / "children.txt")
