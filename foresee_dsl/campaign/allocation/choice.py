"""Who gets the next children: clips by successive halving, and their ways to draw a child by Thompson sampling."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from numpy.random import Generator

WAY_WEIGHT = 8.0
"""So many children's worth of the mean is what a way is taken for before it has children of its own."""
CERTAINTY = 8.0
"""Each child counts as so many where a way's worth is drawn. Ours: drawn from single children, ways that never found
anything are tried about as often as the best; in replays (docs/method.md) that cost one finding in thirty."""


class Way(NamedTuple):
    """A way to draw a child: the names of the operators; and near another child, or anew."""

    operators: tuple[str, ...]
    near: bool = False


FOUND = Way(("searched",))
"""The children of the preset's search, one after the other."""


class Tried(NamedTuple):
    """A child of an earlier round: its clip, how it was drawn, what it was worth, and whether it failed.

    A near miss says something of its clip, and nothing of the way: what is drawn near a near miss is one again.
    """

    clip: str
    way: Way
    worth: float
    fails: bool


def ranked(clips: Sequence[str], tried: Iterable[Tried]) -> list[str]:
    """Return clips by what their children were worth on average, best first; equal ones in the order given."""
    own: defaultdict[str, list[float]] = defaultdict(list)
    for one in tried:
        own[one.clip].append(one.worth)
    return sorted(clips, key=lambda clip: -sum(own[clip]) / max(len(own[clip]), 1))


def halved(count: int, number: int) -> int:
    """Return how many of so many clips are left in a round: all in the first, then half, a quarter, and so on."""
    return max(1, math.ceil(count / (1 << (number - 1))))


class Ways:
    """What failures say of the ways to draw a child, over all clips, and how often each clip had each."""

    def __init__(self, tried: Sequence[Tried], rng: Generator) -> None:
        """Learn from all children so far."""
        self._rng = rng
        # Neither 0 nor 1, between which a beta distribution has its mean.
        self._mean = (sum(one.worth for one in tried if one.fails) + 0.1) / (len(tried) + 1)
        self._worth: defaultdict[Way, list[float]] = defaultdict(list)
        self._had: Counter[tuple[str, Way]] = Counter()
        for one in tried:
            self._worth[one.way].append(one.worth if one.fails else 0.0)
            self._had[one.clip, one.way] += 1

    def choose(self, clip: str, ways: Sequence[Way]) -> Way:
        """Return one of a clip's ways, and remember that it had it."""
        # What a search found differs from child to child already.
        scores = [self._drawn(way) / (1 if way == FOUND else 1 + self._had[clip, way]) for way in ways]
        best = ways[scores.index(max(scores))]
        self._had[clip, best] += 1
        return best

    def _drawn(self, way: Way) -> float:
        worth = self._worth[way]
        good = self._mean * WAY_WEIGHT + sum(worth)
        bad = (1 - self._mean) * WAY_WEIGHT + len(worth) - sum(worth)
        return float(self._rng.beta(good * CERTAINTY, bad * CERTAINTY))


def spread(children: int, rounds: int) -> tuple[int, ...]:
    """Return how many children each of some rounds gets, as evenly as can be; the first ones get what is over."""
    each, over = divmod(children, rounds)
    return tuple(each + (k < over) for k in range(rounds))


def counts(names: Iterable[str]) -> dict[str, int]:
    """Return how often each name occurs, the most frequent first, then by name."""
    return dict(sorted(Counter(names).items(), key=lambda item: (-item[1], item[0])))
