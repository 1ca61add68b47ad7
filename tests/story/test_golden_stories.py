"""Golden stories: `tests/cases/story/NAME/` holds a scenario, its recorded run (driver idm), and the story told of it.

`pytest --rewrite-goldens` drives the scenarios again and writes runs and stories anew.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.story import tell
from tests.support.goldens import Golden, readable, recorded_run

CASES = sorted((Path(__file__).parents[1] / "cases" / "story").iterdir())


@pytest.mark.parametrize("folder", CASES, ids=lambda folder: folder.name)
def test_golden(folder: Path, golden: Golden) -> None:
    case, trace = recorded_run(folder, rewrite=golden.rewrite)
    golden(readable(tell(trace, case)), folder / "story.json")
