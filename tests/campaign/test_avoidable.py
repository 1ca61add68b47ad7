"""A small real campaign with the ranker `careful` and the preset `avoidable`."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from foresee_dsl.avoidance.candidates.behaviours import Kind
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.report.terminal.campaign import print_campaign
from foresee_dsl.simulate.results.verdict import Verdict
from tests.support.small_campaign import SETTINGS, TEXT, Heard, campaign, write_project

SCENARIOS = Path(__file__).parents[2] / "scenarios"
LONELY = """foresee 1

# The ego drives behind a car that is far ahead.
scenario lonely {
  network straight {
    junction west at (0 m, 0 m)
    junction east at (400 m, 0 m)
    road in from west to east { lanes 1; speed 50 km/h }
  }

  ego: car.sedan {
    route [in]
    start at 25 m along in
    start speed 36 km/h
    goal 330 m along in
  }
  vehicle other: car.compact {
    route [in]
    start at 150 m along in
    start speed 50 km/h
    speed 50 km/h
  }

  expect never collision(ego)
  end after 15 s anywhere
}
"""
SEARCH = replace(SETTINGS, ranker="careful", preset="avoidable", children=4, against=("pdm",))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> CampaignResult:
    folder = tmp_path_factory.mktemp("avoidable")
    (folder / "crosser.foresee").write_text(TEXT, encoding="utf-8")
    cases = load_test_cases([f"{folder / 'crosser.foresee'}::last"])
    with Store(folder / "store") as store:
        return run_campaign(cases, SEARCH, out=folder / "out", store=store)


def test_a_failure_is_found_and_a_driver_that_only_comes_earlier_does_not_count_as_avoiding_it(
    found: CampaignResult,
) -> None:
    assert not found.broken
    children = [child for clip in found.clips for child in clip.children]
    assert children
    assert {name for child in children for name in child.operators} <= {*Kind}
    (run,) = [run for child in children for run in child.references if run.passes]
    assert not run.avoids
    assert run.apart == "it would come there 1.0 s earlier in any case"


def test_clips_are_cut_only_where_something_good_may_be_found(found: CampaignResult, tmp_path: Path) -> None:
    """On an empty road, with one car far ahead, there is nobody to behave otherwise; other presets cut clips there."""
    assert found.clips
    (tmp_path / "lonely.foresee").write_text(LONELY, encoding="utf-8")
    cases = load_test_cases([tmp_path / "lonely.foresee"])
    cut = {}
    for preset in ("avoidable", "focused"):
        with Store(tmp_path / "store") as store:
            settings = replace(SETTINGS, ranker="random", preset=preset, children=1)
            result = run_campaign(cases, settings, out=tmp_path / preset, store=store)
        assert not result.broken
        cut[preset] = len(result.clips)
    assert cut == {"avoidable": 0, "focused": 2}


@pytest.fixture(scope="module")
def red_light(tmp_path_factory: pytest.TempPathFactory) -> tuple[CampaignResult, Heard, Path]:
    """A campaign about two vehicles that run a red light, in its folder; two of its clips fail or deviate."""
    out = tmp_path_factory.mktemp("red_light")
    cases = [SCENARIOS / "scenario7.foresee::r02", SCENARIOS / "scenario7.foresee::r03"]
    result, heard = campaign(cases, out, CampaignSettings(driver="pdm", ranker="reach", preset="avoidable"))
    assert not result.broken
    return result, heard, out


def test_a_clip_is_run_only_after_a_child_of_it_has_failed(red_light: tuple[CampaignResult, Heard, Path]) -> None:
    result, heard, out = red_light
    failing = [clip for clip in result.clips if clip.failing]
    run = [clip for clip in result.clips if not clip.not_run]
    assert failing and len(result.clips) > len(run) == heard.count("check")
    data = json.loads((out / "campaign.json").read_text())
    assert data["fidelity"]["clips"] == len(run)
    for clip in data["clip_runs"]:
        assert (clip["deviation_m"]["max"] is None) is clip.get("not_run", False)
    for clip in failing:
        assert not clip.not_run
        assert "  fidelity 0.00 m ego " in (out / clip.file).read_text()


def test_failures_do_not_count_if_their_clip_fails_or_deviates(red_light: tuple[CampaignResult, Heard, Path]) -> None:
    result, heard, out = red_light
    doubtful = [clip for clip in result.clips if clip.verdict is not Verdict.PASS or 1.0 < clip.largest_m < math.inf]
    assert {clip.verdict is Verdict.PASS for clip in doubtful} == {True, False}
    assert not any(clip.children for clip in doubtful)
    ran = {name for kind, name in zip(heard.kinds, heard.names, strict=True) if kind == "child"}
    dropped = ran - {child.name for child in result.children}
    assert dropped and all(any(name.startswith(clip.name) for clip in doubtful) for name in dropped)
    assert sum(clip.dropped for clip in doubtful) == len(dropped) == sum(clip.dropped for clip in result.clips)
    clips = json.loads((out / "campaign.json").read_text())["clip_runs"]
    assert sum(clip.get("dropped", 0) for clip in clips) == len(dropped)
    console = Console(record=True, width=160)
    print_campaign(console, result, out)
    assert f"not counted: {len(dropped)} children of {len(doubtful)} clips whose own run fails" in console.export_text()
    assert dropped.isdisjoint(path.stem for path in out.rglob("*.npz"))
    assert dropped.isdisjoint(path.stem for path in out.rglob("*.foresee"))


def test_more_children_are_drawn_from_the_stored_run_of_the_test_case(tmp_path: Path) -> None:
    """No trace is stored for a clip that is not run."""
    file = write_project(tmp_path / "project")
    few, many = (replace(SEARCH, ranker="random", children=count, against=()) for count in (1, 4))
    campaign(file, tmp_path / "out", few)
    with Store(tmp_path / "out" / "store", write=False) as store:
        assert {bool(trace) for (trace,) in store.execute("SELECT trace FROM runs WHERE kind = 'clip'")} == {False}
    result, heard = campaign(file, tmp_path / "out", many)
    assert not result.broken and not heard.count("clip") and heard.count("mutants") == len(result.clips) > 0
    anew, _ = campaign(file, tmp_path / "anew", many)
    assert [child.digest for child in result.children] == [child.digest for child in anew.children]


def test_mutants_of_all_seeds_have_one_run_of_their_clip(tmp_path: Path) -> None:
    """It has the seed of the parent's run, with which it is compared."""
    settings = replace(SEARCH, children=2, repeat=3, against=())
    result, heard = campaign(write_project(tmp_path / "project"), tmp_path / "out", settings)
    run = [clip for clip in result.clips if not clip.not_run]
    seeds = {child.name.partition("_s")[2][:1] for clip in run for child in clip.failing}
    assert len(seeds) > 1 and heard.count("check") == len(run)
