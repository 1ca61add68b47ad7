"""AV-Fuzzer (Li et al., "AV-Fuzzer: Finding Safety Violations in Autonomous Driving Systems", ISSRE 2020).

A genetic algorithm over what the other vehicles do, whose fitness is the safety potential; a local fuzzer around an
individual whose fitness is promising; a restart, far from all earlier individuals, when the fitness no longer improves.
In the paper a gene is one vehicle's speed and manoeuvre in a time slice; here a gene is a dimension of the space that
all searches share. The safety potential is the smallest gap, which this tool's verdicts are about.

"Program" below means the paper's public program (`GeneticAlgorithm.py`), from which the numbers are.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from foresee_study.search.protocol import Evaluation, Point, Proposals

Generations = Generator[list[Point], list[Evaluation], Evaluation]


@dataclass(frozen=True)
class AvFuzzer:
    """Settings of AV-Fuzzer.

    Attributes:
        population: number of individuals (program: 4).
        crossover: probability with which a pair exchanges a gene (program: 0.8).
        mutation: probability with which an individual gets one new gene (program: 0.4).
        local_generations: number of generations of the local fuzzer (program: 5).
        local_mutation: factor of the mutation's probability in the local fuzzer (program: 1.5).
        settles: number of generations after a beginning or a restart before the local fuzzer may begin (program: more
            than 2).
        patience: number of generations over which the mean of the best fitness must be surpassed, otherwise the search
            restarts (program: 5).
        candidates: number of random individuals from which a restart chooses those that differ most from all earlier
            ones (program: 1000).
    """

    name: str = "av_fuzzer"
    population: int = 4
    crossover: float = 0.8
    mutation: float = 0.4
    local_generations: int = 5
    local_mutation: float = 1.5
    settles: int = 2
    patience: int = 5
    candidates: int = 1000

    def proposals(self, dimensions: int, rng: np.random.Generator) -> Proposals:
        """Search generation after generation (paper, section IV)."""
        every: list[Point] = []
        population = yield from _noted(_drawn(self.population, dimensions, rng), every)
        begun, generation, bests = 0, 0, [_best(population).margin]
        record = bests[-1]
        while True:
            generation += 1
            population = yield from self._generation(population, rng, every)
            best = _best(population)
            bests.append(best.margin)
            stagnates = generation - begun >= self.patience and best.margin >= np.mean(bests[-self.patience - 1 : -1])
            if stagnates:
                points = _far_from(every, _drawn(self.candidates, dimensions, rng), self.population)
                population = yield from _noted(points, every)
                begun, record = generation, _best(population).margin
            elif best.margin < record:
                record = best.margin
                if generation - begun > self.settles:
                    local = yield from self._local(best, rng, every)
                    population[population.index(best)] = min(best, local, key=_margin)
                    record = min(record, local.margin)

    def _local(self, around: Evaluation, rng: np.random.Generator, every: list[Point]) -> Generations:
        """Search around an individual, and return the best one (paper: the local fuzzer)."""
        changed = [_with_new_gene(around.point, rng) for _ in range(self.population)]
        population = yield from _noted(changed, every)
        best = _best(population)
        inner = replace(self, mutation=min(self.mutation * self.local_mutation, 1.0))
        for _ in range(self.local_generations):
            population = yield from inner._generation(population, rng, every)
            best = min(best, _best(population), key=_margin)
        return best

    def _generation(
        self, population: list[Evaluation], rng: np.random.Generator, every: list[Point]
    ) -> Generator[list[Point], list[Evaluation], list[Evaluation]]:
        """Cross, mutate and select; only individuals that changed are run."""
        points = [list(individual.point) for individual in population]
        for _ in range(len(points) // 2):
            if rng.random() < self.crossover:
                first, second = rng.choice(len(points), size=2, replace=False)
                gene = int(rng.integers(len(points[0])))
                points[first][gene], points[second][gene] = points[second][gene], points[first][gene]
        changed = [
            _with_new_gene(tuple(point), rng) if rng.random() < self.mutation else tuple(point) for point in points
        ]
        run = [new for new, old in zip(changed, population, strict=True) if new != old.point]
        results = iter((yield from _noted(run, every)) if run else [])
        after = [old if new == old.point else next(results) for new, old in zip(changed, population, strict=True)]
        return _roulette(after, rng)


def _noted(points: list[Point], every: list[Point]) -> Generator[list[Point], list[Evaluation], list[Evaluation]]:
    every += points
    return (yield points)


def _drawn(count: int, dimensions: int, rng: np.random.Generator) -> list[Point]:
    return [tuple(map(float, row)) for row in rng.random((count, dimensions))]


def _with_new_gene(point: Point, rng: np.random.Generator) -> Point:
    gene, value = int(rng.integers(len(point))), float(rng.random())
    return (*point[:gene], value, *point[gene + 1 :])


def _margin(individual: Evaluation) -> float:
    return individual.margin


def _best(population: list[Evaluation]) -> Evaluation:
    return min(population, key=_margin)


def _roulette(population: list[Evaluation], rng: np.random.Generator) -> list[Evaluation]:
    """Return as many individuals, drawn in proportion to their fitness: how much smaller their margin is than the
    largest one. (The program shifts negative fitness values in the same way.)"""
    fitness = np.array([_margin(max(population, key=_margin)) - individual.margin for individual in population])
    shares = fitness / fitness.sum() if fitness.sum() > 0 else np.full(len(population), 1 / len(population))
    return [population[k] for k in rng.choice(len(population), size=len(population), p=shares)]


def _far_from(every: list[Point], candidates: list[Point], count: int) -> list[Point]:
    """Return the candidates that are farthest from all earlier individuals."""
    apart = np.linalg.norm(np.array(candidates)[:, None] - np.array(every)[None], axis=2).min(axis=1)
    return [candidates[k] for k in np.argsort(-apart, kind="stable")[:count]]
