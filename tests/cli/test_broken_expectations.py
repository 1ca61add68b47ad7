"""A broken `expect` line fails its run in every command; its label, what it asks and the value are the reason."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.folder import as_text, campaign_document
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.simulate.results.verdict import Verdict
from tests.cli.test_ci import run_pytest
from tests.support.first_project import checked, foresee
from tests.support.hidden_walker import TEXT

SCENE = """foresee 1

scenario s {
  network n {
    junction a at (0 m, 0 m)
    junction b at (90 m, 0 m)
    road r from a to b
  }
  ego: car.sedan {
    route [r]
  }
  expect slow: always ego.speed < 30 km/h
  end after 20 s
}
"""
REASON = "does not hold: expect slow: always ego.speed < 30 km/h (50.00 km/h in `ego.speed < 30 km/h`); arrived at "


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    file = Path("s.foresee")
    file.write_text(SCENE)
    return file


def test_run_and_assess_fail_with_the_expectation_as_their_reason(scene: Path) -> None:
    done = foresee("run", scene, "--driver", "idm", expect=1)
    assert done.stdout.startswith(f"s.foresee: expectation, {REASON}"), done.stdout
    foresee("run", scene, "--driver", "idm", "--exit-zero")
    run = checked(foresee("run", scene, "--driver", "idm", "--json", expect=1).stdout)
    assert run["verdict"] == "pass" and run["reason"].startswith(REASON)
    assert run["expectations"][0]["value"] == pytest.approx(50, abs=0.01)
    assert 'type="expectation"' in foresee("run", scene, "--driver", "idm", "--format", "junit", expect=1).stdout
    done = foresee("assess", scene, "--driver", "idm", "--failures", expect=1)
    assert "idm: 1 of 1 test case failed: 1 expectation" in done.stdout
    assert f"expectation: {REASON}" in done.stdout


def test_an_expectation_that_holds_passes(scene: Path) -> None:
    scene.write_text(SCENE.replace("30 km/h", "60 km/h"))
    assert "s.foresee: pass, arrived at" in foresee("run", scene, "--driver", "idm").stdout


def test_several_cases_are_counted_and_the_broken_one_is_named(scene: Path) -> None:
    limit = "  param limit: speed = 60 km/h\n  case a {}\n  case b { limit = 30 km/h }\n"
    scene.write_text(SCENE.replace("  expect", f"{limit}  expect").replace("< 30 km/h", "< limit"))
    done = foresee("run", scene, "--driver", "idm", expect=None)
    assert done.exit_code == 1 and "1 of 2 test cases failed: 1 expectation" in done.stdout, done.output
    assert "s.foresee::b: expectation, does not hold: expect slow" in done.stdout


def test_verify_and_pytest_judge_alike(scene: Path) -> None:
    scene.write_text(SCENE.replace("  end", "  expected idm passes\n  end"))
    done = foresee("verify", scene, "--driver", "idm", "--jobs", "1", expect=1)
    assert "came back" in done.stdout and REASON in done.stdout
    done = run_pytest(scene, "--foresee-driver", "idm")
    assert done.returncode == 1 and f"came back: {REASON}" in done.stdout, done.stdout
    foresee("verify", scene, "--driver", "idm", "--jobs", "1", "--update")
    assert "expected idm fails\n" in scene.read_text()
    foresee("verify", scene, "--driver", "idm", "--jobs", "1")
    assert run_pytest(scene, "--foresee-driver", "idm").returncode == 0


def test_a_campaign_says_it_in_report_data_junit_and_page(scene: Path) -> None:
    options = ("--driver", "idm", "--quiet", "--jobs", "1", "--junit", "j.xml")
    done = foresee("campaign", scene, *options, expect=1)
    assert "1 of 1 test case failed: 1 expectation" in done.stdout
    assert "Expectations that do not hold, in 1 run without another failure:" in done.stdout
    data = checked(Path("out/campaign.json").read_text())
    case = data["test_cases"][0]
    assert case["broken_expectations"] == [REASON.partition(";")[0]] and case["verdict"] == "pass"
    assert data["seeds"] == {"total": 1, "passed": 0, "failed": 1}
    assert 'type="expectation"' in Path("j.xml").read_text()
    page = Path("out/report.html").read_text()
    assert "No failures, but 1 run breaks an expectation, among 0 children" in page
    assert "Nothing failed, but 1 run breaks an expectation: the overview lists them." in page
    assert "1 broke an expectation" in page and "does not hold: expect slow" in page
    compared = json.loads(foresee("compare", "out", "out", "--json").stdout)
    assert compared["rows"][0]["base_failed"] == 1, compared


def test_a_mutant_that_breaks_only_an_expectation_is_kept_and_expected_to_fail(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = TEXT.replace("< 32 m", "< 12 m")
    Path("w.foresee").write_text(text.replace("  end after", "  expect slow: always ego.speed < 5 km/h\n  end after"))
    foresee("run", "w.foresee", "--driver", "idm", "--out", "runs", expect=1)
    foresee("clip", "runs/hidden_walker.npz", "--before", "2", "--after", "2", "--out", "clips")
    options = ("--driver", "idm", "--children", "1", "--exit-zero")
    foresee("mutate", "clips/hidden_walker_p1.foresee", *options, "--out", "mutants")
    (mutant,) = Path("mutants").glob("*_m1.foresee")
    assert '    found "does not hold: expect slow: always ego.speed < 5 km/h (' in mutant.read_text()
    assert "1 as expected" in foresee("verify", "mutants", "--jobs", "1").stdout
    foresee("keep", mutant, "--to", "kept")
    assert "\n  expected idm fails\n" in (Path("kept") / mutant.name).read_text()
    assert "1 as expected" in foresee("verify", "kept", "--jobs", "1").stdout
    refused = str(foresee("minimise", mutant, expect=1).exception)
    assert f"{mutant.stem} breaks only an expectation, which is minimised only as the goal of a campaign" in refused


def test_mutants_that_break_only_an_expectation_are_named_by_review_page_and_markdown(tmp_path: Path) -> None:
    case = CaseRunOutcome("a.foresee::r01", "7", "a", 1.0, verdict=Verdict.PASS, reason="arrived", duration_s=10.0)
    child = ChildOutcome("a_r01_p1_m1", verdict=Verdict.PASS, reason="arrived", broken_expectations=("room > 1 m",))
    child = replace(child, file="m1.foresee")
    children = (child, *(replace(child, name=f"a_r01_p1_m{k}") for k in range(2, 131)))
    clip = ClipOutcome(case.id, name="a_r01_p1", verdict=Verdict.PASS, reason="arrived", children=children)
    out = tmp_path / "out"
    out.mkdir()
    result = CampaignResult(CampaignSettings(), (case,), (clip,), 1.0)
    (out / "campaign.json").write_text(as_text(campaign_document(result)))
    refused = str(foresee("review", child.name, "--campaign", out, expect=1).exception)
    assert f"{child.name} breaks only an expectation, which is reviewed only as the goal of a campaign" in refused
    assert "foresee campaign PATH --goal LABEL" in refused
    listed = foresee("review", "--campaign", out).stdout
    head = "no findings\n\nExpectations that do not hold, in 130 runs without another failure:\n  room > 1 m\n"
    assert listed == head + "".join(f"    {one.name}\n" for one in children)
    page, text = tmp_path / "page.html", tmp_path / "page.md"
    foresee("report", out, "--output", page)
    foresee("report", out, "--format", "markdown", "--output", text)
    told = "No failures, but 130 runs break an expectation, among 130 children"
    assert told in page.read_text() and told in text.read_text()
    assert "a_r01_p1_m100<" in page.read_text() and "and 30 more: campaign.json has all" in page.read_text()
    assert "\n| a&#95;r01&#95;p1&#95;m1 | a.foresee::r01 | room &#62; 1 m |\n| a&#95;r01" in text.read_text()
    assert "\nand more: campaign.json has all\n" in text.read_text()
