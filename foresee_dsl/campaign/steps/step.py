"""Common base of all steps of a campaign, their execution in a worker, and their place in the campaign (`StepNode`)."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

from foresee_dsl.campaign.driving import DriverSetup, longest_s
from foresee_dsl.campaign.records import Draft, Record
from foresee_dsl.campaign.steps.inputs import CaseRef, InputRef, load_case, load_trace
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.requests import RequestedMutant

Above = TypeVar("Above")
"""Type of the step that a step follows from; None for the first step."""
Result = TypeVar("Result")
"""Type of the record of that step."""


@dataclass(frozen=True)
class KeyInputs:
    """Inputs of keys beside a step's own parts.

    Attributes:
        driver, ranker, operators: their identities in keys (see `campaign.keys`).
        references: each reference driver's address, and its identity in keys.
        key: returns the key of a step's class and the parts that its result depends on.
        draws_from_parent: mutants are drawn from the parent's run (`Preset.draws_from_parent`). It is stated here, so
            that the key of a clip does not depend on the code of the presets.
        ends_early: mutants' runs end as soon as they can only pass (`Preset.ends_early`), stated here for the same
            reason.
        earlier: returns the failing mutants of earlier campaigns that are run first in a clip with a text; None if
            there are none.
    """

    settings: CampaignSettings
    driver: str
    ranker: str
    operators: str
    references: tuple[tuple[str, str], ...]
    key: Callable[..., str]
    draws_from_parent: bool = False
    ends_early: bool = False
    earlier: Callable[[str], tuple[RequestedMutant, ...]] | None = None

    @property
    def goal(self) -> dict[str, str]:
        """Return the part of the keys of runs that states the goal; empty without a goal, so that such keys are those
        of a campaign that has no goal.
        """
        return {"goal": self.settings.goal} if self.settings.goal else {}


@dataclass(frozen=True)
class Work:
    """The input of a worker.

    Attributes:
        steps: the first one is run; the others follow from its result and are run in the same process.
        case: the test case that they descend from. folder: absolute folder of the clips' and mutants' files.
        trace: trace of the run that the first step reads (`Step.reads`), if any. deadlines: deadlines of each run.
    """

    steps: tuple[Step[Any, Any], ...]
    case: CaseRef
    settings: CampaignSettings
    folder: Path
    trace: InputRef | None = None
    deadlines: Deadlines = DEADLINES

    def setup(self, seed: int, driver: str = "") -> DriverSetup:
        """Return how runs with a seed are driven; `driver`: another driver than that of the campaign."""
        return DriverSetup(driver or self.settings.driver, seed, self.deadlines, self.settings.rules)


@dataclass(frozen=True)
class StepResult:
    """The output of a worker: one record, and its trace (a packed `.npz`), if any."""

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

    Attributes: key: key of its result. name: name of its file, without folder and suffix. seed: seed of all its random
    choices.

    Attributes of a class:
        kind: its name in the store. title: plural for people. follows: the kind that it follows from.
        record: the class of its result. drives: it is a run, with a verdict.
        reads: the kind of the earlier step whose trace it needs, or "".
        same_task: it is known without the result of the step before, so it runs in the same process right after it.
        after_all: the steps that it follows from are chosen when all of them are known (`Stages.choose`).
        of_failures: it follows from failures only.
        runs: maximum number of its runs, for its deadline.
        share: share of the possible steps that occur, from which the remaining time is estimated (ours: measured on the
            bundled scenarios).
        turn: lower ones are run first.
        usual_s: wall time that is assumed if the store has no step of the kind, s (ours: measured on the bundled
            scenarios with `pdm`).
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
    def following(cls, above: Above, result: Result | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield the steps of this class that follow from a step whose result is `wanted`.

        `result` is None if it is not known yet, which happens only for `same_task` classes.
        """

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:  # noqa: ARG004 - of the classes that ask
        """Return the maximum number of steps of this class that follow from one step."""
        return 1

    @abstractmethod
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Record, Trace | None]:
        """Carry out the step in a worker; return its result, and its trace if that is stored.

        `trace` is that of the run which `reads` names; if that step has no run of its own, the one that it read.
        """

    @staticmethod
    def wanted(result: Result, settings: CampaignSettings) -> bool:  # noqa: ARG004 - of the classes that ask
        """Return whether this step follows from a result of the preceding step."""
        return True

    @staticmethod
    def simulated_s(case: TestCase, settings: CampaignSettings) -> float:  # noqa: ARG004 - see `ClipPart`
        """Return the longest simulated time of the step, s, or its equivalent."""
        return longest_s(case)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> Record | None:  # noqa: ARG002
        """Return the record of a broken run (its process died or hung); None if the step is not a run.

        Args:
            case: the test case that it descends from. file: the step's own. verdict, reason: how it ended.
        """
        return None

    def folder(self, case: TestCase) -> str:
        """Return the folder of the test case's file and of its clip's file, relative to the campaign's folder."""
        return f"children/{case.source.stem}"

    @property
    def rank(self) -> int:
        """Return the rank of its risky point; 0 without one."""
        return 0


@dataclass(frozen=True, eq=False)
class ClipPart(Step[Above, Result]):
    """A step that concerns a clip."""

    draft: Draft

    @staticmethod
    def simulated_s(case: TestCase, settings: CampaignSettings) -> float:  # noqa: ARG004 - as above
        """Return the length of a clip, s."""
        return settings.before_s + settings.after_s

    @property
    def rank(self) -> int:
        """Return the rank of its risky point."""
        return self.draft.rank


def run_steps(work: Work) -> Iterator[StepResult]:
    """Run steps in a worker; yield each result at once, so that it is stored even if the next step breaks."""
    case, settings = load_case(work.case), work.settings
    first, *then = work.steps
    trace_read = load_trace(work.trace) if work.trace is not None else None
    result, trace = _run_step(first, work, case, trace_read)
    yield result
    for step in then:
        if not step.wanted(result.record, settings):
            return
        yield _run_step(step, work, case, trace if trace is not None else trace_read)[0]


def _run_step(
    step: Step[Any, Any], work: Work, case: TestCase, trace_read: Trace | None
) -> tuple[StepResult, Trace | None]:
    started = time.perf_counter()
    record, trace = step.run(work, case, trace_read)
    wall_s = time.perf_counter() - started
    driver = work.settings.driver if step.drives else ""
    packed = trace.packed() if trace is not None else None
    return StepResult(step.key, step.kind, step.name, record, packed, driver, wall_s), trace


AnyStep = Step[Any, Any]


@dataclass(frozen=True, eq=False)
class StepNode:
    """One step of a campaign, its test case, and the step on whose result it depends (`above`)."""

    step: AnyStep
    case: TestCase
    above: StepNode | None = None

    @property
    def folder(self) -> str:
        """Return the folder of the files of clips and mutants, relative to the campaign's folder."""
        return self.step.folder(self.case)

    @property
    def file(self) -> str:
        """Return the step's file, relative to the campaign's folder."""
        return f"{self.folder}/{self.step.name}.foresee"

    def over(self, kind: str) -> StepNode:
        """Return the nearest step of a kind: this step, or one on which it depends.

        Raises:
            ValueError: it follows from no step of that kind.
        """
        node: StepNode = self
        while node.step.kind != kind:
            if node.above is None:
                raise ValueError(f"{self.step.kind} {self.step.name} follows from no {kind}")
            node = node.above
        return node
