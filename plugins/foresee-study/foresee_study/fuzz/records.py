"""What a fuzzing run gives: runs of mutated test cases, cycles of them, seeds, and the whole."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass, field
from functools import cache

from pydantic import TypeAdapter

from foresee_dsl.documents import or_null, plain, rounded
from foresee_dsl.files import unpacked_within
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz.quality import Quality
from foresee_study.fuzz.settings import FuzzSettings


@dataclass(frozen=True)
class Outcome:
    """One mutated test case as it was run; what the store holds.

    Attributes:
        lines: what it adds to and changes of its seed: the lines of its file, without those of its head.
        what: its mutation in words. verdict, with_, reason, time_s, duration_s: of its run.
        quality: how the ego drove. refused: how many draws before it were impossible.
    """

    lines: str
    what: str
    verdict: Verdict
    with_: str
    reason: str
    time_s: float
    duration_s: float
    wall_s: float
    quality: Quality
    refused: int = 0
    digest: str = ""
    """The digest of its trace."""


@dataclass(frozen=True)
class FuzzRun:
    """A mutated test case of a seed. `file`: relative to the folder that is written; `address`: with its case."""

    name: str
    cycle: int
    number: int
    file: str
    address: str
    outcome: Outcome
    text: str = field(default="", repr=False)

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "cycle": self.cycle,
            "number": self.number,
            "what": self.what,
            "score": rounded(self.score, 4),
            "quality": self.quality,
            "verdict": self.verdict,
            "with": or_null(self.with_),
            "reason": self.reason,
            "time_s": rounded(self.time_s, 2),
            "duration_s": rounded(self.duration_s, 2),
            "refused": self.refused,
            "digest": or_null(self.digest),
            "file": self.file,
            "address": self.address,
        }

    @property
    def what(self) -> str:
        """The mutation in words."""
        return self.outcome.what

    @property
    def score(self) -> float:
        """The driving quality; lower is worse."""
        return self.outcome.quality.score

    @property
    def quality(self) -> Quality:
        """The parts of the score."""
        return self.outcome.quality

    @property
    def verdict(self) -> Verdict:
        """How it ended."""
        return self.outcome.verdict

    @property
    def with_(self) -> str:
        """Whom the ego hit, or ""."""
        return self.outcome.with_

    @property
    def reason(self) -> str:
        """How it ended, in words."""
        return self.outcome.reason

    @property
    def time_s(self) -> float:
        """When its verdict was reached, s."""
        return self.outcome.time_s

    @property
    def duration_s(self) -> float:
        """How much was simulated, s."""
        return self.outcome.duration_s

    @property
    def refused(self) -> int:
        """How many draws before it were impossible."""
        return self.outcome.refused

    @property
    def digest(self) -> str:
        """The digest of its trace."""
        return self.outcome.digest


@dataclass(frozen=True)
class Cycle:
    """The mutations of one parent. `chosen`: which of them is mutated next; 0 where the seed ended here."""

    number: int
    runs: tuple[FuzzRun, ...]
    chosen: int = 0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"number": self.number, "chosen": self.chosen, "best": rounded(self.best, 4), "runs": self.runs}

    @property
    def best(self) -> float:
        """The lowest score, which a fuzzer is after."""
        return min((run.score for run in self.runs), default=0.0)


@dataclass(frozen=True)
class SeedFuzz:
    """A test case and what was made of it.

    Attributes:
        test_case: its address. plain: its run without mutations; None where that has not been done.
        cycles: in order; the last may be incomplete where it failed, or where the fuzzing was stopped.
    """

    test_case: str
    family: str
    plain: Outcome | None
    cycles: tuple[Cycle, ...] = ()

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "test_case": self.test_case,
            "family": self.family,
            "verdict": self.verdict,
            "reason": self.reason,
            "usable": self.usable,
            "failure": self.failure,
            "runs": self.runs,
            "simulated_s": rounded(self.simulated_s, 2),
            "last": self.last,
            "passing": self.passing,
            "cycles": self.cycles,
        }

    @property
    def verdict(self) -> Verdict | None:
        """How it ends unmutated."""
        return self.plain.verdict if self.plain is not None else None

    @property
    def reason(self) -> str:
        """The same in words."""
        return self.plain.reason if self.plain is not None else "not run yet"

    @property
    def usable(self) -> bool:
        """Whether it passes unmutated: what fails already says nothing about mutations."""
        return self.verdict is Verdict.PASS

    @property
    def every(self) -> tuple[FuzzRun, ...]:
        """All runs of mutated test cases."""
        return tuple(run for cycle in self.cycles for run in cycle.runs)

    @property
    def failed(self) -> FuzzRun | None:
        """The mutation that failed, and so ended the seed."""
        return next((run for run in self.every if run.verdict.is_failure), None)

    @property
    def failure(self) -> str | None:
        """Its name, in documents."""
        return self.failed.name if self.failed is not None else None

    @property
    def passed(self) -> tuple[FuzzRun, ...]:
        """The mutated test cases that pass."""
        return tuple(run for run in self.every if run.verdict is Verdict.PASS)

    @property
    def passing(self) -> list[str]:
        """Their addresses, relative to the folder."""
        return [run.address for run in self.passed]

    @property
    def worst(self) -> FuzzRun | None:
        """The last chosen parent among the passing drives: the worst drive without a failure."""
        chosen = [run for cycle in self.cycles for run in cycle.runs if run.number == cycle.chosen]
        return next((run for run in reversed(chosen) if run.verdict is Verdict.PASS), None)

    @property
    def last(self) -> str | None:
        """Its address, in documents."""
        return self.worst.address if self.worst is not None else None

    @property
    def runs(self) -> int:
        """How many runs it took, the plain one counted."""
        return len(self.every) + (self.plain is not None)

    @property
    def simulated_s(self) -> float:
        """How much all of them simulated, s."""
        plain_s = self.plain.duration_s if self.plain is not None else 0.0
        return plain_s + sum(run.duration_s for run in self.every)


@dataclass(frozen=True)
class FuzzResult:
    """A whole fuzzing run. `broken`: what could not be done; `interrupted`: it was stopped."""

    settings: FuzzSettings
    seeds: tuple[SeedFuzz, ...]
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
        """How many seeds ended in a failure."""
        return sum(seed.failed is not None for seed in self.seeds)

    @property
    def all_passed(self) -> bool:
        """Whether every seed passes unmutated, no mutation failed, and none broke."""
        good = all(seed.usable and seed.failed is None for seed in self.seeds)
        return good and not any(run.verdict is Verdict.CRASH for seed in self.seeds for run in seed.every)

    @property
    def simulated_s(self) -> float:
        """How much all runs simulated, s."""
        return sum(seed.simulated_s for seed in self.seeds)

    @property
    def by_cycle(self) -> list[CycleMean]:
        """Of each cycle: how many seeds came to it, and the mean of their lowest scores."""
        summaries = []
        for number in range(1, self.settings.cycles + 1):
            best = [cycle.best for seed in self.seeds for cycle in seed.cycles if cycle.number == number]
            failed = sum(1 for seed in self.seeds if seed.failed is not None and seed.failed.cycle == number)
            if best:
                summaries.append(CycleMean(number, len(best), failed, sum(best) / len(best)))
        return summaries


@dataclass(frozen=True)
class CycleMean:
    """How the seeds that came to a cycle did there."""

    cycle: int
    seeds: int
    failures: int
    mean_best: float

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "cycle": self.cycle,
            "seeds": self.seeds,
            "failures": self.failures,
            "mean_best": rounded(self.mean_best, 4),
        }


def encode(outcome: Outcome) -> bytes:
    """Return an outcome as it is stored; floats keep every bit."""
    return zlib.compress(json.dumps(_adapter().dump_python(outcome, mode="json"), separators=(",", ":")).encode(), 1)


def decode(data: bytes) -> Outcome:
    """Return a stored outcome; a `ValueError` where another version wrote it."""
    return _adapter().validate_json(unpacked_within("record", data))


@cache
def _adapter() -> TypeAdapter[Outcome]:
    return TypeAdapter(Outcome)


def document(result: FuzzResult) -> dict[str, object]:
    """Return what `fuzz.json` holds."""
    return {"schema": 1, "document": "fuzz", **plain(result)}
