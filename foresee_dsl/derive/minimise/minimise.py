"""Minimise a mutant: reduce it, then write into it what was left out and where its numbers begin to fail."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.derive.clipping.fidelity import with_fidelity
from foresee_dsl.derive.minimise.boundary import boundaries
from foresee_dsl.derive.minimise.candidate import Candidate, Subject
from foresee_dsl.derive.minimise.outcome import Boundary, Dropped
from foresee_dsl.derive.minimise.reductions import reduce
from foresee_dsl.derive.minimise.trials import Judge, Trials
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language import model as m
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.simulate.trace import STEP_S

RUNS = 60
"""The budget of a mutant. Ours: what the reductions of the bundled library's findings need, nearly always."""


class CannotMinimiseError(ForeseeError):
    """The mutant does not fail, so that there is nothing that could stay."""


@dataclass(frozen=True)
class Minimal:
    """A mutant made smaller, and its clip.

    Attributes:
        clip, mutant: their names are those of the unreduced files.
        dropped: what is left out. boundaries: of each number that is left.
        runs: how many were needed. complete: whether the budget was enough.
        cut_again: whether the parent's run was known, so that the clip could begin later.
    """

    clip: m.Clip
    mutant: m.Mutant
    dropped: Dropped
    boundaries: tuple[Boundary, ...]
    runs: int
    complete: bool
    cut_again: bool


def minimise(subject: Subject, judge: Judge, *, limit_m: float, budget: int = RUNS) -> Minimal:
    """Leave out what a failure does not need.

    The same inputs give the same result.

    Args:
        limit_m: the unmutated run of the smaller clip strays at most this far from the parent's run, and passes.
        budget: runs, at most. With fewer, less is left out.

    Raises:
        CannotMinimiseError: the mutant does not fail.
    """
    trials, whole = Trials(subject, judge, limit_m=limit_m, budget=max(budget, 1)), subject.whole
    first = trials.first(whole)
    if not first.same:
        raise CannotMinimiseError(f"{subject.mutant.name} does not fail: {first.reason or 'it passes'}")
    found = reduce(trials, whole)
    built = trials.trial(found).built
    if built is None:
        raise RuntimeError("a candidate that failed was never built")
    edges, dropped = boundaries(trials, whole, found), _dropped(subject, whole, found, built.clip)
    trials.stands(found)  # for the fidelity of a clip that was not reduced
    strays = trials.fidelity(found)
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


def _clip_meaning(trials: Trials, whole: Candidate) -> str:
    """Return what the unreduced clip means."""
    built = trials.trial(whole).built
    return built.clip_case.meaning if built is not None else ""


def _dropped(subject: Subject, whole: Candidate, found: Candidate, clip: m.Clip) -> Dropped:
    cut = subject.cut(found.first, found.last)
    return Dropped(
        changes=len(whole.changes) - len(found.changes),
        actors=len(found.actors),
        signals=len(found.signals),
        triggers=_triggers(cut) - _triggers(clip),
        seconds=round((whole.last - whole.first - found.last + found.first) * STEP_S, 2),
    )


def _triggers(clip: m.Clip) -> int:
    return sum(isinstance(item, m.When) for item in clip.body)


def _with_origin(mutant: m.Mutant, clip: m.Clip, dropped: Dropped, edges: tuple[Boundary, ...]) -> m.Mutant:
    """Write into the origin what was left out, and where the boundary lies."""
    parts = [f"without {dropped.text}"] if dropped.text else []
    parts += [edge.sentence for edge in edges]
    origin = mutant.origin or m.Origin()
    origin = origin.model_copy(update={"minimised": "; ".join(parts) or "nothing could be left out"})
    others = tuple(item for item in mutant.body if not isinstance(item, m.Origin))
    pin = clip_pin(clip, clip.pin)
    return mutant.model_copy(update={"body": (*others, origin), "pin": pin})
