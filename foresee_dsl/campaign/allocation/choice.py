"""Chooses the clips that get the next mutants, by the usefulness (worth, 0 to 1) of their earlier mutants.

A mutant is worth something if it is a new failure, an avoidable failure, or a pass with a near miss. Clips are chosen
by successive halving, and their ways to draw a mutant by Thompson sampling.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from numpy.random import Generator

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Verdict

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
(`nearness_of`).
"""
NEAR_M = 2.0
"""A pass in which the footprints come nearer than this to each other is a near miss, m. Ours: about a driver's
clearance to a parked car and its door.
"""
NEAR_S = 1.5
"""A pass in which the time to collision falls below this is a near miss, s. The literature calls this a serious
conflict (see `simulate.results.near_misses`).
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


# ---- the worth of a mutant ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ChildFacts:
    """The facts about a run mutant that decide its worth.

    Attributes:
        story: signature that equal failures share; () if the run did not fail.
        avoidable: whether a judge answers that the failure could have been avoided.
        nearness: for a pass, 0 (far) to 1 (almost touching, or almost breaking the campaign's goal); otherwise 0. A
            failure that keeps the goal counts as such a pass.
    """

    story: tuple[str, ...]
    avoidable: bool
    nearness: float

    @classmethod
    def of(cls, child: ChildOutcome, family: str, goal: str = "") -> ChildFacts:
        """Return the facts about a mutant's record. The same story in two families counts as two stories.

        `goal`: that of the campaign.
        """
        if goal and (child.goal is None or child.goal.held):
            return cls((), avoidable=False, nearness=child.goal.nearness if child.goal is not None else 0.0)
        signature = child.story.signature if child.story is not None else (child.verdict.value,)
        return cls(
            story=(family, *signature) if child.verdict.is_failure else (),
            avoidable=any(judgement.avoids for judgement in child.judgements),
            nearness=nearness_of(child.near) if child.verdict is Verdict.PASS else 0.0,
        )


def nearness_of(near: NearMisses | None) -> float:
    """Return how near a run came to a contact, 0 to 1: by distance or by time, whichever is nearer."""
    if near is None:
        return 0.0
    gap = 1.0 - near.distance_m.value / NEAR_M if near.distance_m is not None else 0.0
    time = 1.0 - near.ttc_s.value / NEAR_S if near.ttc_s is not None else 0.0
    return max(gap, time, 0.0)


def avoided(references: Iterable[ReferenceRun]) -> bool:
    """Return whether a reference driver shows that a failure could have been avoided."""
    return any(run.avoids for run in references)


def worths(children: Iterable[tuple[ChildFacts, bool]]) -> list[float]:
    """Return the worth of each mutant, 0 to 1.

    `children`: the facts about the mutants, in the order of their rounds, each with whether a reference driver avoids
    its failure.
    """
    stories: set[tuple[str, ...]] = set()
    values = []
    for facts, other_avoids in children:
        if not facts.story:
            values.append(NEAR_MISS * facts.nearness**2)
            continue
        worth = NEW if facts.avoidable or other_avoids else NEW_UNAVOIDED
        values.append(worth * (AGAIN if facts.story in stories else 1.0))
        stories.add(facts.story)
    return values


# ---- which clips get the next mutants --------------------------------------------------------------------------------


class MutantDraw(NamedTuple):
    """One way of drawing a mutant: by which operators, and whether near an earlier mutant."""

    operators: tuple[str, ...]
    near: bool = False


SEARCHED_WAY = MutantDraw(("searched",))
"""The way of the mutants that the preset's search proposes, one after the other."""


class PastChild(NamedTuple):
    """A mutant of an earlier round: its clip, its way of drawing, its worth, and whether it failed.

    A near miss counts for its clip but not for its way, because mutants drawn near a near miss are near misses again.
    """

    clip: str
    way: MutantDraw
    worth: float
    fails: bool


def ranked(clips: Sequence[str], past: Iterable[PastChild]) -> list[str]:
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

    def __init__(self, past: Sequence[PastChild], rng: Generator) -> None:
        """Estimate from all mutants so far."""
        self._rng = rng
        # Strictly between 0 and 1, as the mean of a beta distribution must be.
        self._mean = (sum(child.worth for child in past if child.fails) + 0.1) / (len(past) + 1)
        self._worth: defaultdict[MutantDraw, list[float]] = defaultdict(list)
        self._had: Counter[tuple[str, MutantDraw]] = Counter()
        for child in past:
            self._worth[child.way].append(child.worth if child.fails else 0.0)
            self._had[child.clip, child.way] += 1

    def choose(self, clip: str, ways: Sequence[MutantDraw]) -> MutantDraw:
        """Return one of a clip's ways, and count its use."""
        # Mutants of the search differ anyway, so repeated use has no penalty.
        scores = [self._drawn(way) / (1 if way == SEARCHED_WAY else 1 + self._had[clip, way]) for way in ways]
        best = ways[scores.index(max(scores))]
        self._had[clip, best] += 1
        return best

    def _drawn(self, way: MutantDraw) -> float:
        worth = self._worth[way]
        good = self._mean * WAY_WEIGHT + sum(worth)
        bad = (1 - self._mean) * WAY_WEIGHT + len(worth) - sum(worth)
        return float(self._rng.beta(good * CERTAINTY, bad * CERTAINTY))


def spread(children: int, rounds: int) -> tuple[int, ...]:
    """Return the number of mutants of each round, as even as possible; the first rounds get the remainder."""
    each, over = divmod(children, rounds)
    return tuple(each + (k < over) for k in range(rounds))


def counts(names: Iterable[str]) -> dict[str, int]:
    """Return the number of occurrences of each name, the most frequent first, then by name."""
    return dict(sorted(Counter(names).items(), key=lambda item: (-item[1], item[0])))
