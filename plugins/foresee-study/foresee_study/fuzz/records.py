"""Records of a fuzzing run: runs of mutated test cases, their cycles, the test cases, and the whole run."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

from pydantic import TypeAdapter

from foresee_dsl.documents import every_field, or_null, packed, plain, rounded, unpacked
from foresee_dsl.simulate.results.verdict import RunRecord, Verdict
from foresee_study.fuzz.quality import Quality
from foresee_study.fuzz.settings import FuzzSettings


@dataclass(frozen=True)
class MutatedRun(RunRecord):
    """The run of one mutated test case, as stored.

    Attributes:
        lines: the lines of its file that add or change statements of the original test case, as text.
        what: its mutation in words.
        wall_s: wall time of the draws and the run, s.
        quality: the driving quality of the ego.
        refused: number of impossible draws before it.
    """

    lines: str = ""
    what: str = ""
    wall_s: float = 0.0
    quality: Quality = field(default_factory=Quality)
    refused: int = 0


@dataclass(frozen=True)
class FuzzRun:
    """A mutated test case as it is reported.

    `file`: its path relative to the output folder; `address`: the file with its case.
    """

    name: str
    cycle: int
    number: int
    file: str
    address: str
    outcome: MutatedRun
    text: str = field(default="", repr=False)

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "cycle": self.cycle,
            "number": self.number,
            "what": self.outcome.what,
            "score": rounded(self.score, 4),
            "quality": self.outcome.quality,
            "verdict": self.outcome.verdict,
            "with": or_null(self.outcome.with_),
            "reason": self.outcome.reason,
            "time_s": rounded(self.outcome.time_s, 2),
            "duration_s": rounded(self.outcome.duration_s, 2),
            "refused": self.outcome.refused,
            "digest": or_null(self.outcome.digest),
            "file": self.file,
            "address": self.address,
        }

    @property
    def score(self) -> float:
        """Return the driving quality; a lower value is worse."""
        return self.outcome.quality.score


@dataclass(frozen=True)
class Cycle:
    """The mutations of one parent.

    `chosen`: the number of the mutation that is mutated in the next cycle; 0 if the test case ended here.
    """

    number: int
    runs: tuple[FuzzRun, ...]
    chosen: int = 0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"number": self.number, "chosen": self.chosen, "best": rounded(self.best, 4), "runs": self.runs}

    @property
    def best(self) -> float:
        """Return the lowest score of the cycle, which is what DriveFuzz searches for."""
        return min((run.score for run in self.runs), default=0.0)


@dataclass(frozen=True)
class FuzzedCase:
    """A test case with its mutations.

    Attributes:
        test_case: its address.
        family: its scenario family.
        plain: its run without mutations; None before that run.
        cycles: in order. The last one is incomplete after a failure, or if the fuzzing was stopped.
    """

    test_case: str
    family: str
    plain: MutatedRun | None
    cycles: tuple[Cycle, ...] = ()

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "test_case": self.test_case,
            "family": self.family,
            "verdict": self.verdict,
            "reason": self.reason,
            "usable": self.usable,
            "failure": self.failed and self.failed.name,
            "runs": self.runs,
            "simulated_s": rounded(self.simulated_s, 2),
            "last": self.worst and self.worst.address,
            "passing": self.passing,
            "cycles": self.cycles,
        }

    @property
    def verdict(self) -> Verdict | None:
        """Return the verdict of the unmutated run."""
        return self.plain.verdict if self.plain is not None else None

    @property
    def reason(self) -> str:
        """Return the verdict of the unmutated run, in words."""
        return self.plain.reason if self.plain is not None else "not run yet"

    @property
    def usable(self) -> bool:
        """Return whether the test case passes unmutated; a failure without mutation does not count."""
        return self.verdict is Verdict.PASS

    @property
    def every(self) -> tuple[FuzzRun, ...]:
        """Return all runs of mutated test cases."""
        return tuple(run for cycle in self.cycles for run in cycle.runs)

    @property
    def failed(self) -> FuzzRun | None:
        """Return the failing mutation, which ended the test case; None without a failure."""
        return next((run for run in self.every if run.outcome.verdict.is_failure), None)

    @property
    def passed(self) -> tuple[FuzzRun, ...]:
        """Return the mutated test cases that pass."""
        return tuple(run for run in self.every if run.outcome.verdict is Verdict.PASS)

    @property
    def passing(self) -> list[str]:
        """Return the addresses of the passing mutated test cases, relative to the output folder."""
        return [run.address for run in self.passed]

    @property
    def worst(self) -> FuzzRun | None:
        """Return the passing drive with the lowest score in the last cycle that has one; None if there is none."""
        chosen = [run for cycle in self.cycles for run in cycle.runs if run.number == cycle.chosen]
        return next((run for run in reversed(chosen) if run.outcome.verdict is Verdict.PASS), None)

    @property
    def runs(self) -> int:
        """Return the number of runs, including the unmutated one."""
        return len(self.every) + (self.plain is not None)

    @property
    def simulated_s(self) -> float:
        """Return the simulated time of all runs, s."""
        plain_s = self.plain.duration_s if self.plain is not None else 0.0
        return plain_s + sum(run.outcome.duration_s for run in self.every)


@dataclass(frozen=True)
class FuzzResult:
    """The result of fuzzing several test cases.

    `broken`: runs that could not be run, in words; `interrupted`: whether it was stopped.
    """

    settings: FuzzSettings
    seeds: tuple[FuzzedCase, ...]
    interrupted: bool = False
    broken: tuple[str, ...] = ()
    wall_s: float = 0.0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "settings": self.settings,
            "interrupted": self.interrupted,
            "broken": self.broken,
            "failed": {"count": self.failures},
            "simulated_s": rounded(self.simulated_s, 2),
            "wall_s": rounded(self.wall_s, 2),
            "by_cycle": self.by_cycle,
            "seeds": self.seeds,
        }

    @property
    def failures(self) -> int:
        """Return the number of test cases that ended with a failing mutation."""
        return sum(case.failed is not None for case in self.seeds)

    @property
    def all_passed(self) -> bool:
        """Return whether every test case passes unmutated, no mutation failed, and the driver never crashed."""
        good = all(case.usable and case.failed is None for case in self.seeds)
        return good and not any(run.outcome.verdict is Verdict.CRASH for case in self.seeds for run in case.every)

    @property
    def simulated_s(self) -> float:
        """Return the simulated time of all runs, s."""
        return sum(case.simulated_s for case in self.seeds)

    @property
    def by_cycle(self) -> list[CycleMean]:
        """Return, for each cycle, the number of test cases that reached it, its failures, and the mean of the lowest
        scores.
        """
        summaries = []
        for number in range(1, self.settings.cycles + 1):
            best = [cycle.best for case in self.seeds for cycle in case.cycles if cycle.number == number]
            failed = sum(1 for case in self.seeds if case.failed is not None and case.failed.cycle == number)
            if best:
                summaries.append(CycleMean(number, len(best), failed, sum(best) / len(best)))
        return summaries


@dataclass(frozen=True)
class CycleMean:
    """Summary of a cycle over all test cases that reached it."""

    cycle: int
    seeds: int
    failures: int
    mean_best: float

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return every_field(self, 4)


def encode(outcome: MutatedRun) -> bytes:
    """Return an outcome as it is stored; floats keep every bit."""
    return packed(_adapter(), outcome)


def decode(data: bytes) -> MutatedRun:
    """Return a stored outcome; raises `ValueError` if another version wrote it."""
    return unpacked(_adapter(), data)


@cache
def _adapter() -> TypeAdapter[MutatedRun]:
    return TypeAdapter(MutatedRun)


def document(result: FuzzResult) -> dict[str, object]:
    """Return the content of `fuzz.json`."""
    return {"schema": 1, "document": "fuzz", **plain(result)}
