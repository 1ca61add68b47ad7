"""Who gets the next children: Thompson sampling over clips, and over the operators and ways to draw a child."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

CLIP_WEIGHT = 2.0
"""So many children's worth of the mean over all clips is what a clip is taken for before it has children of its own."""
WAY_WEIGHT = 8.0
"""Likewise of a way to draw children."""


class Way(NamedTuple):
    """A way to draw a child: the names of the operators; and near another child, or anew."""

    operators: tuple[str, ...]
    near: bool = False


class Tried(NamedTuple):
    """A child of an earlier round: its clip, how it was drawn, and what it was worth."""

    clip: str
    way: Way
    worth: float


@dataclass
class _Posterior:
    """A mean of worths, drawn at random by how many there are (a beta distribution)."""

    prior: float
    weight: float
    count: float = 0.0
    total: float = 0.0

    def add(self, worth: float) -> None:
        self.count += 1
        self.total += worth

    @property
    def shape(self) -> tuple[float, float]:
        return (
            self.prior * self.weight + self.total,
            (1 - self.prior) * self.weight + self.count - self.total,
        )

    @property
    def mean(self) -> float:
        return (self.prior * self.weight + self.total) / (self.weight + self.count)


@dataclass
class Sampler:
    """What is known of clips and ways, from all children so far.

    Children that were chosen in this round count as if they were worth what is expected of them.
    """

    tried: Sequence[Tried]
    rng: Generator
    _clips: dict[str, _Posterior] = field(default_factory=dict)
    _ways: dict[Way, _Posterior] = field(default_factory=dict)

    def __post_init__(self) -> None:
        worth = [one.worth for one in self.tried]
        # Neither 0 nor 1, between which a beta distribution has its mean.
        self.mean = (sum(worth) + 0.1) / (len(worth) + 1)
        for one in self.tried:
            self._clip(one.clip).add(one.worth)
            self._way(one.way).add(one.worth)

    def choose(self, open_ways: Mapping[str, Iterable[Way]]) -> tuple[str, Way] | None:
        """Return a clip and one of its ways; None where no clip has one. The order of the clips decides ties."""
        clips = [(clip, tuple(ways)) for clip, ways in open_ways.items()]
        clips = [(clip, ways) for clip, ways in clips if ways]
        if not clips:
            return None
        ways = sorted({way for _, own in clips for way in own})
        clip_draws = self._drawn([self._clip(clip) for clip, _ in clips])
        way_draws = dict(zip(ways, self._drawn([self._way(way) for way in ways]), strict=True))
        scores = [
            (draw * way_draws[way], -k, way) for k, ((_, own), draw) in enumerate(zip(clips, clip_draws, strict=True))
            for way in own
        ]  # fmt: skip
        _, at, way = max(scores)
        clip = clips[-at][0]
        for posterior in (self._clip(clip), self._way(way)):
            posterior.add(posterior.mean)
        return clip, way

    def _clip(self, clip: str) -> _Posterior:
        return self._clips.setdefault(clip, _Posterior(self.mean, CLIP_WEIGHT))

    def _way(self, way: Way) -> _Posterior:
        return self._ways.setdefault(way, _Posterior(self.mean, WAY_WEIGHT))

    def _drawn(self, posteriors: list[_Posterior]) -> list[float]:
        shapes = np.array([posterior.shape for posterior in posteriors])
        return [float(value) for value in self.rng.beta(shapes[:, 0], shapes[:, 1])]


def spread(children: int, rounds: int) -> tuple[int, ...]:
    """Return how many children each of some rounds gets, as evenly as can be; the first ones get what is over."""
    each, over = divmod(children, rounds)
    return tuple(each + (k < over) for k in range(rounds))


def counts(names: Iterable[str]) -> dict[str, int]:
    """Return how often each name occurs, the most frequent first, then by name."""
    found: defaultdict[str, int] = defaultdict(int)
    for name in names:
        found[name] += 1
    return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))
