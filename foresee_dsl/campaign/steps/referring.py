"""Common part of the steps in which a reference driver drives a failure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from foresee_dsl.avoidance.references import ReferenceRun, reference_run
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.records import Record
from foresee_dsl.campaign.steps.inputs import CaseRef, clip_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.measuring import Part, reference_driver
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings


class Reference:
    """The driver, the number of such steps per failure, and the record of a broken run."""

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


@Part.EXPLAIN.measured
def driven(
    driver: str,
    case: TestCase,
    before: Callable[[], Verdict] | None,
    failed: Trace | None,
    *,
    seed: int,
    deadlines: Deadlines,
    rules: RulesMode,
) -> tuple[ReferenceRun, Trace]:
    """Return a reference driver's run of a failing test case, and its trace."""
    with reference_driver():
        result = run_test_case(case, driver, seed, deadlines=deadlines, rules=rules)
    return reference_run(driver, result, failed, compile_test_case(case), before), result.trace


_MOST_KNOWN = 64
"""Maximum number of cached verdicts. Ours: a few drivers for each of the clips that a process caches."""
_KNOWN: dict[tuple[str, CaseRef, str, int, RulesMode], Verdict] = {}
"""Verdicts of clips with reference drivers, cached because failing mutants of one clip share them."""


def verdict_of_clip(
    text: str, parent: CaseRef, file: Path, *, driver: str, seed: int, deadlines: Deadlines, rules: RulesMode
) -> Verdict:
    """Return the verdict of a clip without mutation, cached per process."""
    verdict = _KNOWN.get((text, parent, driver, seed, rules))
    if verdict is None:
        case = clip_case(text, parent, file)
        verdict = run_test_case(case, driver, seed, deadlines=deadlines, rules=rules).verdict
        if verdict is Verdict.PASS or verdict.is_failure:  # runs that crashed or took too long are repeated
            while len(_KNOWN) >= _MOST_KNOWN:
                del _KNOWN[next(iter(_KNOWN))]
            _KNOWN[text, parent, driver, seed, rules] = verdict
    return verdict
