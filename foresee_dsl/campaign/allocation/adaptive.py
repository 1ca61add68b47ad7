"""The allocation `adaptive`: clips get the next mutants by the usefulness (worth, 0 to 1) of their earlier ones.

A mutant is worth something if it is a new failure, an avoidable failure, or a pass with a near miss. Clips are chosen
by successive halving, and their ways to draw a mutant by Thompson sampling.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from numpy.random import Generator

from foresee_dsl.campaign.allocation.draws import SEARCHED_WAY, ClipDraws, DrawMethod, PastChild, RoundBudget
from foresee_dsl.derive.mutate import How

NEW = 1.0
"""Worth of an avoidable failure whose story is new."""
NEW_UNAVOIDED = 0.6
"""Worth of a failure whose story is new and that is not known to be avoidable."""
AGAIN = 0.1
"""Worth of a failure whose story occurred before, as a share of the worth that the story had at first. Ours: in replays
(docs/background/method.md), 0.25 gave as many failures but a tenth fewer findings, and 0 gave fewer of both.
"""
NEAR_MISS = 0.2
"""Worth of a pass with the nearest possible miss; any other pass is worth this times the square of its nearness
(`draws.nearness_of`).
"""
WAY_WEIGHT = 8.0
"""When the worth of a way of drawing mutants is estimated, this many imagined mutants of average worth are added, so
that a few results have little weight.
"""
CERTAINTY = 8.0
"""Weight of each earlier mutant when the worth of a way of drawing is drawn at random. Ours: with weight 1, ways that
never found a failure are tried about as often as the best ones; in replays (docs/background/method.md), one finding in
thirty was lost in this way.
"""


class ValuedChild(NamedTuple):
    """A mutant of an earlier round: its clip, its way of drawing, its worth, and whether it failed.

    A near miss counts for its clip but not for its way, because mutants drawn near a near miss are near misses again.
    """

    clip: str
    way: DrawMethod
    worth: float
    fails: bool


class Adaptive:
    """Half of the clips remain in each round, and get mutants in turn."""

    rounds = 4
    """Number of rounds. Ours: with four mutants per clip, each round has about as many mutants as there are clips."""
    words = "more for clips whose children in earlier rounds were worth most"

    def give_out(self, clips: Sequence[ClipDraws], past: Sequence[PastChild], budget: RoundBudget) -> None:
        """Request the mutants of a round. If the clips that remain in this round have no more mutants, other clips get
        them.
        """
        valued = [ValuedChild(child.clip, child.way, worth, bool(child.facts.story))
                  for child, worth in zip(past, worths(past), strict=True)]  # fmt: skip
        by_pin = {clip.pin: clip for clip in clips}
        order, draws = ranked(list(by_pin), valued), MutantDraws(valued, budget.rng)
        left, allocated = halved(len(order), budget.number), Counter[str]()
        while allocated.total() < budget.children:
            some = False
            for place, pin in enumerate(order[:left]):
                clip = by_pin[pin]
                near = clip.best_bases(How.NEAR)
                ways = tuple(sorted({*clip.ways, *near}))
                most = budget.most * len(clip.units)
                if not ways or allocated[pin] >= most or allocated.total() == budget.children:
                    continue
                way = draws.choose(pin, ways)
                option = near[way] if way in near else clip.anew(way)
                why = f"its clip is number {place + 1} of {len(order)} by the worth of the children so far"
                clip.want(option, way.how, f"{why}; {clip.why_near(option)}" if option.base is not None else why)
                allocated[pin] += 1
                some = True
            if not some and left == len(order):
                return
            left = left if some else min(2 * left, len(order))


def worths(children: Iterable[PastChild]) -> list[float]:
    """Return the worth of each mutant, 0 to 1; `children`: in the order of their rounds."""
    stories: set[tuple[str, ...]] = set()
    values = []
    for child in children:
        facts = child.facts
        if not facts.story:
            values.append(NEAR_MISS * facts.nearness**2)
            continue
        worth = NEW if child.avoided else NEW_UNAVOIDED
        values.append(worth * (AGAIN if facts.story in stories else 1.0))
        stories.add(facts.story)
    return values


def ranked(clips: Sequence[str], past: Iterable[ValuedChild]) -> list[str]:
    """Return clips by the mean worth of their mutants, best first; equal ones in the given order."""
    own: defaultdict[str, list[float]] = defaultdict(list)
    for child in past:
        own[child.clip].append(child.worth)
    return sorted(clips, key=lambda clip: -sum(own[clip]) / max(len(own[clip]), 1))


def halved(count: int, number: int) -> int:
    """Return how many of `count` clips remain in a round: all in the first, then half, a quarter, and so on."""
    return max(1, math.ceil(count / (1 << (number - 1))))


class MutantDraws:
    """Estimates the worth of each way of drawing over all clips, and counts how often each clip used it."""

    def __init__(self, past: Sequence[ValuedChild], rng: Generator) -> None:
        """Estimate from all mutants so far."""
        self._rng = rng
        # Strictly between 0 and 1, as the mean of a beta distribution must be.
        self._mean = (sum(child.worth for child in past if child.fails) + 0.1) / (len(past) + 1)
        self._worth: defaultdict[DrawMethod, list[float]] = defaultdict(list)
        self._had: Counter[tuple[str, DrawMethod]] = Counter()
        for child in past:
            self._worth[child.way].append(child.worth if child.fails else 0.0)
            self._had[child.clip, child.way] += 1

    def choose(self, clip: str, ways: Sequence[DrawMethod]) -> DrawMethod:
        """Return one of a clip's ways, and count its use."""
        # Mutants of the search differ anyway, so repeated use has no penalty.
        scores = [self._drawn(way) / (1 if way == SEARCHED_WAY else 1 + self._had[clip, way]) for way in ways]
        best = ways[scores.index(max(scores))]
        self._had[clip, best] += 1
        return best

    def _drawn(self, way: DrawMethod) -> float:
        worth = self._worth[way]
        good = self._mean * WAY_WEIGHT + sum(worth)
        bad = (1 - self._mean) * WAY_WEIGHT + len(worth) - sum(worth)
        return float(self._rng.beta(good * CERTAINTY, bad * CERTAINTY))
