"""The step after a clip's run: the clip is mutated, once for each seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from foresee_dsl.campaign.records import ClipOutcome, MutantDraft, Mutants
from foresee_dsl.campaign.steps.clip_text import clip_case, clip_of
from foresee_dsl.campaign.steps.step import Campaign, ClipPart, Work
from foresee_dsl.derive.mutate import Mutator
from foresee_dsl.drivers.registry import recorded_driver
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.clip import ClipStep


@dataclass(frozen=True, eq=False)
class MutantsStep(ClipPart["ClipStep", ClipOutcome]):
    """Mutate a clip with one seed."""

    kind = "mutants"
    title = "mutations"
    follows = "clip"
    record = Mutants
    drives = False
    reads = "clip"
    same_task = True
    turn = 1
    usual_s = 0.05

    @classmethod
    def following(cls, above: ClipStep, result: ClipOutcome | None, campaign: Campaign) -> Iterator[Self]:  # noqa: ARG003
        """Yield a mutation for each seed."""
        s, draft = campaign.settings, above.draft
        for seed in range(s.seed, s.seed + s.repeat) if s.children else ():
            key = campaign.key(cls, clip=above.key, risk=draft.risk, preset=s.preset, count=s.children, seed=seed,
                               operators=campaign.operators)  # fmt: skip
            yield cls(key, above.name, seed, draft)

    @staticmethod
    def wanted(result: ClipOutcome, settings: CampaignSettings) -> bool:
        """Only a clip that passed unmutated and is true to its parent's run is mutated."""
        return result.largest_m <= settings.fidelity_limit_m and result.verdict is Verdict.PASS

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """One for each seed."""
        return settings.repeat if settings.children else 0

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Mutants, None]:  # noqa: ARG002
        """Mutate the clip."""
        if trace is None:
            raise ValueError(f"clip {self.draft.name} is mutated without its own run's trace")
        settings, text = work.settings, self.draft.text
        parent = clip_case(text, work.case, work.folder / f"{self.draft.name}.foresee")
        mutator = Mutator(parent, clip_of(text), trace, preset=settings.preset)
        drafts = []
        for mutant in mutator.children(settings.children, seed=self.seed, driver=driver_of(trace, settings.driver)):
            meaning = expand_mutant(mutant, parent, source=work.folder / f"{mutant.name}.foresee").meaning
            drafts.append(MutantDraft(int(mutant.name.rpartition("_m")[2]), print_model(mutant), meaning))
        return Mutants(tuple(drafts)), None


def driver_of(clip_trace: Trace, driver: str) -> str:
    """Return the driver as a mutant's file records it, with the version that drove the clip's own unmutated run."""
    return recorded_driver(driver, str(clip_trace.meta.get("driver_version", "")))
