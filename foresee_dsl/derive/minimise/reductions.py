"""The reductions: fewer changes, actors, signals and triggers, smaller numbers, a shorter clip.

Each takes a candidate that shows the failure and returns one that still does. They are done in the order of
`reduce`: what makes the later runs cheaper comes first, and numbers are brought near before the clip is shortened, as
a clip that ends right after the contact would hide a contact that a smaller change makes later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from foresee_dsl.derive.minimise.boundary import ask_for_passing, nearest
from foresee_dsl.derive.minimise.candidate import Candidate
from foresee_dsl.derive.minimise.trials import Trials
from foresee_dsl.language import model as m
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

T = TypeVar("T")

BEFORE_S = 2.0
"""A clip begins so long before the contact, or earlier. Ours: a second in which the driver drives (`DRIVES_S`), and one
more for people to see who comes from where."""
AFTER_S = 1.0
"""A clip ends so long after the contact, or later. Ours: the run ends with the contact; what passes needs the time to
pass."""
_STARTS_EVERY_S = 0.5
"""The later beginnings that are tried. Ours: ten of them in the 5 s before a risky point; four runs tell them apart."""
_RESERVE = 28
"""Runs that are kept for what comes after the actors. Ours: 7 for a number, 12 to shorten, 4 for signals and
triggers, 5 for the boundary."""


def reduce(trials: Trials, whole: Candidate) -> Candidate:
    """Return the smallest candidate found."""
    found = without_changes(trials, whole)
    trials.reserve = min(_RESERVE, trials.left // 2)
    found = without_bystanders(trials, found)
    trials.reserve = 0
    found = nearer(trials, found)
    found = shorter(trials, found)
    found = without_signals(trials, found)
    found = without_triggers(trials, found)
    found = without_changes(trials, found)
    found = nearer(trials, found, look_beside=True)
    ask_for_passing(trials, found)
    return found


def without_changes(trials: Trials, found: Candidate) -> Candidate:
    """Leave out each change that the failure does not need, the last first, until all that are left are needed."""
    again = len(found.changes) > 1
    while again:
        again = False
        for change in reversed(found.changes):
            left = tuple(c for c in found.changes if c is not change)
            if left and trials.fails(fewer := replace(found, changes=left)):
                found, again = fewer, len(left) > 1
                break
    return found


def without_bystanders(trials: Trials, found: Candidate) -> Candidate:
    """Leave out actors that play no part, those far from the ego first: all, then halves, then one by one."""
    trial = trials.trial(found)
    if trial.result is None:
        return found
    needed = {trial.result.with_, *(change.actor for change in found.changes)}
    others = [name for name in trials.subject.actors if name not in needed]
    order = _far_first(trial.result.trace, others)
    gone = drop_most(order, lambda names: trials.stands(replace(found, actors=names)))
    return replace(found, actors=gone)


def without_signals(trials: Trials, found: Candidate) -> Candidate:
    """Leave out the states of signals that nobody meets: those signals then begin with their program."""
    gone = drop_most(trials.subject.signals, lambda names: trials.stands(replace(found, signals=names)))
    return replace(found, signals=gone)


def without_triggers(trials: Trials, found: Candidate) -> Candidate:
    """Leave out triggers that the failure does not need."""
    cut = trials.subject.cut(found.first, found.last)
    numbers = range(sum(isinstance(item, m.When) for item in cut.body))
    gone = drop_most(numbers, lambda chosen: trials.stands(replace(found, triggers=chosen)))
    return replace(found, triggers=gone)


def nearer(trials: Trials, found: Candidate, *, look_beside: bool = False) -> Candidate:
    """Bring every number as near to its `was` value as still fails, one change after the other (see `nearest`)."""
    for index in range(len(found.changes)):
        found = nearest(trials, found, index, look_beside=look_beside)
    return found


def shorter(trials: Trials, found: Candidate) -> Candidate:
    """Let the clip begin as late, and end as early, as still shows the failure; a careful driver's answer stays.

    Without the latter, a clip that begins too late would make a failure unavoidable that was not.
    """
    result = trials.trial(found).result
    if result is None or not trials.subject.cut_again:
        return found
    contact = found.first + round(result.time_s / STEP_S)
    risk = _risk_frame(trials, found)
    last = min(found.last, max(contact + round(AFTER_S / STEP_S), risk))
    latest = min(contact - round(BEFORE_S / STEP_S), risk, *(_onset(change, found) for change in found.changes))
    every = round(_STARTS_EVERY_S / STEP_S)
    starts = range(found.first, max(latest, found.first) + 1, every)
    if last < found.last and trials.stands(ended := replace(found, last=last)):
        found = ended
    if len(starts) < 2 or not (answer := trials.answer(found)):
        return found

    def holds(k: int) -> bool:
        begun = replace(found, first=starts[k])
        return trials.stands(begun) and trials.answer(begun) == answer

    return replace(found, first=starts[_last_that_holds(len(starts) - 1, holds)])


def drop_most(items: Sequence[T], holds: Callable[[frozenset[T]], bool]) -> frozenset[T]:
    """Return as many of some items as can be dropped together: all, else parts half as large each time (Zeller's
    delta debugging, with the parts in the order given)."""
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
    """Return a number from 0 on that holds while the next one does not, or the largest: by bisection; 0 does hold."""
    if holds(largest):
        return largest
    low, high = 0, largest
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _far_first(trace: Trace, names: Collection[str]) -> list[str]:
    """Return actors by how near they came to the ego, the farthest first; by name among equals."""
    ego = trace.states[:, 0, [X, Y]]
    columns = {info.id: k for k, info in enumerate(trace.actors)}

    def near_m(name: str) -> float:
        if name not in columns:
            return math.inf
        apart = np.hypot(*(trace.states[:, columns[name], [X, Y]] - ego).T)
        return float(np.nanmin(apart)) if np.isfinite(apart).any() else math.inf

    return sorted(names, key=lambda name: (-near_m(name), name))


def _risk_frame(trials: Trials, found: Candidate) -> int:
    """Return the frame of the risky point; where the clip names none, of its end."""
    risk = trials.subject.clip.risk
    return round(risk.at.si / STEP_S) if risk is not None and isinstance(risk.at, m.Quantity) else found.last


def _onset(change: m.Change, found: Candidate) -> int:
    """Return the frame at which a change that has a time begins; the last frame for the others."""
    if isinstance(change.start, m.Quantity):
        return found.first + round(change.start.si / STEP_S)
    return found.last
