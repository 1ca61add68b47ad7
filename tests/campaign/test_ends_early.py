"""The runs of a campaign's mutants end as soon as they can only pass, with the presets that are ours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.steps.inputs import clip_of, mutant_of
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.small_campaign import SETTINGS, finished, write_project

EARLY = ": no failure is possible any more before the end at "


def children(result: CampaignResult) -> list[ChildOutcome]:
    return [child for clip in result.clips for child in clip.children]


def test_the_children_of_a_campaign_end_early_and_say_so(tmp_path: Path) -> None:
    file = write_project(tmp_path)
    result = finished(file, tmp_path / "out")
    passing = [child for child in children(result) if child.passed]
    early = [child for child in passing if EARLY in child.reason]
    assert len(early) > len(passing) / 2
    cases = {case.id: case for case in load_test_cases([file])}
    for clip in result.clips:
        for child in clip.children:
            case = cases[clip.seed]
            whole = expand_clip(clip_of(clip.text), case, source=Path(clip.file))
            ran = DriverSetup("idm").run(expand_mutant(mutant_of(child.text), whole, source=Path(child.file)))
            assert ran.verdict is child.verdict, child.name
            assert (ran.duration_s > child.duration_s) == (child in early), child.name
            assert EARLY not in ran.reason


def test_the_children_of_the_papers_preset_last_as_long_as_their_clips(tmp_path: Path) -> None:
    result = finished(write_project(tmp_path), tmp_path / "out", replace(SETTINGS, preset="paper"))
    passing = [child for child in children(result) if child.passed]
    assert passing
    assert not any(EARLY in child.reason for child in passing)
