"""Local search: changes near given ones, by the same operators on the same targets, a little nearer to the ego."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from numpy.random import Generator

from foresee_dsl.derive.operators import Operator, Situation
from foresee_dsl.derive.presets import Preset
from foresee_dsl.language.model import Change, Quantity

Plan = tuple[tuple[Operator, str], ...]
"""The operators of one child, each with its target."""
Gap = Callable[[tuple[Change, ...]], tuple[float, float]]
"""How near the roll-out of changes comes to the recorded ego."""
NEAR_OF = 32
"""So many draws of an operator are compared with the change that is given."""
NEAREST = 8
"""The nearest of these are near it. Ours: a quarter, so that a number moves by an eighth of its range at most, on
average."""


def near_changes(
    situation: Situation,
    preset: Preset,
    plan: Plan,
    given: tuple[Change, ...],
    rng: Generator,
    *,
    seen: Collection[tuple[Change, ...]],
    gap: Gap,
) -> tuple[tuple[str, ...], tuple[Change, ...]] | None:
    """Draw changes near given ones; None where there are none that were not `seen`.

    Of as many draws as the preset asks for, those whose roll-out comes nearest to the ego are taken.

    Returns:
        The names of the operators that make them, and the changes.
    """
    parts = [_alternatives(operator, target, given, situation, preset, rng) for operator, target in plan]
    names = tuple(operator.name for (operator, _), ways in zip(plan, parts, strict=True) if ways[0])
    found: dict[tuple[Change, ...], None] = {}
    for _ in range(2 * max(preset.draws, NEAREST)):
        changes = tuple(change for ways in parts for change in ways[int(rng.integers(len(ways)))])
        if changes != given and changes not in seen:
            found.setdefault(changes)
        if len(found) >= preset.draws:
            break
    return (names, min(found, key=gap)) if found else None


def _alternatives(
    operator: Operator, target: str, given: tuple[Change, ...], situation: Situation, preset: Preset, rng: Generator
) -> list[tuple[Change, ...]]:
    """Return what may stand in place of an operator's part of given changes: that part itself, and others near it.

    An operator may have a method `near(change, situation, preset, rng)` that draws a change near one of its own (None
    where there is none); of others the nearest of many draws are taken.
    """
    draws = [operator.changes(situation, target, preset, rng) for _ in range(NEAR_OF)]
    own = {(change.actor, change.property) for made in draws for change in made}
    part = tuple(change for change in given if (change.actor, change.property) in own)
    if not part:
        return [()]
    near = getattr(operator, "near", None)
    if near is not None:
        moved = [tuple(near(change, situation, preset, rng) or change for change in part) for _ in range(NEAREST)]
        return [part, *dict.fromkeys(made for made in moved if made != part)]
    others = [made for made in dict.fromkeys(draws) if made != part and _alike(made, part)]
    if not others:
        return [part]
    values = np.array([_numbers(made) for made in (part, *others)])
    spread = np.ptp(values, axis=0)
    far = (np.abs(values[1:] - values[0]) / np.where(spread > 0, spread, 1.0)).sum(axis=1)
    return [part, *(others[k] for k in np.argsort(far, kind="stable")[:NEAREST])]


def _alike(made: tuple[Change, ...], part: tuple[Change, ...]) -> bool:
    """Whether changes differ from others in numbers alone."""
    return [_words(change) for change in made] == [_words(change) for change in part]


def _words(change: Change) -> tuple[object, ...]:
    now = None if isinstance(change.now, Quantity) else change.now
    return change.actor, change.property, now, change.start is None, change.duration is None


def _numbers(changes: tuple[Change, ...]) -> list[float]:
    values = (value for change in changes for value in (change.now, change.start, change.duration))
    return [value.si for value in values if isinstance(value, Quantity)]
