"""Statistics against published worked examples, and what must hold for all data."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.stats
from foresee_study.statistics import NotTested, Pair, compare
from foresee_study.statistics.bootstrap import RESAMPLES, percentiles, ratio_interval, resampled_ratios
from foresee_study.statistics.comparison import sign_flips, signed_rank
from foresee_study.statistics.effects import a12, a12_size, cohens_d, holm
from hypothesis import given, settings
from hypothesis import strategies as st

# Wilcoxon 1945, table I: per cent of flies killed by two preparations; rank totals 91 and 45.
FLIES_A = (68, 68, 59, 72, 64, 67, 70, 74)
FLIES_B = (60, 67, 61, 62, 67, 63, 56, 58)
# Darwin 1876 (Fisher 1935, section 17; scipy's documentation of `wilcoxon`): crossed less self-fertilised maize,
# eighths of an inch.
MAIZE = (6, 8, 14, 16, 23, 24, 28, 29, 41, -48, 49, 56, 60, -67, 75)
# scipy's documentation of `mannwhitneyu`: age at which type II diabetes was found, men and women.
MEN, WOMEN = (19, 22, 16, 29, 24), (20, 11, 17, 12)
# Hollander and Wolfe 1973, p. 29 (R's documentation of `wilcox.test`): depression before and after.
BEFORE = (1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30)
AFTER = (0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29)
# Efron and Tibshirani 1993, table 10.1: hormone in the blood of eight patients; new less old, old less placebo.
NEW_LESS_OLD = (-1200, 2601, -2705, 1982, -1290, 351, -638, -2719)
OLD_LESS_PLACEBO = (8406, 2342, 8187, 8459, 4795, 3516, 4796, 10238)

COUNTS = st.lists(st.integers(0, 6), min_size=6, max_size=14)


def test_signed_rank_of_darwins_maize() -> None:
    found = signed_rank(MAIZE, [0] * len(MAIZE))
    assert found == pytest.approx(0.041259765625)


def test_signed_rank_of_hollander_and_wolfes_patients() -> None:
    found = signed_rank(BEFORE, AFTER)
    assert found == pytest.approx(0.0390625)  # R says 0.01953 on one side


def test_permutation_of_darwins_maize() -> None:
    # Fisher 1935, section 21: in 863 of 32,768 the sum is as large or larger; he counts both sides, with those that
    # are equal, as 1,726.
    assert sign_flips(MAIZE) == pytest.approx(1726 / 32768)


def test_a12_is_formula_14_of_vargha_and_delaney() -> None:
    assert a12(MEN, WOMEN) == pytest.approx(17 / 20)  # U / (n m)
    assert a12(FLIES_A, FLIES_B) == pytest.approx((91 / 8 - 9 / 2) / 8)
    assert [a12_size(value) for value in (0.5, 0.56, 0.64, 0.71, 0.29)] == [
        "negligible", "small", "medium", "large", "large",
    ]  # fmt: skip


def test_cohens_d_of_borensteins_example() -> None:
    # Borenstein and others 2009, chapter 4: means 103 and 100, deviations 5.5 and 4.5, 50 each; d = 0.5970.
    shape = scipy.stats.zscore(np.arange(50), ddof=1)
    d = cohens_d(list(103 + 5.5 * shape), list(100 + 4.5 * shape))
    assert d == pytest.approx(0.5970, abs=5e-5)


def test_holms_correction_of_four_p_values() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx((0.03, 0.06, 0.06, 0.02))
    assert holm([]) == ()


def test_bootstrap_of_efrons_hormone_patches() -> None:
    assert sum(NEW_LESS_OLD) / sum(OLD_LESS_PLACEBO) == pytest.approx(-0.0713, abs=5e-5)
    new, old = ({("", 0): {str(k): value for k, value in enumerate(v)}} for v in (NEW_LESS_OLD, OLD_LESS_PLACEBO))
    drawn = resampled_ratios(new, old)
    assert len(drawn) == RESAMPLES
    assert drawn.std() == pytest.approx(0.105, abs=0.007)  # 0.105 from 200 resamples, 0.101 from 400
    low, high = ratio_interval(new, old)
    assert low < -0.0713 < high


def test_repetitions_of_one_test_case_are_never_tested() -> None:
    repeated = [Pair("a", repetition, 9, 0) for repetition in range(30)]
    found = compare(repeated)
    assert isinstance(found.signed_rank, NotTested) and "1 test cases, 30 units" in found.signed_rank.reason


@settings(max_examples=50, deadline=None)
@given(COUNTS, COUNTS)
def test_exchanging_the_samples_changes_only_the_sign(first: list[int], second: list[int]) -> None:
    size = min(len(first), len(second))
    first, second = first[:size], second[:size]
    assert a12(first, second) == pytest.approx(1 - a12(second, first))
    assert signed_rank(first, second) == signed_rank(second, first)
    d, back = cohens_d(first, second), cohens_d(second, first)
    assert (math.isnan(d) and math.isnan(back)) or d == pytest.approx(-back)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(-5, 5), min_size=6, max_size=10))
def test_sign_flips_count_all_of_them(differences: list[int]) -> None:
    every = np.array(np.meshgrid(*[(-1, 1)] * len(differences))).reshape(len(differences), -1)
    sums = np.abs(np.array(differences) @ every)
    assert sign_flips(differences) == pytest.approx(float((sums >= abs(sum(differences))).mean()))


@settings(max_examples=15, deadline=None)  # statsmodels 0.15 collects garbage in each call
@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_never_lowers_a_p_value_and_keeps_their_order(values: list[float]) -> None:
    corrected = holm(values)
    assert all(was <= now <= 1 for was, now in zip(values, corrected, strict=True))
    in_order = [corrected[k] for k in np.argsort(values, kind="stable")]
    assert in_order == sorted(in_order)


@settings(max_examples=25, deadline=None)
@given(COUNTS, COUNTS)
def test_repetitions_of_a_test_case_are_drawn_together(first: list[int], second: list[int]) -> None:
    pairs = [Pair(f"c{k}", 0, a, b) for k, (a, b) in enumerate(zip(first, second, strict=False))]
    thrice = [Pair(p.case, repetition, p.first, p.second) for p in pairs for repetition in range(3)]
    once, three = compare(pairs), compare(thrice)
    assert np.array_equal(once.interval, three.interval, equal_nan=True)
    assert once.flips == three.flips  # copies are no evidence


def test_seeds_are_drawn_too() -> None:
    """One seed finds all, for every test case alike: only over seeds does the ratio vary."""
    lucky = [Pair(f"c{k}", seed, 3 if seed == 0 else 0, 1) for k in range(8) for seed in range(3)]
    low, high = compare(lucky).interval
    assert (low, high) == (0.0, 3.0)
    assert compare([pair for pair in lucky if pair.repetition == 0]).interval == (3.0, 3.0)
    of_two_drivers = [Pair(p.case, 0, p.first, p.second, f"driver {p.repetition}") for p in lucky]
    assert compare(of_two_drivers).interval == (1.0, 1.0), "drivers are not drawn"


def test_an_interval_is_the_middle_95_percent_of_the_resamples() -> None:
    assert percentiles(np.arange(1001.0)) == (25.0, 975.0)
    few, many = (np.where(np.arange(1000) < without, np.nan, np.arange(1000.0)) for without in (50, 51))
    assert not np.isnan(percentiles(few)).any() and np.isnan(percentiles(many)).all()
