"""The ranker protocol and what a ranker returns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, Self, runtime_checkable

from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.compile.bundle import ModelSpec, Signal, SumoBundle
    from foresee_dsl.compile.roads.network import RoadNetwork
    from foresee_dsl.drivers.protocol import Mission

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
        operator: the mutation operator with which the actor is to be changed, or "" where the ranker proposes none.
        begins: the frame at which the change begins (and the clip, but for a hand-over); None where the ranker leaves
            that to the length of clips.
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
    operator: str = ""
    begins: int | None = None

    shown = "rank time_s:2 frame actor group distance_m?:3 why operator? begins?"

    @classmethod
    def without_actor(cls, trace: Trace, rank: int, frame: int, score: float, why: str) -> Self:
        """Return a moment of a run that no actor makes risky."""
        return cls(rank, frame, float(trace.time_s[frame]), "", "none", math.nan, math.nan, score, why)


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


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a trace does not hold of the place where it was recorded.

    Attributes:
        network: the roads and buildings. mission: the ego's route. signals: the programs by junction.
    """

    network: RoadNetwork
    mission: Mission
    signals: Mapping[str, Signal]

    @classmethod
    def of(cls, bundle: SumoBundle) -> Self:
        """Return those of a compiled test case."""
        from foresee_dsl.simulate.mission import mission_of

        return cls(bundle.network, mission_of(bundle), bundle.signals)


@runtime_checkable
class NeedsSurroundings(Protocol):
    """A ranker that cannot rank a trace alone, for example because it draws what a camera saw."""

    def within(self, surroundings: Surroundings) -> Ranker:
        """Return the ranker of the runs in these surroundings."""
        ...


@dataclass(frozen=True)
class Mutations:
    """How the clips around a ranker's points will be mutated.

    Attributes:
        preset: the name of the preset. models: all models of the test case, by name.
    """

    preset: str
    models: Mapping[str, ModelSpec]


@runtime_checkable
class Proposes(Protocol):
    """A ranker that also proposes what to change, and when; it needs to know what the mutation can do."""

    def before(self, mutations: Mutations) -> Ranker:
        """Return the ranker of runs whose clips are mutated in this way."""
        ...


@runtime_checkable
class Learned(Protocol):
    """A ranker whose answers depend on trained weights; campaign keys contain their hash."""

    def weights_hash(self, driver: str) -> str:
        """Return the hash of the weights with which runs of a driver are ranked."""
        ...
