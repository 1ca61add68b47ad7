"""What a round requests of the step that mutates a clip."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace

from foresee_dsl.derive.mutate import Draw, How, PlanNames


@dataclass(frozen=True)
class RequestedMutant:
    """A mutant that a round requests.

    Attributes:
        number: last part of its name. draw: index of the draw from its clip.
        how: how it comes about. near: text of the mutant whose changes it uses; "" for an independent draw.
        near_number, near_suffix: number of that mutant and the end of its name; 0 and "" if it belongs to an earlier
            campaign.
        why: why the round requests it, in a sentence; its result does not depend on that.
    """

    number: int
    draw: Draw
    how: How = How.ANEW
    near: str = ""
    near_number: int = 0
    near_suffix: str = ""
    why: str = ""

    @property
    def suffix(self) -> str:
        """Return the end of its name: `_m7`, or `_m3_m7` if a change was added to those of `_m3`."""
        return f"{self.near_suffix if self.how is How.BESIDE else ''}_m{self.number}"


@dataclass(frozen=True)
class RoundRequest:
    """The request of a round for one clip.

    Attributes:
        round: number of the round. In the first one each clip gets its first mutants, after the requested ones, which
            are those of earlier campaigns. 0: no rounds.
        children: the requested mutants. plans: the plans by which the clip's mutants are drawn. existing: texts of the
            existing mutants.
    """

    round: int = 0
    children: tuple[RequestedMutant, ...] = ()
    plans: tuple[PlanNames, ...] = ()
    existing: tuple[str, ...] = ()

    @property
    def identity(self) -> str:
        """Return the part of a key that states the request: everything but why."""
        return json.dumps(asdict(replace(self, children=tuple(replace(child, why="") for child in self.children))))


NO_ROUNDS = RoundRequest()
"""The request of a campaign without rounds."""
