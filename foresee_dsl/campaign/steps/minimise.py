"""Step after all mutants: the representative of a finding is minimised."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from foresee_dsl.avoidance.judge import Failure
from foresee_dsl.avoidance.judges import judged
from foresee_dsl.avoidance.responsibility import responsibility_of
from foresee_dsl.campaign.driving import DriverSetup, relative_path
from foresee_dsl.campaign.records import ChildOutcome, Minimised, MutantDraft, Reduced
from foresee_dsl.campaign.steps.child import ChildStep, run_child
from foresee_dsl.campaign.steps.inputs import clip_of, mutant_of
from foresee_dsl.campaign.steps.step import ClipPart, KeyInputs, Work
from foresee_dsl.derive.minimise.candidate import Subject
from foresee_dsl.derive.minimise.minimise import RUNS, CannotMinimiseError, minimise
from foresee_dsl.derive.minimise.trials import TrialJudge
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Actor, Clip, Fidelity, Mutant
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.story import tell


@dataclass(frozen=True, eq=False)
class MinimiseStep(ClipPart[ChildStep, ChildOutcome]):
    """Minimise a failing mutant; `run_seed` is the seed of the run that its clip was cut from."""

    kind = "minimise"
    title = "findings minimised"
    follows = "child"
    record = Minimised
    reads = "seed"
    after_all = True
    of_failures = True
    runs = RUNS + 3
    share = 0.05
    turn = 3
    usual_s = 3.0

    mutant: MutantDraft
    child_text: str

    @classmethod
    def following(cls, above: ChildStep, result: ChildOutcome | None, campaign: KeyInputs) -> Iterator[Self]:
        """Yield the single step of a mutant."""
        if result is not None:
            s = campaign.settings
            key = campaign.key(cls, child=above.key, risk=above.draft.risk, run_seed=s.seed,
                               limit_m=s.fidelity_limit_m, budget=RUNS)  # fmt: skip
            yield cls(key, above.name, above.seed, above.draft, above.mutant, result.text)

    def folder(self, case: TestCase) -> str:  # noqa: ARG002
        """Return a separate folder per finding."""
        return f"findings/{self.name}"

    @Part.MINIMISE.measured
    def run(self, work: Work, case: TestCase, trace: Trace | None) -> tuple[Minimised, Trace | None]:
        """Minimise the mutant, and run the minimised form once more."""
        clip = clip_of(self.draft.text)
        clip = clip.model_copy(update={"parent": relative_path(case.source, work.folder)})
        mutant = mutant_of(self.mutant.text).model_copy(update={"name": self.name, "parent": f"{clip.name}.foresee"})
        subject = Subject(case, clip, mutant, trace, work.folder)
        setup = DriverSetup(work.settings.driver, self.seed, rules=work.settings.rules)
        return minimised(subject, setup, limit_m=work.settings.fidelity_limit_m, budget=RUNS)

    def broken(self, case: TestCase, file: str, verdict: Verdict, reason: str) -> Minimised:  # noqa: ARG002
        """Return the original mutant with the reason why the process that minimised it broke."""
        child = ChildOutcome(self.name, file, self.child_text, verdict=verdict, reason=reason)
        return _as_found(child, clip_of(self.draft.text), f"not minimised: {reason}")


def minimised(subject: Subject, setup: DriverSetup, *, limit_m: float, budget: int) -> tuple[Minimised, Trace | None]:
    """Minimise a mutant and run the result; one that no longer fails is returned unchanged."""
    before = subject.clip
    try:
        smaller = minimise(subject, judge_of(setup), limit_m=limit_m, budget=budget)
    except CannotMinimiseError as err:
        child, result = _run(subject, before, subject.mutant, setup)
        return _as_found(child, before, f"not minimised: {err}"), result.trace
    child, result = _run(subject, smaller.clip, smaller.mutant, setup)
    notes = (
        "" if smaller.complete else f"the budget of {budget} runs was not enough for all reductions",
        "" if smaller.cut_again else "not shortened: the run from which its clip was cut is not available",
    )
    record = Minimised(
        child=child,
        clip=smaller.clip.name,
        clip_text=print_model(smaller.clip),
        dropped=smaller.dropped,
        boundaries=smaller.boundaries,
        changes=Reduced(len(subject.mutant.changes), len(smaller.mutant.changes)),
        actors=Reduced(_actors(before), _actors(smaller.clip)),
        clip_lines=Reduced(_lines(before, smaller.clip), _lines(smaller.clip)),
        runs=smaller.runs,
        complete=smaller.complete,
        note="; ".join(note for note in notes if note),
    )
    return record, result.trace


def _as_found(child: ChildOutcome, clip: Clip, note: str) -> Minimised:
    """Return the record of a mutant that was not minimised, with the reason."""
    text, changes, actors = print_model(clip), len(child.changes), _actors(clip)
    lines = text.count("\n")
    return Minimised(child, clip.name, text, changes=Reduced(changes, changes), actors=Reduced(actors, actors),
                     clip_lines=Reduced(lines, lines), complete=False, note=note)  # fmt: skip


def _lines(clip: Clip, smaller: Clip | None = None) -> int:
    """Return the number of lines of a clip's file. The file of a clip gets its `fidelity` line when it is run, so if
    only `smaller` has one yet, it is counted for the clip too."""
    measured = smaller.all(Fidelity)[:1] if smaller is not None and not clip.all(Fidelity) else ()
    return print_model(clip.model_copy(update={"body": (*clip.body, *measured)})).count("\n")


def _actors(clip: Clip) -> int:
    return sum(isinstance(item, Actor) for item in clip.body)


def judge_of(setup: DriverSetup) -> TrialJudge:
    """Return how mutants are run with a driver, and when two of their failures count as the same."""

    def sign(case: TestCase, result: RunResult) -> tuple[str, ...]:
        story = tell(result.trace, case)
        grounds = story.grounds
        whose = responsibility_of(story, result.verdict, (), ()).whose.value
        situation = grounds.gives_way, grounds.breaks_rule, grounds.hidden_by, grounds.signal
        return (result.verdict.value, result.with_, *story.signature, whose, *situation)

    def avoided(case: TestCase, result: RunResult) -> str:
        return ", ".join(str(judgement.answer) for judgement in judged(Failure.of(result, case)))

    return TrialJudge(drive=setup.run, sign=sign, avoided=avoided)


def _run(subject: Subject, clip: Clip, mutant: Mutant, setup: DriverSetup) -> tuple[ChildOutcome, RunResult]:
    case = expand_clip(clip, subject.parent, source=subject.folder / f"{clip.name}.foresee")
    file = subject.folder / f"{mutant.name}.foresee"
    return run_child(mutant, case, file, setup)
