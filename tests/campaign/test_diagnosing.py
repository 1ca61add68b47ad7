"""`foresee diagnose`: ideal parts of drivers, what they declare, and the part that causes a failure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from foresee_dsl.avoidance.causes import Diagnosis, diagnosed
from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.findings.diagnosing import (
    FILE,
    DiagnosedFailure,
    Failing,
    diagnose,
    diagnosis_of,
    failing_named,
)
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.parts import DriverPart, ideal_parts, parts_of, with_ideal, without_ideal
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.terminal.review import diagnosis_text
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Event
from tests.support.handmade_traces import EAST, NORTH, make_trace, straight

P = DriverPart


def test_an_address_names_ideal_parts() -> None:
    assert with_ideal("pdm", [P.TRACKING, P.PERCEPTION]) == "pdm+ideal+ideal_tracking"
    assert ideal_parts("pdm+ideal+ideal_tracking") == {P.PERCEPTION, P.TRACKING}
    assert ideal_parts("external+ideal_control:a+ideal") == {P.CONTROL}
    assert without_ideal("pdm+ideal_rules+ideal") == "pdm" and ideal_parts("pdm+ideal_mood") == frozenset()


@pytest.mark.parametrize(("name", "lacks"), [("pdm", ()), ("idm", (P.PREDICTION,))])
def test_bundled_drivers_declare_their_parts(name: str, lacks: tuple[DriverPart, ...]) -> None:
    assert parts_of(load_driver(name)) == tuple(part for part in P if part not in lacks)
    for part in lacks:
        with pytest.raises(DriverError, match=f"does not declare its {part}"):
            load_driver(with_ideal(name, [part]))


def test_ideal_parts_change_the_run_and_end_it_alike(scenarios: Path) -> None:
    case = load_test_case(f"{scenarios / 'scenario7.foresee'}::r01")
    plain = run_test_case(case, "pdm", 0)
    assert plain.verdict is Verdict.PASS
    digests = {
        part: run_test_case(case, with_ideal("pdm", [part]), 0).trace.digest for part in (P.PERCEPTION, P.CONTROL)
    }
    assert plain.trace.digest not in digests.values()
    assert run_test_case(case, "pdm", 0).trace.digest == plain.trace.digest


def test_without_a_part_that_helps_it_is_the_planning(scenarios: Path) -> None:
    case = load_test_case(f"{scenarios / 'scenario7.foresee'}::r01")
    passed = run_test_case(case, "pdm", 0)
    failed = replace(passed, verdict=Verdict.RULE, reason="rule: ego runs red")
    bundle, declared = compile_test_case(case), parts_of(load_driver("pdm"))

    def drive(*helping: DriverPart) -> Diagnosis:
        def again(parts: frozenset[DriverPart]) -> RunResult:
            return passed if helping and parts >= set(helping) else failed

        return diagnosed(failed, bundle, again, driver="pdm", seed=0, declared=declared)

    nothing = drive()
    assert nothing.cause == () and "planning" in nothing.text and len(nothing.runs) == len(P) + 1
    assert drive(P.TRACKING).text.startswith("the failure goes away with ideal tracking")
    both = drive(P.TRACKING, P.CONTROL)
    assert both.cause == (P.TRACKING, P.CONTROL) and "only goes away with ideal tracking and control" in both.text
    assert len(drive(P.TRACKING, P.CONTROL, P.RULES).cause) == 3


def test_a_part_with_which_the_driver_passes_elsewhere_is_the_probable_cause(scenarios: Path) -> None:
    case = load_test_case(f"{scenarios / 'scenario7.foresee'}::r01")
    passed = run_test_case(case, "pdm", 0)
    van = straight("van", 50.0, 0.0, EAST, 0.0, seconds=4.0)
    hit = Event(4.0, "ego", "collision", {"with": "van"})
    failed = replace(
        passed,
        verdict=Verdict.F4,
        reason="F4 collision with van",
        trace=make_trace({"ego": straight("car", 0.0, 0.0, EAST, 10.0, seconds=4.0), "van": van}, events=[hit]),
    )
    turned = replace(passed, trace=make_trace({"ego": straight("car", 0.0, 0.0, NORTH, 10.0, seconds=4.0), "van": van}))

    def drive(parts: frozenset[DriverPart]) -> RunResult:
        return turned if P.TRACKING in parts else failed

    no_map: Any = SimpleNamespace()  # an actor that stands needs no map
    diagnosis = diagnosed(failed, no_map, drive, driver="pdm", seed=0, declared=(P.PERCEPTION, P.TRACKING, P.CONTROL))
    assert diagnosis.cause == (P.TRACKING,) and not diagnosis.sure
    assert diagnosis.text.startswith("probably tracking:") and diagnosis.also == ()
    likely = diagnosed(
        failed, no_map, lambda parts: turned if parts & {P.TRACKING, P.CONTROL} else failed, driver="pdm", seed=0,
        declared=(P.PERCEPTION, P.TRACKING, P.CONTROL),
    )  # fmt: skip
    assert len(likely.cause) == 1 and {*likely.cause, *likely.also} == {P.CONTROL, P.TRACKING}
    assert likely.text.startswith(f"probably {likely.cause[0]} (as likely: {likely.also[0]}):")
    table = diagnosis_text(DiagnosedFailure(Failing("turns", case, DriverSetup("pdm")), diagnosis))
    assert "still fails: F4 collision with van" in table
    assert "passes elsewhere: it takes another way" in table and "Passes elsewhere: the ego no longer" in table


def test_the_command_says_why_a_passing_test_case_is_not_diagnosed(scenarios: Path) -> None:
    failing = failing_named(f"{scenarios / 'scenario7.foresee'}::r01", Path("out"))
    (result,) = diagnose([failing])
    assert result.diagnosis is None and result.note.startswith("it does not fail with pdm: arrived")


def test_a_diagnosis_of_another_run_is_not_shown(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text('{"a": {"reason": "F4: hit", "text": "the cause"}}')
    assert diagnosis_of(tmp_path, "a", "F4: hit") == "the cause"
    assert diagnosis_of(tmp_path, "a", "F1: alone") == "" and diagnosis_of(tmp_path, "b", "F4: hit") == ""
    (tmp_path / FILE).write_text("[")
    with pytest.raises(ForeseeError, match="cannot be read"):
        diagnosis_of(tmp_path, "a", "F4: hit")
