"""The comparison of two versions of a driver: which near miss became nearer, the order of what changed, its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from foresee_dsl.campaign.regression.comparison import ComparedRun, Pair, Side, compare
from foresee_dsl.documents import read_record
from foresee_dsl.simulate.results.near_misses import NearMiss, NearMisses
from foresee_dsl.simulate.results.verdict import ExpectationResult, Verdict, passes

NONE: dict[str, Any] = dict.fromkeys(("distance_m", "ttc_s", "pet_s", "drac_mps2"))
"""The measures of near misses without a value."""


def ran(
    name: str = "a", verdict: Verdict = Verdict.PASS, near: Mapping[str, float] | None = None, **more: str
) -> ComparedRun:
    misses = NearMisses(**{**NONE, **{key: NearMiss(value, 1.0, "kid") for key, value in (near or {}).items()}})
    return ComparedRun(name, name, more.get("family", ""), verdict=verdict, near=None if near is None else misses)


def nearer(measure: str, was: float | None, now: float) -> tuple[float | None, float, float] | None:
    """Return the values before and after and the share, if a pair became nearer by a measure."""
    base = ran(near={} if was is None else {measure: was})
    found = Pair(base, ran(near={measure: now})).nearer
    return None if found is None else (found.was, found.now, found.share)


@pytest.mark.parametrize(
    ("measure", "was", "now", "expected"),
    [
        ("distance_m", 3.0, 0.99, (3.0, 0.99, 2.01)),
        ("distance_m", 3.0, 1.01, None),  # it is still far
        ("distance_m", 0.6, 0.39, (0.6, 0.39, 0.21)),
        ("distance_m", 0.6, 0.41, None),  # too small a change
        ("distance_m", 0.4, 0.6, None),  # it is farther now
        ("distance_m", None, 0.9, (None, 0.9, 0.3)),  # no value counts as one step beyond the limit, 1.2 m
        ("ttc_s", 4.0, 1.99, (4.0, 1.99, 1.005)),
        ("ttc_s", 4.0, 2.01, None),
        ("ttc_s", 1.0, 0.79, (1.0, 0.79, 0.105)),
        ("ttc_s", 1.0, 0.81, None),
        ("pet_s", 4.0, 1.99, (4.0, 1.99, 1.005)),
        ("pet_s", 4.0, 2.01, None),
        ("pet_s", 1.0, 0.81, None),
        ("pet_s", 1.0, 0.79, (1.0, 0.79, 0.105)),
        ("drac_mps2", 1.0, 3.01, (1.0, 3.01, 0.67)),
        ("drac_mps2", 1.0, 2.99, None),
        ("drac_mps2", 4.0, 4.51, (4.0, 4.51, 0.17)),
        ("drac_mps2", 4.0, 4.49, None),
        ("drac_mps2", 5.0, 4.0, None),
        ("drac_mps2", None, 3.1, (None, 3.1, 0.2)),  # no value counts as 2.5 m/s^2
    ],
)
def test_a_near_miss_is_nearer_by_more_than_a_step_within_its_limit(
    measure: str, was: float | None, now: float, expected: tuple[float | None, float, float] | None
) -> None:
    assert nearer(measure, was, now) == (expected and pytest.approx(expected))


def test_an_infinite_value_is_far_and_null_in_json() -> None:
    near = read_record(NearMisses, {**NONE, "ttc_s": {"value": None, "time_s": 1.0, "with": "kid"}})
    base = ComparedRun("a", "a", "", verdict=Verdict.PASS, near=near)
    found = Pair(base, ran(near={"ttc_s": 1.0})).nearer
    assert found is not None and (found.share, found.actor) == (99.0, "kid")
    assert Pair(base, base).nearer is None
    assert Pair(ran(near=None), ran(near={"ttc_s": 1.0})).nearer is None  # an older record holds no near misses


def test_of_several_measures_the_one_with_the_largest_share_counts() -> None:
    pair = Pair(ran(near={"ttc_s": 2.0, "distance_m": 2.0}), ran(near={"ttc_s": 1.5, "distance_m": 0.9}))
    assert pair.nearer is not None and pair.nearer.measure == "distance_m"
    failing = ran(verdict=Verdict.F2, near={"ttc_s": 0.1})
    assert Pair(ran(near={"ttc_s": 2.0}), failing).nearer is None  # only pairs that pass on both sides


def test_nearer_pairs_are_in_the_order_of_their_change() -> None:
    base = Side("old", tuple(ran(name, near={"ttc_s": 3.0}) for name in "abc"))
    new = Side("new", tuple(ran(name, near={"ttc_s": now}) for name, now in (("a", 1.5), ("b", 0.5), ("c", 1.0))))
    assert [pair.new.name for pair in compare(base, new).nearer] == ["b", "c", "a"]


def test_tests_that_cannot_be_run_on_either_side_are_named() -> None:
    compared = compare(Side("old", (ran(),), ("x: gone",)), Side("new", (ran(),), ("y: torn",)))
    assert compared.broken == ("x: gone", "y: torn")


def test_crashes_come_before_failures_of_the_drive() -> None:
    base = Side("old", tuple(ran(name) for name in "abcd"))
    verdicts = (Verdict.F2, Verdict.CRASH, Verdict.F4, Verdict.TIMEOUT)
    new = Side("new", tuple(ran(name, verdict) for name, verdict in zip("abcd", verdicts, strict=True)))
    compared = compare(base, new)
    assert [pair.new.name for pair in compared.new_failures] == ["b", "d", "a", "c"]
    assert not compared.ok


def test_figures_by_family_and_kind() -> None:
    base = Side("old", (ran("a", Verdict.F2, family="10"), ran("b", family="2"), ran("c", family="3"), ran("d")))
    new = Side("new", (ran("a", family="10"), ran("b", Verdict.F2, family="2"), ran("c", family="3"), ran("d")))
    compared = compare(base, new)
    rows = {row.label: (row.kind, row.pairs, row.base_failed, row.new_failed, row.new_failures, row.fixed)
            for row in compared.rows}  # fmt: skip
    assert list(rows) == ["all", "family 2", "family 3", "family 10", "family -", "F2"]
    assert rows["all"] == (False, 4, 1, 1, 1, 1)
    assert rows["family 2"] == (False, 1, 0, 1, 1, 0)
    assert rows["family 10"] == (False, 1, 1, 0, 0, 1)
    assert rows["F2"] == (True, 4, 1, 1, 1, 1)
    assert compared.sentence == "1 new failure, 1 fixed: it may be chance (p = 1, exact two-sided test)"


def test_the_sentence_says_what_is_more_than_chance() -> None:
    def sentence(new_failures: int, fixed: int) -> str:
        names = [f"t{k}" for k in range(new_failures + fixed)]
        before = [Verdict.PASS] * new_failures + [Verdict.F2] * fixed
        after = [Verdict.F2] * new_failures + [Verdict.PASS] * fixed
        sides = (tuple(map(ran, names, verdicts)) for verdicts in (before, after))
        return compare(*(Side("", runs) for runs in sides)).sentence

    assert sentence(6, 0) == "6 new failures, 0 fixed: more failures than by chance (p = 0.031, exact two-sided test)"
    assert sentence(0, 6) == "0 new failures, 6 fixed: fewer failures than by chance (p = 0.031, exact two-sided test)"
    assert sentence(5, 0) == "5 new failures, 0 fixed: it may be chance (p = 0.062, exact two-sided test)"
    assert sentence(1, 0).startswith("1 new failure, 0 fixed: it may be chance")
    assert compare(Side("", (ran(),)), Side("", (ran(),))).sentence.endswith("0 fixed: the same test cases pass")


def test_test_cases_are_paired_by_meaning_and_named_where_they_cannot_be() -> None:
    def edited(key: str, name: str) -> ComparedRun:
        return ComparedRun(key, name, "", verdict=Verdict.PASS)

    base = Side("old", (edited("1", "same"), edited("2", "changed"), edited("3", "gone")))
    new = Side("new", (edited("1", "renamed"), edited("4", "changed"), edited("5", "added")))
    compared = compare(base, new)
    assert [pair.new.name for pair in compared.pairs] == ["renamed"]
    assert (compared.only_base, compared.only_new, compared.edited) == (("gone",), ("added",), ("changed",))


def test_of_two_runs_with_one_meaning_the_first_counts() -> None:
    base = Side("old", (ran(), ran(verdict=Verdict.F2)))
    assert compare(base, Side("new", (ran(),))).sentence.endswith("the same test cases pass")


def test_a_broken_expectation_says_the_value_in_its_words_or_else_by_how_much() -> None:
    bare = ExpectationResult("never collision(ego)", held=False)
    margin = replace(bare, text="ego.speed < 50 km/h", margin=-1.5, unit="km/h")
    measured = replace(margin, text="arrived(ego) and ego.speed < 50 km/h", decides="ego.speed", value=51.5)
    assert [result.broken_sentence for result in (bare, margin, measured)] == [
        "does not hold: never collision(ego)",
        "does not hold: ego.speed < 50 km/h (by 1.50 km/h)",
        "does not hold: arrived(ego) and ego.speed < 50 km/h (51.50 km/h in `ego.speed`)",
    ]


def test_a_run_passes_without_a_failure_and_without_a_broken_expectation() -> None:
    assert passes(Verdict.PASS) and not passes(Verdict.PASS, ["arrived at 43.85 s"])
    assert not any(passes(verdict) for verdict in Verdict if verdict is not Verdict.PASS)
