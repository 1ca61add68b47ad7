"""Step after a clip's run: the clip is mutated, once per seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from foresee_dsl.campaign.records import ClipOutcome, MutantDraft, Mutants
from foresee_dsl.campaign.steps.inputs import clip_case, clip_of, mutant_of
from foresee_dsl.campaign.steps.requests import NO_ROUNDS, RoundRequest
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.derive.mutate import How, Mutator
from foresee_dsl.drivers.registry import recorded_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Mutant
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.clip import ClipStep


FROM_S = 1.0
"""A risky point of a mutant's own run lies at least this long after the clip's beginning, s. Ours: as
`steer.before_point_s` of the preset `focused`, the time from a change to its risky point.
"""
SEARCHED_FOR = 3
"""Number of mutants requested from the preset's search, as a multiple of a clip's share, with allocation in rounds."""


@dataclass(frozen=True, eq=False)
class MutantsStep(ClipPart["ClipStep", ClipOutcome]):
    """Mutate a clip with one seed.

    `request`: the request of a round, if mutants are allocated in rounds. `from_parent`: see `ClipStep`.
    """

    kind = "mutants"
    title = "mutations"
    follows = "clip"
    record = Mutants
    drives = False
    reads = "clip"
    same_task = True
    turn = 1
    runs = 2
    usual_s = 0.05

    request: RoundRequest = NO_ROUNDS
    from_parent: bool = False

    @classmethod
    def following(cls, above: ClipStep, result: ClipOutcome | None, campaign: KeyInputs) -> Iterator[Self]:  # noqa: ARG003
        """Yield one step per seed."""
        s, draft = campaign.settings, above.draft
        request = RoundRequest(int(s.in_rounds), campaign.earlier(draft.text) if campaign.earlier else ())
        request_part = {"asked": request.identity} if request.children else {}
        for seed in range(s.seed, s.seed + s.repeat) if s.children else ():
            key = campaign.key(cls, clip=above.key, risk=draft.risk, preset=s.preset, count=s.first_children, seed=seed,
                               operators=campaign.operators, **request_part)  # fmt: skip
            yield cls(key, above.name, seed, draft, request, above.from_parent)

    def again(self, request: RoundRequest, clip: ClipStep, campaign: KeyInputs) -> Self:
        """Return the step that mutates the same clip with the same seed in a later round."""
        key = campaign.key(type(self), clip=clip.key, risk=self.draft.risk, preset=campaign.settings.preset,
                           seed=self.seed, operators=campaign.operators, asked=request.identity)  # fmt: skip
        return replace(self, key=key, request=request)

    @staticmethod
    def wanted(result: ClipOutcome, settings: CampaignSettings) -> bool:
        """Return True for a clip that can be trusted."""
        return result.trusted(settings.fidelity_limit_m)

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """Return the number of seeds."""
        return settings.repeat if settings.children else 0

    @Part.MUTATE.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Mutants, None]:  # noqa: ARG002
        """Mutate the clip."""
        trace, settings = self.clip_trace(trace), work.settings
        parent = clip_case(self.draft.text, work.case, work.folder / f"{self.draft.name}.foresee")
        clip = clip_of(self.draft.text)
        mutator = Mutator(parent, clip, trace, preset=settings.preset, plans=self.request.plans)
        driver = driver_of(trace, settings.driver)
        drafts = []
        for number, mutant in self._drawn(mutator, parent, work, driver):
            meaning = expand_mutant(mutant, parent, source=work.folder / f"{mutant.name}.foresee").meaning
            suffix = mutant.name.removeprefix(self.draft.name)
            drafts.append(MutantDraft(number, print_model(mutant), meaning, suffix))
        searched = mutator.searched(self.seed, SEARCHED_FOR * settings.children) if self.request.round else 0
        return Mutants(tuple(drafts), mutator.plans, searched), None

    def clip_trace(self, trace: Trace | None) -> Trace:
        """Return the clip's own trace, or its seconds of the parent's trace, from the trace that the step has read."""
        if trace is None:
            raise ValueError(f"clip {self.draft.name} is mutated without the trace of a run")
        if not self.from_parent:
            return trace
        clip = clip_of(self.draft.text)
        return trace.part(trace.frame_at(clip.start_s), trace.frame_at(clip.end_s) + 1)

    def _drawn(self, mutator: Mutator, parent: TestCase, work: Work, driver: str) -> Iterator[tuple[int, Mutant]]:
        """Yield the mutants with their numbers."""
        seen = {mutant_of(text).changes for text in self.request.existing}
        forecasts: dict[str, Mutator | None] = {}
        for child in self.request.children:
            near = mutant_of(child.near) if child.near else None
            drawn_by: Mutator | None = mutator
            if near is not None and child.how is How.BESIDE:
                if child.near not in forecasts:
                    forecasts[child.near] = self._forecast(near, parent, work)
                drawn_by = forecasts[child.near]
            drawn = drawn_by and drawn_by.child(
                child.draw, seed=self.seed, driver=driver, seen=seen, near=near, how=child.how
            )
            if drawn and (child.how is not How.EARLIER or _possible(drawn, parent)):
                seen.add(drawn.changes)
                yield child.number, drawn.model_copy(update={"name": f"{self.draft.name}{child.suffix}"})
        if self.request.round <= 1:
            for mutant in mutator.children(self._first(work.settings), seed=self.seed, driver=driver, seen=seen):
                number = len(self.request.children) + int(mutant.name.rpartition("_m")[2])
                yield number, mutant.model_copy(update={"name": f"{self.draft.name}_m{number}"})

    def _first(self, settings: CampaignSettings) -> int:
        """Return the number of mutants that are drawn anew in the first round; without rounds, these are the rest."""
        earlier = 0 if settings.in_rounds else len(self.request.children)
        return max(settings.first_children - earlier, 0)

    def _forecast(self, near: Mutant, parent: TestCase, work: Work) -> Mutator | None:
        """Return the mutator for the riskiest point of a mutant's own run; None if the run has no such point.

        The forecaster is `foresee` in every campaign, because it needs nothing but the trace. The run is repeated,
        because the store has no traces of mutants that passed.
        """
        settings = work.settings
        case = expand_mutant(near, parent, source=work.folder / f"{near.name}.foresee")
        run = work.setup(self.seed).run(case)
        if run.verdict is not Verdict.PASS:
            return None
        points = ForeseeRanker().rank(run.trace, seed=self.seed, before_s=FROM_S, after_s=0.0)
        clip = clip_of(self.draft.text)
        return next((Mutator(parent, clip, run.trace, preset=settings.preset, point=point) for point in points), None)


def _possible(mutant: Mutant, parent: TestCase) -> bool:
    """Return whether the changes of a mutant fit a clip that they were not drawn for."""
    try:
        expand_mutant(mutant, parent, source=parent.source)
    except ForeseeError:
        return False
    return True


def driver_of(clip_trace: Trace, driver: str) -> str:
    """Return the driver as a mutant's file records it, with the version of the clip's own unmutated run."""
    return recorded_driver(driver, str(clip_trace.meta.get("driver_version", "")))
