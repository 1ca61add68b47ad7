"""Sizes of differences: Vargha and Delaney's A, Cohen's d; and Holm's correction of several p values."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from foresee_dsl.errors import ForeseeError

SIZES = ("negligible", "small", "medium", "large")
_A_FROM = (0.56, 0.64, 0.71)
"""Values from which an A is small, medium or large (Vargha and Delaney 2000, table 1)."""


def a12(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the probability that a value of the first sample is larger than a value of the second; ties count half.

    Source: Vargha and Delaney 2000. It is 0.5 if the samples are alike, and NaN if one is empty.
    """
    from scipy.stats import rankdata

    n, m = len(first), len(second)
    if not n or not m:
        return math.nan
    ranks = rankdata([*first, *second])
    return (float(ranks[:n].sum()) / n - (n + 1) / 2) / m


def cohens_d(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the difference of the means in pooled standard deviations (Cohen 1988); NaN if that is undefined."""
    n, m = len(first), len(second)
    if n + m < 3 or not n or not m:
        return math.nan
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    squares = ((a - a.mean()) ** 2).sum() + ((b - b.mean()) ** 2).sum()
    pooled = math.sqrt(squares / (n + m - 2))
    apart = float(a.mean() - b.mean())
    return apart / pooled if pooled else (0.0 if not apart else math.nan)


def a12_size(value: float) -> str:
    """Return the size of an A in a word, whichever sample is larger."""
    return "undefined" if math.isnan(value) else SIZES[bisect.bisect_right(_A_FROM, max(value, 1 - value))]


def lacks_statsmodels() -> str:
    """Return how to install the package that corrects p values; "" if it is installed."""
    if find_spec("statsmodels") is not None:
        return ""
    return (
        "no tables, because they need statsmodels. After `pip install 'foresee-dsl[study]'`, `foresee study report` "
        "writes the tables of these runs"
    )


def holm(values: Sequence[float]) -> tuple[float, ...]:
    """Return p values, corrected because there are several of them (Holm 1979), in the same order.

    Raises:
        ForeseeError: statsmodels is not installed.
    """
    if not values:
        return ()
    if lacking := lacks_statsmodels():
        raise ForeseeError(lacking)
    from statsmodels.stats.multitest import multipletests

    return tuple(float(p) for p in multipletests(values, method="holm")[1])
