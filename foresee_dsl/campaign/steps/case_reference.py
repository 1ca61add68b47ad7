"""Step: a reference driver drives a failing test case, which shows whether it avoids the failure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.records import CaseRunOutcome
from foresee_dsl.campaign.steps.case_run import CaseStep
from foresee_dsl.campaign.steps.referring import Reference, driven
from foresee_dsl.campaign.steps.step import KeyInputs, Step, Work
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.trace import Trace


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
        return driven(
            self.driver, case, None, trace, seed=self.seed, deadlines=work.deadlines, rules=work.settings.rules
        )
