"""Statistics for counts of failures: tests, effect sizes, correction and intervals.

The unit of all counts is a test case in one repetition.
"""

from foresee_study.statistics.comparison import NotTested, Pair, PairedComparison, compare

__all__ = ["NotTested", "Pair", "PairedComparison", "compare"]
