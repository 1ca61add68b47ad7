"""A surrogate-assisted many-objective search in the manner of SAMOTA (Ul Haq, Shin, Briand, "Efficient Online Testing
for DNN-Enabled Systems using Surrogate-Assisted and Many-Objective Optimization", ICSE 2022).

Runs fill a database. The global search trains an ensemble of surrogates for each objective that is not yet reached,
evolves points on the surrogates alone, and proposes the best and the most uncertain point of each objective. The local
search trains a radial basis function on clusters of the best runs, and proposes the best point of each cluster. The
paper ends when all requirements are violated; with an equal simulated time, all objectives are then opened again.

The paper's requirements are its system's (a lane, a vehicle, a pedestrian, ...). Here the objectives are the margins
`protocol.OBJECTIVES`: a gap, a time to collision, a post-encroachment time. "Program" below means the authors' program
in the form in which later public test frameworks contain it; the numbers are from there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_study.search.protocol import FAR, OBJECTIVES, Evaluation, Point, Proposals

Predicted = Callable[[FloatArray], FloatArray]
"""A surrogate: from points [N, D] to margins [N]."""
_LENGTH = 0.5
"""Width of the Gaussian kernels, as a share of the unit cube's side. Ours: half of it; the program fits it."""
_NOISE = 1e-3
"""Variance that is added to the kernel's diagonal. Ours: it keeps the matrix invertible if two points are equal."""


@dataclass(frozen=True)
class Samota:
    """Settings of the search.

    Attributes:
        population: number of random points of the beginning, and size of the populations (program: 6, the number of
            its objectives).
        generations: generations on surrogates (program: 200 in the local search). Ours: 50, as the points of these
            small databases no longer change after them.
        tournament: number of candidates of a tournament (program: 10).
        crossover: probability of a crossover at one place (program: 0.75). A gene mutates with probability 1 / D.
        best_share, best_least: share and least number of the runs that the local search clusters (program: 20 %, 5).
        near: distance below which two of the best runs are of one cluster. Ours: the default radius of DBSCAN in the
            library that the program uses.
    """

    name: str = "samota"
    population: int = 6
    generations: int = 50
    tournament: int = 10
    crossover: float = 0.75
    best_share: float = 0.2
    best_least: int = 5
    near: float = 0.5

    def proposals(self, dimensions: int, rng: np.random.Generator) -> Proposals:
        """Search globally and locally in turn (paper, algorithm 1)."""
        database = yield [tuple(map(float, row)) for row in rng.random((self.population, dimensions))]
        while True:
            for search in (self._global, self._local):
                open_ = [k for k in range(len(OBJECTIVES)) if all(e.margins[k] > 0 for e in database)]
                points = search(database, open_ or list(range(len(OBJECTIVES))), rng)
                new = list(dict.fromkeys(point for point in points if all(point != e.point for e in database)))
                new = new or [tuple(map(float, rng.random(dimensions)))]
                database += yield new

    def _global(self, database: list[Evaluation], objectives: list[int], rng: np.random.Generator) -> list[Point]:
        """Return the best and the most uncertain point of each objective (paper, algorithm 2)."""
        points, margins = _table(database)
        proposed: list[Point] = []
        for k in objectives:
            surrogates = _ensemble(points, margins[:, k])
            predicted = _weighted(surrogates, _weights(points, margins[:, k]))
            population = self._evolved(rng.random((self.population, points.shape[1])), predicted, rng)
            spread = np.ptp([model(population) for model in surrogates], axis=0)
            proposed += [_point(population[predicted(population).argmin()]), _point(population[spread.argmax()])]
        return proposed

    def _local(self, database: list[Evaluation], objectives: list[int], rng: np.random.Generator) -> list[Point]:
        """Return the best point of each cluster of the best runs, for each objective (paper, algorithm 3)."""
        points, margins = _table(database)
        proposed: list[Point] = []
        for k in objectives:
            best = np.argsort(margins[:, k], kind="stable")[
                : max(self.best_least, round(self.best_share * len(points)))
            ]
            for cluster in _clusters(points[best], self.near):
                own = best[cluster]
                model = _radial(points[own], margins[own, k])
                low, high = points[own].min(axis=0), points[own].max(axis=0)
                begun = low + rng.random((self.population, points.shape[1])) * (high - low)
                population = self._evolved(begun, model, rng)
                proposed.append(_point(population[model(population).argmin()]))
        return proposed

    def _evolved(self, population: FloatArray, predicted: Predicted, rng: np.random.Generator) -> FloatArray:
        """Return a population after its generations on a surrogate: of parents and children the best remain."""
        count, dimensions = population.shape
        for _ in range(self.generations):
            value = predicted(population)
            drawn = rng.integers(count, size=(count, 2, self.tournament))
            parents = population[np.take_along_axis(drawn, value[drawn].argmin(axis=2)[..., None], axis=2)[..., 0]]
            place = rng.integers(1, max(dimensions, 2), size=count)
            place = np.where(rng.random(count) < self.crossover, place, dimensions)
            crossed = np.arange(dimensions) >= place[:, None]
            children = np.where(crossed, parents[:, 1], parents[:, 0])
            mutates = rng.random(children.shape) < 1 / dimensions
            children = np.where(mutates, rng.random(children.shape), children)
            both = np.unique(np.vstack([population, children]), axis=0)
            population = both[np.argsort(predicted(both), kind="stable")[:count]]
            if len(population) < count:
                population = np.vstack([population, rng.random((count - len(population), dimensions))])
        return population


def _table(database: list[Evaluation]) -> tuple[FloatArray, FloatArray]:
    """Return the points, [N, D], and the margins, [N, objectives], of all runs."""
    return np.array([e.point for e in database]), np.array([e.margins for e in database])


def _point(row: FloatArray) -> Point:
    return tuple(map(float, row))


def _ensemble(points: FloatArray, margins: FloatArray) -> tuple[Predicted, ...]:
    """Return the surrogates of an objective: Kriging, a polynomial, a radial basis function (paper, section 3.2)."""
    return _kriging(points, margins), _polynomial(points, margins), _radial(points, margins)


def _weights(points: FloatArray, margins: FloatArray) -> FloatArray:
    """Return the weight of each surrogate, the larger the smaller its error on every third run, which it is not trained
    with."""
    apart = np.arange(len(points)) % 3 == 0
    models = _ensemble(points[~apart], margins[~apart])
    errors = np.array([np.abs(model(points[apart]) - margins[apart]).mean() for model in models])
    weights: FloatArray = (errors.sum() - errors + _NOISE) / (2 * errors.sum() + 3 * _NOISE)
    return weights


def _weighted(surrogates: tuple[Predicted, ...], weights: FloatArray) -> Predicted:
    def predicted(at: FloatArray) -> FloatArray:
        margins: FloatArray = weights @ np.array([model(at) for model in surrogates])
        return margins

    return predicted


def _kernel(a: FloatArray, b: FloatArray) -> FloatArray:
    apart: FloatArray = ((a[:, None] - b[None]) ** 2).sum(axis=2)
    gauss: FloatArray = np.exp(-apart / (2 * _LENGTH**2))
    return gauss


def _kriging(points: FloatArray, margins: FloatArray) -> Predicted:
    """Return ordinary Kriging: a Gaussian process about the mean."""
    mean = float(margins.mean())
    weights = np.linalg.solve(_kernel(points, points) + _NOISE * np.eye(len(points)), margins - mean)
    return lambda at: np.clip(mean + _kernel(at, points) @ weights, 0.0, FAR)


def _polynomial(points: FloatArray, margins: FloatArray) -> Predicted:
    """Return the polynomial of degree 2 without mixed terms that fits best."""

    def terms(at: FloatArray) -> FloatArray:
        return np.hstack([np.ones((len(at), 1)), at, at**2])

    weights = np.linalg.lstsq(terms(points), margins, rcond=None)[0]
    return lambda at: np.clip(terms(at) @ weights, 0.0, FAR)


_NEURONS = 10
"""Number of centres of a radial basis function (program: 10 neurons)."""


def _radial(points: FloatArray, margins: FloatArray) -> Predicted:
    """Return a radial basis function whose centres are the runs with the smallest margins."""
    centres = points[np.argsort(margins, kind="stable")[:_NEURONS]]
    weights = np.linalg.lstsq(np.hstack([np.ones((len(points), 1)), _kernel(points, centres)]), margins, rcond=None)[0]
    return lambda at: np.clip(np.hstack([np.ones((len(at), 1)), _kernel(at, centres)]) @ weights, 0.0, FAR)


def _clusters(points: FloatArray, near: float) -> list[IntArray]:
    """Return the groups of points that are connected by steps of at most `near`."""
    import networkx as nx

    linked = np.linalg.norm(points[:, None] - points[None], axis=2) <= near
    return [np.array(sorted(group), dtype=np.intp) for group in nx.connected_components(nx.from_numpy_array(linked))]
