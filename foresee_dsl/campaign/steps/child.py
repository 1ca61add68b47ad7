"""Step: a mutant is run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

from foresee_dsl.campaign.driving import DriverSetup, notes_of
from foresee_dsl.campaign.records import ChildOutcome, MutantDraft, Mutants
from foresee_dsl.campaign.steps.explanations import NOTHING, Explanation, explained
from foresee_dsl.campaign.steps.inputs import clip_case, mutant_of
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.language.document import Comments, Key, TestCase
from foresee_dsl.language.model import Change, Mutant, Origin
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.campaign.steps.mutants import MutantsStep


@dataclass(frozen=True, eq=False)
class ChildStep(ClipPart["MutantsStep", Mutants]):
    """Run a mutant; for a failure, ask whether a careful driver would have avoided it."""

    kind = "child"
    title = "children"
    follows = "mutants"
    record = ChildOutcome
    turn = 2
    usual_s = 0.12

    mutant: MutantDraft
    ends_early: bool

    @classmethod
    def following(cls, above: MutantsStep, result: Mutants | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield one step per mutant."""
        again = f"_s{above.seed}" if above.seed != campaign.settings.seed else ""
        ends_early = campaign.ends_early
        for mutant in result.drafts if result is not None else ():
            key = campaign.key(cls, clip=above.draft.pin, meaning=mutant.meaning, driver=campaign.driver,
                               seed=above.seed, **campaign.goal, **run_length(ends_early))  # fmt: skip
            name = f"{above.name}{again}{mutant.suffix}"
            yield cls(key, name, above.seed, above.draft, mutant, ends_early=ends_early)

    @staticmethod
    def at_most(settings: CampaignSettings) -> int:
        """Return the number of mutants of a clip."""
        return settings.children

    @Part.MUTATE.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[ChildOutcome, Trace | None]:  # noqa: ARG002
        """Run the mutant; traces of failures are stored."""
        parent = clip_case(self.draft.text, work.case, work.folder / f"{self.draft.name}.foresee")
        file = work.folder / f"{self.name}.foresee"
        mutant = mutant_of(self.mutant.text).model_copy(update={"name": self.name})
        setup = replace(work.setup(self.seed), ends_early=self.ends_early)
        outcome, result = run_child(mutant, parent, file, setup, meaning=self.mutant.meaning)
        return outcome, result.trace if result.verdict.is_failure else None

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> ChildOutcome:  # noqa: ARG002
        """Return the mutant's record for a broken run."""
        return ChildOutcome(
            self.name, file, self.mutant.text, verdict=verdict, reason=reason, meaning=self.mutant.meaning
        )


def run_length(ends_early: bool) -> dict[str, str]:
    """Return the part of the keys of mutants' runs that says that they last as long as their clips; empty if they end
    as soon as they can only pass.
    """
    return {} if ends_early else {"ends": "with its clip"}


def run_child(
    mutant: Mutant, clip_case: TestCase, file: Path, setup: DriverSetup, *, meaning: str = ""
) -> tuple[ChildOutcome, RunResult]:
    """Run a mutant; write the result into it and, for a failure, whether a careful driver would have avoided it.

    `meaning`: hash of its test case's meaning, if already known.
    """
    case = expand_mutant(mutant, clip_case, source=file, meaning=meaning)
    result = setup.run(case)
    explanation = explained(case, result)
    mutant, story = with_found(mutant, result.reason, explanation), explanation.story
    outcome = ChildOutcome.of(
        result,
        name=mutant.name,
        file=file.as_posix(),
        text=with_sentence(mutant, story.sentence) if story else print_model(mutant),
        operators=mutant.origin.operator if mutant.origin else (),
        digest=result.trace.digest,
        meaning=case.meaning,
        judgements=explanation.judgements,
        near=result.near_misses,
        story=story,
        notes=notes_of(result),
        goal=result.goal,
    )
    return outcome, result


def with_sentence(mutant: Mutant, sentence: str) -> str:
    """Return a mutant's text with a comment above its changes that describes what happens."""
    comments: dict[Key, Comments] = {}
    for k, item in enumerate(mutant.body):
        apart = k > 0 and type(item) is not type(mutant.body[k - 1])
        comments["body", k] = Comments(blank_before=apart)
    first = next((k for k, item in enumerate(mutant.body) if isinstance(item, Change)), None)
    if first is not None:
        one_line = " ".join(sentence.split())
        comments["body", first] = replace(comments["body", first], before=(one_line,))
    return print_model(mutant, comments)


def with_found(mutant: Mutant, reason: str, explanation: Explanation = NOTHING) -> Mutant:
    """Return the mutant with its run's result in the origin block, and whether a failure was preventable."""
    lines: dict[str, str | None] = {"found": reason, "preventable": None, "anticipating": None}
    lines |= dict(judgement.origin for judgement in explanation.judgements if judgement.origin is not None)
    body = tuple(item.model_copy(update=lines) if isinstance(item, Origin) else item for item in mutant.body)
    return mutant.model_copy(update={"body": body})
