"""The reductions: fewer changes, actors, signals and triggers, smaller numbers, a shorter clip.

Each takes a candidate that shows the failure and returns one that still does. `reduce` orders them so that those that
make later runs cheaper come first. Numbers are reduced before the clip is shortened: a clip that ends right after the
contact would hide a later contact of a smaller change."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from foresee_dsl.derive.minimise.boundary import ask_for_passing, nearest
from foresee_dsl.derive.minimise.candidate import TrialCandidate
from foresee_dsl.derive.minimise.trials import Trials
from foresee_dsl.language import model as m
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

T = TypeVar("T")

BEFORE_S = 2.0
"""Shortest time from the clip's beginning to the contact, s. Ours: a second in which the driver drives (`DRIVES_S`),
and another second in which a viewer sees where the actors come from."""
AFTER_S = 1.0
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


def reduce(trials: Trials, whole: TrialCandidate) -> TrialCandidate:
    """Return the smallest candidate that still shows the failure."""
    candidate = without_changes(trials, whole)
    trials.reserve = min(_RESERVE, trials.left // 2)
    candidate = without_bystanders(trials, candidate)
    trials.reserve = 0
    candidate = nearer(trials, candidate)
    candidate = shorter(trials, candidate)
    candidate = without_signals(trials, candidate)
    candidate = without_triggers(trials, candidate)
    candidate = without_changes(trials, candidate)
    candidate = nearer(trials, candidate, look_beside=True)
    ask_for_passing(trials, candidate)
    return candidate


def without_changes(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
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


def without_bystanders(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
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


def without_signals(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Leave out the states of signals that the failure does not need; these signals then begin with their program."""
    gone = drop_most(trials.subject.signals, lambda names: trials.stands(replace(candidate, signals=names)))
    return replace(candidate, signals=gone)


def without_triggers(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Leave out triggers that the failure does not need."""
    cut = trials.subject.cut(candidate.first, candidate.last)
    numbers = range(sum(isinstance(item, m.When) for item in cut.body))
    gone = drop_most(numbers, lambda chosen: trials.stands(replace(candidate, triggers=chosen)))
    return replace(candidate, triggers=gone)


def nearer(trials: Trials, candidate: TrialCandidate, *, look_beside: bool = False) -> TrialCandidate:
    """Change every number to the value nearest to `was` that still fails, one change after the other (see
    `nearest`).
    """
    for index in range(len(candidate.changes)):
        candidate = nearest(trials, candidate, index, look_beside=look_beside)
    return candidate


def shorter(trials: Trials, candidate: TrialCandidate) -> TrialCandidate:
    """Let the clip begin as late and end as early as it still shows the failure with the same avoidability.

    Without the condition on avoidability, a clip that begins too late would make an avoidable failure unavoidable.
    """
    result = trials.trial(candidate).result
    if result is None or not trials.subject.cut_again:
        return candidate
    contact = candidate.first + round(result.time_s / STEP_S)
    risk = _risk_frame(trials, candidate)
    last = min(candidate.last, max(contact + round(AFTER_S / STEP_S), risk))
    latest = min(contact - round(BEFORE_S / STEP_S), risk, *(_onset(change, candidate) for change in candidate.changes))
    every = round(_STARTS_EVERY_S / STEP_S)
    starts = range(candidate.first, max(latest, candidate.first) + 1, every)
    if last < candidate.last and trials.stands(ended := replace(candidate, last=last)):
        candidate = ended
    if len(starts) < 2 or not (answer := trials.answer(candidate)):
        return candidate

    def holds(k: int) -> bool:
        begun = replace(candidate, first=starts[k])
        return trials.stands(begun) and trials.answer(begun) == answer

    return replace(candidate, first=starts[_last_that_holds(len(starts) - 1, holds)])


def drop_most(items: Sequence[T], holds: Callable[[frozenset[T]], bool]) -> frozenset[T]:
    """Return as many of some items as can be dropped together.

    First all are dropped, then parts of half the size each round (Zeller's delta debugging, with the parts in the order
    of the items).
    """
    gone: frozenset[T] = frozenset()
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


def _last_that_holds(largest: int, holds: Callable[[int], bool]) -> int:
    """Return, by bisection, a number that holds while the next one does not; `largest` if that holds. 0 must hold."""
    if holds(largest):
        return largest
    low, high = 0, largest
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


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
