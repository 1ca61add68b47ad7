"""The interface of rankers, and the risky points that they return."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, Self, runtime_checkable

from foresee_dsl.documents import or_null, rounded
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.compile.bundle import ModelSpec, Signal, SumoBundle
    from foresee_dsl.compile.roads.network import RoadNetwork
    from foresee_dsl.drivers.protocol import Mission
    from foresee_dsl.forecast.pair_goal import PairGoal

Group = Literal["critical crossing", "crossing", "critical", "close", "none"]
"""The paper's groups of actors (section 3.2); `close` for the proximity ranker, `none` for points without an actor."""


@dataclass(frozen=True)
class RiskyPoint:
    """A moment of a run that passed, around which a failure may hide.

    Attributes:
        rank: from 1. frame: index into the trace. time_s: its time.
        actor: the id of the actor that makes it risky, or "" if the ranker names none.
        group: the actor's group. distance_m: distance between the footprints of the ego and the actor at `frame` (NaN
            without an actor).
        trajectory_distance_m: distance from the actor to the ego's trajectory, the tie-breaker of step 1d (NaN if
            unknown).
        score: the ranker's own measure of risk; larger is riskier.
        why: one sentence for the report.
        operator: the mutation operator that the ranker proposes for the actor, or "" for none.
        begins: the frame at which the proposed change of the actor begins. The clip begins at the same frame, or
            earlier by the time of the hand-over to the driver; None if the clip's length decides where the clip begins.
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

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "rank": self.rank,
            "time_s": rounded(self.time_s, 2),
            "frame": self.frame,
            "actor": self.actor,
            "group": self.group,
            "distance_m": rounded(or_null(self.distance_m), 3),
            "why": self.why,
            "operator": or_null(self.operator),
            "begins": or_null(self.begins),
        }

    @classmethod
    def without_actor(cls, trace: Trace, rank: int, frame: int, score: float, why: str) -> Self:
        """Return a risky point without an actor."""
        return cls(rank, frame, float(trace.time_s[frame]), "", "none", math.nan, math.nan, score, why)


@runtime_checkable
class Ranker(Protocol):
    """Turns a trace into a ranked list of risky points, best first."""

    @property
    def name(self) -> str:
        """Its name, as on the command line."""
        ...

    def rank(
        self, trace: Trace, *, seed: int = 0, before_s: float = 5.0, after_s: float = 5.0
    ) -> tuple[RiskyPoint, ...]:
        """Rank the moments of a run.

        Args:
            trace: a run that passed.
            seed: seed of all random choices.
            before_s: the paper's offset o_b, s: no point lies nearer than this to the run's beginning.
            after_s: the paper's offset o_a, s: a point may lie nearer than this to the run's end (the clip is then
                shorter).
        """
        ...


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The surroundings of a run, which its trace does not contain.

    Attributes:
        network: the roads and buildings. mission: the ego's route. signals: signal programs by junction.
    """

    network: RoadNetwork
    mission: Mission
    signals: Mapping[str, Signal]

    @classmethod
    def of(cls, bundle: SumoBundle) -> Self:
        """Return the surroundings of a compiled test case."""
        from foresee_dsl.simulate.mission import mission_of

        return cls(bundle.network, mission_of(bundle), bundle.signals)


@runtime_checkable
class NeedsSurroundings(Protocol):
    """A ranker that needs more than a trace, for example because it draws camera images."""

    def within(self, surroundings: Surroundings) -> Ranker:
        """Return the ranker for runs in these surroundings."""
        ...


@dataclass(frozen=True)
class Mutations:
    """The settings with which the clips around a ranker's points will be mutated.

    Attributes:
        preset: the name of the preset.
        models: all models of the test case, by name.
    """

    preset: str
    models: Mapping[str, ModelSpec]


@runtime_checkable
class Proposes(Protocol):
    """A ranker that also proposes which actor to change and when, for which it needs the settings of the mutation."""

    def before(self, mutations: Mutations) -> Ranker:
        """Return the ranker for runs whose clips are mutated in this way."""
        ...


@runtime_checkable
class RollsOutGoals(Protocol):
    """A ranker that can rank changes by a campaign's goal, if the margin of the goal can be rolled out."""

    def toward(self, goal: PairGoal) -> Ranker:
        """Return the ranker of changes that may break the goal."""
        ...


@runtime_checkable
class Learned(Protocol):
    """A ranker that depends on trained weights; campaign keys contain their hash."""

    def weights_hash(self, driver: str) -> str:
        """Return the hash of the weights with which the runs of a driver are ranked."""
        ...
