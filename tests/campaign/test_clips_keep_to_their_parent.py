"""Clips of real runs: rebuilt from their text, they go on as the run that they were cut from did."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.derive.clipping.fidelity import WITHIN_M, ClipDeviation
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Actor, Clip, EdgeRoute, Ego, MeetsState, When
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import Trace


@lru_cache(maxsize=4)
def parent_of(address: str) -> tuple[TestCase, Trace]:
    case = load_test_case(address)
    return case, run_test_case(case, "pdm", 0).trace


def cut(address: str, frame: int, folder: Path) -> tuple[Clip, ClipDeviation]:
    """Cut from this frame on, 8 s, and run what the text says."""
    case, trace = parent_of(address)
    point = RiskyPoint(1, frame + 60, (frame + 60) * 0.05, "", "none", float("nan"), float("nan"), 0.0, "a test")
    file = folder / "clip.foresee"
    clip = parse(print_model(clip_around(case, trace, point, file, before_s=3.0, after_s=5.0)), str(file)).model
    assert isinstance(clip, Clip)
    return clip, measure_clip(clip, case, trace, file, DriverSetup("pdm"))[3]


def actors_of(clip: Clip) -> list[Actor]:
    return [item for item in clip.body if isinstance(item, Actor)]


@pytest.mark.parametrize("frame", [0, 20, 60, 140, 180])
def test_on_a_real_map(carla: Path, tmp_path: Path, frame: int) -> None:
    """With lane changes, vehicles inside junctions, and lanes beside sidewalks."""
    text = (Path(__file__).parent / "town10hd.foresee").read_text()
    file = tmp_path / "town10hd.foresee"
    file.write_text(text.replace("Town10HD.xodr", str(carla / "maps" / "xodr" / "Town10HD.xodr")))
    _, found = cut(str(file), frame, tmp_path)
    assert found.largest_others_m < WITHIN_M, found.actors  # the ego's driver starts afresh


def test_who_keeps_its_speed_near_a_junction_does_so_in_the_clip(scenarios: Path, tmp_path: Path) -> None:
    address = f"{scenarios}/scenario9.foresee::r01"
    _, trace = parent_of(address)
    keeps, met = (next(e for e in trace.events if e.what == what) for what in ("keeps_speed", "met"))
    for frame in (trace.frame_at(keeps.time_s), trace.frame_at((keeps.time_s + met.time_s) / 2)):
        clip, found = cut(address, frame, tmp_path)
        actor = next(a for a in actors_of(clip) if a.name == keeps.actor)
        assert not any(isinstance(item, MeetsState) for item in actor.body)
        assert any(
            action.actor == keeps.actor for when in clip.body if isinstance(when, When) for action in when.actions
        )
        assert found.actors[keeps.actor] < WITHIN_M
    clip, _ = cut(address, trace.frame_at(keeps.time_s) - 20, tmp_path)
    assert any(isinstance(item, MeetsState) for a in actors_of(clip) for item in a.body)


def test_the_driver_keeps_its_line_when_it_has_changed_its_lane(scenarios: Path, tmp_path: Path) -> None:
    """What is behind the ego is part of its route: the line to follow hangs on where it came from."""
    address = f"{scenarios}/scenario4.foresee::r01"
    _, trace = parent_of(address)
    clip, _ = cut(address, trace.frames - 100, tmp_path)
    ego = next(item for item in clip.body if isinstance(item, Ego))
    route = next(item for item in ego.body if isinstance(item, EdgeRoute))
    assert route.edges == trace.actors[0].route


def test_nearly_all_of_a_busy_run(scenarios: Path, tmp_path: Path) -> None:
    address = f"{scenarios}/scenario8.foresee::r02"
    _, trace = parent_of(address)
    found = [cut(address, frame, tmp_path)[1] for frame in range(0, trace.frames - 100, 60)]
    # Where the ego goes another way, as its driver starts afresh, the others rightly make room for it.
    true = [one for one in found if one.ego_m <= WITHIN_M]
    assert len(true) > len(found) / 2
    values = [value for one in true for value in one.actors.values()]
    assert sum(value <= WITHIN_M for value in values) / len(values) >= 0.995
    assert sum(one.largest_m <= WITHIN_M for one in true) / len(true) >= 0.9
