"""What is certain about conditions before the run: what can or must hold, and which expectation implies another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written

TURNED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The opposite of a comparison."""
_NEVER_NEGATIVE = ("time", "speed", "eta", "ttc", "headway")


@dataclass(frozen=True)
class Limits:
    """What is known of a run: how long it lasts, and its actors (the distance to an actor is never negative)."""

    end_s: float
    actors: frozenset[str]


def never(condition: m.Condition, limits: Limits) -> str:
    """Return why a condition cannot hold at any frame, or nothing when it may."""
    reason = ""
    match condition:
        case m.Comparison():
            reason = _out_of_reach(condition, limits)
        case m.Not():
            reason = always(condition.condition, limits)
        case m.Both(conditions=parts):
            reason = next(filter(None, (never(part, limits) for part in parts)), "") or _contradiction(parts)
        case m.Either(conditions=parts):
            reason = _of_all(never(part, limits) for part in parts)
        case m.Sustained(since=since, duration=duration):
            before_s = -since.si if isinstance(since, m.Quantity) else 0.0
            if isinstance(duration, m.Quantity) and duration.si - before_s > limits.end_s:
                return f"the run lasts {limits.end_s:g} s"
            reason = never(condition.condition, limits)
        case m.Within(distance=m.Quantity() as distance) if distance.si < 0:
            reason = "a distance is never under 0 m"
    return reason


def always(condition: m.Condition, limits: Limits) -> str:
    """Return why a condition holds at every frame at which it is defined, or nothing when it may not."""
    match condition:
        case m.Comparison():
            return _out_of_reach(negated(condition), limits)
        case m.Not():
            return never(condition.condition, limits)
        case m.Both(conditions=parts):
            return _of_all(always(part, limits) for part in parts)
        case m.Either(conditions=parts):
            return next(filter(None, (always(part, limits) for part in parts)), "")
    return ""


def _of_all(reasons: Iterable[str]) -> str:
    """Return the first reason where there is one for every part, or nothing."""
    found = list(reasons)
    return found[0] if all(found) else ""


def negated(comparison: m.Comparison) -> m.Comparison:
    """Return the comparison that holds where this one does not."""
    return comparison.model_copy(update={"op": TURNED[comparison.op]})


def holds_for_some(op: str, value: float, low: float, high: float) -> bool:
    """Return whether some number from `low` to `high` (both included) satisfies `number op value`."""
    return {"<": low < value, "<=": low <= value, ">": high > value, ">=": high >= value}[op]


def _out_of_reach(comparison: m.Comparison, limits: Limits) -> str:
    left, right = comparison.left, comparison.right
    if not isinstance(left, m.Measure) or not isinstance(right, m.Quantity):
        return ""
    never_negative = left.what in _NEVER_NEGATIVE or (left.what == "distance" and left.other in limits.actors)
    low, high = 0.0 if never_negative else -math.inf, limits.end_s if left.what == "time" else math.inf
    if holds_for_some(comparison.op, right.si, low, high):
        return ""
    if left.what == "time" and comparison.op in (">", ">="):
        return f"the run ends after {limits.end_s:g} s"
    return f"`{written(left)}` is never under 0"


def _contradiction(conditions: Sequence[m.Condition]) -> str:
    """Return which two comparisons of one number exclude each other."""
    known = [c for c in _all_of(conditions) if isinstance(c.left, m.Measure) and isinstance(c.right, m.Quantity)]
    pairs = ((one, other) for k, one in enumerate(known) for other in known[:k])
    found = ((one, other) for one, other in pairs if one.left == other.left and _exclude(one, other))
    return next((f"`{written(other)}` and `{written(one)}` exclude each other" for one, other in found), "")


def _all_of(conditions: Sequence[m.Condition]) -> Iterator[m.Comparison]:
    for condition in conditions:
        if isinstance(condition, m.Both):
            yield from _all_of(condition.conditions)
        elif isinstance(condition, m.Not) and isinstance(condition.condition, m.Comparison):
            yield negated(condition.condition)
        elif isinstance(condition, m.Comparison):
            yield condition


def _exclude(one: m.Comparison, other: m.Comparison) -> bool:
    upper, lower = (one, other) if one.op[0] == "<" else (other, one)
    top, bottom = upper.right, lower.right
    if upper.op[0] == lower.op[0] or not isinstance(top, m.Quantity) or not isinstance(bottom, m.Quantity):
        return False
    return top.si < bottom.si or (top.si == bottom.si and (upper.op, lower.op) != ("<=", ">="))


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
