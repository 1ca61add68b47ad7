"""`foresee diagnose`: ideal parts of drivers, what they declare, and the part that causes a failure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.avoidance.causes import Diagnosis, diagnosed
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.findings.diagnosing import FILE, diagnose, diagnosis_of, failing_named
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.parts import DriverPart, ideal_parts, parts_of, with_ideal, without_ideal
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError, ForeseeError
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult, Verdict

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
