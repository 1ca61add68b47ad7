"""Who gets the next children, from what earlier ones were worth.

A child was worth something where it is a new failure, one that could have been avoided, or a pass that was a near miss.
Clips are chosen by successive halving, and their ways to draw a child by Thompson sampling.
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
"""A failure whose story no earlier one tells, and that could have been avoided."""
NEW_UNAVOIDED = 0.6
"""Such a failure of which that is not known."""
AGAIN = 0.1
"""A failure whose story is known, as a share of what it was worth as the first. Ours: in replays
(docs/background/method.md) 0.25 found as many failures and a tenth fewer findings, 0 fewer of both."""
NEAR_MISS = 0.2
"""A pass that came as near as can be; a quarter of it for one half as near (`nearness_of`)."""
NEAR_M = 2.0
"""A pass counts as a near miss below this distance between the footprints. Ours: about what a driver leaves beside a
parked car and its door."""
NEAR_S = 1.5
"""Likewise below this time to collision: what conflict studies call serious (see `simulate.results.near_misses`)."""


WAY_WEIGHT = 8.0
"""The worth of a way is estimated as if it had had this many children of average worth besides its own."""
CERTAINTY = 8.0
"""Each child counts as so many where a way's worth is drawn. Ours: drawn from single children, ways that never found
anything are tried about as often as the best; in replays (docs/background/method.md) that cost one finding in
thirty."""


# ---- what a child was worth ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Told:
    """What allocation reads of a child.

    Attributes:
        story: what equal failures have in common; () of another run.
        avoidable: whether a judge says that its driver would have avoided it.
        nearness: of a pass, 0 (far) to 1 (they nearly touch); else 0.
    """

    story: tuple[str, ...]
    avoidable: bool
    nearness: float

    @classmethod
    def of(cls, child: ChildOutcome, family: str) -> Told:
        """Read a child's record; findings of different families are different ones."""
        signature = child.story.signature if child.story is not None else (child.verdict.value,)
        return cls(
            story=(family, *signature) if child.verdict.is_failure else (),
            avoidable=any(found.avoids for found in child.judgements),
            nearness=nearness_of(child.near) if child.verdict is Verdict.PASS else 0.0,
        )


def nearness_of(near: NearMisses | None) -> float:
    """Return how near a run came to a contact, 0 to 1: by distance, or by time where that says more."""
    if near is None:
        return 0.0
    gap = 1.0 - near.distance_m.value / NEAR_M if near.distance_m is not None else 0.0
    time = 1.0 - near.ttc_s.value / NEAR_S if near.ttc_s is not None else 0.0
    return max(gap, time, 0.0)


def avoided(references: Iterable[ReferenceRun]) -> bool:
    """Return whether a reference driver shows that a failure could have been avoided."""
    return any(run.avoids for run in references)


def worths(children: Iterable[tuple[Told, bool]]) -> list[float]:
    """Return what each child was worth, 0 to 1.

    `children`: in the order of their rounds; with each, whether a reference driver is known to avoid it.
    """
    stories: set[tuple[str, ...]] = set()
    found = []
    for told, other_avoids in children:
        if not told.story:
            found.append(NEAR_MISS * told.nearness**2)
            continue
        worth = NEW if told.avoidable or other_avoids else NEW_UNAVOIDED
        found.append(worth * (AGAIN if told.story in stories else 1.0))
        stories.add(told.story)
    return found


# ---- who gets the next children --------------------------------------------------------------------------------------


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
