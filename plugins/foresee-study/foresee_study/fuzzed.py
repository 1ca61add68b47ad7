"""What a study keeps of DriveFuzz on its test cases, for rq4."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl import __version__
from foresee_dsl.campaign.driving import case_name
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.fuzz.records import FuzzResult, SeedFuzz
from foresee_study.halves import Half, half_of


@dataclass(frozen=True)
class FuzzedSeed:
    """A test case and what became of it.

    Attributes:
        plain: how it ends unmutated. failed: how the mutation that ended it failed; None where none did.
        runs: of mutated test cases. simulated_s, wall_s: what they took.
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
    """One iteration of DriveFuzz. `iteration`: 1 or 2. repetition: from 0."""

    driver: str
    repetition: int
    iteration: int
    cycles: int
    mutations: int
    tool: str
    seeds: tuple[FuzzedSeed, ...]

    @property
    def name(self) -> str:
        """The name of its file."""
        return f"{self.driver}-{self.repetition}-{self.iteration}"

    @property
    def failed(self) -> frozenset[str]:
        """The names of the test cases in which it found a failure."""
        return frozenset(seed.name for seed in self.seeds if seed.failed is not None)


def fuzzed(result: FuzzResult, cases: dict[str, TestCase], *, repetition: int, iteration: int) -> Fuzzed:
    """Return what a study keeps; `cases`: the seeds by address."""
    settings = result.settings
    seeds = tuple(sorted((_seed(entry, cases[entry.test_case]) for entry in result.seeds), key=lambda seed: seed.name))
    return Fuzzed(settings.driver, repetition, iteration, settings.cycles, settings.mutations, __version__, seeds)


def _seed(result: SeedFuzz, case: TestCase) -> FuzzedSeed:
    return FuzzedSeed(
        name=case_name(case),
        family=result.family,
        half=half_of(case.id),
        plain=result.verdict,
        failed=result.failed.verdict if result.failed is not None else None,
        runs=len(result.every),
        simulated_s=round(sum(run.duration_s for run in result.every), 2),
        wall_s=round(sum(run.outcome.wall_s for run in result.every), 4),
    )
