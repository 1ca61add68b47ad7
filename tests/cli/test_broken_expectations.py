"""A broken `expect` line fails its run in every command; its label, what it asks and the value are the reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.test_ci import run_pytest
from tests.support.first_project import checked, foresee

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
    assert "1 broke an expectation" in page and "does not hold: expect slow" in page
    compared = json.loads(foresee("compare", "out", "out", "--json").stdout)
    assert compared["rows"][0]["base_failed"] == 1, compared
