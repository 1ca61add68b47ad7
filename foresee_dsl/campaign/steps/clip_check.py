"""Step after a failing mutant: its clip is run without mutation, if its mutants were drawn from the parent's run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from foresee_dsl.campaign.records import ChildOutcome, ClipOutcome
from foresee_dsl.campaign.steps.clip import broken_clip, run_clip
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.language.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.child import ChildStep


@dataclass(frozen=True, eq=False)
class ClipCheckStep(ClipPart["ChildStep", ChildOutcome]):
    """Run the clip of a failing mutant without mutation, if that was not done before.

    The failure counts only if the clip passes and is close enough to its parent's run (`ClipOutcome.trusted`).
    """

    kind = "check"
    title = "clips of failing children"
    follows = "child"
    record = ClipOutcome
    reads = "seed"
    of_failures = True
    turn = 2
    usual_s = 0.2

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:  # noqa: ARG004 - as in other steps
        """Return 0: the plan counts a clip's one run as its `ClipStep`."""
        return 0

    @classmethod
    def following(cls, above: ChildStep, result: ChildOutcome | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield the one run of the clip; all failing mutants of a clip have the same."""
        if result is not None and campaign.draws_from_parent:
            seed = campaign.settings.seed  # that of the parent's run, whatever the seed of the mutant
            key = campaign.key(cls, clip=above.draft.pin, driver=campaign.driver, seed=seed, **campaign.goal)
            yield cls(key, above.draft.name, seed, above.draft)

    @Part.CLIP.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ClipOutcome, Trace]:
        """Run the clip and compare it."""
        return run_clip(self, work, case, trace)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> ClipOutcome:
        """Return the clip's record for a broken run."""
        return broken_clip(self, case, file, verdict, reason)
