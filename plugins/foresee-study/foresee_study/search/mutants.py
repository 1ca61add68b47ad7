"""The step of a campaign that makes the mutants which a search proposes for one clip."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Self

from foresee_dsl import __version__
from foresee_dsl.campaign.records import ClipOutcome, MutantDraft, Mutants
from foresee_dsl.campaign.steps.clip import ClipStep
from foresee_dsl.campaign.steps.inputs import clip_case, clip_of
from foresee_dsl.campaign.steps.mutants import MutantsStep, driver_of
from foresee_dsl.campaign.steps.requests import RoundRequest
from foresee_dsl.campaign.steps.step import KeyInputs, Work
from foresee_dsl.derive.mutate import Mutator
from foresee_dsl.derive.presets import preset
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Mutant, Origin, Quantity
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.simulate.trace import Trace
from foresee_study.search.protocol import Point
from foresee_study.search.space import changes_at


@dataclass(frozen=True, eq=False)
class ProposedMutants(MutantsStep):
    """Make the mutants of some points of a search; `points`: each with the number of its mutant."""

    points: tuple[tuple[int, Point], ...] = ()

    @classmethod
    def at(cls, clip: ClipStep, number: int, points: tuple[tuple[int, Point], ...]) -> Self:
        """Return the step for a clip, still without its key (`again`); `number`: that of the search's round."""
        return cls("", clip.name, clip.seed, clip.draft, RoundRequest(number), clip.from_parent, points)

    @classmethod
    def following(cls, above: ClipStep, result: ClipOutcome | None, campaign: KeyInputs) -> Iterator[Self]:  # noqa: ARG003
        """Yield nothing, because a search proposes the steps."""
        yield from ()

    def again(self, request: RoundRequest, clip: ClipStep, campaign: KeyInputs) -> Self:
        """Return the step with its key."""
        key = campaign.key(type(self), clip=clip.key, preset=campaign.settings.preset, seed=self.seed,
                           operators=campaign.operators, points=json.dumps(self.points))  # fmt: skip
        return replace(self, key=key, request=request)

    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Mutants, None]:  # noqa: ARG002
        """Make the mutants; a point that changes nothing has none."""
        trace, settings, text = self.clip_trace(trace), work.settings, self.draft.text
        parent = clip_case(text, work.case, work.folder / f"{self.draft.name}.foresee")
        situation = Mutator(parent, clip_of(text), trace, preset=settings.preset).situation
        driver = driver_of(trace, settings.driver)
        drafts = []
        for number, point in self.points:
            drawn = changes_at(situation, preset(settings.preset), point)
            if drawn is None:
                continue
            names, changes = drawn
            origin = Origin(operator=names, preset=settings.preset, seed=Quantity(value=Decimal(self.seed)),
                            tool=__version__, driver=driver or None)  # fmt: skip
            suffix = f"_m{number}"
            name = f"{self.draft.name}{suffix}"
            mutant = Mutant(name=name, parent=f"{self.draft.name}.foresee", pin=pin_of(parent), body=(*changes, origin))
            meaning = expand_mutant(mutant, parent, source=work.folder / f"{name}.foresee").meaning
            drafts.append(MutantDraft(number, print_model(mutant), meaning, suffix))
        return Mutants(tuple(drafts)), None
