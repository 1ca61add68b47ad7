"""What all steps share that drive a failure with a reference driver."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.avoidance.references import ReferenceDriver, ReferenceRun
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.records import Record
from foresee_dsl.campaign.steps.clip_text import clip_case
from foresee_dsl.campaign.steps.inputs import CaseRef
from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.measuring import Part, reference_driver
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings


class Reference:
    """The driver, how many such steps follow from one failure, and what is recorded where the run breaks."""

    record: ClassVar[type[Record]] = ReferenceRun
    of_failures: ClassVar[bool] = True
    driver: str

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """The reference drivers."""
        return len(settings.against)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> ReferenceRun:  # noqa: ARG002
        """Return how its run broke."""
        return ReferenceRun(self.driver, verdict, reason, 0.0)


@Part.EXPLAIN.measured
def driven(
    driver: str,
    case: TestCase,
    before: Callable[[], Verdict] | None,
    failed: Trace | None,
    *,
    seed: int,
    deadlines: Deadlines,
) -> ReferenceRun:
    """Ask a reference driver about a test case that fails."""

    def drive() -> RunResult:
        with reference_driver():
            return run_test_case(case, driver, seed, deadlines=deadlines)

    return ReferenceDriver(driver, drive, before).judge(Failure(failed))


_MOST_KNOWN = 64
"""Verdicts of clips that are kept. Ours: a few drivers for each of the clips that a process keeps."""
_KNOWN: dict[tuple[str, CaseRef, str, int], Verdict] = {}
"""Verdicts of clips with reference drivers: failing children of one clip ask for the same."""


def verdict_of_clip(text: str, parent: CaseRef, file: Path, *, driver: str, seed: int, deadlines: Deadlines) -> Verdict:
    """Run a clip before its mutation, or return what that gave before in this process."""
    known = _KNOWN.get((text, parent, driver, seed))
    if known is None:
        known = run_test_case(clip_case(text, parent, file), driver, seed, deadlines=deadlines).verdict
        if known is Verdict.PASS or known.is_failure:  # what broke or took too long is tried again
            while len(_KNOWN) >= _MOST_KNOWN:
                del _KNOWN[next(iter(_KNOWN))]
            _KNOWN[text, parent, driver, seed] = known
    return known
