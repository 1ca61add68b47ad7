"""The parts of a suite's tools that need no run: edits of a text, which line is about a driver, the exact test."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.regression.comparison import ComparedRun, OutcomeChange, Side, compare, exact_p
from foresee_dsl.campaign.regression.edits import with_doc, with_expected, with_paths
from foresee_dsl.campaign.regression.expectations import (
    Status,
    expected_in,
    in_words,
    judge,
    name_to_record,
    names_of,
    recorded_end,
    recorded_in,
)
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import format_text, parse
from foresee_dsl.report.terminal.comparison import to_markdown
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import DriverNotes, Hang, RunRecord, Verdict

MUTANT = """foresee 1

mutant a_m1 of "a.foresee" pin sha256:5ef2c6120a41 {
  # Why it is here.
  change walker.timing: 1.00 => 1.38  # faster

  origin {
    driver "pdm 2"
    found "F2 collision with walker (pedestrian) at 4.75 s, 6.4 m/s"
  }
}
"""
FAILS = m.Expected(driver="pdm", outcome="fails", failure="F2", actor="walker")


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_line_is_added_and_replaced_and_nothing_else_changes(end: str) -> None:
    text = MUTANT.replace("\n", end)
    once = with_expected(text, FAILS)
    assert once == text.replace(f"# faster{end}", f"# faster{end}{end}  expected pdm fails F2 with walker{end}")
    assert format_text(once, "a") == once.replace("\r\n", "\n")
    again = with_expected(once, m.Expected(driver="pdm", outcome="passes"))
    assert again == once.replace("fails F2 with walker", "passes")
    other = with_expected(again, m.Expected(driver="idm", outcome="fails"))
    assert other == again.replace(f"pdm passes{end}", f"pdm passes{end}  expected idm fails{end}")


def test_a_text_in_one_line_is_laid_out() -> None:
    text = (
        'foresee 1\nmutant a_m1 of "a.foresee" pin sha256:5ef2c6120a41 { change a.timing: 1 => 2; origin { seed 0 } }\n'
    )
    assert "\n  expected pdm fails F2 with walker\n" in with_expected(text, FAILS)


def test_paths_and_sentences() -> None:
    assert with_paths(MUTANT, {"a.foresee": "parents/a_2.foresee"}) == MUTANT.replace('"a.', '"parents/a_2.')
    assert with_doc(MUTANT, "It is hit.") == MUTANT  # its comment says it
    bare = MUTANT.replace("  # Why it is here.\n", "")
    assert "{\n  doc \"Its 'own' words\"\n\n  change" in with_doc(bare, 'Its "own"\nwords')


def test_the_most_exact_line_is_about_a_run() -> None:
    lines = [
        m.Expected(driver="pdm", outcome="fails"),
        m.Expected(driver="pdm 3", outcome="passes"),
        m.Expected(driver="pdm", case="wet", outcome="fails", failure="stuck"),
        m.Expected(driver="keeper", outcome="passes"),
    ]
    found = [expected_in(lines, case, names_of("pdm", version)) for case, version in
             ((None, "2"), (None, "3"), ("wet", "2"), ("dry", "2"))]  # fmt: skip
    assert [in_words(one) for one in found] == ["fails", "passes", "fails stuck", "fails"]
    program = "external:python3 keeper.py"
    assert in_words(expected_in(lines, None, names_of(program, "keeper 7"))) == "passes"
    assert expected_in(lines, None, names_of("idm", "1")) is None
    assert [name_to_record("pdm", "2"), name_to_record(program, "keeper 7"), name_to_record(program, "")] == [
        "pdm",
        "keeper",
        program,
    ]


def test_a_mutant_without_a_line_is_expected_to_fail_as_found() -> None:
    model = parse(MUTANT, "a").model
    assert isinstance(model, m.Mutant)
    assert recorded_in(model.origin) == FAILS
    assert expected_in((), None, names_of("pdm", "9"), model.origin) == FAILS
    assert expected_in((), None, names_of("idm", "1"), model.origin) is None
    broken = m.Origin(driver="pdm 2", found="does not hold: expect room: always a > 1 m; arrived at 3.00 s")
    assert in_words(expected_in((), None, names_of("pdm", "9"), broken)) == "fails"
    assert expected_in((), None, names_of("pdm", "9"), m.Origin(driver="pdm 2", found="arrived at 3.00 s")) is None


@pytest.mark.parametrize(
    ("expected", "verdict", "actor", "status"),
    [
        (FAILS, Verdict.F2, "walker", Status.AS_EXPECTED),
        (FAILS, Verdict.F2, "other", Status.CHANGED),
        (FAILS, Verdict.STUCK, "", Status.CHANGED),
        (FAILS, Verdict.PASS, "", Status.FIXED),
        (FAILS, Verdict.CRASH, "", Status.CRASHED),
        (FAILS, Verdict.TIMEOUT, "", Status.TIMED_OUT),
        (m.Expected(driver="pdm", outcome="passes"), Verdict.F4, "other", Status.CAME_BACK),
        (m.Expected(driver="pdm", outcome="passes"), Verdict.TIMEOUT, "", Status.TIMED_OUT),
        (m.Expected(driver="pdm", outcome="fails"), Verdict.F1, "", Status.AS_EXPECTED),
        (m.Expected(driver="pdm", outcome="fails", failure="timeout"), Verdict.TIMEOUT, "", Status.AS_EXPECTED),
        (None, Verdict.PASS, "", Status.NEW),
        (None, Verdict.CRASH, "", Status.CRASHED),
    ],
)
def test_how_a_run_compares(expected: m.Expected | None, verdict: Verdict, actor: str, status: Status) -> None:
    run = RunRecord(verdict=verdict, with_=actor)
    assert judge(expected, run) is status
    if verdict is Verdict.TIMEOUT:
        hung = replace(run, notes=DriverNotes(hang=Hang("step", 1.0)))
        assert judge(expected, hung) is Status.TIMED_OUT  # not a result, whatever is said


@pytest.mark.parametrize("one", range(9))
@pytest.mark.parametrize("other", range(9))
def test_the_exact_p_is_the_sum_of_splits_that_are_no_more_probable(one: int, other: int) -> None:
    number = one + other
    splits = [math.comb(number, k) / 2**number for k in range(number + 1)]
    assert exact_p(one, other) == pytest.approx(sum(p for p in splits if p <= splits[one] * (1 + 1e-7)))


def side(label: str, verdicts: dict[str, Verdict], near: dict[str, float]) -> Side:
    runs = (
        ComparedRun(f"sha256:{name}", name, "3" if name < "f" else "4", verdict=verdict,
            reason=f"{verdict} <b>|</b>",
            near=NearMisses(None, NearMiss(near[name], 1.0, "walker") if name in near else None, None, None))
        for name, verdict in verdicts.items()
    )  # fmt: skip
    return Side(label, tuple(runs))


def test_what_a_comparison_says() -> None:
    good = dict.fromkeys("abcdefghij", Verdict.PASS)
    bad = good | dict.fromkeys("abcdefg", Verdict.F2) | {"h": Verdict.INVALID}
    found = compare(side("old", good, {"i": 1.5, "j": 1.5}), side("new", bad, {"i": 1.4, "j": 0.4}))
    assert len(found.of(OutcomeChange.NEW_FAILURE)) == 7 and not found.of(OutcomeChange.FIXED)
    assert [(pair.new.name, pair.nearer.now) for pair in found.nearer if pair.nearer] == [("j", 0.4)]  # i: too little
    assert found.only_base == ("h",)
    assert [(row.label, row.pairs, row.new_failures, round(row.p, 4)) for row in found.rows] == [
        ("all", 9, 7, 0.0156),
        ("family 3", 5, 5, 0.0625),
        ("family 4", 4, 2, 0.5),
        ("F2", 9, 7, 0.0156),
    ]
    assert found.sentence.startswith("7 new failures, 0 fixed: more failures than by chance (p = 0.016")
    comment = to_markdown(found)
    assert "<b>" not in comment and "&lt;b&gt;" in comment and len(comment) < 60_000


def test_the_files_that_explain_it_are_there(root: Path) -> None:
    page = (root / "docs" / "guide" / "regression.md").read_text(encoding="utf-8")
    assert all(f"`{status.label}`" in page for status in Status)


@pytest.mark.parametrize(
    ("reason", "verdict", "actor"),
    [
        ("F2 collision with walker (pedestrian) at 4.75 s, 6.4 m/s", Verdict.F2, "walker"),
        ("F1 left the drivable area at 3.20 s", Verdict.F1, ""),
        ("stuck: stood for 10 s with nothing to wait for, until 12.00 s", Verdict.STUCK, ""),
    ],
)
def test_only_a_contact_is_with_somebody(reason: str, verdict: Verdict, actor: str) -> None:
    run = recorded_end(reason)
    assert run is not None
    assert (run.verdict, run.with_) == (verdict, actor)
