"""The ranker protocol and what a ranker returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from foresee_dsl.simulate.trace import Trace

Group = Literal["critical crossing", "crossing", "critical", "close", "none"]
"""The paper's groups of actors (section 3.2); `close` for the proximity ranker, `none` for points without an actor."""


@dataclass(frozen=True)
class RiskyPoint:
    """A moment of a run that passed, around which a failure may hide.

    Attributes:
        rank: from 1. frame: index into the trace. time_s: its time.
        actor: the id of the actor that makes it risky, or "" where the ranker names none.
        group: the actor's group. distance_m: smallest distance between the footprints of the ego and the actor, at
            `frame` (NaN without actor).
        trajectory_distance_m: distance from the actor to the ego's trajectory, the tie-breaker of step 1d (NaN
            without).
        score: the ranker's own figure, larger is riskier.
        why: one sentence for the report.
    """

    rank: int
    frame: int
    time_s: float
    actor: str
    group: Group
    distance_m: float
    trajectory_distance_m: float
    score: float
    why: str


@runtime_checkable
class Ranker(Protocol):
    """Turns a trace into a ranked list of risky points, best first."""

    name: str

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the moments of a run.

        Args:
            trace: a run that passed.
            seed: of all random choices.
            before_s: o_b; no point lies nearer to the beginning.
            after_s: o_a; a point may lie nearer to the end (the clip is then shorter).
        """
        ...
