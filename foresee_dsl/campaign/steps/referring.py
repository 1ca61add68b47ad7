"""What all steps share that drive a failure with a reference driver."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.records import Record, ReferenceRun
from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.story import how_avoided

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings


class Reference:
    """The driver, how many such steps follow from one failure, and what is recorded where the run breaks."""

    record: ClassVar[type[Record]] = ReferenceRun
    driver: str

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """The reference drivers."""
        return len(settings.against)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> ReferenceRun:  # noqa: ARG002
        """Return how its run broke."""
        return ReferenceRun(self.driver, verdict, reason, 0.0)


def driven(
    driver: str, case: TestCase, clip: TestCase | None, failed: Trace | None, *, seed: int, deadlines: Deadlines
) -> ReferenceRun:
    """Run a test case that fails with another driver; where that one passes, run the clip before the mutation too."""
    result = run_test_case(case, driver, seed, deadlines=deadlines)
    before = None
    how: tuple[str, ...] = ()
    if result.verdict is Verdict.PASS:
        if clip is not None:
            before = run_test_case(clip, driver, seed, deadlines=deadlines).verdict
        how = how_avoided(failed, result.trace) if failed is not None else ()
    return ReferenceRun(driver, result.verdict, result.reason, result.duration_s, before, how)
