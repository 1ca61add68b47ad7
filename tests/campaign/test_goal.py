"""A campaign with a goal, really run: an expectation is searched like a collision, and a run that breaks it fails."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.allocation.draws import ChildFacts
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.findings.diagnosing import failing_named
from foresee_dsl.campaign.findings.named_failure import find_failure
from foresee_dsl.campaign.goal import left_out, with_goal
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.campaign.regression.expectations import Status
from foresee_dsl.campaign.regression.verify import verify_files
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.case_run import CaseStep
from foresee_dsl.campaign.steps.forecast import toward_goal
from foresee_dsl.campaign.steps.step import KeyInputs
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.derive.reach.ranker import ReachRanker
from foresee_dsl.documents import plain
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.forecast.margin import MarginRanker
from foresee_dsl.forecast.pair_goal import PairGoal
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.addresses import kind_of
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.goal import GoalMargin, GoalSeries
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import SPEED
from tests.support import command
from tests.support.small_campaign import SETTINGS, TEXT, campaign, published

ROOM = "expect room: always distance(ego, other) > 2.5 m"
GOAL = replace(SETTINGS, goal="room", risky_points=1)


def written(folder: Path, *expects: str) -> Path:
    file = folder / "crosser.foresee"
    file.write_text(TEXT.replace("expect never collision(ego)", "\n  ".join(("expect never collision(ego)", *expects))))
    return file


def cases_of(folder: Path, expect: str, goal: str = "room") -> list[TestCase]:
    return with_goal(load_test_cases([written(folder, expect)]), goal)


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> tuple[CampaignResult, Path]:
    folder = tmp_path_factory.mktemp("goal")
    result, _ = campaign(written(folder, ROOM), folder / "out", GOAL)
    return result, folder


def test_only_a_run_with_the_goal_fails_by_it(tmp_path: Path) -> None:
    case = cases_of(tmp_path, "expect room: always distance(ego, other) > 3 m")[0]
    failed, passed = run_test_case(case, "idm", 0), run_test_case(replace(case, goal=""), "idm", 0)
    assert (failed.verdict, passed.verdict) == (Verdict.GOAL, Verdict.PASS)
    assert failed.trace.digest == passed.trace.digest
    assert failed.reason == f"goal: {passed.reason}"
    assert "goal" not in passed.trace.meta and passed.goal is None
    series = GoalSeries.in_meta(failed.trace.meta)
    assert series is not None and failed.goal is not None
    (expectation,) = [e for e in failed.expectations if e.name == "room"]
    assert (failed.goal.margin, failed.goal.held) == (expectation.margin, False)
    assert len(series.margins) == failed.trace.frames
    assert series.worst == round((failed.goal.time_s or 0.0) / 0.05)


@pytest.mark.parametrize(
    "condition",
    [
        "always distance(ego, other) > 2 m",
        "never other within 2 m of ego",
        "always ttc(ego, other) > 1 s",
        "never headway(other, ego) < 0.3 s",
        "always not relative_speed(ego, other) > 9 m/s",
    ],
)
def test_the_margin_of_a_rolled_out_actor_is_that_of_a_run(condition: str, tmp_path: Path) -> None:
    case = replace(cases_of(tmp_path, f"expect room: {condition}")[0])
    pair = PairGoal.of(case)
    assert pair is not None and pair.actor == "other"
    # A driver that does not brake, so that the two come near and have a time to collision.
    trace = run_test_case(case, "pdm", 0).trace
    series = GoalSeries.in_meta(trace.meta)
    assert series is not None
    column = trace.index("other")
    margins = pair.margins(trace.boxes(0), trace.states[:, 0, SPEED], trace.boxes(column),
                           trace.states[:, column, SPEED])  # fmt: skip
    assert np.where(np.isfinite(margins), margins, np.nan) == pytest.approx(series.margins, abs=1e-4, nan_ok=True)


def test_points_are_the_smallest_margins_first(tmp_path: Path) -> None:
    trace = run_test_case(cases_of(tmp_path, ROOM)[0], "idm", 0).trace
    series = GoalSeries.in_meta(trace.meta)
    assert series is not None
    points = MarginRanker(ForeseeRanker()).rank(trace, before_s=3.0, after_s=3.0)
    assert points[0].frame == series.worst
    assert points[0].actor == "other"
    assert points[0].why == f"room is {series.margins[points[0].frame]:.2f} m from being broken"


def test_proposals_come_first_for_a_goal_that_cannot_be_rolled_out(tmp_path: Path) -> None:
    case = cases_of(tmp_path, "expect room: always ego.acceleration > -9 m/s^2")[0]
    ranker = toward_goal(ReachRanker(), case)
    points = ranker.rank(run_test_case(case, "idm", 0).trace, before_s=3.0, after_s=3.0)
    by_margin = ["from being broken" in point.why for point in points]
    assert any(by_margin) and not all(by_margin)
    assert by_margin == sorted(by_margin)
    assert all(point.why.endswith("(not by the goal's margin)") for point in points if point.operator)


@pytest.mark.parametrize("fact", ["never ego runs red", "always other.speed < 99 m/s or ego sees other"])
def test_without_a_margin_the_other_ranker_remains(fact: str, tmp_path: Path) -> None:
    trace = run_test_case(cases_of(tmp_path, f"expect room: {fact}")[0], "idm", 0).trace
    points = MarginRanker(ForeseeRanker()).rank(trace, before_s=3.0, after_s=3.0)
    own = [p for p in points if "from being broken" in p.why]
    others = ForeseeRanker().rank(trace, before_s=3.0, after_s=3.0)
    if "runs red" in fact:
        assert not own
        assert [p.frame for p in points] == [p.frame for p in others]
        assert all(p.why.endswith("(not by the goal's margin)") for p in points)
    else:
        assert own


def test_reach_proposes_changes_that_break_the_goal(tmp_path: Path) -> None:
    case = cases_of(tmp_path, ROOM)[0]
    pair = PairGoal.of(case)
    assert pair is not None
    trace = run_test_case(case, "idm", 0).trace
    points = ReachRanker().toward(pair).rank(trace)
    assert "changes break room" in points[0].why
    assert points[0].score > 0
    far = replace(pair, bound=-100.0)  # nothing breaks it, so that the margin alone ranks
    assert "from being broken" in ReachRanker().toward(far).rank(trace)[0].why


def test_what_breaks_the_goal_is_a_finding_with_its_file(searched: tuple[CampaignResult, Path]) -> None:
    result, folder = searched
    assert not result.broken
    counts = result.goal
    assert counts is not None and counts.children > 0 and counts.findings > 0
    breaking = [finding.run.breaks_goal for finding in result.findings]
    assert breaking == sorted(breaking, reverse=True)
    by_goal = [child for clip in result.clips for child in clip.children if child.verdict is Verdict.GOAL]
    assert by_goal
    data = json.loads((folder / "out" / "campaign.json").read_text())
    assert data["settings"]["goal"] == "room"
    assert data["goal"]["children"] == counts.children
    assert data["failures"]["goal"] == len(by_goal)
    for child in by_goal:
        mutant = parse((folder / "out" / child.file).read_text(), child.file).model
        assert isinstance(mutant, Mutant) and mutant.origin is not None
        assert mutant.origin.goal == "room"
        assert (mutant.origin.found or "").startswith("goal: does not hold: expect room: always")
        assert child.story is not None and "breaks 'room' by" in child.story.sentence
        assert child.goal is not None and (child.goal.margin or 0.0) < 0


def test_its_file_fails_again_on_its_own(searched: tuple[CampaignResult, Path]) -> None:
    result, folder = searched
    child = next(child for clip in result.clips for child in clip.children if child.verdict is Verdict.GOAL)
    (again,) = verify_files([folder / "out" / child.file])
    assert again.status is Status.AS_EXPECTED, again.now
    assert again.was == "fails"


def test_a_test_case_that_breaks_the_goal_is_a_failure_for_other_commands_too(tmp_path: Path) -> None:
    file = written(tmp_path, "expect room: always distance(ego, other) > 3 m")
    result, _ = campaign(file, tmp_path / "out", replace(GOAL, against=()))
    number = next(k for k, finding in enumerate(result.findings, 1) if finding.representative in result.seeds)
    failing = failing_named(str(number), tmp_path / "out")
    assert failing.case.mutant is None and failing.case.goal == "room"
    assert failing.setup.run(failing.case).verdict is Verdict.GOAL


def test_what_breaks_an_expectation_that_is_no_goal_has_its_file_too(
    searched: tuple[CampaignResult, Path], tmp_path: Path
) -> None:
    _, folder = searched
    out = tmp_path / "out"
    result, _ = campaign(folder / "crosser.foresee", out, replace(SETTINGS, risky_points=1), store=tmp_path / "store")
    breaking = [child for child in result.children if child.broken_expectations and not child.verdict.is_failure]
    assert breaking
    for child in breaking:
        (again,) = verify_files([out / child.file])
        assert child.broken_expectations[0] in again.now
        assert find_failure(child.name, out).file == out / child.file
    text = (out / "campaign.json").read_text()
    assert text.count('"file": "children/') == sum(child.is_written for child in result.children)


def test_new_mutants_do_not_replace_those_of_a_campaign(searched: tuple[CampaignResult, Path], tmp_path: Path) -> None:
    _, folder = searched
    clip = next(file for file in (folder / "out" / "children").rglob("*.foresee") if kind_of(file) == "clip")
    before = {file: file.read_bytes() for file in clip.parent.iterdir()}
    for out in ((), ("--out", clip.parent)):
        refused = command.foresee("mutate", clip, "--driver", "idm", "--allow-outside", *out, expect=1)
        assert "name another folder for them with `--out`" in refused.stderr
    options = ("--driver", "idm", "--children", "1", "--out", tmp_path / "mutants", "--allow-outside", "--exit-zero")
    command.foresee("mutate", clip, *options)
    (mutant,) = (tmp_path / "mutants").iterdir()
    command.foresee("check", mutant, "--allow-outside")
    assert {file: file.read_bytes() for file in clip.parent.iterdir()} == before


def test_the_same_again_runs_nothing_and_another_goal_runs_again(
    searched: tuple[CampaignResult, Path], tmp_path: Path
) -> None:
    _, folder = searched
    before = published(folder / "out")
    _, heard = campaign(folder / "crosser.foresee", folder / "out", GOAL)
    assert heard.kinds == []
    assert published(folder / "out") == before
    cases = load_test_cases([written(tmp_path, ROOM)])
    plain_keys, goal_keys = (
        [node.step.key for node in Stages(cases, s, None, tmp_path).seeds] for s in (SETTINGS, GOAL)
    )
    assert not set(plain_keys) & set(goal_keys)


def test_without_a_goal_keys_have_the_parts_that_they_had(tmp_path: Path) -> None:
    case = load_test_cases([written(tmp_path, ROOM)])[0]
    parts: list[set[str]] = []

    def noted(_step: object, **named: object) -> str:
        parts.append(set(named))
        return ""

    for settings in (SETTINGS, GOAL):
        CaseStep.of_case(case, "one", KeyInputs(settings, "idm", "foresee", "", (), noted))
    assert parts == [{"meaning", "window", "driver", "seed"}, {"meaning", "window", "driver", "seed", "goal"}]


def test_a_goal_that_is_no_contact_is_searched_with_the_default_preset(tmp_path: Path, root: Path) -> None:
    """The preset looks for contacts; where it finds none, clips are cut and drawn as without it."""
    case = root / "tests" / "cases" / "goals" / "calm_turn.foresee"
    settings = CampaignSettings(goal="safe", risky_points=1)
    assert settings.preset == "avoidable"
    result, _ = campaign([f"{case}::r01"], tmp_path, settings)
    assert not result.broken
    ((clip,),) = [result.clips]
    assert len(clip.children) == settings.children and clip.failing
    assert all(child.goal is not None for child in clip.children)


def test_the_run_of_a_clip_after_its_child_failed_has_the_goal_in_its_key(tmp_path: Path) -> None:
    """The same clip is run once more without the goal: with it, it would fail where it breaks the expectation."""
    file, keys = written(tmp_path, ROOM), []
    for settings in (GOAL, SETTINGS):
        search = replace(settings, ranker="reach", preset="avoidable", risky_points=1, children=2, against=())
        campaign(file, tmp_path / "out", search)
        with Store(tmp_path / "out" / "store", write=False) as store:
            keys.append({(row.name, row.key) for row in store.rows() if row.kind == "check"})
    with_goal, every = keys
    without = every - with_goal
    assert {name for name, _ in with_goal} & {name for name, _ in without}


def test_a_campaign_without_a_goal_says_nothing_of_one(tmp_path: Path) -> None:
    assert "goal" not in plain(CampaignSettings())
    result, _ = campaign(written(tmp_path, ROOM), tmp_path / "out", replace(SETTINGS, children=1, risky_points=1))
    text = (tmp_path / "out" / "campaign.json").read_text()
    assert '"goal"' not in text
    assert result.goal is None


def test_requirements_of_eight_kinds_are_goals() -> None:
    cases = with_goal(load_test_cases([Path(__file__).parents[1] / "cases" / "goals"]), "safe")
    pairs = {case.source.stem: PairGoal.of(case) for case in cases}
    assert len(cases) == 31
    measures = {name: pair.measure for name, pair in pairs.items() if pair is not None}
    assert measures == {
        "walker_room": "distance", "yard_room": "distance", "oncoming_room": "distance", "junction_room": "distance",
        "turner_room": "distance", "runner_time": "ttc", "puller_headway": "headway",
    }  # fmt: skip
    assert pairs["calm_turn"] is None, "how the ego brakes cannot be rolled out"


def test_children_go_where_the_margin_is_small() -> None:
    run = ChildOutcome("a", verdict=Verdict.F2, with_="other", time_s=1.0, duration_s=1.0)
    assert ChildFacts.of(run, "7").story
    assert not ChildFacts.of(run, "7", "room").story, "a failure that keeps the goal is not what is searched"
    near = replace(run, verdict=Verdict.PASS, goal=GoalMargin("room", held=True, margin=0.1, unit="m", nearness=0.96))
    assert ChildFacts.of(near, "7", "room").nearness == 0.96


def test_test_cases_without_the_goal_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    cases = load_test_cases([written(tmp_path / "one", ROOM), written(tmp_path / "two")])
    assert len(with_goal(cases, "room")) == 3
    assert left_out(cases, "room") == (
        "3 of 6 test cases have no `expect room: always ...` (or `never`) and are left out"
    )
    with pytest.raises(ForeseeError, match="no test case has an expectation called 'rooms': did you mean 'room'"):
        with_goal(cases, "rooms")
    with pytest.raises(ForeseeError, match="an `expect eventually`, which clips do not check"):
        cases_of(tmp_path, "expect there: eventually arrived(ego)", "there")


def test_the_command_and_the_campaign_file_state_the_goal(tmp_path: Path) -> None:
    written(tmp_path, ROOM)
    (tmp_path / "search.foresee").write_text(
        'foresee 1\n\ncampaign search {\n  seeds "crosser.foresee"\n  drivers [idm]\n  goal rooms\n}\n'
    )
    done = command.foresee("plan", tmp_path / "search.foresee", "--out", tmp_path / "out", expect=1)
    assert "did you mean 'room'?" in done.stdout + done.stderr
    for option in ("--goal", "--first-from"):
        done = command.foresee("plan", tmp_path / "crosser.foresee", option, "", "--out", tmp_path / "out", expect=2)
        assert option in done.stderr and "it is empty: name one, or" in done.stderr
    command.foresee("plan", tmp_path / "search.foresee", "--goal", "", "--out", tmp_path / "out")
    done = command.foresee("plan", tmp_path / "search.foresee", "--goal", "room", "--out", tmp_path / "out")
    assert "test cases" in done.stdout
