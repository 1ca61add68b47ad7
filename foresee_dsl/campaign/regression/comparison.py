"""Compares two versions of a driver on the same test cases: new, fixed and remaining failures, and nearer misses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from foresee_dsl.language.document import family_order
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import RunRecord, Verdict

SIGNIFICANT = 0.05
"""A p below this counts as more than chance: the usual level."""


@dataclass(frozen=True)
class NearLimit:
    """A measure of near misses, with the limit of near values and the smallest change that is reported.

    Attributes:
        title: its name in words. unit: unit of its values. near: limit from which a value is near. step: smallest
            reported change.
        sign: -1 if smaller values are nearer.
    """

    title: str
    unit: str
    near: float
    step: float
    sign: int = -1


MEASURES: Mapping[str, NearLimit] = {
    "distance_m": NearLimit("distance", "m", 1.0, 0.2),
    "ttc_s": NearLimit("time to collision", "s", 2.0, 0.2),
    "pet_s": NearLimit("post-encroachment time", "s", 2.0, 0.2),
    "drac_mps2": NearLimit("braking needed", "m/s^2", 3.0, 0.5, 1),
}
"""The measures. Their limits are ours: conflict studies call times below 1.5 s to 3 s serious, and 3 m/s^2 is harsh
braking. Each smallest reported change is several times the effect of a decision that is 0.1 s later.
"""


@dataclass(frozen=True)
class ComparedRun(RunRecord):
    """The run of one test case by one driver.

    `key`: equal for the same test case on both sides. `name`: its name for people.
    """

    key: str
    name: str
    family: str

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"verdict": self.verdict, "reason": self.reason}

    @property
    def failed(self) -> bool:
        """Return whether the run did not pass: a failure, a broken expectation, a crash or a timeout."""
        return not self.passed


@dataclass(frozen=True)
class Side:
    """All runs of one version. `label`: its name. `broken`: tests that could not be run, with reasons."""

    label: str
    runs: tuple[ComparedRun, ...]
    broken: tuple[str, ...] = ()


class OutcomeChange(StrEnum):
    """The kinds of change of a test case between the two sides."""

    NEW_FAILURE = "new failure"
    FIXED = "fixed"
    STILL_FAILING = "still failing"
    STILL_PASSING = "still passing"


@dataclass(frozen=True)
class Pair:
    """The same test case on both sides."""

    base: ComparedRun
    new: ComparedRun

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "test_case": self.new.name,
            "family": self.new.family,
            "base": self.base,
            "new": self.new,
            "nearer": self.nearer,
        }

    @property
    def change(self) -> OutcomeChange:
        """Return how the test case changed."""
        if self.base.failed:
            return OutcomeChange.STILL_FAILING if self.new.failed else OutcomeChange.FIXED
        return OutcomeChange.NEW_FAILURE if self.new.failed else OutcomeChange.STILL_PASSING

    @cached_property
    def nearer(self) -> Nearer | None:
        """Return the measure that moved most towards a failure, for a pair that passes on both sides; None if there is
        none.
        """
        if self.change is not OutcomeChange.STILL_PASSING:
            return None
        candidates = [
            candidate for name in MEASURES if (candidate := _nearer(name, self.base.near, self.new.near)) is not None
        ]
        return max(candidates, key=lambda candidate: candidate.share, default=None)


@dataclass(frozen=True)
class Nearer:
    """A near miss that became nearer to a failure: its measure, the values before and after (None: no value), and the
    other actor.

    `share`: the change, divided by the limit below which values are near.
    """

    measure: str
    was: float | None
    now: float
    actor: str
    share: float


@dataclass(frozen=True)
class Row:
    """Figures of one family or one kind of failure: failures on each side, and the exact test.

    Attributes:
        label: `all`, a family, or a kind. kind: whether the row is that of a kind of failure. pairs: test cases on both
            sides.
        new_failures, fixed: pairs that fail only on the new side, or only on the base side.
        p: two-sided probability that chance alone splits these pairs at least as unevenly.
    """

    label: str
    kind: bool
    pairs: int
    base_failed: int
    new_failed: int
    new_failures: int
    fixed: int
    p: float


@dataclass(frozen=True)
class CampaignComparison:
    """Two sides, paired. `edited`: test cases of the same name whose meaning differs."""

    base: Side
    new: Side
    pairs: tuple[Pair, ...]
    only_base: tuple[str, ...]
    only_new: tuple[str, ...]
    edited: tuple[str, ...]

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "base": self.base.label,
            "new": self.new.label,
            "ok": self.ok,
            "sentence": self.sentence,
            "pairs": self.paired,
            "only_base": self.only_base,
            "only_new": self.only_new,
            "edited": self.edited,
            "broken": self.broken,
            "new_failures": self.new_failures,
            "fixed": self.fixed,
            "still_failing": self.still_failing,
            "nearer": self.nearer,
            "rows": self.rows,
        }

    @property
    def ok(self) -> bool:
        """Return whether there is no new failure."""
        return not self.new_failures

    @property
    def paired(self) -> int:
        """Return the number of test cases on both sides."""
        return len(self.pairs)

    @property
    def broken(self) -> tuple[str, ...]:
        """Return the tests that could not be run on either side."""
        return self.base.broken + self.new.broken

    @property
    def new_failures(self) -> tuple[Pair, ...]:
        """Return the test cases that pass on the old side and fail on the new one."""
        return self.of(OutcomeChange.NEW_FAILURE)

    @property
    def fixed(self) -> tuple[Pair, ...]:
        """Return the pairs that only the new side passes."""
        return self.of(OutcomeChange.FIXED)

    @property
    def still_failing(self) -> tuple[Pair, ...]:
        """Return the pairs that neither side passes."""
        return self.of(OutcomeChange.STILL_FAILING)

    def of(self, change: OutcomeChange) -> tuple[Pair, ...]:
        """Return the pairs of one kind; crashes and timeouts first."""
        pairs = (pair for pair in self.pairs if pair.change is change)
        return tuple(sorted(pairs, key=lambda pair: (pair.new.verdict.is_failure, pair.new.name)))

    @property
    def nearer(self) -> tuple[Pair, ...]:
        """Return the pairs whose near miss came nearer, the largest change first."""
        pairs = [pair for pair in self.pairs if pair.nearer is not None]
        return tuple(sorted(pairs, key=lambda pair: (-pair.nearer.share if pair.nearer else 0.0, pair.new.name)))

    @property
    def rows(self) -> tuple[Row, ...]:
        """Return the figures of all test cases, of each family, and of each kind of failure that occurs."""
        families = sorted({pair.new.family for pair in self.pairs}, key=family_order)
        ended = {ran.verdict for pair in self.pairs for ran in (pair.base, pair.new)}
        kinds = [v for v in Verdict if v is not Verdict.PASS and v in ended]
        rows = [_row("all", self.pairs)]
        for family in families if len(families) > 1 else ():
            rows.append(_row(f"family {family or '-'}", [pair for pair in self.pairs if pair.new.family == family]))
        return (*rows, *(_row(kind.value, self.pairs, kind) for kind in kinds))

    @property
    def sentence(self) -> str:
        """Return the result in a sentence."""
        total = self.rows[0]
        counts = f"{total.new_failures} new failure{'' if total.new_failures == 1 else 's'}, {total.fixed} fixed"
        if not total.new_failures + total.fixed:
            return f"{counts}: the same test cases pass"
        fewer = "more" if total.new_failures > total.fixed else "fewer"
        chance = f"{fewer} failures than by chance" if total.p < SIGNIFICANT else "it may be chance"
        return f"{counts}: {chance} (p = {total.p:.2g}, exact two-sided test)"


def compare(base: Side, new: Side) -> CampaignComparison:
    """Return two sides with their test cases paired by meaning; test cases that are invalid on one side (a collision at
    the start) are left out.
    """
    a, b = (_by_key(side) for side in (base, new))
    pairs = tuple(Pair(a[key], b[key]) for key in a if key in b)
    left, right = ({ran.name for key, ran in own.items() if key not in other} for own, other in ((a, b), (b, a)))
    edited = left & right
    return CampaignComparison(
        base, new, pairs, tuple(sorted(left - edited)), tuple(sorted(right - edited)), tuple(sorted(edited))
    )


def exact_p(first: int, second: int) -> float:
    """Return the exact two-sided p of a split into two counts under equal probability (McNemar's exact test)."""
    total = first + second
    tail = sum(math.comb(total, k) for k in range(min(first, second) + 1))
    return min(1.0, 2 * tail / float(2**total))


def _by_key(side: Side) -> dict[str, ComparedRun]:
    runs: dict[str, ComparedRun] = {}
    for ran in side.runs:
        if ran.verdict is not Verdict.INVALID:
            runs.setdefault(ran.key, ran)
    return runs


def _row(label: str, pairs: Iterable[Pair], kind: Verdict | None = None) -> Row:
    """Return the figures of some pairs, of all failures or of one kind."""
    counts = [[ran.failed if kind is None else ran.verdict is kind for ran in (pair.base, pair.new)] for pair in pairs]
    new = sum(now and not was for was, now in counts)
    fixed = sum(was and not now for was, now in counts)
    was_failing, now_failing = (sum(failed[side] for failed in counts) for side in (0, 1))
    return Row(label, kind is not None, len(counts), was_failing, now_failing, new, fixed, exact_p(new, fixed))


def _nearer(name: str, base: NearMisses | None, new: NearMisses | None) -> Nearer | None:
    """Return how a measure became nearer, or None; a missing value counts as far."""
    measure = MEASURES[name]
    if base is None or new is None or (near_miss := getattr(new, name)) is None:
        return None
    before, now = getattr(base, name), near_miss.value
    was = before.value if before is not None else None
    far = measure.near - measure.sign * measure.step if was is None else was
    change = (now - far) * measure.sign
    # `not`, because the comparison must also be true for inf - inf.
    if (now - measure.near) * measure.sign < 0 or not change >= measure.step:
        return None
    capped = min(now, 99.0) if math.isinf(now) else now
    return Nearer(name, was, capped, near_miss.actor, round(min(change / measure.near, 99.0), 3))
