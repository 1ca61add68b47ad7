"""Computes figures from the records of searches: thresholds, precision, recall, time to the first failure, accuracy of
verdicts.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from foresee_study.faults.evidence import ANY, Evidence, Failure


def weakest(strengths: Sequence[float], finds: Callable[[float], bool]) -> float:
    """Return the weakest of ascending strengths that is detected, by bisection; infinite if none is.

    It begins in the middle, and assumes that a fault detected at one strength is detected at all higher ones.
    """
    low, high, threshold = 0, len(strengths) - 1, math.inf
    middle = len(strengths) // 2
    while low <= high:
        if finds(strengths[middle]):
            threshold, high = strengths[middle], middle - 1
        else:
            low = middle + 1
        middle = (low + high) // 2
    return threshold


@dataclass(frozen=True)
class Score:
    """The score of one search. The fault causes a failure if the healthy driver passes the same run.

    Attributes:
        failing, the_faults: number of failing children, and of those that the fault causes; if only test cases were
            driven, the numbers of failing test cases.
        findings, right_findings: the same numbers after failures with equal stories are merged; the fault causes a
            finding if it causes at least half of its failures.
        true_findings: number of the fault's findings, including test cases.
        recall: share of the fault's findings, over all approaches together, that this search has; None if the fault
            has none.
        first_s: simulated time until the end of the first failure that the fault causes, s; infinite if there is none.
        said, said_right: number of failing runs that a judge calls avoidable, and of those that the fault causes.
        simulated_s, wall_s: simulated time and wall time of the search, s.
    """

    failing: int
    the_faults: int
    said: int
    said_right: int
    findings: int
    right_findings: int
    true_findings: int
    recall: float | None
    first_s: float
    simulated_s: float
    wall_s: float

    @property
    def precision(self) -> float | None:
        """Return the share of the failing runs that the fault causes; None without failures."""
        return self.the_faults / self.failing if self.failing else None

    @property
    def precision_of_said(self) -> float | None:
        """Return the share of the failures called avoidable that the fault causes."""
        return self.said_right / self.said if self.said else None

    @property
    def precision_of_findings(self) -> float | None:
        """Return the share of the findings that the fault causes."""
        return self.right_findings / self.findings if self.findings else None


def detects(evidence: Evidence, simulated_s: float) -> bool:
    """Return whether a search detects its fault within this simulated time."""
    return any(failure.is_the_faults for failure in evidence.failures(simulated_s))


def true_findings(evidence: Evidence, simulated_s: float) -> frozenset[tuple[str, ...]]:
    """Return the findings that the fault causes."""
    return frozenset(finding for finding, share in _shares(evidence.failures(simulated_s)).items() if share >= 1 / 2)


def scores(evidences: Iterable[Evidence], simulated_s: float) -> dict[str, Score]:
    """Return the score of each approach with one fault at one strength, at equal simulated time."""
    searches = tuple(evidences)
    all_findings = (
        frozenset().union(*(true_findings(evidence, simulated_s) for evidence in searches)) if searches else frozenset()
    )
    return {evidence.approach: _score(evidence, all_findings, simulated_s) for evidence in searches}


def _score(evidence: Evidence, all_findings: frozenset[tuple[str, ...]], simulated_s: float) -> Score:
    own = true_findings(evidence, simulated_s)
    plain = all(run.kind == "seed" for run in evidence.runs)
    failures = evidence.failures(simulated_s) if plain else evidence.of_children(simulated_s)
    shares, spent_s, first_s = _shares(failures), 0.0, math.inf
    for run in evidence.within(simulated_s):
        spent_s += run.simulated_s
        if run.failure is not None and run.failure.is_the_faults:
            first_s = min(first_s, spent_s)
    return Score(
        failing=len(failures),
        the_faults=sum(failure.is_the_faults for failure in failures),
        said=sum(bool(failure.verdicts.get(ANY)) for failure in failures),
        said_right=sum(failure.is_the_faults for failure in failures if failure.verdicts.get(ANY)),
        findings=len(shares),
        right_findings=sum(share >= 1 / 2 for share in shares.values()),
        true_findings=len(own),
        recall=len(own & all_findings) / len(all_findings) if all_findings else None,
        first_s=first_s,
        simulated_s=spent_s,
        wall_s=evidence.wall_s,
    )


def _shares(failures: Iterable[Failure]) -> dict[tuple[str, ...], float]:
    """Return, for each finding, the share of its failures that the fault causes."""
    groups: dict[tuple[str, ...], list[bool]] = defaultdict(list)
    for failure in failures:
        groups[failure.finding].append(failure.is_the_faults)
    return {finding: sum(answers) / len(answers) for finding, answers in groups.items()}


@dataclass(frozen=True)
class Confusion:
    """How well a judge agrees with the ground truth.

    Attributes:
        true_yes: number of failures caused by the fault that the judge calls avoidable.
        open: number of failures that the judge does not decide; they count as called unavoidable.
    """

    true_yes: int
    false_yes: int
    true_no: int
    false_no: int
    open: int

    @classmethod
    def of(cls, answers: Sequence[tuple[bool, bool | None]]) -> Confusion:
        """Count the answers of a judge, each with whether the fault causes the failure."""
        counts = Counter((own, bool(answer)) for own, answer in answers)
        undecided = sum(answer is None for _, answer in answers)
        return cls(counts[True, True], counts[False, True], counts[False, False], counts[True, False], undecided)

    @property
    def balanced(self) -> float | None:
        """Return the balanced accuracy: the mean of the shares of right answers for the fault's failures and for the
        others.
        """
        own, others = self.true_yes + self.false_no, self.true_no + self.false_yes
        return (self.true_yes / own + self.true_no / others) / 2 if own and others else None

    @property
    def precision(self) -> float | None:
        """Return the share of the failures called avoidable that the fault causes."""
        called = self.true_yes + self.false_yes
        return self.true_yes / called if called else None

    @property
    def recall(self) -> float | None:
        """Return the share of the failures caused by the fault that the judge calls avoidable."""
        own = self.true_yes + self.false_no
        return self.true_yes / own if own else None


def confusions(failures: Iterable[Failure]) -> dict[str, Confusion]:
    """Return, for each judge, its agreement with the ground truth over the failures that it judged."""
    answers: dict[str, list[tuple[bool, bool | None]]] = defaultdict(list)
    for failure in failures:
        for judge, answer in failure.verdicts.items():
            answers[judge].append((failure.is_the_faults, answer))
    return {judge: Confusion.of(own) for judge, own in answers.items()}


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the values that are not None; infinite values count."""
    present = [value for value in values if value is not None]
    return statistics.median_low(present) if present else None
