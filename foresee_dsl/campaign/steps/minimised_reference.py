"""Step: a reference driver drives a minimised finding, as it did its representative."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from foresee_dsl.avoidance.references import ReferenceRun
from foresee_dsl.campaign.records import Minimised
from foresee_dsl.campaign.steps.case_reference import Reference, drive_failure
from foresee_dsl.campaign.steps.inputs import clip_of, mutant_of
from foresee_dsl.campaign.steps.minimise import MinimiseStep
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True, eq=False)
class MinimisedReferenceStep(Reference, ClipPart[MinimiseStep, Minimised]):
    """Run a minimised mutant and its clip, as `ReferenceStep` does."""

    kind = "minimised_reference"
    title = "minimised findings with reference drivers"
    follows = "minimise"
    reads = "minimise"
    runs = 2
    share = 0.05
    turn = 4
    usual_s = 0.3

    clip: str
    mutant: str
    driver: str

    @classmethod
    def following(cls, above: MinimiseStep, result: Minimised | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield one step per reference driver."""
        if result is None:
            return
        for driver, identity in campaign.references:
            key = campaign.key(cls, minimised=above.key, driver=identity)
            texts = result.clip_text, result.child.text
            yield cls(key, f"{above.name}_{driver}", above.seed, above.draft, *texts, driver)

    def folder(self, case: TestCase) -> str:  # noqa: ARG002
        """Return the folder of the minimised mutant."""
        return f"findings/{self.name.removesuffix(f'_{self.driver}')}"

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ReferenceRun, Trace | None]:
        """Run the child, then the clip; compare the child's run, which a report shows, with the failing one."""
        clip_model = clip_of(self.clip)
        clip = expand_clip(clip_model, case, source=work.folder / f"{clip_model.name}.foresee")
        child = expand_mutant(mutant_of(self.mutant), clip, source=work.folder / f"{self.name}.foresee")
        setup = work.setup(self.seed, self.driver)
        return drive_failure(setup, child, lambda: setup.run(clip).verdict, trace)
