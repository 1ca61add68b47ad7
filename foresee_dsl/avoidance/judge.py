"""The interface of judges: a judge says whether its driver model avoids a failure, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

from foresee_dsl.avoidance.replay import Replay
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.verdict import Impact, RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import X, Y

R157 = "R157's driver"
"""The name of UN Regulation 157's driver (`avoidance.r157`)."""
ANTICIPATING = "an anticipating driver"
"""The name of the anticipating driver (`avoidance.anticipating`)."""


class Judgement(Protocol):
    """The answer of one judge about one failure; a frozen dataclass, as it is stored.

    Attributes:
        name: the judge's name, for people. answer: the answer in a few words. why: a sentence with figures.
        avoids: whether the judge's driver avoids the failure, or would have avoided it.
        origin: setting and value for a mutant's `origin` block; None for no entry.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - see the class
    @property
    def answer(self) -> str: ...  # noqa: D102
    @property
    def why(self) -> str: ...  # noqa: D102
    @property
    def avoids(self) -> bool: ...  # noqa: D102
    @property
    def origin(self) -> tuple[str, str] | None: ...  # noqa: D102


Answered_co = TypeVar("Answered_co", bound=Judgement, covariant=True)
"""The class of the judgement that a judge returns."""


@dataclass(frozen=True)
class Opinion:
    """An answer of a judge that stores no figures of its own; for its fields see `Judgement`."""

    name: str
    answer: str
    why: str
    avoids: bool
    origin: tuple[str, str] | None = None


class Judge(Protocol[Answered_co]):
    """Judges whether a driver avoids a failure."""

    def judge(self, failure: Failure) -> Answered_co:
        """Return the judgement; this may run the simulation."""


REPLAYED_WITHIN_S = 0.1
"""Largest difference in time between the contact and the contact in a replay without braking, s. Ours: two steps."""
REPLAYED_WITHIN_M = 0.1
"""Largest distance between the places of the ego at the contact and at the contact in a replay without braking, m.
Ours: the tolerance of a clip's fidelity.
"""


@dataclass(frozen=True, eq=False)
class Failure:
    """A failed run, the input of judges; results that several judges need are computed once.

    Attributes:
        result: the result of the run. bundle: its compiled test case.
    """

    result: RunResult
    bundle: SumoBundle

    @classmethod
    def of(cls, result: RunResult, run_as: TestCase | SumoBundle) -> Failure:
        """Return the failure that judges examine, from the result of a failed run.

        Raises:
            ValueError: the run did not fail.
        """
        if not result.verdict.is_failure:
            raise ValueError(f"the run did not fail: {result.reason}")
        return cls(result, compile_test_case(run_as) if isinstance(run_as, TestCase) else run_as)

    @property
    def contact(self) -> Impact | None:
        """The contact with which the run ended; None if it ended otherwise."""
        return contact(self.result)

    @property
    def without_contact(self) -> str:
        """How a run without a contact failed, in words."""
        match self.result.verdict:
            case Verdict.STUCK:
                return "it got stuck"
            case Verdict.RULE:
                return "it broke a traffic rule, without a contact"
            case Verdict.GOAL:
                return "it broke the campaign's goal, without a contact"
            case _:
                return "it left the road, without a contact"

    @cached_property
    def astray(self) -> str:
        """How a replay without braking differs from the failure, in words; "" if the replay repeats the failure."""
        replay = run(self.bundle, Replay(self.result.trace, None, self.bundle.scene), rules=RulesMode.OFF)
        result = self.result
        again = "the replay without braking is not the failure: "
        if (replay.verdict, replay.with_) != (result.verdict, result.with_):
            return f"{again}{replay.reason}"
        late = abs(replay.time_s - result.time_s)
        off = math.dist(replay.trace.states[-1, 0, [X, Y]], result.trace.states[-1, 0, [X, Y]])
        if late > REPLAYED_WITHIN_S or off > REPLAYED_WITHIN_M:
            return f"{again}the contact is {late:.2f} s and {off:.2f} m off"
        return ""


def contact(result: RunResult) -> Impact | None:
    """Return the contact with which a run ended; None if it ended otherwise."""
    return result.impact if result.verdict.is_collision else None
