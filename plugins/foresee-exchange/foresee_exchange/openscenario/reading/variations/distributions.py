"""Distributions of parameters (`<ParameterValueDistribution>`): the sets of values of a scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np

from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_exchange.naming import number
from foresee_exchange.openscenario.losses import SourceError
from foresee_exchange.openscenario.reading.source import WHAT, Source, project_roots

MOST_SETS = 10_000
"""Maximum number of cases that a scenario may draw (the limit of `cases` in the language)."""
_MOST_STEPS = 10_000
_DEVIATIONS = 4.0
"""A normal distribution without a range is cut off at this many standard deviations from its mean. Ours: one draw of
16,000 is outside."""
_MOST_TRIES = 10_000
Values = Mapping[str, str]
"""Values of parameters as text, by the parameters' names."""


@dataclass(frozen=True)
class Drawn:
    """The distribution of a parameter.

    Attributes:
        kind: `uniform`, `normal` and `choice` exist in the language; values of the others are drawn by the import.
        low, high: the range, for kinds without weights. mean, deviation: those of a `normal`, or of the logarithm of a
            `lognormal`; a `poisson` has only a mean.
        options: the values of a `choice`. bins: the ranges of a `histogram`. weights: one for each option or bin, in
            the same order.
    """

    kind: Literal["uniform", "normal", "lognormal", "poisson", "choice", "histogram"]
    low: float = 0.0
    high: float = 0.0
    mean: float = 0.0
    deviation: float = 0.0
    options: tuple[str, ...] = ()
    bins: tuple[tuple[float, float], ...] = ()
    weights: tuple[float, ...] = ()


@dataclass(frozen=True)
class Variation:
    """A file that varies the parameters of a scenario.

    Attributes:
        path: the file. scenario: the scenario that it varies. description: the description in its header.
        groups: for each group of parameters that vary together, its sets of values; all combinations are used.
        drawn: distributions of parameters, instead of groups. runs, seed: number and seed of the draws.
    """

    path: Path
    scenario: Path
    description: str = ""
    groups: tuple[tuple[Values, ...], ...] = ()
    drawn: Mapping[str, Drawn] = field(default_factory=dict)
    runs: int = 1
    seed: int = 1

    @property
    def count(self) -> int:
        """Return the number of value sets."""
        return self.runs if self.drawn else math.prod(len(group) for group in self.groups)

    def sets(self, most: int) -> list[dict[str, str]]:
        """Return the value sets; if there are more than `most`, an even selection."""
        if self.drawn:
            rng = np.random.default_rng(self.seed)
            return [{name: _draw(how, rng) for name, how in self.drawn.items()} for _ in range(min(self.runs, most))]
        count = self.count
        wanted = range(count) if count <= most else sorted({round(k) for k in np.linspace(0, count - 1, most)})
        return [self._combination(k) for k in wanted]

    def _combination(self, k: int) -> dict[str, str]:
        """Return the k-th combination; the last group changes fastest."""
        values: dict[str, str] = {}
        for group in reversed(self.groups):
            k, at = divmod(k, len(group))
            values = {**group[at], **values}
        return values


def read_variation(path: Path, *, allow_outside: bool) -> Variation | None:
    """Read a file that varies a scenario; None if the file is something else.

    Raises:
        ExchangeError: its scenario does not exist or lies outside the project, or a distribution cannot be drawn.
    """
    root = parse_xml(path, "OpenSCENARIO", WHAT, ExchangeError)
    varied = root.find("ParameterValueDistribution")
    if varied is None:
        return None
    source = Source(path, root, project_roots(path, allow_outside=allow_outside))
    file = varied.find("ScenarioFile")
    if file is None or not file.get("filepath"):
        raise SourceError(f"{path} does not name the scenario whose parameters it varies")
    scenario = source.named(file.get("filepath", ""), "the scenario")
    variation = Variation(path, scenario, source.description)
    fixed, random = varied.find("Deterministic"), varied.find("Stochastic")
    if random is not None:
        drawn = {
            e.get("parameterName", "").removeprefix("$"): _drawn(path, e)
            for e in random.iterfind("StochasticDistribution")
        }
        runs = max(round(number(random, "numberOfTestRuns", 1)), 1)
        return replace(variation, drawn=drawn, runs=runs, seed=abs(round(number(random, "randomSeed", 1))))
    groups = [_group(path, e) for e in fixed] if fixed is not None else []
    if not groups:
        raise SourceError(f"{path} varies no parameter")
    return replace(variation, groups=tuple(groups))


def _group(path: Path, distribution: Element) -> tuple[Values, ...]:
    """Return the values of a `<Deterministic...Distribution>`."""
    if distribution.tag == "DeterministicMultiParameterDistribution":
        sets = [
            {
                a.get("parameterRef", "").removeprefix("$"): a.get("value", "")
                for a in value_set.iterfind("ParameterAssignment")
            }
            for value_set in distribution.iterfind("ValueSetDistribution/ParameterValueSet")
        ]
        if sets:
            return tuple(sets)
    name = distribution.get("parameterName", "").removeprefix("$")
    values = [e.get("value", "") for e in distribution.iterfind("DistributionSet/Element")]
    steps = distribution.find("DistributionRange")
    if steps is not None:
        values = _steps(path, name, steps)
    if not values:
        raise SourceError(f"{path} gives the parameter '{name}' a distribution that is not one of the standard's")
    return tuple({name: value} for value in values)


def _steps(path: Path, name: str, steps: Element) -> list[str]:
    low, high = _limits(path, name, steps)
    step = number(steps, "stepWidth")
    count = math.floor((high - low) / step + 1e-9) + 1 if step > 0 else 0
    if not 0 < count <= _MOST_STEPS:
        raise SourceError(f"{path}: the range of '{name}' has no steps, or more than {_MOST_STEPS}")
    return [f"{round(low + k * step, 9):.10g}" for k in range(count)]


def _limits(path: Path, name: str, holder: Element) -> tuple[float, float]:
    limits = holder.find("Range")
    if limits is None:
        raise SourceError(f"{path}: the distribution of '{name}' has no range")
    return number(limits, "lowerLimit"), number(limits, "upperLimit")


def _drawn(path: Path, distribution: Element) -> Drawn:
    """Return the distribution of a `<StochasticDistribution>`."""
    name = distribution.get("parameterName", "").removeprefix("$")
    kind = next((e for e in distribution if e.tag.endswith(("Distribution", "DistributionSet", "Histogram"))), None)
    tag = "" if kind is None else kind.tag
    if kind is not None and tag == "UniformDistribution":
        low, high = _limits(path, name, kind)
        return Drawn("uniform", low, high)
    if kind is not None and tag in ("NormalDistribution", "LogNormalDistribution"):
        mean, deviation = number(kind, "expectedValue"), math.sqrt(max(number(kind, "variance"), 0.0))
        ends = mean - _DEVIATIONS * deviation, mean + _DEVIATIONS * deviation
        if tag == "LogNormalDistribution":
            ends = math.exp(ends[0]), math.exp(ends[1])
        low, high = ends if kind.find("Range") is None else _limits(path, name, kind)
        return Drawn("normal" if tag == "NormalDistribution" else "lognormal", low, high, mean, deviation)
    if kind is not None and tag == "PoissonDistribution":
        mean = number(kind, "expectedValue")
        most = mean + _DEVIATIONS * 2 * math.sqrt(mean) + 1
        low, high = (0.0, most) if kind.find("Range") is None else _limits(path, name, kind)
        return Drawn("poisson", low, high, mean)
    if kind is not None and tag == "ProbabilityDistributionSet":
        elements = kind.findall("Element")
        weights = tuple(number(e, "weight") for e in elements)
        return Drawn("choice", options=tuple(e.get("value", "") for e in elements), weights=weights)
    if kind is not None and tag == "Histogram":
        bins = kind.findall("Bin")
        weights = tuple(number(e, "weight") for e in bins)
        return Drawn("histogram", bins=tuple(_limits(path, name, e) for e in bins), weights=weights)
    raise SourceError(
        f"{path} draws '{name}' from {tag or 'nothing'}, which is not one of the standard's distributions: write a "
        "NormalDistribution, a UniformDistribution or a ProbabilityDistributionSet"
    )


def _draw(how: Drawn, rng: np.random.Generator) -> str:
    """Return a drawn value."""
    if how.weights:
        chosen = int(rng.choice(len(how.weights), p=np.array(how.weights) / sum(how.weights)))
        return how.options[chosen] if how.options else repr(float(rng.uniform(*how.bins[chosen])))
    for _ in range(_MOST_TRIES):
        if how.kind == "uniform":
            value = float(rng.uniform(how.low, how.high))
        elif how.kind == "poisson":
            value = float(rng.poisson(how.mean))
        else:
            value = float(rng.normal(how.mean, how.deviation))
            value = math.exp(value) if how.kind == "lognormal" else value
        if how.low <= value <= how.high:
            return f"{value:.10g}"
    raise SourceError(f"a distribution has hardly any values between {how.low:g} and {how.high:g}")
