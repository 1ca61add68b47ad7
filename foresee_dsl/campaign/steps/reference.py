"""Steps after a failure: a reference driver drives the failing mutant or test case, which shows whether it avoids the
failure, and how."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.avoidance.references import ReferenceDriver, ReferenceRun
from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, MutantDraft, Record
from foresee_dsl.campaign.steps.case_run import CaseStep
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.inputs import CaseRef, clip_case, mutant_of
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Step, Work
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.measuring import Part, reference_driver
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings


class Reference:
    """The number of steps with reference drivers per failure, and the record of a broken run."""

    record: ClassVar[type[Record]] = ReferenceRun
    of_failures: ClassVar[bool] = True
    driver: str

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """Return the number of reference drivers."""
        return len(settings.against)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> ReferenceRun:  # noqa: ARG002
        """Return the record of a broken run."""
        return ReferenceRun(self.driver, verdict=verdict, reason=reason)


@dataclass(frozen=True, eq=False)
class CaseReferenceStep(Reference, Step[CaseStep, CaseRunOutcome]):
    """Run a failing test case with a reference driver."""

    kind = "case_reference"
    title = "failing test cases with reference drivers"
    follows = "seed"
    reads = "seed"
    share = 0.08
    turn = 3
    usual_s = 0.8

    driver: str

    @classmethod
    def following(cls, above: CaseStep, result: CaseRunOutcome | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield one step per reference driver."""
        for driver, identity in campaign.references if result is not None else ():
            key = campaign.key(cls, seed=above.key, driver=identity)
            yield cls(key, f"{above.name}_{driver}", above.seed, driver)

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ReferenceRun, Trace | None]:
        """Run the test case with the reference driver; a report shows the run beside the failing one."""
        return drive_failure(work.setup(self.seed, self.driver), case, None, trace)


@dataclass(frozen=True, eq=False)
class ReferenceStep(Reference, ClipPart[ChildStep, ChildOutcome]):
    """Run a failing mutant with a reference driver; if that one passes, also the clip without mutation."""

    kind = "reference"
    title = "failures with reference drivers"
    follows = "child"
    reads = "child"
    runs = 2
    share = 0.05
    turn = 3
    usual_s = 0.3

    mutant: MutantDraft
    driver: str

    @classmethod
    def following(cls, above: ChildStep, result: ChildOutcome | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield one step per reference driver."""
        for driver, identity in campaign.references if result is not None else ():
            key = campaign.key(cls, child=above.key, clip=above.draft.pin, driver=identity)
            yield cls(key, f"{above.name}_{driver}", above.seed, above.draft, above.mutant, driver)

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ReferenceRun, Trace | None]:  # noqa: ARG002
        """Run the mutant, then the clip; compare the mutant's run with the failing one."""
        file, setup = work.folder / f"{self.draft.name}.foresee", work.setup(self.seed, self.driver)
        clip = clip_case(self.draft.text, work.case, file)
        child = expand_mutant(mutant_of(self.mutant.text), clip, source=work.folder / f"{self.name}.foresee")
        before = partial(verdict_of_clip, self.draft.text, work.case, file, setup)
        return drive_failure(setup, child, before, trace)[0], None


@Part.EXPLAIN.measured
def drive_failure(
    setup: DriverSetup, case: TestCase, before: Callable[[], Verdict] | None, failed: Trace | None
) -> tuple[ReferenceRun, Trace]:
    """Return a reference driver's run of a failing test case, and its trace.

    Args:
        before: returns how the driver's run of the unmutated clip ends; None for a test case that is not a mutant.
        failed: the failing run.
    """
    with reference_driver():
        result = setup.run(case)
    judge = ReferenceDriver(setup.driver, lambda: result, before)
    return judge.judge(Failure(failed, compiled=compile_test_case(case))), result.trace


_MOST_KNOWN = 64
"""Maximum number of cached verdicts. Ours: a few drivers for each of the clips that a process caches."""
_KNOWN: dict[tuple[str, CaseRef, DriverSetup], Verdict] = {}
"""Verdicts of clips with reference drivers, cached because failing mutants of one clip share them."""


def verdict_of_clip(text: str, parent: CaseRef, file: Path, setup: DriverSetup) -> Verdict:
    """Return the verdict of a clip without mutation, cached per process."""
    verdict = _KNOWN.get((text, parent, setup))
    if verdict is None:
        verdict = setup.run(clip_case(text, parent, file)).verdict
        if verdict is Verdict.PASS or verdict.is_failure:  # runs that crashed or took too long are repeated
            while len(_KNOWN) >= _MOST_KNOWN:
                del _KNOWN[next(iter(_KNOWN))]
            _KNOWN[text, parent, setup] = verdict
    return verdict
