"""Which expectation implies another; comparisons and their opposites."""

from __future__ import annotations

import math

from foresee_dsl.language import model as m

TURNED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The opposite of a comparison."""


def negated(comparison: m.Comparison) -> m.Comparison:
    """Return the comparison that holds where this one does not."""
    return comparison.model_copy(update={"op": TURNED[comparison.op]})


def holds_for_some(op: str, value: float, low: float, high: float) -> bool:
    """Return whether some number from `low` to `high` (both included) satisfies `number op value`."""
    return {"<": low < value, "<=": low <= value, ">": high > value, ">=": high >= value}[op]


def weaker(old: m.Expect, new: m.Expect) -> bool | None:
    """Say whether `new` is easier to meet than `old`.

    True: every run that meets the old one meets the new one, and not the other way round. False: it is as hard, or
    harder. None: unknown (another measure, another actor, parameters).
    """
    if implies(new, old):
        return False
    return True if implies(old, new) else None


def implies(one: m.Expect, other: m.Expect) -> bool:
    """Return whether it can be shown that a run that meets `one` meets `other`."""
    first, second = _until(one), _until(other)
    if first is None or second is None:
        return False
    if one.mode == "eventually":
        return other.mode == "eventually" and first <= second and _follows(one.condition, other.condition)
    if other.mode != "eventually" and first < second:
        return False  # what holds for a shorter time says nothing of the rest
    return _follows(*(m.Not(condition=e.condition) if e.mode == "never" else e.condition for e in (one, other)))


def _until(expect: m.Expect) -> float | None:
    """The last moment that counts, in s; None when a parameter says so."""
    if expect.within is None:
        return math.inf
    return expect.within.si if isinstance(expect.within, m.Quantity) else None


def _follows(one: m.Condition, other: m.Condition) -> bool:
    """Return whether it can be shown that where `one` holds `other` holds."""
    return _implies(_plain(one), _plain(other))


def _implies(one: m.Condition, other: m.Condition) -> bool:
    """The same, of conditions with `not` only in front of what has no parts."""
    if one == other:
        return True
    if isinstance(one, m.Either):
        return all(_implies(part, other) for part in one.conditions)
    if isinstance(other, m.Both):
        return all(_implies(one, part) for part in other.conditions)
    if isinstance(one, m.Both) and any(_implies(part, other) for part in one.conditions):
        return True
    if isinstance(other, m.Either):
        return any(_implies(one, part) for part in other.conditions)
    return _simple(one, other)


def _simple(one: m.Condition, other: m.Condition) -> bool:
    if isinstance(one, m.Not) and isinstance(other, m.Not):
        return _simple(other.condition, one.condition)
    if isinstance(one, m.Comparison) and isinstance(other, m.Comparison):
        return _tighter(one, other)
    if isinstance(one, m.Sustained):
        if not isinstance(other, m.Sustained):
            return _follows(one.condition, other)
        same = one.since == other.since
        return same and _at_most(other.duration, one.duration) and _follows(one.condition, other.condition)
    if isinstance(one, m.Within) and isinstance(other, m.Within):
        same = one.actor == other.actor and one.of == other.of
        return same and _at_most(one.distance, other.distance)
    return one == other


def _tighter(one: m.Comparison, other: m.Comparison) -> bool:
    """`ttc(a, b) > 2 s` implies `ttc(a, b) >= 1 s`."""
    if one.left != other.left or one.op[0] != other.op[0]:
        return False
    if not isinstance(one.right, m.Quantity) or not isinstance(other.right, m.Quantity):
        return False
    if one.right.si == other.right.si:
        return one.op == other.op or "=" not in one.op
    return (one.right.si < other.right.si) == (one.op[0] == "<")


def _at_most(one: m.Value, other: m.Value) -> bool:
    if isinstance(one, m.Quantity) and isinstance(other, m.Quantity):
        return one.si <= other.si
    return one == other


def _plain(condition: m.Condition, turned: bool = False) -> m.Condition:
    """Move every `not` inwards, until it stands in front of what has no parts."""
    if isinstance(condition, m.Not):
        return _plain(condition.condition, not turned)
    if isinstance(condition, m.Both | m.Either):
        parts = tuple(_plain(part, turned) for part in condition.conditions)
        both = isinstance(condition, m.Both) is not turned
        return m.Both(conditions=parts) if both else m.Either(conditions=parts)
    if not turned:
        return condition
    if isinstance(condition, m.Comparison):
        return negated(condition)
    return m.Not(condition=condition)
