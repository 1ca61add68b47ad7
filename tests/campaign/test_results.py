"""The figures of a campaign, worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from foresee_dsl.avoidance.anticipating import Answer, Anticipation
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult, sorted_outcomes
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.documents import plain, read_record
from foresee_dsl.report.terminal.campaign import save_campaign
from foresee_dsl.simulate.results.goal import GoalMargin
from foresee_dsl.simulate.results.infraction import Infraction, Rule
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import DriverNotes, Hang, Impact, Verdict
from foresee_dsl.story import Moment, Story
from foresee_dsl.story.story import ContactClass


def seed(name: str, family: str, verdict: Verdict = Verdict.PASS, points: int = 0) -> CaseRunOutcome:
    return CaseRunOutcome(
        name, family, "s", 1.0, "t.npz", points, verdict=verdict, reason=verdict.value, duration_s=30.0
    )


def child(name: str, verdict: Verdict, operators: tuple[str, ...], time_s: float) -> ChildOutcome:
    return ChildOutcome(
        name, f"{name}.foresee", "", operators, verdict=verdict, reason=verdict.value, time_s=time_s, duration_s=10.0
    )


def clip(of: str, rank: int, *children: ChildOutcome, deviation: float = 0.0) -> ClipOutcome:
    return ClipOutcome(
        seed=of,
        family=of[0],
        name=f"{of}_p{rank}",
        file=f"{of}_p{rank}.foresee",
        text="",
        rank=rank,
        verdict=Verdict.PASS,
        reason="",
        duration_s=10.0,
        wall_s=2.0,
        largest_m=deviation,
        median_m=0.0,
        within=1.0,
        children=children,
    )


def result() -> CampaignResult:
    seeds = (seed("3a", "3", points=5), seed("7a", "7", points=2), seed("7b", "7", Verdict.F4))
    steer = child("m1", Verdict.F4, ("steer",), 5.0)
    late = child("m2", Verdict.F2, ("timing",), 6.0)
    early = child("m3", Verdict.F3, ("timing",), 2.0)
    fine = child("m4", Verdict.PASS, ("timing",), 10.0)
    clips = (clip("3a", 1, steer, late, fine), clip("3a", 2, deviation=0.4), clip("7a", 1, early, deviation=0.2))
    return CampaignResult(CampaignSettings(), *sorted_outcomes(reversed(seeds), reversed(clips)), wall_s=9.0)


def test_rows_of_families_and_of_all() -> None:
    found = result()
    three, seven, total = found.row("3"), found.row("7"), found.row()
    assert found.families == ("3", "7")
    assert (three.cases, three.clips, three.children, three.failed) == (1, 2, 3, 2)
    assert three.per_risky_point == 1.0
    assert (seven.cases, seven.cases_failed, seven.failures["F3"]) == (2, 1, 1)
    assert total.simulated_s == 3 * 30 + 3 * 10 + 4 * 10
    assert total.per_simulated_hour == 3 / (160 / 3600)
    assert total.fidelity_median_m == 0.2
    assert total.fidelity_max_m == 0.4


def test_fidelity_tells_the_others_from_the_ego() -> None:
    clips = tuple(
        replace(one, others_m=others, ego_m=ego)
        for one, others, ego in zip(result().clips, ((0.0, 0.02, 0.3), (0.01,), ()), (0.5, 0.1, 0.2), strict=True)
    )
    found = replace(result(), clips=clips)
    assert plain(found)["fidelity"] == {
        "driver": "pdm",
        "clips": 3,
        "others": {"actors": 4, "median_m": 0.015, "within_0.1_m": 0.75, "max_m": 0.3},
        "ego": {"median_m": 0.2, "max_m": 0.5},
    }
    assert [run["deviation_m"]["ego"] for run in plain(found)["clip_runs"]] == [0.5, 0.1, 0.2]
    # An actor that a clip's run lacks is infinitely far, which JSON cannot say.
    lost = replace(found, clips=(replace(clips[0], others_m=(math.inf,)),))
    assert plain(lost)["fidelity"]["others"]["max_m"] is None


def test_order_does_not_depend_on_who_finished_first() -> None:
    found = result()
    assert [s.id for s in found.seeds] == ["3a", "7a", "7b"]
    assert [c.name for c in found.clips] == ["3a_p1", "3a_p2", "7a_p1"]


def test_what_to_open_first_is_late_and_not_steered_and_one_a_clip_at_first() -> None:
    assert [c.name for c in result().to_open_first()] == ["m2", "m3", "m1"]


def test_the_report_can_be_saved(tmp_path: Path) -> None:
    for suffix, begins in (
        (".svg", "<svg"),
        (".html", "<!DOCTYPE html>"),
        (".txt", "\n"),
    ):
        file = tmp_path / f"report{suffix}"
        save_campaign(file, result(), Path("out"))
        assert file.read_text().startswith(begins)


def test_a_failing_test_case_says_whether_it_could_have_been_prevented(tmp_path: Path) -> None:
    found = result()
    why = Preventability(Preventable.NO, "the risk begins too late")
    seeds = tuple(replace(s, judgements=(why,)) if s.verdict is Verdict.F4 else s for s in found.seeds)
    save_campaign(tmp_path / "r.txt", replace(found, seeds=seeds), Path("out"))
    assert "\n    7b\n" in (tmp_path / "r.txt").read_text()
    told = {s["test_case"]: s["preventability"] for s in plain(replace(found, seeds=seeds))["test_cases"]}
    assert told["7b"]["verdict"] == "unavoidable" and told["3a"] is None


def test_a_written_run_is_read_into_the_record_that_wrote_it() -> None:
    of_failure = {
        "verdict": Verdict.F4,
        "reason": "F4 lateral collision with van (van) at 5.00 s, 6.0 m/s",
        "with_": "van",
        "time_s": 5.0,
        "duration_s": 5.0,
        "digest": "sha256:1",
        "meaning": "sha256:2",
        "impact": Impact("van", "left", "front", 1.5, -0.5, math.pi / 4, "both", 6.0, 5.0, 4.0, 3.0),
        "near": NearMisses(NearMiss(0.5, 1.0, "van"), None, None, NearMiss(math.inf, 5.0, "van")),
        "broken_expectations": ("does not hold: ttc > 1 s",),
        "infractions": (Infraction(Rule.RED, "ego", 3.0, "king_oak", 3.0),),
        "goal": GoalMargin("room", False, -0.25, "m", 4.0),
        "judgements": (Preventability(Preventable.NO, "too late"), Anticipation(Answer.BRAKING, "in time", 1.0)),
        "references": (ReferenceRun("idm", Verdict.PASS, ("brakes",), verdict=Verdict.PASS),),
        "story": Story((Moment(1.0, "van", "appears", "comes"),), "It comes.", "van", "van", ContactClass.BOTH_MOVING,
                       "goes ahead", "comes", "a junction"),
    }  # fmt: skip
    clip_of_it = ClipOutcome("a", name="a_p1", largest_m=math.inf, median_m=0.5, within=0.5, verdict=Verdict.PASS)
    notes = DriverNotes(output="hello", hang=Hang("step", 1.0), changed=("set its folder",))
    for record in (
        CaseRunOutcome("a", "7", trace="traces/a.npz", risky_points=3, notes=notes, **of_failure),  # type: ignore[arg-type]
        ChildOutcome("a_p1_m1", "children/a_p1_m1.foresee", round=2, drawn_near="a_p1_m0", **of_failure),  # type: ignore[arg-type]
        clip_of_it,
    ):
        document = plain(record)
        assert plain(read_record(type(record), document)) == document
