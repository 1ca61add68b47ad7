"""From what was found to figures: detection thresholds, precision, recall, time to the first, and how good verdicts
are."""

from __future__ import annotations

import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from foresee_study.faults.evidence import ANY, Evidence, Failure


def weakest(strengths: Sequence[float], finds: Callable[[float], bool]) -> float:
    """Return the weakest of ascending strengths that is found, infinite where none is, by bisection.

    It begins in the middle, and takes it that what is found at a strength is found at all stronger ones.
    """
    low, high, found = 0, len(strengths) - 1, math.inf
    middle = len(strengths) // 2
    while low <= high:
        if finds(strengths[middle]):
            found, high = strengths[middle], middle - 1
        else:
            low = middle + 1
        middle = (low + high) // 2
    return found


@dataclass(frozen=True)
class Score:
    """How well one search did.

    Attributes:
        failing, the_faults: failing children, and those of them that the healthy driver passes; of test cases where
            these alone were driven.
        findings, right_findings: the same after equal stories were put together; a finding is the fault's where at
            least half of its failures are.
        true_findings: the fault's findings, test cases included.
        recall: share of the fault's findings of all approaches that this one found; None where nobody found any.
        first_s: simulated seconds until the end of the first failure that is the fault's; infinite: none.
        said, said_right: failing runs that any verdict calls avoidable, and those of them that are the fault's.
        simulated_s, wall_s: what it took.
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
        """The share of the failing runs that is the fault's; None where nothing fails."""
        return self.the_faults / self.failing if self.failing else None

    @property
    def precision_of_said(self) -> float | None:
        """The share of what is called avoidable that is the fault's."""
        return self.said_right / self.said if self.said else None

    @property
    def precision_of_findings(self) -> float | None:
        """The share of the findings that is the fault's."""
        return self.right_findings / self.findings if self.findings else None


def detects(evidence: Evidence, simulated_s: float) -> bool:
    """Tell whether a search finds its fault within so many simulated seconds."""
    return any(failure.is_the_faults for failure in evidence.failures(simulated_s))


def true_findings(evidence: Evidence, simulated_s: float) -> frozenset[tuple[str, ...]]:
    """Return the findings that are the fault's."""
    return frozenset(finding for finding, share in _shares(evidence.failures(simulated_s)).items() if share >= 1 / 2)


def scores(evidences: Iterable[Evidence], simulated_s: float) -> dict[str, Score]:
    """Return by approach how well each did with one fault at one strength, at equal simulated time."""
    given = tuple(evidences)
    known = frozenset().union(*(true_findings(evidence, simulated_s) for evidence in given)) if given else frozenset()
    return {evidence.approach: _score(evidence, known, simulated_s) for evidence in given}


def _score(evidence: Evidence, known: frozenset[tuple[str, ...]], simulated_s: float) -> Score:
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
        recall=len(own & known) / len(known) if known else None,
        first_s=first_s,
        simulated_s=spent_s,
        wall_s=evidence.wall_s,
    )


def _shares(failures: Iterable[Failure]) -> dict[tuple[str, ...], float]:
    """Return by finding the share of its failures that is the fault's."""
    groups: dict[tuple[str, ...], list[bool]] = defaultdict(list)
    for failure in failures:
        groups[failure.finding].append(failure.is_the_faults)
    return {finding: sum(answers) / len(answers) for finding, answers in groups.items()}


@dataclass(frozen=True)
class Confusion:
    """How often a verdict agrees with the ground truth: `true_yes` are the fault's and said to be avoidable.

    Attributes:
        open: failures that it does not decide; they count as said to be unavoidable.
    """

    true_yes: int
    false_yes: int
    true_no: int
    false_no: int
    open: int

    @property
    def balanced(self) -> float | None:
        """Balanced accuracy: the mean of the shares of the fault's and of the others that are told apart."""
        own, others = self.true_yes + self.false_no, self.true_no + self.false_yes
        return (self.true_yes / own + self.true_no / others) / 2 if own and others else None

    @property
    def precision(self) -> float | None:
        """The share of what it calls avoidable that is the fault's."""
        said = self.true_yes + self.false_yes
        return self.true_yes / said if said else None

    @property
    def recall(self) -> float | None:
        """The share of the fault's failures that it calls avoidable."""
        own = self.true_yes + self.false_no
        return self.true_yes / own if own else None


def confusions(failures: Iterable[Failure]) -> dict[str, Confusion]:
    """Return by judge how often it agrees with the ground truth, over the failures that it was asked about."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for failure in failures:
        for judge, answer in failure.verdicts.items():
            said, right = bool(answer), bool(answer) == failure.is_the_faults
            counts[judge][f"{'true' if right else 'false'}_{'yes' if said else 'no'}"] += 1
            counts[judge]["open"] += answer is None
    names = ("true_yes", "false_yes", "true_no", "false_no", "open")
    return {judge: Confusion(*(found[name] for name in names)) for judge, found in counts.items()}


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the values that there are; infinite ones count."""
    known = [value for value in values if value is not None]
    return statistics.median_low(known) if known else None
