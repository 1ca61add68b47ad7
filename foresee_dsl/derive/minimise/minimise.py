"""Minimises a mutant, and writes into its file what was left out and where its numbers begin to fail.

The reductions are fewer changes, actors, signals and triggers, smaller numbers, and a shorter clip. Each takes a
candidate that shows the failure and returns one that still does. `_reduce` orders them so that those that make later
runs cheaper come first. Numbers are reduced before the clip is shortened: a clip that ends right after the contact
would hide a later contact of a smaller change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from foresee_dsl.derive.clipping.fidelity import with_fidelity
from foresee_dsl.derive.minimise.boundary import ask_for_passing, boundaries, last_failing, nearest
from foresee_dsl.derive.minimise.candidate import Subject, TrialCandidate
from foresee_dsl.derive.minimise.outcome import Boundary, DropCounts
from foresee_dsl.derive.minimise.trials import TrialJudge, Trials
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language import model as m
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

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
    reduced = _reduce(trials, whole)
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


_T = TypeVar("_T")

_BEFORE_S = 2.0
"""Shortest time from the clip's beginning to the contact, s. Ours: a second in which the driver drives (`DRIVES_S`),
and another second in which a viewer sees where the actors come from."""
_AFTER_S = 1.0
"""Shortest time from the contact to the clip's end, s. Ours: a failing run ends with the contact; a passing one needs
this time to pass."""
_STARTS_EVERY_S = 0.5
"""Time between the beginnings that are tried, s. Ours: in the 5 s before a risky point there are ten beginnings, among
which bisection needs four runs.
"""
_RESERVE = 31
"""Number of runs that are kept for the reductions that follow the removal of actors. Ours: 7 for a number, 3 for its
neighbours, 12 to shorten, 4 for signals and triggers, 5 for the boundary.
"""


def _reduce(trials: Trials, whole: TrialCandidate) -> TrialCandidate:
    """Return the smallest candidate that still shows the failure."""
    candidate = _without_changes(trials, whole)
    trials.reserve = min(_RESERVE, trials.left // 2)
    candidate = _without_bystanders(trials, candidate)
    trials.reserve = 0
    candidate = _nearer(trials, candidate)
    candidate = _shorter(trials, candidate)
    candidate = _without_signals(trials, candidate)
    candidate = _without_triggers(trials, candidate)
    candidate = _without_changes(trials, candidate)
    candidate = _nearer(trials, candidate, look_beside=True)
    ask_for_passing(trials, candidate)
    return candidate


def _without_changes(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Leave out each change that the failure does not need, beginning with the last one, until all remaining changes
    are needed.
    """
    again = len(candidate.changes) > 1
    while again:
        again = False
        for change in reversed(candidate.changes):
            left = tuple(c for c in candidate.changes if c is not change)
            if left and trials.fails(fewer := replace(candidate, changes=left)):
                candidate, again = fewer, len(left) > 1
                break
    return candidate


def _without_bystanders(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Leave out actors that the failure does not need, the farthest first. First all are left out together, then halves
    of them, then single ones.
    """
    trial = trials.trial(candidate)
    if trial.result is None:
        return candidate
    needed = {trial.result.with_, *(change.actor for change in candidate.changes)}
    others = [name for name in trials.subject.actors if name not in needed]
    order = _far_first(trial.result.trace, others)
    gone = drop_most(order, lambda names: trials.stands(replace(candidate, actors=names)))
    return replace(candidate, actors=gone)


def _without_signals(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Leave out the states of signals that the failure does not need; these signals then begin with their program."""
    gone = drop_most(trials.subject.signals, lambda names: trials.stands(replace(candidate, signals=names)))
    return replace(candidate, signals=gone)


def _without_triggers(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Leave out triggers that the failure does not need."""
    cut = trials.subject.cut(candidate.first, candidate.last)
    numbers = range(sum(isinstance(item, m.When) for item in cut.body))
    gone = drop_most(numbers, lambda chosen: trials.stands(replace(candidate, triggers=chosen)))
    return replace(candidate, triggers=gone)


def _nearer(trials: Trials, candidate: TrialCandidate, *, look_beside: bool = False) -> TrialCandidate:
    """Change every number to the value nearest to `was` that still fails, one change after the other (see
    `nearest`).
    """
    for index in range(len(candidate.changes)):
        candidate = nearest(trials, candidate, index, look_beside=look_beside)
    return candidate


def _shorter(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Let the clip begin as late and end as early as it still shows the failure with the same avoidability.

    Without the condition on avoidability, a clip that begins too late would make an avoidable failure unavoidable.
    """
    result = trials.trial(candidate).result
    if result is None or not trials.subject.cut_again:
        return candidate
    contact = candidate.first + round(result.time_s / STEP_S)
    risk = _risk_frame(trials, candidate)
    last = min(candidate.last, max(contact + round(_AFTER_S / STEP_S), risk))
    latest = min(
        contact - round(_BEFORE_S / STEP_S), risk, *(_onset(change, candidate) for change in candidate.changes)
    )
    every = round(_STARTS_EVERY_S / STEP_S)
    starts = range(candidate.first, max(latest, candidate.first) + 1, every)
    if last < candidate.last and trials.stands(ended := replace(candidate, last=last)):
        candidate = ended
    if len(starts) < 2 or not (answer := trials.answer(candidate)):
        return candidate

    def holds(k: int) -> bool:
        begun = replace(candidate, first=starts[k])
        return trials.stands(begun) and trials.answer(begun) == answer

    latest = len(starts) - 1
    return replace(candidate, first=starts[latest if holds(latest) else last_failing(0, latest, holds)])


def drop_most(items: Sequence[_T], holds: Callable[[frozenset[_T]], bool]) -> frozenset[_T]:
    """Return as many of some items as can be dropped together.

    First all are dropped, then parts of half the size each round (Zeller's delta debugging, with the parts in the order
    of the items).
    """
    gone: frozenset[_T] = frozenset()
    left, size = list(items), len(items)
    while size and left:
        k = 0
        while k < len(left):
            part = left[k : k + size]
            if holds(gone | frozenset(part)):
                gone |= frozenset(part)
                del left[k : k + size]
            else:
                k += size
        size = min(size - 1, math.ceil(size / 2)) if size > 1 else 0
    return gone


def _far_first(trace: Trace, names: Collection[str]) -> list[str]:
    """Return actors by their smallest distance to the ego, the farthest first; actors with equal distances by name."""
    ego = trace.states[:, 0, [X, Y]]
    columns = {info.id: k for k, info in enumerate(trace.actors)}

    def near_m(name: str) -> float:
        if name not in columns:
            return math.inf
        apart = np.hypot(*(trace.states[:, columns[name], [X, Y]] - ego).T)
        return float(np.nanmin(apart)) if np.isfinite(apart).any() else math.inf

    return sorted(names, key=lambda name: (-near_m(name), name))


def _risk_frame(trials: Trials, candidate: TrialCandidate) -> int:
    """Return the frame of the risky point; if the clip does not state one, its last frame."""
    risk = trials.subject.clip.risk
    return round(risk.at.si / STEP_S) if risk is not None and isinstance(risk.at, m.Quantity) else candidate.last


def _onset(change: m.Change, candidate: TrialCandidate) -> int:
    """Return the frame at which a change begins; the last frame for a change without a time."""
    if isinstance(change.start, m.Quantity):
        return candidate.first + round(change.start.si / STEP_S)
    return candidate.last
