"""What a child was worth: a failure that is new, one that could have been avoided, or a pass that was a near miss."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from foresee_dsl.campaign.records import ChildOutcome, ReferenceRun
from foresee_dsl.derive.preventability import Preventable
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Verdict

NEW = 1.0
"""A failure whose story no earlier one tells, and that could have been avoided."""
NEW_UNAVOIDED = 0.6
"""Such a failure of which that is not known."""
AGAIN = 0.1
"""A failure whose story is known, as a share of what it was worth as the first. Ours: in replays (docs/method.md) 0.25
found as many failures and a tenth fewer findings, 0 fewer of both."""
NEAR_MISS = 0.2
"""A pass that came as near as can be; a quarter of it for one half as near (`nearness_of`)."""
NEAR_M = 2.0
"""A pass counts as a near miss below this distance between the footprints. Ours: about what a driver leaves beside a
parked car and its door."""
NEAR_S = 1.5
"""Likewise below this time to collision: what conflict studies call serious (see `simulate.results.near_misses`)."""


@dataclass(frozen=True)
class Told:
    """What allocation reads of a child.

    Attributes:
        story: what equal failures have in common; () of another run.
        avoidable: whether a careful driver who brakes, or one who anticipates, would have avoided it.
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
            avoidable=child.preventable is Preventable.YES
            or (child.anticipation is not None and child.anticipation.answer.preventable),
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
    return any(run.shows_it for run in references)


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
