"""The conformance suite: drivers with one fault each fail the check that is for it, and bundled drivers fail none."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.campaign.conformance.records import Check, CheckStatus, Conformance, ConformanceCase
from foresee_dsl.campaign.conformance.runs import ExaminedDriver
from foresee_dsl.campaign.conformance.suite import (
    check_answers,
    check_handover,
    check_parts,
    check_place,
    check_process,
    check_repetition,
    check_reset,
    check_speed,
    check_steering,
    check_times,
    conform,
    conformance_cases,
    step_times,
)
from foresee_dsl.cli import app
from foresee_dsl.drivers.consent import allowing
from foresee_dsl.drivers.deadlines import DEADLINES
from foresee_dsl.drivers.parts import with_ideal
from foresee_dsl.files import data_folder
from foresee_dsl.language.document import TestCase
from foresee_dsl.report.builds.case_results import of_conformance
from foresee_dsl.report.formats import CommandReport, rendered
from foresee_dsl.simulate.results.verdict import RunRecord, Verdict

CASES = conformance_cases()
FAULTS = """
import dataclasses, math, os, time
import my_driver
from my_driver import MyDriver

class Changed(MyDriver):
    def step(self, seen):
        return dataclasses.replace(answer := super().step(seen), **self.change(answer))

class Mirrored(Changed):
    def change(self, answer): return {"steer": -answer.steer}

class Degrees(Changed):
    def change(self, answer): return {"steer": answer.steer * 35}

class NotANumber(Changed):
    def change(self, answer): return {"steer": math.nan}

class Exchanged(Changed):
    def change(self, answer): return {"throttle": answer.brake, "brake": answer.throttle}

class Random(Changed):
    def change(self, answer): return {"brake": os.urandom(1)[0] / 2550}

class Slow(Changed):
    def change(self, answer):
        time.sleep(0.02)
        return {}

class Counting(Changed):
    def reset(self, mission, vehicle, seed):
        super().reset(mission, vehicle, seed)
        my_driver.runs = self.before = getattr(my_driver, "runs", 0) + 1
    def change(self, answer): return {"brake": 0.001 * self.before}

class Remembering(Changed):
    stood_s = 0.0
    def change(self, answer):
        self.stood_s += 0.05
        return {"throttle": min(answer.throttle, self.stood_s / 60)}

class Tired(Remembering):
    def reset(self, mission, vehicle, seed):
        super().reset(mission, vehicle, seed)
        self.stood_s = 0.0

class Aside(MyDriver):
    def point(self, s):
        x, y = super().point(s)
        return x, y + 1.2

class KmPerHour(MyDriver):
    def reset(self, mission, vehicle, seed):
        super().reset(dataclasses.replace(mission, speed_limit_mps=mission.speed_limit_mps * 3.6), vehicle, seed)

class Chdir(MyDriver):
    def reset(self, mission, vehicle, seed):
        super().reset(mission, vehicle, seed)
        os.environ["HOME"] = "/"
        with open("driver.log", "a") as log: log.write("reset")

class Stuck(MyDriver):
    def close(self): raise OSError("no answer")

class Parts(MyDriver):
    parts = ("tracking",)
    def idealise(self, ideal, truth): raise NotImplementedError("tracking")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the driver of `foresee init --driver python`, and drivers that change one thing of it."""
    folder = tmp_path_factory.mktemp("drivers")
    shutil.copy(data_folder("templates") / "init" / "drivers" / "python" / "my_driver.py", folder)
    (folder / "faults.py").write_text(FAULTS, encoding="utf-8")
    return folder


@pytest.fixture(autouse=True)
def consent(folder: Path) -> Iterator[None]:
    with allowing([f"python:{folder / 'faults.py'}:{line.split()[1].partition('(')[0]}"
                   for line in FAULTS.splitlines() if line.startswith("class ")]):  # fmt: skip
        yield


def drive(folder: Path, name: str) -> ExaminedDriver:
    return ExaminedDriver(f"python:{folder / 'faults.py'}:{name}", 0, DEADLINES)


def case(name: str) -> TestCase:
    return CASES[name]


def failed(check: Check, *words: str) -> None:
    assert check.status is CheckStatus.FAIL, check
    assert check.advice and all(word in check.detail for word in words), check


def test_there_are_ten_cases_with_a_sentence_each() -> None:
    assert len(CASES) == 10
    assert [test_case.source.name[:2] for test_case in CASES.values()] == [f"{k:02}" for k in range(1, 11)]


def test_answers_outside_their_range_fail(folder: Path) -> None:
    failed(check_answers([drive(folder, "Degrees").case(case("two_bends"))]), "steer", "outside -1 to 1")
    failed(check_answers([drive(folder, "NotANumber").case(case("straight_road"))]), "nan")


def test_steering_to_the_wrong_side_fails(folder: Path) -> None:
    run = drive(folder, "Mirrored").case(case("two_bends"))
    assert not run.passed
    failed(check_steering(run), "only to the side of the route in 0 of")


def test_units_of_speed_are_checked(folder: Path) -> None:
    failed(check_speed(drive(folder, "KmPerHour").case(case("straight_road"))), "times the speed limit")
    failed(check_speed(drive(folder, "Exchanged").case(case("straight_road"))), "the ego moved 0.")


def test_a_driver_beside_the_lane_fails(folder: Path) -> None:
    failed(check_place(drive(folder, "Aside").case(case("straight_road"))), "left of the lane's middle")


def test_a_driver_that_cannot_be_closed_fails(folder: Path) -> None:
    run = drive(folder, "Stuck").case(case("straight_road"))
    assert run.passed
    failed(check_process([run]), "could not be closed after the run", "OSError: no answer, at faults.py:")


def test_a_driver_that_is_not_deterministic_fails(folder: Path) -> None:
    faulty = drive(folder, "Random")
    runs = faulty.in_one_process((case("straight_road"), case("red_light")))
    failed(check_repetition(runs, faulty.case(case("straight_road"))), "in the same process differs")


def test_a_driver_that_counts_its_runs_in_the_process_fails(folder: Path) -> None:
    faulty = drive(folder, "Counting")
    runs = faulty.in_one_process((case("straight_road"), case("red_light")))
    failed(check_reset(runs), "a run after a run of another test case differs")


def test_a_driver_object_that_forgets_nothing_at_reset_fails(folder: Path) -> None:
    runs = drive(folder, "Remembering").in_one_process((case("straight_road"), case("red_light")))
    assert runs.first.digest == runs.second.digest == runs.after.digest
    failed(check_reset(runs), "a driver object that is reset for a second run")


def test_a_driver_that_depends_on_its_memory_drives_a_clip_differently(folder: Path) -> None:
    failed(check_handover(drive(folder, "Tired").handover(case("zebra_crossing"))), "deviates by at most")


def test_slow_steps_fail_near_their_deadline(folder: Path) -> None:
    run = drive(folder, "Slow").case(case("zebra_crossing"))
    times = step_times([run])
    assert times is not None and times.mean_ms > 20
    failed(check_times(times, 0.03), "mean")
    assert check_times(times, 10.0).status is CheckStatus.PASS


def test_a_part_that_cannot_be_replaced_fails(folder: Path) -> None:
    faulty = drive(folder, "Parts")
    address = with_ideal(faulty.driver, ["tracking"])
    failed(check_parts({"tracking": faulty.with_ideal_part((case("zebra_crossing"), address))}), "tracking")


def test_the_whole_suite_names_what_a_driver_leaves_behind(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["conform", drive(folder, "Chdir").driver])
    assert done.exit_code == 1
    assert "1 environment variable (HOME)" in " ".join(done.output.split())
    assert "driver.log" in done.output
    assert "does not conform: 10 of 12 checks, 10 of 10 cases pass" in done.output.replace("\n", " ")
    assert max(map(len, done.output.splitlines()[2:-1])) <= 80


def test_a_bundled_driver_conforms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["conform", "idm", "--json"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert (report["document"], report["conforms"]) == ("conform", True)
    assert {check["status"] for check in report["checks"]} == {"pass"}
    assert [test_case["verdict"] for test_case in report["cases"]] == ["pass"] * 10


def test_a_driver_that_does_not_start_gets_one_check(folder: Path) -> None:
    result = conform(f"python:{folder / 'faults.py'}:Changed")
    assert isinstance(result, Conformance)
    assert not result.conforms
    (check,) = result.checks
    assert check.name == "starts" and "AttributeError" in check.detail


def test_build_servers_get_each_check_at_the_driver_s_file(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    junit = tmp_path / "conform.xml"
    words = ["conform", "python:faults.py:Changed", "--format", "sarif", "--junit", str(junit)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1, done.output
    (found,) = json.loads(done.stdout)["runs"][0]["results"]
    assert found["ruleId"] == "conformance" and found["message"]["text"].startswith("starts: ")
    assert found["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "faults.py"
    assert (
        'name="starts"' in junit.read_text()
        and "reproduce: foresee conform python:faults.py:Changed" in junit.read_text()
    )


def test_a_result_without_a_file_is_valid_in_every_format() -> None:
    run = RunRecord(verdict=Verdict.F2, reason="collision with walker")
    checks = (Check("starts", CheckStatus.PASS, "well"), Check("speed", CheckStatus.SKIPPED, "it does not apply"))
    conformance = Conformance("idm", "1", 0, checks, (ConformanceCase("steps_out", "a walker steps out", run),))
    results = of_conformance(conformance)
    assert [(result.name, result.outcome.value) for result in results] == [
        ("starts", "passed"),
        ("steps_out", "failed"),
    ]
    assert results[1].reproduce.endswith("cases/09_steps_out.foresee --driver idm")
    report = CommandReport("conform", lambda: "{}", lambda: results)
    assert rendered("github", report).startswith("::error title=F2 ")
    assert json.loads(rendered("sarif", report))["runs"][0]["results"][0]["locations"] == []
    assert "\n\n" not in results[1].text
