"""The result of the conformance suite, as commands print it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from foresee_dsl.documents import every_field, rounded
from foresee_dsl.simulate.results.verdict import RunRecord


class CheckStatus(StrEnum):
    """How a check ended."""

    PASS = "pass"
    FAIL = "fail"
    SKIPPED = "skipped"
    """It could not be made; the detail says why."""


@dataclass(frozen=True)
class Check:
    """One check of a driver.

    Attributes:
        detail: the figures, or what is wrong. advice: what to do; "" if the check did not fail.
    """

    name: str
    status: CheckStatus
    detail: str
    advice: str = ""


@dataclass(frozen=True)
class ConformanceCase:
    """One of the ten test cases: what it is about (`about`), and how the driver's run ended."""

    name: str
    about: str
    run: RunRecord

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.name,
            "about": self.about,
            "verdict": self.run.verdict,
            "passed": self.run.passed,
            "reason": self.run.reason,
            "duration_s": rounded(self.run.duration_s, 2),
            "digest": self.run.digest,
        }


@dataclass(frozen=True)
class StepTimes:
    """Wall time of the driver's calls in all runs, ms: the slowest reset, and of its steps the mean, the 99th
    percentile and the slowest.
    """

    reset_ms: float
    mean_ms: float
    p99_ms: float
    slowest_ms: float
    steps: int

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return every_field(self, 3)


@dataclass(frozen=True)
class Conformance:
    """All checks of a driver and the ten test cases. `version` is "" if the driver did not start."""

    driver: str
    version: str
    seed: int
    checks: tuple[Check, ...]
    cases: tuple[ConformanceCase, ...] = ()
    times: StepTimes | None = None

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "driver": self.driver,
            "version": self.version,
            "seed": self.seed,
            "conforms": self.conforms,
            "checks": self.checks,
            "cases": self.cases,
            "times": self.times,
        }

    @property
    def failed(self) -> tuple[Check, ...]:
        """Return the checks that failed."""
        return tuple(check for check in self.checks if check.status is CheckStatus.FAIL)

    @property
    def conforms(self) -> bool:
        """Return whether no check failed and the driver passes all test cases."""
        return not self.failed and all(case.run.passed for case in self.cases)
