"""Failing children are driven by other drivers: who avoids the failure, and how."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.avoidance.comparison import SAME_PLACE_M, compared
from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import Allocation
from foresee_dsl.campaign.steps.case_reference import drive_failure
from foresee_dsl.campaign.steps.mutants import MutantsStep
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import name_in, recorded_address, recorded_driver, reference_drivers, sees_all
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.simulate.results.verdict import FAILURES, Verdict
from foresee_dsl.simulate.trace import HEADING, SPEED, X, Y
from tests.support.small_campaign import SETTINGS, TEXT, Heard, campaign, published, write_project

AGAINST = replace(SETTINGS, against=("pdm", "idm+ideal"))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, CampaignResult, Heard]:
    root = tmp_path_factory.mktemp("references")
    file = write_project(root / "project")
    result, heard = campaign(file, root / "out", AGAINST, options=RunOptions(jobs=2))
    return file, root / "out", result, heard


def test_every_failure_is_driven_by_each_and_nothing_else_is(
    done: tuple[Path, Path, CampaignResult, Heard],
) -> None:
    _, _, result, heard = done
    children = [child for clip in result.clips for child in clip.children]
    failing = [child for child in children if child.verdict.is_failure]
    assert failing
    assert [child.references == () for child in children] == [not child.verdict.is_failure for child in children]
    assert all([run.driver for run in child.references] == ["pdm", "idm+ideal"] for child in failing)
    assert heard.count("reference") == 2 * len(failing)


def test_an_answer_is_that_of_the_same_child_with_that_driver(
    done: tuple[Path, Path, CampaignResult, Heard],
) -> None:
    _, out, result, _ = done
    child = next(child for clip in result.clips for child in clip.failing)
    case = load_test_case(str(out / child.file))
    failing, bundle = run_test_case(case, "idm", AGAINST.seed).trace, compile_test_case(case)
    assert compared(failing, failing, bundle).apart == "it drives nearly the same way"
    for run in child.references:
        result_again = run_test_case(case, run.driver, AGAINST.seed)
        assert result_again.verdict is run.verdict
        assert (run.before is not None) == run.passes
        comparison = compared(failing, result_again.trace, bundle)
        assert (comparison.how, comparison.apart) == (run.how, run.apart) != ((), "")
        assert run.avoids == (run.passes and not run.apart)


def struck_case(folder: Path) -> TestCase:
    """Return a test case that `pdm` fails and `idm` passes, because it brakes earlier."""
    file = write_project(folder)
    text = TEXT.replace("case after { gap = -0.8 s }", "case struck { gap = 0 s }")
    file.write_text(text.replace("end after 12 s", "end after 30 s"))  # time to arrive after braking
    return next(case for case in load_test_cases([file]) if case.id.endswith("::struck"))


def test_a_driver_that_is_elsewhere_or_comes_later_anyhow_is_not_comparable(tmp_path: Path) -> None:
    case = struck_case(tmp_path / "project")
    failing, passing = (run_test_case(case, driver, 0).trace for driver in ("pdm", "idm"))
    bundle, opponent = compile_test_case(case), failing.index("other")
    assert compared(failing, passing, bundle).how
    for actor, words in ((0, ("in any case", "another way")), (opponent, ("elsewhere",))):
        states = passing.states.copy()
        heading = states[0, 0, HEADING]
        back_m = 4 * SAME_PLACE_M + 4 * failing.states[:, 0, SPEED].max()
        states[:, actor, X] -= back_m * np.cos(heading)
        states[:, actor, Y] -= back_m * np.sin(heading)
        apart = compared(failing, replace(passing, states=states), bundle).apart
        assert any(word in apart for word in words), apart


@pytest.mark.parametrize(("behind_s", "comparable"), [(0.0, True), (0.5, True), (1.5, False)])
def test_who_would_come_within_a_second_is_in_the_same_situation(
    tmp_path: Path, behind_s: float, comparable: bool
) -> None:
    case = struck_case(tmp_path / "project")
    failing, passing = (run_test_case(case, driver, 0).trace for driver in ("pdm", "idm"))
    states = passing.states.copy()
    heading = states[0, 0, HEADING]
    back_m = behind_s * failing.states[:, 0, SPEED].max()
    states[:, 0, X] -= back_m * np.cos(heading)
    states[:, 0, Y] -= back_m * np.sin(heading)
    apart = compared(failing, replace(passing, states=states), compile_test_case(case)).apart
    assert apart == "" if comparable else "later in any case" in apart, apart


def test_the_mutant_says_it_and_means_the_same(done: tuple[Path, Path, CampaignResult, Heard]) -> None:
    _, out, result, _ = done
    for clip in result.clips:
        for child in clip.failing:
            model = parse((out / child.file).read_text(), child.name).model
            assert isinstance(model, Mutant)
            assert model.origin is not None
            told = "; ".join(run.sentence for run in child.avoided)
            assert (model.origin.avoided or "") == told
            assert load_test_case(str(out / child.file)).meaning == child.meaning


def test_a_minimised_child_is_asked_again(done: tuple[Path, Path, CampaignResult, Heard]) -> None:
    _, out, result, heard = done
    small = [one.child for one in result.minimised]
    assert heard.count("minimised_reference") == 2 * len(small) > 0
    findings = {finding.name: finding for finding in result.findings}
    for child in small:
        case = load_test_case(str(out / child.file))
        assert [run_test_case(case, run.driver, 0).verdict for run in child.references] == [
            run.verdict for run in child.references
        ]
        assert findings[child.name].run.references == child.references
        model = parse((out / child.file).read_text(), child.name).model
        assert isinstance(model, Mutant)
        assert model.origin is not None
        assert (model.origin.avoided or "") == "; ".join(run.sentence for run in child.avoided)


def test_a_failing_test_case_is_driven_too(tmp_path: Path) -> None:
    struck = [struck_case(tmp_path / "project")]
    with Store(tmp_path / "store") as store:
        result = run_campaign(struck, replace(SETTINGS, driver="pdm", against=("idm",)), out=tmp_path, store=store)
    (seed,) = result.seeds
    assert seed.verdict.is_failure
    (run,) = seed.references
    assert (run.driver, run.verdict, run.before) == ("idm", Verdict.PASS, None)
    assert run.how
    (finding,) = result.findings
    assert finding.avoided == 1
    assert published(tmp_path)["json"]["findings"][0]["references"][0]["how"] == list(run.how)


def test_a_driver_that_fails_before_the_mutation_shows_nothing(
    done: tuple[Path, Path, CampaignResult, Heard],
) -> None:
    _, out, result, _ = done
    child = next(child for clip in result.clips for child in clip.failing if child.references[0].passes)
    case, address = load_test_case(str(out / child.file)), child.references[0].driver
    setup = DriverSetup(address, rules=AGAINST.rules)
    runs = {}
    for verdict in (Verdict.PASS, *FAILURES, Verdict.TIMEOUT, Verdict.CRASH):
        runs[verdict], _ = drive_failure(setup, case, lambda verdict=verdict: verdict, None)
        assert (runs[verdict].verdict, runs[verdict].before) == (Verdict.PASS, verdict)
    passes, fails = runs[Verdict.PASS], runs[Verdict.F4]
    assert [verdict for verdict, run in runs.items() if run.avoids] == [Verdict.PASS]
    assert replace(child, references=(fails,)).avoided == ()
    assert replace(child, references=(fails, passes)).avoided == (passes,)
    assert fails.sentence.endswith("(but fails before the mutation: F4)") and fails.sentence not in passes.sentence


def test_a_finding_counts_what_is_avoided(done: tuple[Path, Path, CampaignResult, Heard]) -> None:
    _, out, result, _ = done
    avoided = sum(bool(child.avoided) for clip in result.clips for child in clip.failing)
    found = published(out)["json"]["findings"]
    assert sum(finding["avoided"] for finding in found) == avoided


def test_workers_and_a_second_time_give_the_same(
    done: tuple[Path, Path, CampaignResult, Heard], tmp_path: Path
) -> None:
    file, out, _, _ = done
    _, heard = campaign(file, out, AGAINST)
    assert heard.kinds == []
    campaign(file, tmp_path / "out", AGAINST, store=out / "store")
    again, before = published(tmp_path / "out"), published(out)
    assert again["json"] == before["json"]


def test_without_references_only_these_are_missing(
    done: tuple[Path, Path, CampaignResult, Heard], tmp_path: Path
) -> None:
    file, out, with_them, _ = done
    without, heard = campaign(file, tmp_path / "out", SETTINGS, store=out / "store")
    assert heard.kinds == []
    plain = [replace(child, references=(), text="") for clip in with_them.clips for child in clip.children]
    assert [replace(child, text="") for clip in without.clips for child in clip.children] == plain


@pytest.mark.parametrize("allocation", ["even", "adaptive"])
def test_a_clip_that_strays_too_far_or_does_not_pass_is_not_mutated(
    done: tuple[Path, Path, CampaignResult, Heard], tmp_path: Path, allocation: Allocation
) -> None:
    file, out, before, _ = done
    assert any(clip.children for clip in before.clips)
    farthest_m = max(clip.largest_m for clip in before.clips)
    strict = replace(SETTINGS, fidelity_limit_m=farthest_m - 1e-6, allocation=allocation)
    result, _ = campaign(file, tmp_path / "out", strict, store=out / "store")
    straying = {clip.name for clip in result.clips if clip.largest_m > strict.fidelity_limit_m}
    assert {clip.name for clip in result.clips if not clip.children} >= straying != set()
    clip, limit_m = before.clips[0], SETTINGS.fidelity_limit_m
    verdicts = [verdict for verdict in Verdict
                if MutantsStep.wanted(replace(clip, verdict=verdict, largest_m=limit_m), SETTINGS)]  # fmt: skip
    assert verdicts == [Verdict.PASS]
    assert not MutantsStep.wanted(replace(clip, verdict=Verdict.PASS, largest_m=limit_m + 0.01), SETTINGS)


def test_addresses() -> None:
    assert [name_in(a) for a in ("pdm", "pdm+ideal", "external+ideal:python3 a+ideal.py")] == ["pdm", "pdm", "external"]
    assert [sees_all(a) for a in ("pdm", "pdm+ideal", "external:python3 a+ideal")] == [False, True, False]
    for address in ("pdm+ideal", "external+ideal:python3 mine.py"):
        assert recorded_address(recorded_driver(address, "2")) == address
    assert "pdm+ideal" in reference_drivers("pdm")
    assert not {"pdm"} & set(reference_drivers("pdm"))
    assert reference_drivers("external:python3 mine.py")[-1] == "external+ideal:python3 mine.py"


def test_ideal_sensors_are_another_run() -> None:
    case = load_test_case("scenarios/scenario3/behind_the_bus.foresee::commuter")
    plain, ideal = (run_test_case(case, driver, 0) for driver in ("pdm", "pdm+ideal"))
    assert plain.trace.digest != ideal.trace.digest
    assert {plain.verdict, ideal.verdict} == {Verdict.PASS}
