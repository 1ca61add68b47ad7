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
SHARES = (1.0, 0.9, 0.8)
"""A change that no operator makes is near one of this share of its strength. Ours."""
SHIFTS_S = (0.0, -0.4, -0.2, 0.2, 0.4)
"""And near one that begins so much later. Ours: what a driver's reaction times differ by."""
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

    Of as many draws as the preset asks for, those whose roll-out comes nearest to the ego are taken. What no operator
    of the plan makes becomes weaker, or begins earlier or later.

    Returns:
        The names of the operators that make them, and the changes.
    """
    parts = [_alternatives(operator, target, given, situation, preset, rng) for operator, target in plan]
    names = tuple(operator.name for (operator, _), ways in zip(plan, parts, strict=True) if ways[0])
    made = {(change.actor, change.property) for ways in parts for change in ways[0]}
    parts += [[(c,), *_weaker_or_moved(c)] for c in given if (c.actor, c.property) not in made]
    found: dict[tuple[Change, ...], None] = {}
    for _ in range(2 * max(preset.draws, NEAREST)):
        changes = tuple(change for ways in parts for change in ways[int(rng.integers(len(ways)))])
        if changes and changes != given and changes not in seen:
            found.setdefault(changes)
        if len(found) >= preset.draws:
            break
    return (names, min(found, key=gap)) if found else None


def _weaker_or_moved(change: Change) -> list[tuple[Change, ...]]:
    """Return changes near one that no operator makes: never stronger than it, as its search bounds what people do."""
    if not isinstance(change.now, Quantity) or not isinstance(change.was, Quantity):
        return []
    now, was, found = change.now, change.was, []
    for share in SHARES:
        value = Quantity.of(was.si + share * (now.si - was.si), was.dimension, 2)
        for shift_s in SHIFTS_S if isinstance(change.start, Quantity) else (0.0,):
            start = change.start
            if isinstance(start, Quantity) and shift_s:
                if start.si + shift_s < 0:
                    continue
                start = Quantity.of(start.si + shift_s, "time", 2)
            found.append(change.model_copy(update={"now": value if share < 1 else now, "start": start}))
    return [(one,) for one in dict.fromkeys(found) if one != change]


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
