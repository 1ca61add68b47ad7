"""Golden cases: `tests/cases/derive/NAME/` holds a recorded run, the clip of its first risky point, and its mutants.

`trace.npz` is a run of `scenario.foresee` with the driver idm, `clip.npz` the unmutated run of the clip, so a case
tests clipping and mutation alone. `pytest --rewrite-goldens` records both runs again and writes the children.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip
from tests.support.goldens import Golden, recorded_run

CASES = sorted((Path(__file__).parents[1] / "cases" / "derive").iterdir())


@pytest.mark.parametrize("folder", CASES, ids=lambda folder: folder.name)
def test_golden(folder: Path, golden: Golden) -> None:
    case, trace = recorded_run(folder, rewrite=golden.rewrite)
    point = load_ranker("foresee").rank(trace, seed=0, before_s=2.0, after_s=2.0)[0]
    file = folder / f"{folder.name}_p1.foresee"
    clip = clip_around(case, trace, point, file, before_s=2.0, after_s=2.0)
    golden(print_model(clip), file)
    clip_case, clip_trace = recorded_run(folder, "clip", expand_clip(clip, case, source=file), rewrite=golden.rewrite)
    for preset in PRESETS:
        mutants = mutate(clip_case, clip, clip_trace, preset=preset, count=3, seed=0)
        assert mutants
        golden("\n".join(print_model(mutant) for mutant in mutants), folder / f"mutants_{preset}.txt")
