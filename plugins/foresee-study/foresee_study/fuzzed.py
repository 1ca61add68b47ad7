"""Summaries of DriveFuzz's runs that a study stores for rq4."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl import __version__
from foresee_dsl.campaign.driving import case_name
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz.records import FuzzedCase, FuzzResult
from foresee_study.halves import Half, half_of


@dataclass(frozen=True)
class CaseSummary:
    """A test case and the result of fuzzing it.

    Attributes:
        name, family, half: the test case.
        plain: verdict without mutation; None if it was not run.
        failed: verdict of the failing mutation that ended it; None without a failure.
        runs: number of runs of mutated test cases.
        simulated_s, wall_s: simulated time and wall time of these runs, s.
    """

    name: str
    family: str
    half: Half
    plain: Verdict | None
    failed: Verdict | None
    runs: int
    simulated_s: float
    wall_s: float


@dataclass(frozen=True)
class Fuzzed:
    """One iteration (1 or 2) of DriveFuzz with a driver, in a repetition (from 0)."""

    driver: str
    repetition: int
    iteration: int
    cycles: int
    mutations: int
    tool: str
    seeds: tuple[CaseSummary, ...]

    @property
    def name(self) -> str:
        """The name of its file."""
        return f"{self.driver}-{self.repetition}-{self.iteration}"

    @property
    def failed(self) -> frozenset[str]:
        """The names of the test cases in which DriveFuzz found a failure."""
        return frozenset(case.name for case in self.seeds if case.failed is not None)


def fuzzed(result: FuzzResult, cases: dict[str, TestCase], *, repetition: int, iteration: int) -> Fuzzed:
    """Return the summary of a fuzzing run; `cases`: its test cases by address."""
    settings = result.settings
    seeds = tuple(
        sorted((_summary(entry, cases[entry.test_case]) for entry in result.seeds), key=lambda case: case.name)
    )
    return Fuzzed(settings.driver, repetition, iteration, settings.cycles, settings.mutations, __version__, seeds)


def _summary(result: FuzzedCase, case: TestCase) -> CaseSummary:
    return CaseSummary(
        name=case_name(case),
        family=result.family,
        half=half_of(case.id),
        plain=result.verdict,
        failed=result.failed.outcome.verdict if result.failed is not None else None,
        runs=len(result.every),
        simulated_s=round(sum(run.outcome.duration_s for run in result.every), 2),
        wall_s=round(sum(run.outcome.wall_s for run in result.every), 4),
    )
