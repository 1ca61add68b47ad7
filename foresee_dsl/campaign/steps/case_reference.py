"""Step after a failing test case: a reference driver drives it, which shows whether it avoids the failure, and how.

The other steps with reference drivers share their basis here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from foresee_dsl.avoidance.references import ReferenceRun, reference_run
from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.records import CaseRunOutcome, Record
from foresee_dsl.campaign.steps.step import KeyInputs, Step, Work
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.document import TestCase
from foresee_dsl.measuring import Part, reference_driver
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.case_run import CaseStep


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
class CaseReferenceStep(Reference, Step["CaseStep", CaseRunOutcome]):
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
    return reference_run(setup.driver, result, failed, compile_test_case(case), before), result.trace
