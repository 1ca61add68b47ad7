"""What a judge is: it takes a failure, and says whether its driver avoids it, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol, TypeVar

from foresee_dsl.avoidance.replay import Replay
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Impact, RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import Trace, X, Y

R157 = "R157's driver"
"""The name of UN Regulation 157's driver (`avoidance.r157`)."""
ANTICIPATING = "an anticipating driver"
"""And of the one that looks ahead (`avoidance.anticipating`)."""


class Judgement(Protocol):
    """The answer of one judge about one failure; a frozen dataclass, as it is stored.

    Attributes:
        name: of the judge, for people. answers: all that it may answer, in the order of reports; () where that is open.
        answer: in a word or a few. why: a sentence with figures.
        avoids: whether its driver avoids the failure, or would have. settles: whether it says that or the opposite.
        origin: what a mutant's `origin` block says: a setting and its value; None where it says nothing.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - see the class
    @property
    def answers(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def answer(self) -> str: ...  # noqa: D102
    @property
    def why(self) -> str: ...  # noqa: D102
    @property
    def avoids(self) -> bool: ...  # noqa: D102
    @property
    def settles(self) -> bool: ...  # noqa: D102
    @property
    def origin(self) -> tuple[str, str] | None: ...  # noqa: D102


Answered_co = TypeVar("Answered_co", bound=Judgement, covariant=True)
"""The class of the judgement that a judge returns."""


@dataclass(frozen=True)
class Opinion:
    """A judgement that has no figures of its own; what its fields are, `Judgement` says.

    `settled`: as `settles`.
    """

    name: str
    answer: str
    why: str
    avoids: bool
    settled: bool = True
    origin: tuple[str, str] | None = None

    answers: ClassVar[tuple[str, ...]] = ()

    @property
    def settles(self) -> bool:
        """Whether it says that its driver avoids the failure, or that it does not."""
        return self.settled


class Judge(Protocol[Answered_co]):
    """Says of a failure whether a driver avoids it."""

    def judge(self, failure: Failure) -> Answered_co:
        """Return the judgement; runs of the simulation may be needed for it."""


SAME_TIME_S = 0.1
"""The replay without braking has to end with the same contact within this time. Ours: two steps."""
SAME_PLACE_M = 0.1
"""And with the ego within this distance. Ours: the tolerance of a clip's fidelity."""


@dataclass(frozen=True, eq=False)
class Failure:
    """A run that failed, as judges get it; what several of them need is computed once.

    Attributes:
        trace: of the run; None where it was lost.
        outcome, compiled: how it ended, and its test case as it was run; None where only the trace is at hand, which is
            enough for judges that drive the test case themselves.
    """

    trace: Trace | None
    outcome: RunResult | None = None
    compiled: SumoBundle | None = None

    @classmethod
    def of(cls, result: RunResult, run_as: TestCase | SumoBundle) -> Failure:
        """Return the failure of a run.

        Raises:
            ValueError: the run did not fail.
        """
        if not result.verdict.is_failure:
            raise ValueError(f"the run did not fail: {result.reason}")
        return cls(result.trace, result, compile_test_case(run_as) if isinstance(run_as, TestCase) else run_as)

    @property
    def result(self) -> RunResult:
        """How it ended.

        Raises:
            ValueError: only its trace is at hand.
        """
        if self.outcome is None:
            raise ValueError("of this failure only the trace is at hand: how it ended is not known")
        return self.outcome

    @property
    def bundle(self) -> SumoBundle:
        """Its test case as it was run; errors as of `result`."""
        if self.compiled is None:
            raise ValueError("of this failure only the trace is at hand: its test case is not known")
        return self.compiled

    @property
    def contact(self) -> Impact | None:
        """The contact that it ended with, None where it ended otherwise."""
        return contact(self.result)

    @cached_property
    def astray(self) -> str:
        """How it differs from the failure if it is driven again without braking; "" where it does not."""
        replay = run(self.bundle, Replay(self.result.trace, None, self.bundle.scene))
        result = self.result
        again = "the replay without braking is not the failure: "
        if (replay.verdict, replay.with_) != (result.verdict, result.with_):
            return f"{again}{replay.reason}"
        late = abs(replay.time_s - result.time_s)
        off = math.dist(replay.trace.states[-1, 0, [X, Y]], result.trace.states[-1, 0, [X, Y]])
        if late > SAME_TIME_S or off > SAME_PLACE_M:
            return f"{again}the contact is {late:.2f} s and {off:.2f} m off"
        return ""


def contact(result: RunResult) -> Impact | None:
    """Return the contact that a run ended with, None where it ended otherwise."""
    return result.impact if result.verdict.is_collision else None
