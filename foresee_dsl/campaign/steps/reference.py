"""Step after a failing mutant: a reference driver drives it, which shows whether it avoids the failure, and how."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Self

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.records import ChildOutcome, MutantDraft
from foresee_dsl.campaign.steps.child import ChildStep
from foresee_dsl.campaign.steps.inputs import clip_case, mutant_of
from foresee_dsl.campaign.steps.referring import Reference, driven, verdict_of_clip
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.simulate.trace import Trace


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
        file = work.folder / f"{self.draft.name}.foresee"
        clip = clip_case(self.draft.text, work.case, file)
        child = expand_mutant(mutant_of(self.mutant.text), clip, source=work.folder / f"{self.name}.foresee")
        before = partial(verdict_of_clip, self.draft.text, work.case, file, driver=self.driver, seed=self.seed,
                         deadlines=work.deadlines, rules=work.settings.rules)  # fmt: skip
        run, _ = driven(
            self.driver, child, before, trace, seed=self.seed, deadlines=work.deadlines, rules=work.settings.rules
        )
        return run, None
