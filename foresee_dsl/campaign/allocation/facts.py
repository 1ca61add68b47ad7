"""The facts about run mutants that decide which mutants follow: their story, whether it is avoidable, and how near a
pass came to a failure.
"""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.campaign.findings.grouping import story_cell
from foresee_dsl.campaign.records import ChildOutcome
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Verdict

NEAR_M = 2.0
"""A pass in which the footprints come nearer than this to each other is a near miss, m. Ours: about a driver's
clearance to a parked car and its door.
"""
NEAR_S = 1.5
"""A pass in which the time to collision falls below this is a near miss, s. The literature calls this a serious
conflict (see `simulate.results.near_misses`).
"""


@dataclass(frozen=True)
class ChildFacts:
    """The facts about a run mutant that decide its worth.

    Attributes:
        story: the words by which its failure is grouped into a finding; () if the run did not fail.
        avoidable: whether a judge answers that the failure could have been avoided.
        nearness: for a pass, 0 (far) to 1 (almost touching, or almost breaking the campaign's goal); otherwise 0. A
            failure that keeps the goal counts as such a pass.
        miss: for such a pass, how near it came, in words; otherwise "".
    """

    story: tuple[str, ...]
    avoidable: bool
    nearness: float
    miss: str = ""

    @classmethod
    def of(cls, child: ChildOutcome, family: str, goal: str = "") -> ChildFacts:
        """Return the facts about a mutant's record. The same story in two families counts as two stories.

        `goal`: that of the campaign.
        """
        if goal and (child.goal is None or child.goal.held):
            nearness = child.goal.nearness if child.goal is not None else 0.0
            return cls((), avoidable=False, nearness=nearness, miss="keeping its goal narrowly")
        if not child.verdict.is_failure:
            passed = child.verdict is Verdict.PASS
            return cls((), avoidable=False, nearness=nearness_of(child.near) if passed else 0.0, miss=_miss(child.near))
        return cls(
            story=story_cell(family, child.story) if child.story is not None else (family, child.verdict.value),
            avoidable=any(judgement.avoids for judgement in child.judgements),
            nearness=0.0,
        )


def nearness_of(near: NearMisses | None) -> float:
    """Return how near a run came to a contact, 0 to 1: by distance or by time, whichever is nearer."""
    return max(*_nearness(near), 0.0)


def _nearness(near: NearMisses | None) -> tuple[float, float]:
    if near is None:
        return 0.0, 0.0
    gap = 1.0 - near.distance_m.value / NEAR_M if near.distance_m is not None else 0.0
    time = 1.0 - near.ttc_s.value / NEAR_S if near.ttc_s is not None else 0.0
    return gap, time


def _miss(near: NearMisses | None) -> str:
    """Return how near a run came to a contact, in words."""
    gap, time = _nearness(near)
    if near is None or max(gap, time) <= 0:
        return ""
    if near.ttc_s is not None and time > gap:
        return f"{near.ttc_s.value:.2f} s before a collision with {near.ttc_s.actor}"
    return f"{near.distance_m.value:.2f} m from {near.distance_m.actor}" if near.distance_m is not None else ""
