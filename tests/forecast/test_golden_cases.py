"""Golden cases: `tests/cases/forecast/NAME/` holds a recorded run and what each bundled ranker finds in it.

`trace.npz` is a run of `scenario.foresee` with the driver idm, so a case tests the rankers alone.
`pytest --rewrite-goldens` records the run again and writes `risky_points.json`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.forecast.protocol import NeedsSurroundings
from foresee_dsl.forecast.registry import RANKERS, load_ranker
from tests.support.goldens import Golden, readable, recorded_run

CASES = sorted((Path(__file__).parents[1] / "cases" / "forecast").iterdir())


@pytest.mark.parametrize("folder", CASES, ids=lambda folder: folder.name)
def test_golden(folder: Path, golden: Golden) -> None:
    _, trace = recorded_run(folder, rewrite=golden.rewrite)
    rankers = {name: load_ranker(name) for name in RANKERS.names()}
    found = {
        name: ranker.rank(trace, seed=0, before_s=2.0, after_s=2.0)
        for name, ranker in rankers.items()
        if not isinstance(ranker, NeedsSurroundings)  # those have trained weights, and tests of their own
    }
    assert any(found.values())
    golden(readable(found), folder / "risky_points.json")
