"""Step after a clip's run: the clip is mutated, once per seed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Self

from foresee_dsl.campaign.records import ClipOutcome, MutantDraft, Mutants
from foresee_dsl.campaign.steps.clip_text import clip_case, clip_of, mutant_of
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.derive.mutate import Draw, Mutator, PlanNames
from foresee_dsl.drivers.registry import recorded_driver
from foresee_dsl.language.model import Mutant
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.clip import ClipStep


SEARCHED_FOR = 3
"""Number of mutants requested from the preset's search, as a multiple of a clip's share, with allocation in rounds."""


@dataclass(frozen=True)
class RequestedMutant:
    """A mutant that a round requests.

    Attributes:
        number: last part of its name. draw: index of the draw from its clip.
        near: text of the mutant near which it is drawn; "" for an independent draw. near_number: number of that mutant.
    """

    number: int
    draw: Draw
    near: str = ""
    near_number: int = 0


@dataclass(frozen=True)
class RoundRequest:
    """The request of a round for one clip.

    Attributes:
        round: number of the round; the first has no explicit request: each clip gets its first mutants. 0: no rounds.
        children: the requested mutants. plans: the plans by which the clip's mutants are drawn. existing: texts of the
            existing mutants.
    """

    round: int = 0
    children: tuple[RequestedMutant, ...] = ()
    plans: tuple[PlanNames, ...] = ()
    existing: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class MutantsStep(ClipPart["ClipStep", ClipOutcome]):
    """Mutate a clip with one seed; `request`: the request of a round, if mutants are allocated in rounds."""

    kind = "mutants"
    title = "mutations"
    follows = "clip"
    record = Mutants
    drives = False
    reads = "clip"
    same_task = True
    turn = 1
    usual_s = 0.05

    request: RoundRequest = RoundRequest()

    @classmethod
    def following(cls, above: ClipStep, result: ClipOutcome | None, campaign: KeyInputs) -> Iterator[Self]:  # noqa: ARG003
        """Yield one step per seed."""
        s, draft = campaign.settings, above.draft
        for seed in range(s.seed, s.seed + s.repeat) if s.children else ():
            key = campaign.key(cls, clip=above.key, risk=draft.risk, preset=s.preset, count=s.first_children, seed=seed,
                               operators=campaign.operators)  # fmt: skip
            yield cls(key, above.name, seed, draft, RoundRequest(int(s.allocation == "adaptive")))

    def again(self, request: RoundRequest, clip: ClipStep, campaign: KeyInputs) -> Self:
        """Return the step that mutates the same clip with the same seed in a later round."""
        key = campaign.key(type(self), clip=clip.key, risk=self.draft.risk, preset=campaign.settings.preset,
                           seed=self.seed, operators=campaign.operators, asked=json.dumps(asdict(request)))  # fmt: skip
        return replace(self, key=key, request=request)

    @staticmethod
    def wanted(result: ClipOutcome, settings: CampaignSettings) -> bool:
        """Return True for a clip that passed without mutation and is close enough to its parent's run."""
        return result.largest_m <= settings.fidelity_limit_m and result.verdict is Verdict.PASS

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """Return the number of seeds."""
        return settings.repeat if settings.children else 0

    @Part.MUTATE.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Mutants, None]:  # noqa: ARG002
        """Mutate the clip."""
        if trace is None:
            raise ValueError(f"clip {self.draft.name} is mutated without its own run's trace")
        settings, text = work.settings, self.draft.text
        parent = clip_case(text, work.case, work.folder / f"{self.draft.name}.foresee")
        mutator = Mutator(parent, clip_of(text), trace, preset=settings.preset, plans=self.request.plans)
        driver = driver_of(trace, settings.driver)
        drafts = []
        for number, mutant in self._drawn(mutator, settings, driver):
            meaning = expand_mutant(mutant, parent, source=work.folder / f"{mutant.name}.foresee").meaning
            drafts.append(MutantDraft(number, print_model(mutant), meaning))
        searched = mutator.searched(self.seed, SEARCHED_FOR * settings.children) if self.request.round else 0
        return Mutants(tuple(drafts), mutator.plans, searched), None

    def _drawn(self, mutator: Mutator, settings: CampaignSettings, driver: str) -> Iterator[tuple[int, Mutant]]:
        """Yield the mutants with their numbers."""
        if not self.request.children:
            for mutant in mutator.children(settings.first_children, seed=self.seed, driver=driver):
                yield int(mutant.name.rpartition("_m")[2]), mutant
            return
        seen = {mutant_of(text).changes for text in self.request.existing}
        for child in self.request.children:
            near = mutant_of(child.near) if child.near else None
            drawn = mutator.child(child.draw, seed=self.seed, driver=driver, seen=seen, near=near)
            if drawn is not None:
                seen.add(drawn.changes)
                yield child.number, drawn.model_copy(update={"name": f"{self.draft.name}_m{child.number}"})


def driver_of(clip_trace: Trace, driver: str) -> str:
    """Return the driver as a mutant's file records it, with the version of the clip's own unmutated run."""
    return recorded_driver(driver, str(clip_trace.meta.get("driver_version", "")))
