"""What is certain about a condition before the run: whether it can hold at all, and whether it must."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written

TURNED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The opposite of a comparison."""
_NEVER_NEGATIVE = ("time", "speed", "eta", "ttc", "headway")


@dataclass(frozen=True)
class Limits:
    """What is known of a run: how long it lasts, and who takes part (a distance to an actor is never negative)."""

    end_s: float
    actors: frozenset[str]


def never(condition: m.Condition, limits: Limits) -> str:
    """Return why a condition cannot hold at any frame, or nothing when it may."""
    if isinstance(condition, m.Comparison):
        return _out_of_reach(condition, limits)
    if isinstance(condition, m.Not):
        return always(condition.condition, limits)
    if isinstance(condition, m.Both):
        reasons = (never(part, limits) for part in condition.conditions)
        return next((reason for reason in reasons if reason), "") or _contradiction(condition.conditions)
    if isinstance(condition, m.Either):
        found = [never(part, limits) for part in condition.conditions]
        return found[0] if all(found) else ""
    return _never_of_others(condition, limits)


def _never_of_others(condition: m.Condition, limits: Limits) -> str:
    if isinstance(condition, m.Sustained):
        before_s = -condition.since.si if isinstance(condition.since, m.Quantity) else 0.0
        if isinstance(condition.duration, m.Quantity) and condition.duration.si - before_s > limits.end_s:
            return f"the run lasts {limits.end_s:g} s"
        return never(condition.condition, limits)
    if isinstance(condition, m.Within) and isinstance(condition.distance, m.Quantity) and condition.distance.si < 0:
        return "a distance is never under 0 m"
    return ""


def always(condition: m.Condition, limits: Limits) -> str:
    """Return why a condition holds at every frame at which it is defined, or nothing when it may not."""
    if isinstance(condition, m.Comparison):
        return _out_of_reach(negated(condition), limits)
    if isinstance(condition, m.Not):
        return never(condition.condition, limits)
    if isinstance(condition, m.Both):
        found = [always(part, limits) for part in condition.conditions]
        return found[0] if all(found) else ""
    if isinstance(condition, m.Either):
        return next((reason for part in condition.conditions if (reason := always(part, limits))), "")
    return ""


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
    low, high = _range(left, limits)
    if holds_for_some(comparison.op, right.si, low, high):
        return ""
    if left.what == "time" and comparison.op in (">", ">="):
        return f"the run ends after {limits.end_s:g} s"
    return f"`{written(left)}` is never under 0"


def _range(measure: m.Measure, limits: Limits) -> tuple[float, float]:
    if measure.what == "time":
        return 0.0, limits.end_s
    apart = measure.what == "distance" and measure.other in limits.actors
    return (0.0 if apart or measure.what in _NEVER_NEGATIVE else -math.inf), math.inf


def _contradiction(conditions: Sequence[m.Condition]) -> str:
    """Return which two comparisons of one number exclude each other."""
    known = [c for c in _all_of(conditions) if isinstance(c.left, m.Measure) and isinstance(c.right, m.Quantity)]
    for k, one in enumerate(known):
        for other in known[:k]:
            if one.left == other.left and _exclude(one, other):
                return f"`{written(other)}` and `{written(one)}` exclude each other"
    return ""


def _all_of(conditions: Sequence[m.Condition]) -> Iterator[m.Comparison]:
    for condition in conditions:
        if isinstance(condition, m.Both):
            yield from _all_of(condition.conditions)
        elif isinstance(condition, m.Not) and isinstance(condition.condition, m.Comparison):
            yield negated(condition.condition)
        elif isinstance(condition, m.Comparison):
            yield condition


def _exclude(one: m.Comparison, other: m.Comparison) -> bool:
    upper, lower = (one, other) if one.op in ("<", "<=") else (other, one)
    if upper.op not in ("<", "<=") or lower.op not in (">", ">="):
        return False
    top, bottom = upper.right, lower.right
    if not isinstance(top, m.Quantity) or not isinstance(bottom, m.Quantity):
        return False
    return top.si < bottom.si or (top.si == bottom.si and (upper.op, lower.op) != ("<=", ">="))
