"""Finds the boundary of a failure along a change: the value nearest to the unmutated one that fails, and its neighbour
that passes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from types import MappingProxyType

from foresee_dsl.derive.minimise.candidate import TrialCandidate
from foresee_dsl.derive.minimise.outcome import Boundary, Ended, ValueTrial
from foresee_dsl.derive.minimise.trials import Trial, Trials
from foresee_dsl.derive.presets import FOCUSED
from foresee_dsl.language import model as m
from foresee_dsl.language.units import UNITS

STEPS: Mapping[str, Decimal] = MappingProxyType(
    {
        "steer": Decimal(str(FOCUSED.steer.step)),
        "timing": Decimal(str(FOCUSED.timing.step)),
        "delay": Decimal(str(FOCUSED.delay.step_s)),
        "line": Decimal(str(FOCUSED.line.step_m)),
    }
)
"""Step between the values of each property, as its operator draws them, in the property's unit."""
NEIGHBOURS = 3
"""Number of values next to a boundary, on the failing side, that must fail as well. Ours: if the next three hundredths
fail too, the boundary is not due to chance; more runs seldom find another region.
"""
_STEP = Decimal("0.01")
"""Step of all other properties. Ours: generated files write two decimals."""


@dataclass(frozen=True)
class ValueGrid:
    """The values of a change from the mutated one (index 0) towards the unmutated one (index `count`, which is not
    tried).
    """

    change: m.Change
    was: Decimal
    now: Decimal
    step: Decimal
    unit: str

    @property
    def count(self) -> int:
        """Index of the unmutated value."""
        return math.ceil(abs(self.now - self.was) / self.step)

    def value(self, k: int) -> Decimal:
        """Return the value at index `k`; values at negative indices lie beyond the mutated one."""
        return self.now - k * self.step if self.now > self.was else self.now + k * self.step

    def changed(self, k: int) -> m.Change:
        """Return the change with the value at index `k`."""
        return self.change.model_copy(update={"now": m.Quantity(value=self.value(k), unit=self.unit)})


def nearest(trials: Trials, candidate: TrialCandidate, index: int, *, look_beside: bool = False) -> TrialCandidate:
    """Return the candidate with the number of one change moved towards its `was` value as far as the mutant still
    fails.

    A change without a number (a model swap) stays. The number is found by bisection. The next value towards `was` does
    not fail, and values beyond that one are not tried. The `NEIGHBOURS` next values on the other side all fail: if one
    of them passed, the failing values would lie in several regions, and the search would go on beyond it, towards the
    mutated value. If there is no stable region, the result is the edge with the most failing neighbours.

    Args:
        look_beside: try the next value first; if it does not fail, the search ends.
    """
    grid = grid_of(candidate.changes[index])
    if grid is None:
        return candidate

    def fails(k: int) -> bool:
        return trials.fails(_with(candidate, index, grid.changed(k)))

    high = grid.count
    if look_beside and high > 1 and not fails(1):
        return candidate
    best = stable_edge(high, fails)
    return _with(candidate, index, grid.changed(best)) if best else candidate


def stable_edge(high: int, fails: Callable[[int], bool]) -> int:
    """Return, by bisection, the largest failing index whose `NEIGHBOURS` next smaller indices fail too.

    If there is none, return the index with the most such neighbours. Index 0 must fail, and `high` must not.
    """
    edges: list[tuple[int, int]] = []  # number of neighbours that fail, and the edge
    while True:
        low = last_failing(0, high, fails)
        near = [fails(k) for k in range(low - 1, max(low - NEIGHBOURS, 0) - 1, -1)]
        edges.append((near.index(False) if False in near else NEIGHBOURS, low))
        if False not in near:
            return max(edges)[1]
        high = low - 1 - near.index(False)


def last_failing(low: int, high: int, fails: Callable[[int], bool]) -> int:
    """Return, by bisection, a number that fails while the next one does not; `low` fails, and `high` does not."""
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fails(middle) else (low, middle)
    return low


def ask_for_passing(trials: Trials, candidate: TrialCandidate) -> None:
    """If the value next to a boundary fails in another way, run values by bisection until one passes."""
    for index, change in enumerate(candidate.changes):
        grid = grid_of(change)
        if grid is None:
            continue

        def fails(k: int, index: int = index, grid: ValueGrid = grid) -> bool:
            return trials.fails_somehow(_with(candidate, index, grid.changed(k)))

        if grid.count > 1 and fails(1):
            last_failing(1, grid.count, fails)


def boundaries(trials: Trials, whole: TrialCandidate, reduced: TrialCandidate) -> tuple[Boundary, ...]:
    """Return the boundary of each number in the reduced mutant, from the runs so far."""
    return tuple(_boundaries(trials, whole, reduced))


def _boundaries(trials: Trials, whole: TrialCandidate, reduced: TrialCandidate) -> Iterator[Boundary]:
    for index, change in enumerate(reduced.changes):
        grid = grid_of(change)
        if grid is None:
            continue
        as_mutated = next(c for c in whole.changes if _same_place(c, change))
        runs = {float(value): trial for value, trial in _runs_of(trials, reduced, index)}
        was, now = float(grid.was), float(grid.now)
        values = sorted(runs, key=lambda value: abs(value - was))
        nearer = [value for value in values if abs(value - was) < abs(now - was)]
        failing = [value for value in nearer if runs[value].failed]
        worst = failing[0] if failing else now
        passing = [value for value in nearer if not runs[value].failed and abs(value - was) < abs(worst - was)]
        if not passing and len(reduced.changes) > 1:
            continue  # without this change, the others may fail in another way
        offset = _offset(trials, reduced, index, grid)
        first = grid_of(as_mutated)
        yield Boundary(
            change=f"{change.actor}.{change.property}",
            unit=grid.unit,
            step=float(grid.step),
            was=_rounded(was + offset),
            first=_rounded(float(first.now if first else grid.now) + offset),
            fails=_rounded(now + offset),
            also_fails=_rounded(worst + offset),
            passes=_rounded((passing[-1] if passing else was) + offset),
            tried=tuple(_summary(value + offset, runs[value]) for value in values),
        )


def _runs_of(trials: Trials, reduced: TrialCandidate, index: int) -> Iterable[tuple[Decimal, Trial]]:
    """Yield the values of one change that were run in the candidate's clip or in one from which it was reduced.

    A run without an actor that the candidate's clip needs says nothing about the value. The runs of the candidate's
    own clip come last, so that they replace others.
    """
    own, change = [], reduced.changes[index]
    for candidate, trial in trials.finished():
        there = next((c for c in candidate.changes if _same_place(c, change)), None)
        grid = grid_of(there) if there is not None else None
        if grid is None or trial.verdict is None or not candidate.has_clip_of(reduced):
            continue
        if _others(candidate, grid.change) != _others(reduced, change):
            continue
        if replace(candidate, changes=()) == replace(reduced, changes=()):
            own.append((grid.now, trial))
        else:
            yield grid.now, trial
    yield from own


def _others(candidate: TrialCandidate, change: m.Change) -> tuple[m.Change, ...]:
    return tuple(other for other in candidate.changes if other is not change)


def _summary(value: float, trial: Trial) -> ValueTrial:
    ended: Ended = "fails" if trial.same else "otherwise" if trial.failed else "passes"
    return ValueTrial(_rounded(value), ended, trial.reason)


def _offset(trials: Trials, candidate: TrialCandidate, index: int, grid: ValueGrid) -> float:
    """Return by how much the actor's value is larger in a clip that begins later, at a moment to which the actor has
    moved on.
    """
    built = trials.trial(candidate).built
    own = grid_of(built.mutant.changes[index]) if built is not None else None
    return float(own.now - grid.now) if own is not None else 0.0


def _same_place(change: m.Change, other: m.Change) -> bool:
    return (change.actor, change.property) == (other.actor, other.property)


def grid_of(change: m.Change) -> ValueGrid | None:
    """Return the values of a change; None if it changes no number."""
    was, now = change.was, change.now
    if not isinstance(was, m.Quantity) or not isinstance(now, m.Quantity) or was.dimension != now.dimension:
        return None
    before = was.value if was.unit == now.unit else Decimal(repr(round(was.si / UNITS[now.unit].to_si, 6)))
    return ValueGrid(change, before, now.value, STEPS.get(change.property, _STEP), now.unit)


def _with(candidate: TrialCandidate, index: int, change: m.Change) -> TrialCandidate:
    return replace(candidate, changes=(*candidate.changes[:index], change, *candidate.changes[index + 1 :]))


def _rounded(value: float) -> float:
    return round(value, 6) + 0.0
