"""What a careful driver would have avoided, in a campaign's figures, files and report."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome
from foresee_dsl.campaign.regression.expectations import Status
from foresee_dsl.campaign.regression.verify import verify_files
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.steps.child import run_child
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.documents import plain
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.model import Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.terminal.campaign import print_campaign
from foresee_dsl.simulate.results.verdict import Verdict


def child(name: str, answer: Preventable | None, verdict: Verdict = Verdict.F4, time_s: float = 5.0) -> ChildOutcome:
    found = Preventability(answer, f"because of {name}", impact_mps=3.14159) if answer else None
    judgements = () if found is None else (found,)
    return ChildOutcome(
        name,
        f"{name}.foresee",
        "",
        ("timing",),
        verdict=verdict,
        with_="x",
        reason="f",
        time_s=time_s,
        duration_s=10.0,
        judgements=judgements,
    )


def clip(name: str, *children: ChildOutcome) -> ClipOutcome:
    return ClipOutcome("s", "7", name, "", "", 1, 1.0, children=children, verdict=Verdict.PASS, duration_s=10.0)


@pytest.fixture
def result() -> CampaignResult:
    clips = (
        clip("a", child("late", Preventable.NO, time_s=9.0), child("unclear", Preventable.UNKNOWN)),
        clip("b", child("passes", None, Verdict.PASS), child("yes", Preventable.YES, Verdict.F2, time_s=1.0)),
    )
    return CampaignResult(CampaignSettings(), (), clips, 1.0)


def test_preventable_failures_come_first_and_unavoidable_ones_last(result: CampaignResult) -> None:
    assert [c.name for c in result.to_open_first()] == ["yes", "unclear", "late"]


def test_counts(result: CampaignResult) -> None:
    assert result.avoidable() == {Preventable.YES: 1, Preventable.NO: 1, Preventable.UNKNOWN: 1}
    assert result.avoidable(Verdict.F2) == {Preventable.YES: 1, Preventable.NO: 0, Preventable.UNKNOWN: 0}
    data = plain(result)
    assert data["preventability"] == {"preventable": 1, "unavoidable": 1, "undecided": 1}
    shown = {c["mutant"]: c["preventability"] for run in data["clip_runs"] for c in run["children"]}
    assert shown["passes"] is None
    assert shown["yes"]["verdict"] == "preventable"
    assert (shown["yes"]["impact_mps"], shown["yes"]["braked_s"]) == (3.142, None)


def test_the_report_shows_them_in_this_order(result: CampaignResult) -> None:
    console = Console(file=io.StringIO(), width=80)
    print_campaign(console, result, Path("out"), raw=True)
    text = console.file.getvalue()
    assert (
        text.index("yes.foresee") < text.index("late.foresee") < text.index("3 failures") < text.index("What was run")
    )


def test_a_failing_child_says_it_in_its_file_and_is_still_reproduced(scenarios: Path, tmp_path: Path) -> None:
    case = load_test_case(f"{scenarios / 'scenario8.foresee'}::r01")
    parent = run_test_case(case, "pdm", 0)
    point = load_ranker("foresee").rank(parent.trace, seed=0, before_s=5.0, after_s=5.0)[0]
    file = tmp_path / "p1.foresee"
    cut = clip_around(case, parent.trace, point, file, before_s=5.0, after_s=5.0)
    model, clip_case, ran, _ = measure_clip(cut, case, parent.trace, file, DriverSetup("pdm"))
    file.write_text(print_model(model))
    found, failing = [], []
    for mutant in mutate(clip_case, model, ran.trace, preset="focused", count=4, seed=0):
        at = tmp_path / f"{mutant.name}.foresee"
        outcome, result = run_child(mutant, clip_case, at, DriverSetup("pdm"))
        written = parse(outcome.text, str(at)).model
        assert isinstance(written, Mutant)
        assert written.origin is not None
        if not result.verdict.is_failure:
            assert (outcome.preventability, written.origin.preventable) == (None, None)
            continue
        found.append(outcome)
        assert outcome.preventable is not None
        assert written.origin.preventable == outcome.preventable.origin
        assert outcome.anticipation is not None
        assert written.origin.anticipating == outcome.anticipation.answer.origin
        counted = CampaignResult(CampaignSettings(), (), (clip("a", outcome),), 1.0).anticipated()
        assert counted[outcome.anticipation.answer] == sum(counted.values()) == 1
        assert print_model(with_other_answer(written)) != outcome.text
        at.write_text(outcome.text)
        failing.append(at)
    assert {again.status for again in verify_files(failing)} == {Status.AS_EXPECTED}
    assert found, "the clip has lost its failures: take another"


def with_other_answer(mutant: Mutant) -> Mutant:
    assert mutant.origin is not None
    other = mutant.origin.model_copy(update={"preventable": None})
    return mutant.model_copy(update={"body": tuple(other if i is mutant.origin else i for i in mutant.body)})
