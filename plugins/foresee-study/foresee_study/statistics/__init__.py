"""Statistics for counts of failures: tests, effect sizes, correction and intervals.

The units are (test case, repetition).
"""

from foresee_study.statistics.comparison import Comparison, NotTested, Pair, compare

__all__ = ["Comparison", "NotTested", "Pair", "compare"]
