"""What all steps of a campaign have in common, and what a worker does with them."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

from foresee_dsl.campaign.driving import longest_s
from foresee_dsl.campaign.records import Draft, Record
from foresee_dsl.campaign.steps.inputs import CaseRef, Ref, load_case, load_trace
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings

Above = TypeVar("Above")
"""The class of the step that a step follows from; None of the first."""
Result = TypeVar("Result")
"""The record of that step."""


@dataclass(frozen=True)
class Campaign:
    """What keys are made of beside a step's own parts.

    Attributes:
        driver, ranker, operators: what stands for each of them in a key (see `campaign.keys`).
        references: each reference driver's address, and what stands for it in a key.
        key: returns the key of a step's class and the parts that its result depends on.
    """

    settings: CampaignSettings
    driver: str
    ranker: str
    operators: str
    references: tuple[tuple[str, str], ...]
    key: Callable[..., str]


@dataclass(frozen=True)
class Work:
    """What a worker gets.

    Attributes:
        steps: the first is run; the others all follow from its result and are run in the same process.
        case: the test case that all began with. folder: where the clips' and children's files will be, absolute.
        trace: of the run that the first step begins with (`Step.reads`), if any. deadlines: of each run.
    """

    steps: tuple[Step[Any, Any], ...]
    case: CaseRef
    settings: CampaignSettings
    folder: Path
    trace: Ref | None = None
    deadlines: Deadlines = DEADLINES


@dataclass(frozen=True)
class Made:
    """What a worker hands over: one record, and the trace (a packed `.npz`) that belongs to it."""

    key: str
    kind: str
    name: str
    record: Record
    trace: bytes | None = None
    driver: str = ""
    wall_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Step(ABC, Generic[Above, Result]):
    """One step of a campaign.

    Attributes:
        key: of its result. name: of its file, without folder and suffix. seed: of all its random choices.

    Attributes of a class:
        kind: its name in the store. title: of many such steps, for people. follows: the kind that it follows from.
        record: the class of its result. drives: whether it is a run, with a verdict.
        reads: the kind of the run above whose trace it needs, or "".
        same_task: whether it is known without the result of the step above; it then runs in the same process, right
            after it.
        after_all: whether the steps that it follows from are chosen when all of them are known (`Stages.chosen`).
        of_failures: whether it follows from failures alone.
        runs: how many runs it makes at most, for its deadline.
        share: how many of those that may follow do so, for the time that is left (ours: the bundled scenarios).
        turn: lower ones are run first.
        usual_s: wall time where the store has none of its kind (ours: the bundled scenarios with `pdm`).
    """

    kind: ClassVar[str]
    title: ClassVar[str]
    follows: ClassVar[str]
    record: ClassVar[type[Record]]
    drives: ClassVar[bool] = True
    reads: ClassVar[str] = ""
    same_task: ClassVar[bool] = False
    after_all: ClassVar[bool] = False
    of_failures: ClassVar[bool] = False
    runs: ClassVar[int] = 1
    share: ClassVar[float] = 1.0
    turn: ClassVar[int]
    usual_s: ClassVar[float]

    key: str
    name: str
    seed: int

    @classmethod
    @abstractmethod
    def following(cls, above: Above, result: Result | None, campaign: Campaign) -> Iterator[Self]:
        """Yield the steps of this class that follow from a step, its result being as `wanted`.

        `result` is None where it is not known yet, which only `same_task` classes are asked.
        """

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:  # noqa: ARG004 - of the classes that ask
        """Return how many of this class follow from one step above at most."""
        return 1

    @abstractmethod
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Record, Trace | None]:
        """Do the step, in a worker; return its result, and its trace where that is stored.

        `trace` is that of the run which `reads` names.
        """

    @staticmethod
    def wanted(result: Result, settings: CampaignSettings) -> bool:  # noqa: ARG004 - of the classes that ask
        """Whether this step follows from a result of the step above at all."""
        return True

    @staticmethod
    def simulated_s(case: TestCase, settings: CampaignSettings) -> float:  # noqa: ARG004 - see `ClipPart`
        """Return for how long the step simulates at most, or may take as if it did."""
        return longest_s(case)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> Record | None:  # noqa: ARG002
        """Return the result of a run that gave none (its process died or hung); None of what is no run.

        Args:
            case: the test case that all began with. file: the step's own. verdict, reason: how it ended.
        """
        return None

    def folder(self, case: TestCase) -> str:
        """Return where its file and that of its clip are, relative to the campaign's folder."""
        return f"children/{case.source.stem}"

    @property
    def rank(self) -> int:
        """The rank of its risky point; 0 where there is none yet."""
        return 0


@dataclass(frozen=True, eq=False)
class ClipPart(Step[Above, Result]):
    """A step that has to do with a clip."""

    draft: Draft

    @staticmethod
    def simulated_s(case: TestCase, settings: CampaignSettings) -> float:  # noqa: ARG004 - as above
        """The length of a clip."""
        return settings.before_s + settings.after_s

    @property
    def rank(self) -> int:
        """The rank of its risky point."""
        return self.draft.rank


def run_steps(work: Work) -> Iterator[Made]:
    """Run steps, in a worker; yield each result as soon as there is one: it is stored even if the next breaks."""
    case, settings = load_case(work.case), work.settings
    first, *then = work.steps
    given = load_trace(work.trace) if work.trace is not None else None
    made, trace = _made(first, work, case, given)
    yield made
    for step in then:
        if not step.wanted(made.record, settings):
            return
        yield _made(step, work, case, trace)[0]


def _made(step: Step[Any, Any], work: Work, case: TestCase, given: Trace | None) -> tuple[Made, Trace | None]:
    started = time.perf_counter()
    record, trace = step.run(work, case, given)
    wall_s = time.perf_counter() - started
    driver = work.settings.driver if step.drives else ""
    packed = trace.packed() if trace is not None else None
    return Made(step.key, step.kind, step.name, record, packed, driver, wall_s), trace
