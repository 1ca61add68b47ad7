"""Findings: failures that tell the same story are one, with the simplest of them in front."""

from __future__ import annotations

from dataclasses import replace

import pytest

from foresee_dsl.campaign.grouping import findings_of
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult, sorted_outcomes
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.child import with_sentence
from foresee_dsl.documents import plain
from foresee_dsl.language.model import Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.story import ContactClass, Story

MUTANT = """foresee 1

mutant NAME of "clip.foresee" pin sha256:0123456789ab {
CHANGES

  origin {
    operator [timing]
    seed 0
  }
}
"""
STEPS_OUT = Story(
    moments=(),
    sentence="walker steps onto the road",
    opponent="walker",
    opponent_kind="pedestrian",
    contact=ContactClass.EGO_DROVE_INTO,
    ego_manoeuvre="brakes",
    opponent_manoeuvre="walks from the left",
    place="the road",
    touch="front",
)
RUNS_RED = replace(STEPS_OUT, sentence="runner comes", opponent="runner", opponent_kind="van", touch="left side")


def child(name: str, changes: tuple[str, ...], story: Story | None = STEPS_OUT) -> ChildOutcome:
    lines = "\n".join(f"  change {line}" for line in changes)
    text = MUTANT.replace("NAME", name).replace("CHANGES", lines)
    verdict = Verdict.F2 if story else Verdict.PASS
    return ChildOutcome(
        name, f"children/{name}.foresee", text, ("timing",), verdict=verdict, time_s=4.0, duration_s=5.0, story=story
    )


def clip(name: str, case: str, family: str, *children: ChildOutcome) -> ClipOutcome:
    return ClipOutcome(case, family, name, f"children/{name}.foresee", "", 1, 1.0, children=children,
                       verdict=Verdict.PASS, duration_s=5.0)  # fmt: skip


def seed(case: str, family: str, story: Story | None = None) -> CaseRunOutcome:
    verdict = Verdict.F2 if story else Verdict.PASS
    return CaseRunOutcome(case, family, "s", 1.0, verdict=verdict, duration_s=30.0, story=story)


def campaign(seeds: tuple[CaseRunOutcome, ...], clips: tuple[ClipOutcome, ...]) -> CampaignResult:
    return CampaignResult(CampaignSettings(), *sorted_outcomes(seeds, clips), wall_s=1.0)


FAR, NEAR = "walker.timing: 1.00 => 1.40", "walker.timing: 1.00 => 1.20"
LINE = "walker.line: 0.00 m => 0.10 m"
CLIPS = (
    clip("a_p1", "f::a", "3", child("a_p1_m1", (FAR,)), child("a_p1_m2", (LINE, NEAR)), child("a_p1_m3", (), None)),
    clip("b_p1", "f::b", "3", child("b_p1_m1", (NEAR,)), child("b_p1_m2", (FAR,), RUNS_RED)),
    clip("c_p1", "g::c", "4", child("c_p1_m1", (NEAR,))),
)
SEEDS = (seed("f::a", "3"), seed("f::b", "3"), seed("g::c", "4"), seed("g::d", "4", STEPS_OUT))


def test_equal_stories_of_a_family_are_one_and_the_nearest_change_stands_for_them() -> None:
    found = findings_of(SEEDS, CLIPS)
    assert [(f.family, f.name, f.siblings) for f in found] == [
        ("3", "b_p1_m1", ("a_p1_m1", "a_p1_m2")),
        ("3", "b_p1_m2", ()),
        ("4", "s_d", ("c_p1_m1",)),
    ]
    assert sum(f.count for f in found) == 6
    assert (found[0].test_case, found[0].clip) == ("f::b", "children/b_p1.foresee")


def test_a_failing_test_case_is_a_finding_as_it_is() -> None:
    (found,) = findings_of([seed("g::d", "4", STEPS_OUT)], [])
    assert (found.name, found.file, found.clip) == ("s_d", "g::d", "")


def test_the_order_of_what_finished_does_not_matter() -> None:
    assert findings_of(SEEDS[::-1], CLIPS[::-1]) == findings_of(SEEDS, CLIPS)


def test_campaign_json_lists_them() -> None:
    listed = plain(campaign(SEEDS, CLIPS))["findings"]
    assert [(f["name"], f["class"], f["count"]) for f in listed] == [
        ("s_d", "ego drove into", 2),
        ("b_p1_m1", "ego drove into", 3),
        ("b_p1_m2", "ego drove into", 1),
    ]
    assert [f["number"] for f in listed] == [1, 2, 3]
    assert listed[1]["sibling_files"] == ["children/a_p1_m1.foresee", "children/a_p1_m2.foresee"]
    assert listed[1]["sentence"] == "walker steps onto the road"


@pytest.mark.parametrize("sentence", ["walker steps out", 'a "b" # c\nd { }', "</script>"])
def test_a_mutants_comment_is_one_line_and_changes_nothing_else(sentence: str) -> None:
    plain = child("m", (NEAR, LINE)).text
    model = parse(plain, "m").model
    assert isinstance(model, Mutant)
    text = with_sentence(model, sentence)
    again = parse(text, "m")
    assert again.model == model
    assert print_model(again.model, again.comments) == text  # `foresee fmt` leaves it as it is
    assert [line for line in text.splitlines() if not line.startswith("  # ")] == print_model(model).splitlines()
    assert f"  # {' '.join(sentence.split())}\n  change {NEAR}" in text


def test_a_broken_run_has_no_story_and_is_no_finding() -> None:
    crashed = replace(seed("g::d", "4"), verdict=Verdict.CRASH)
    assert findings_of([crashed], []) == ()
