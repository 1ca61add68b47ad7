"""Tests, effect sizes, correction and intervals for counts of failures; the units are (test case, repetition)."""

from foresee_study.statistics.comparison import Comparison, NotTested, Pair, compare

__all__ = ["Comparison", "NotTested", "Pair", "compare"]
