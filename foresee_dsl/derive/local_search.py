"""Local search: draws changes similar to those of an earlier mutant, by the same operators on the same targets, or the
same changes with less strength."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from numpy.random import Generator

from foresee_dsl.derive.operators import Operator, Situation
from foresee_dsl.derive.presets import MutationPreset
from foresee_dsl.language.model import Change, Quantity

Plan = tuple[tuple[Operator, str], ...]
"""The operators of one mutant, each with its target."""
Gap = Callable[[tuple[Change, ...]], tuple[float, float]]
"""A function that returns the smallest distances to the recorded ego when changes are rolled out, m: between
footprints, and between centres."""
NEAR_OF = 32
"""Number of values that an operator draws to find values near the original one. Ours."""
SHARES = (1.0, 0.9, 0.8)
"""If no operator of the plan draws the property of a change, the change is reduced to these shares of its strength.
Ours.
"""
SHIFTS_S = (0.0, -0.4, -0.2, 0.2, 0.4)
"""Shifts of the beginning of a change whose property no operator of the plan draws, s. Ours: the spread of a driver's
reaction times.
"""
NEAREST = 8
"""Number of the nearest draws that count as near. Ours: a quarter of `NEAR_OF`, so that on average a number moves by at
most an eighth of its range.
"""
WEAKER = (0.7, 0.5, 0.85)
"""Shares of the strength of a failing mutant's changes with which they are tried again, in this order. Ours: the middle
first, then the half in which the boundary of the failure lies is likely the upper one.
"""


def weaker_changes(original: tuple[Change, ...], turn: int) -> tuple[Change, ...] | None:
    """Return changes with a share of their strength (`WEAKER`, by turn); None if no change is a number, or if there is
    no such turn.
    """
    if turn >= len(WEAKER):
        return None
    changes = tuple(_weakened(change, WEAKER[turn]) for change in original)
    return changes if changes != original else None


def _weakened(change: Change, share: float) -> Change:
    if not isinstance(change.now, Quantity) or not isinstance(change.was, Quantity):
        return change
    value = change.was.si + share * (change.now.si - change.was.si)
    return change.model_copy(update={"now": Quantity.of(value, change.was.dimension, 2)})


def near_changes(
    situation: Situation,
    preset: MutationPreset,
    plan: Plan,
    original: tuple[Change, ...],
    rng: Generator,
    *,
    seen: Collection[tuple[Change, ...]],
    gap: Gap,
) -> tuple[tuple[str, ...], tuple[Change, ...]] | None:
    """Return changes near the original ones; None if all near changes were `seen`.

    Of `preset.draws` draws, the one whose roll-out comes nearest to the ego is returned. A change that no operator of
    the plan draws becomes weaker, or begins earlier or later.

    Returns:
        The names of the operators that draw the changes, and the changes.
    """
    parts = [_alternatives(operator, target, original, situation, preset, rng) for operator, target in plan]
    names = tuple(operator.name for (operator, _), ways in zip(plan, parts, strict=True) if ways[0])
    covered = {(change.actor, change.property) for ways in parts for change in ways[0]}
    parts += [[(c,), *_weaker_or_moved(c)] for c in original if (c.actor, c.property) not in covered]
    variants: dict[tuple[Change, ...], None] = {}
    for _ in range(2 * max(preset.draws, NEAREST)):
        changes = tuple(change for ways in parts for change in ways[int(rng.integers(len(ways)))])
        if changes and changes != original and changes not in seen:
            variants.setdefault(changes)
        if len(variants) >= preset.draws:
            break
    return (names, min(variants, key=gap)) if variants else None


def _weaker_or_moved(change: Change) -> list[tuple[Change, ...]]:
    """Return variants of a change that no operator draws.

    No variant is stronger than the change, because the search that proposed it stays within what people do.
    """
    if not isinstance(change.now, Quantity) or not isinstance(change.was, Quantity):
        return []
    now, variants = change.now, []
    for share in SHARES:
        value = _weakened(change, share).now
        for shift_s in SHIFTS_S if isinstance(change.start, Quantity) else (0.0,):
            start = change.start
            if isinstance(start, Quantity) and shift_s:
                if start.si + shift_s < 0:
                    continue
                start = Quantity.of(start.si + shift_s, "time", 2)
            variants.append(change.model_copy(update={"now": value if share < 1 else now, "start": start}))
    return [(variant,) for variant in dict.fromkeys(variants) if variant != change]


def _alternatives(
    operator: Operator,
    target: str,
    original: tuple[Change, ...],
    situation: Situation,
    preset: MutationPreset,
    rng: Generator,
) -> list[tuple[Change, ...]]:
    """Return an operator's part of the original changes, followed by variants near it.

    An operator may have a method `near(change, situation, preset, rng)` that draws a change near one of its own (None
    where there is none). For any other operator, the nearest of `NEAR_OF` draws are returned."""
    draws = [operator.changes(situation, target, preset, rng) for _ in range(NEAR_OF)]
    own = {(change.actor, change.property) for changes in draws for change in changes}
    part = tuple(change for change in original if (change.actor, change.property) in own)
    if not part:
        return [()]
    near = getattr(operator, "near", None)
    if near is not None:
        moved = [tuple(near(change, situation, preset, rng) or change for change in part) for _ in range(NEAREST)]
        return [part, *dict.fromkeys(changes for changes in moved if changes != part)]
    others = [changes for changes in dict.fromkeys(draws) if changes != part and _alike(changes, part)]
    if not others:
        return [part]
    values = np.array([_numbers(changes) for changes in (part, *others)])
    spread = np.ptp(values, axis=0)
    far = (np.abs(values[1:] - values[0]) / np.where(spread > 0, spread, 1.0)).sum(axis=1)
    return [part, *(others[k] for k in np.argsort(far, kind="stable")[:NEAREST])]


def _alike(changes: tuple[Change, ...], part: tuple[Change, ...]) -> bool:
    """Return whether two tuples of changes differ only in their numbers."""
    return [_words(change) for change in changes] == [_words(change) for change in part]


def _words(change: Change) -> tuple[object, ...]:
    now = None if isinstance(change.now, Quantity) else change.now
    return change.actor, change.property, now, change.start is None, change.duration is None


def _numbers(changes: tuple[Change, ...]) -> list[float]:
    values = (value for change in changes for value in (change.now, change.start, change.duration))
    return [value.si for value in values if isinstance(value, Quantity)]
