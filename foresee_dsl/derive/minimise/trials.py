"""Runs candidates and tests whether each shows the same failure. Each candidate runs once, within a budget of runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Literal, TypeVar

from foresee_dsl.derive.clipping.fidelity import ClipDeviation, deviation
from foresee_dsl.derive.minimise.candidate import BuiltCandidate, Subject, TrialCandidate, build
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Actor
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Trace

T = TypeVar("T")


@dataclass(frozen=True)
class TrialJudge:
    """How candidates are run, and which properties of the failure must stay.

    Attributes:
        drive: runs a test case.
        sign: returns the signature of a failure (verdict, actor, story, whose failure, right of way, signal, who hid
            whom); equal ones are the same failure in the same situation.
        avoided: returns, in words, whether the careful drivers would have avoided a failure.
    """

    drive: Callable[[TestCase], RunResult]
    sign: Callable[[TestCase, RunResult], tuple[str, ...]]
    avoided: Callable[[TestCase, RunResult], str]


@dataclass(frozen=True)
class Trial:
    """The result of a candidate's run.

    `same`: whether it shows the same failure. `built`: the candidate's test cases; None if it is not valid.
    """

    same: bool
    verdict: Verdict | None
    reason: str
    built: BuiltCandidate | None = None
    result: RunResult | None = field(default=None, repr=False)

    @property
    def failed(self) -> bool:
        """Return whether the run shows any failure."""
        return self.verdict is not None and self.verdict.is_failure


class BudgetSpentError(Exception):
    """Raised if no run is left in the budget."""


class Trials:
    """The runs of the candidates of one mutant, within the budget."""

    def __init__(self, subject: Subject, judge: TrialJudge, *, limit_m: float, budget: int) -> None:
        """Prepare the runs; nothing runs yet.

        Args:
            limit_m: largest deviation of a clip's unmutated run from its parent's.
            budget: largest number of runs.
        """
        self.subject, self.runs, self.reserve = subject, 0, 0
        self.spent = False
        """Whether a run was skipped because the budget was used up."""
        self._judge, self._limit_m, self._budget = judge, limit_m, budget
        self._trials: dict[TrialCandidate, Trial] = {}
        self._clips: dict[str, ClipDeviation | None] = {}
        self._answers: dict[TrialCandidate, str] = {}
        self._wanted: tuple[str, ...] | None = None
        self._own: tuple[Trace | None, ...] = ()
        """The unmutated run of the unreduced clip; empty until it is needed."""

    @property
    def left(self) -> int:
        """Return the number of runs that are left."""
        return self._budget - self.runs

    def first(self, candidate: TrialCandidate) -> Trial:
        """Run the unreduced mutant; its failure is the one that all smaller versions must show."""
        trial = self.trial(candidate)
        if trial.built is not None and trial.result is not None and trial.result.verdict.is_failure:
            self._wanted = self._judge.sign(trial.built.case, trial.result)
            self._trials[candidate] = trial = Trial(True, trial.verdict, trial.reason, trial.built, trial.result)
        return trial

    def trial(self, candidate: TrialCandidate) -> Trial:
        """Run a candidate.

        Raises:
            BudgetSpentError: no run is left for it.
        """
        if candidate not in self._trials:
            self._trials[candidate] = self._run(candidate)
        return self._trials[candidate]

    def fails(self, candidate: TrialCandidate) -> bool:
        """Return whether a candidate shows the same failure with the same actor; False if no run is left."""
        return self._within_budget(lambda: self.trial(candidate).same)

    def fails_somehow(self, candidate: TrialCandidate) -> bool:
        """Return whether a candidate shows any failure; False if no run is left."""
        return self._within_budget(lambda: self.trial(candidate).failed)

    def stands(self, candidate: TrialCandidate) -> bool:
        """Return whether a candidate shows the same failure, and its unmutated clip passes within `limit_m` of its
        parent's run."""
        return self.fails(candidate) and self._within_budget(lambda: self._clip_stands(candidate))

    def answer(self, candidate: TrialCandidate) -> str:
        """Return, in words, whether a careful driver would have avoided a failure; "" if no run is left.

        It counts as two runs.
        """
        trial = self._trials[candidate]
        if candidate not in self._answers and trial.built is not None and trial.result is not None:
            if self._within_budget(lambda: self._spend(2)) is False:
                return ""
            self._answers[candidate] = self._judge.avoided(trial.built.case, trial.result)
        return self._answers.get(candidate, "")

    def finished(self) -> Iterable[tuple[TrialCandidate, Trial]]:
        """Return all candidates that were run and their trials, in the order of the runs."""
        return self._trials.items()

    def fidelity(self, candidate: TrialCandidate) -> ClipDeviation | None:
        """Return the deviation of a candidate's unmutated clip; None if it was not measured."""
        built = self._trials[candidate].built
        return self._clips.get(built.clip_case.meaning) if built is not None else None

    def _within_budget(self, find_out: Callable[[], T]) -> T | Literal[False]:
        try:
            return find_out()
        except BudgetSpentError:
            self.spent = True
            return False

    def _spend(self, runs: int) -> None:
        if self.runs + runs > self._budget - self.reserve:
            raise BudgetSpentError
        self.runs += runs

    def _run(self, candidate: TrialCandidate) -> Trial:
        try:
            built = build(self.subject, candidate)
        except (ForeseeError, ValueError) as err:
            return Trial(False, None, str(err))
        self._spend(1)
        try:
            result = self._judge.drive(built.case)
        except ForeseeError as err:
            return Trial(False, None, str(err), built)
        same = result.verdict.is_failure and self._judge.sign(built.case, result) == self._wanted
        return Trial(same, result.verdict, result.reason, built, result)

    def _clip_stands(self, candidate: TrialCandidate) -> bool:
        built = self.trial(candidate).built
        if built is None:
            return False
        key = built.clip_case.meaning
        if key not in self._clips:
            self._spend(1)
            self._clips[key] = self._strays(built, candidate)
        strays = self._clips[key]
        return strays is not None and strays.largest_m <= self._limit_m

    def _strays(self, built: BuiltCandidate, candidate: TrialCandidate) -> ClipDeviation | None:
        """Return the deviation of the unmutated clip from its parent's run; None if the clip does not pass."""
        there = self._reference()
        trace = self._passed(built)
        if there is None or trace is None:
            return None
        left = {"ego", *(item.name for item in built.clip.body if isinstance(item, Actor))}
        gone = frozenset(info.id for info in there.actors) - left
        first = candidate.first if self.subject.cut_again else 0
        return deviation(there, first, trace, without=gone)

    def _reference(self) -> Trace | None:
        """Return the run with which clips are compared: the parent's run or, if the clip was edited, its own unmutated
        run.
        """
        if self.subject.cut_again:
            return self.subject.trace
        if not self._own:
            built = self.trial(self.subject.whole).built
            self._spend(1)
            self._own = (self._passed(built) if built is not None else None,)
        return self._own[0]

    def _passed(self, built: BuiltCandidate) -> Trace | None:
        try:
            result = self._judge.drive(built.clip_case)
        except ForeseeError:
            return None
        return result.trace if result.verdict is Verdict.PASS else None
