"""Minimises a mutant, and writes into its file what was left out and where its numbers begin to fail."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.derive.clipping.fidelity import with_fidelity
from foresee_dsl.derive.minimise.boundary import boundaries
from foresee_dsl.derive.minimise.candidate import Subject, TrialCandidate
from foresee_dsl.derive.minimise.outcome import Boundary, DropCounts
from foresee_dsl.derive.minimise.reductions import reduce
from foresee_dsl.derive.minimise.trials import TrialJudge, Trials
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language import model as m
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.simulate.trace import STEP_S

RUNS = 60
"""Maximum number of runs for each mutant. Ours: nearly always enough for the findings of the bundled library."""


class CannotMinimiseError(ForeseeError):
    """Raised if the mutant does not fail, so that there is no failure to keep."""


@dataclass(frozen=True)
class Minimal:
    """A minimised mutant and its clip.

    Attributes:
        clip, mutant: the reduced ones, with the names of the unreduced files. dropped: counts of what was left out.
        boundaries: one boundary for each remaining number.
        runs: number of runs. complete: whether the budget was enough.
        cut_again: whether the parent's run was available, so that the clip could be shortened.
    """

    clip: m.Clip
    mutant: m.Mutant
    dropped: DropCounts
    boundaries: tuple[Boundary, ...]
    runs: int
    complete: bool
    cut_again: bool


def minimise(subject: Subject, judge: TrialJudge, *, limit_m: float, budget: int = RUNS) -> Minimal:
    """Return the mutant without what its failure does not need.

    The same inputs give the same result.

    Args:
        limit_m: largest deviation of the smaller clip's unmutated run, which must pass, from the parent's run.
        budget: maximum number of runs. With a smaller budget, less is left out.

    Raises:
        CannotMinimiseError: the mutant does not fail.
    """
    trials, whole = Trials(subject, judge, limit_m=limit_m, budget=max(budget, 1)), subject.whole
    first = trials.first(whole)
    if not first.same:
        raise CannotMinimiseError(f"{subject.mutant.name} does not fail: {first.reason or 'it passes'}")
    reduced = reduce(trials, whole)
    built = trials.trial(reduced).built
    if built is None:
        raise RuntimeError("a candidate that failed was never built")
    edges, dropped = boundaries(trials, whole, reduced), _dropped(subject, whole, reduced, built.clip)
    trials.stands(reduced)  # measures the fidelity of a clip, even if the clip was not reduced
    strays = trials.fidelity(reduced)
    clip = subject.clip if built.clip_case.meaning == _clip_meaning(trials, whole) else built.clip
    if strays is not None and subject.cut_again:
        clip = with_fidelity(clip, strays)
    return Minimal(
        clip=clip,
        mutant=_with_origin(built.mutant, clip, dropped, edges),
        dropped=dropped,
        boundaries=edges,
        runs=trials.runs,
        complete=not trials.spent,
        cut_again=subject.cut_again,
    )


def _clip_meaning(trials: Trials, whole: TrialCandidate) -> str:
    """Return the hash of the meaning of the unreduced clip."""
    built = trials.trial(whole).built
    return built.clip_case.meaning if built is not None else ""


def _dropped(subject: Subject, whole: TrialCandidate, reduced: TrialCandidate, clip: m.Clip) -> DropCounts:
    cut = subject.cut(reduced.first, reduced.last)
    return DropCounts(
        changes=len(whole.changes) - len(reduced.changes),
        actors=len(reduced.actors),
        signals=len(reduced.signals),
        triggers=_triggers(cut) - _triggers(clip),
        seconds=round((whole.last - whole.first - reduced.last + reduced.first) * STEP_S, 2),
    )


def _triggers(clip: m.Clip) -> int:
    return sum(isinstance(item, m.When) for item in clip.body)


def _with_origin(mutant: m.Mutant, clip: m.Clip, dropped: DropCounts, edges: tuple[Boundary, ...]) -> m.Mutant:
    """Return the mutant with an origin that states what was left out and where the boundaries are."""
    parts = [f"without {dropped.text}"] if dropped.text else []
    parts += [edge.sentence for edge in edges]
    origin = mutant.origin or m.Origin()
    origin = origin.model_copy(update={"minimised": "; ".join(parts) or "nothing could be left out"})
    others = tuple(item for item in mutant.body if not isinstance(item, m.Origin))
    pin = clip_pin(clip, clip.pin)
    return mutant.model_copy(update={"body": (*others, origin), "pin": pin})
