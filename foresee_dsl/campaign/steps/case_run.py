"""First step: a test case is run without mutation."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from foresee_dsl.campaign.records import CaseRunOutcome
from foresee_dsl.campaign.steps.explanations import explained
from foresee_dsl.campaign.steps.step import KeyInputs, Step, Work
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings


@dataclass(frozen=True, eq=False)
class CaseStep(Step[None, None]):
    """Run a test case; for a failure, ask whether a careful driver would have avoided it."""

    kind = "seed"
    title = "test cases"
    follows = ""
    record = CaseRunOutcome
    turn = 0
    usual_s = 0.6

    @classmethod
    def of_case(cls, case: TestCase, name: str, campaign: KeyInputs) -> Self:
        """Return the step of a test case; `name` begins the names of its files."""
        # The window of a clip is not part of the scenario, but it determines the noise of the sensors.
        window = clip_pin(case.clip, case.clip.pin) if case.clip is not None else ""
        seed = campaign.settings.seed
        key = campaign.key(cls, meaning=case.meaning, window=window, driver=campaign.driver, seed=seed,
                           **campaign.goal)  # fmt: skip
        return cls(key, name, seed)

    @classmethod
    def following(cls, above: None, result: None, campaign: KeyInputs) -> Iterator[Self]:  # noqa: ARG003
        """Yield nothing, because test cases are inputs."""
        yield from ()

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:  # noqa: ARG004
        """Return 0, as it follows from no step."""
        return 0

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[CaseRunOutcome, Trace]:  # noqa: ARG002
        """Run the test case."""
        started = time.perf_counter()
        result = work.setup(self.seed).run(case)
        explanation = explained(case, result)
        outcome = CaseRunOutcome.of(
            result,
            id=case.id,
            family=case.family,
            scenario=case.scenario.name,
            wall_s=time.perf_counter() - started,
            near=result.near_misses,
            judgements=explanation.judgements,
            story=explanation.story,
            goal=result.goal,
        )
        return outcome, result.trace

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> CaseRunOutcome:  # noqa: ARG002
        """Return the test case's record for a broken run."""
        return CaseRunOutcome(case.id, case.family, case.scenario.name, verdict=verdict, reason=reason)
