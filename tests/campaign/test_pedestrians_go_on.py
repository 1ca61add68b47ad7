"""Pedestrians go on in a clip as they did in the run, wherever they are at its first frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import SPEED

FOR_S = 5.0
MOMENTS = 10


@pytest.mark.parametrize("name", ["scenario3.foresee::r01", "scenario9.foresee::r01"])
def test_at_many_moments_of_a_run(scenarios: Path, tmp_path: Path, name: str) -> None:
    """On crossings, at corners, waiting at red, on paths of their own, and of the background traffic."""
    case = load_test_case(f"{scenarios}/{name}")
    trace = run_test_case(case, "idm", 0).trace
    walkers = [k for k, info in enumerate(trace.actors) if info.kind == "pedestrian"]
    assert len(walkers) >= 5
    stood = walked = 0
    for k, frame in enumerate(np.linspace(0, trace.frames - FOR_S * 20 - 1, MOMENTS).astype(int).tolist()):
        file = tmp_path / f"p{k}.foresee"
        point = RiskyPoint(1, frame, frame * 0.05, "", "none", float("nan"), float("nan"), 0.0, "a test")
        clip = parse(print_model(clip_around(case, trace, point, file, before_s=0.0, after_s=FOR_S)), str(file)).model
        found = measure_clip(clip, case, trace, file, DriverSetup("idm"))[3]  # type: ignore[arg-type]  # it is a clip
        assert found.frames >= FOR_S * 20
        far = {trace.actors[w].id: found.actors.get(trace.actors[w].id, 0.0) for w in walkers}
        assert max(far.values()) < 0.01, (frame, far)
        speeds = trace.states[frame, walkers, SPEED]
        stood, walked = stood + int((speeds == 0).sum()), walked + int((speeds > 0).sum())
    # Some of them waited at these moments, and some walked.
    assert stood > 0
    assert walked > MOMENTS
