"""Two techniques compared on the same units, with everything that a row of a table says of them."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from foresee_dsl.study.statistics.bootstrap import Interval, percentiles, resampled_ratios
from foresee_dsl.study.statistics.effects import a12, cohens_d
from foresee_dsl.study.statistics.exact import TooFewUnitsError, sign_flips, signed_rank

FEWEST_CASES = 6
"""With five test cases no outcome gives an exact p under 0.05 (2 / 2**5 = 0.0625)."""


@dataclass(frozen=True)
class Pair:
    """One unit, a test case in one repetition: what each of two techniques counts there."""

    case: str
    repetition: int
    first: float
    second: float


@dataclass(frozen=True)
class NotTested:
    """Why there is no p value."""

    reason: str


@dataclass(frozen=True)
class Comparison:
    """Two techniques on the same units.

    Attributes:
        first, second: the sums over all units. pairs, cases: how many units and test cases.
        a12, d: effect sizes over the units. interval: of the ratio of the sums, by bootstrap over test cases.
        signed_rank: p of Wilcoxon's test over the units that differ. flips: p of the exact permutation of whole test
            cases, which does not take repetitions of one test case for independent. Or why there is none.
    """

    first: float
    second: float
    pairs: int
    cases: int
    a12: float
    d: float
    interval: Interval
    signed_rank: float | NotTested
    flips: float | NotTested

    @property
    def ratio(self) -> float:
        """How many times the second the first is; infinite over 0, NaN where both are 0."""
        if not self.second:
            return math.inf if self.first else math.nan
        return self.first / self.second

    @property
    def change_percent(self) -> float:
        """By how much the first is more than the second, %."""
        return (self.ratio - 1) * 100


def compare(pairs: Sequence[Pair]) -> Comparison:
    """Compare two techniques; fewer than six test cases are not tested, however many repetitions there are.

    Repetitions of one test case are no independent units: three against three that are wholly apart give p = 0.10
    exactly, and the normal approximation's 0.0495 is an artefact.
    """
    first, second = [p.first for p in pairs], [p.second for p in pairs]
    sums: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    for pair in pairs:
        sums[pair.case][0] += pair.first
        sums[pair.case][1] += pair.second
    totals = list(sums.values())
    by_rank, by_flips = _tested(first, second, totals)
    return Comparison(
        first=sum(first),
        second=sum(second),
        pairs=len(pairs),
        cases=len(totals),
        a12=a12(first, second),
        d=cohens_d(first, second),
        interval=percentiles(resampled_ratios([a for a, _ in totals], [b for _, b in totals])),
        signed_rank=by_rank,
        flips=by_flips,
    )


def _tested(
    first: Sequence[float], second: Sequence[float], totals: Sequence[Sequence[float]]
) -> tuple[float | NotTested, float | NotTested]:
    if len(totals) < FEWEST_CASES:
        repeated = f", {len(first)} units with their repetitions," if len(first) > len(totals) else ""
        reason = NotTested(f"{len(totals)} test cases{repeated} are too few for a test: it takes {FEWEST_CASES}")
        return reason, reason
    try:
        return signed_rank(first, second).p, sign_flips([round(a - b) for a, b in totals]).p
    except TooFewUnitsError as err:  # all that is left to refuse
        return NotTested(str(err)), NotTested(str(err))
