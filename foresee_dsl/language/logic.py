"""Logic of conditions: joins truths of parts, negates comparisons, decides whether an expectation implies another."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from types import MappingProxyType

from foresee_dsl.language import model as m

TURNED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The opposite of each comparison."""
_COMPARES: MappingProxyType[str, Callable[[float, float], bool]] = MappingProxyType(
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
)


def negated(comparison: m.Comparison) -> m.Comparison:
    """Return the opposite comparison."""
    return comparison.model_copy(update={"op": TURNED[comparison.op]})


def holds_for_some(op: str, value: float, low: float, high: float) -> bool:
    """Return whether some number from `low` to `high` (both included) satisfies `number op value`."""
    return compares(op, low if op[0] == "<" else high, value)


def compares(op: str, first: float, second: float) -> bool:
    """Return whether `first op second` holds."""
    return _COMPARES[op](first, second)


def truth(condition: m.Condition, leaf: Callable[[m.Condition], bool | None]) -> bool | None:
    """Return whether a condition holds; None if its parts do not determine that.

    `leaf` returns whether a part other than `not`, `and` and `or` holds; None if that is unknown.
    """
    match condition:
        case m.Not(condition=inner):
            held = truth(inner, leaf)
            return None if held is None else not held
        case m.Both(conditions=several) | m.Either(conditions=several):
            decides, results = isinstance(condition, m.Either), {truth(part, leaf) for part in several}
            return decides if decides in results else None if None in results else not decides
    return leaf(condition)


def weaker(old: m.Expect, new: m.Expect) -> bool | None:
    """Return whether `new` is easier to meet than `old`.

    True: every run that meets the old one meets the new one, but not the other way round. False: the new one is as
    hard, or harder. None: unknown (another measure, another actor, parameters).
    """
    if implies(new, old):
        return False
    return True if implies(old, new) else None


def implies(premise: m.Expect, conclusion: m.Expect) -> bool:
    """Return whether every run that meets `premise` provably meets `conclusion`."""
    first, second = _until(premise), _until(conclusion)
    if first is None or second is None:
        return False
    if premise.mode == "eventually":
        return conclusion.mode == "eventually" and first <= second and _follows(premise.condition, conclusion.condition)
    if conclusion.mode != "eventually" and first < second:
        return False  # a condition that holds for a shorter time need not hold for the longer one
    return _follows(
        *(m.Not(condition=e.condition) if e.mode == "never" else e.condition for e in (premise, conclusion))
    )


def _until(expect: m.Expect) -> float | None:
    """Return the last moment at which an expectation is judged, s; None if a parameter determines it."""
    if expect.within is None:
        return math.inf
    return expect.within.si if isinstance(expect.within, m.Quantity) else None


def _follows(premise: m.Condition, conclusion: m.Condition) -> bool:
    """Return whether `premise` provably implies `conclusion`."""
    return _implies(_plain(premise), _plain(conclusion))


def _implies(premise: m.Condition, conclusion: m.Condition) -> bool:
    """Return the result of `_follows` for conditions in which `not` stands only in front of conditions without
    parts."""
    if premise == conclusion:
        return True
    if isinstance(premise, m.Either):
        return all(_implies(part, conclusion) for part in premise.conditions)
    if isinstance(conclusion, m.Both):
        return all(_implies(premise, part) for part in conclusion.conditions)
    if isinstance(premise, m.Both) and any(_implies(part, conclusion) for part in premise.conditions):
        return True
    if isinstance(conclusion, m.Either):
        return any(_implies(premise, part) for part in conclusion.conditions)
    return _simple(premise, conclusion)


def _simple(premise: m.Condition, conclusion: m.Condition) -> bool:
    if isinstance(premise, m.Not) and isinstance(conclusion, m.Not):
        return _simple(conclusion.condition, premise.condition)
    if isinstance(premise, m.Comparison) and isinstance(conclusion, m.Comparison):
        return implies_comparison(premise, conclusion)
    if isinstance(premise, m.Sustained):
        if not isinstance(conclusion, m.Sustained):
            return _follows(premise.condition, conclusion)
        same = premise.since == conclusion.since
        return (
            same
            and _at_most(conclusion.duration, premise.duration)
            and _follows(premise.condition, conclusion.condition)
        )
    if isinstance(premise, m.Within) and isinstance(conclusion, m.Within):
        same = premise.actor == conclusion.actor and premise.of == conclusion.of
        return same and _at_most(premise.distance, conclusion.distance)
    return premise == conclusion


def implies_comparison(premise: m.Comparison, conclusion: m.Comparison) -> bool:
    """Return whether one comparison implies another: `ttc(a, b) > 2 s` implies `ttc(a, b) >= 1 s`."""
    if premise.left != conclusion.left or premise.op[0] != conclusion.op[0]:
        return False
    if not isinstance(premise.right, m.Quantity) or not isinstance(conclusion.right, m.Quantity):
        return False
    if premise.right.si == conclusion.right.si:
        return premise.op == conclusion.op or "=" not in premise.op
    return (premise.right.si < conclusion.right.si) == (premise.op[0] == "<")


def _at_most(small: m.Value, large: m.Value) -> bool:
    if isinstance(small, m.Quantity) and isinstance(large, m.Quantity):
        return small.si <= large.si
    return small == large


def _plain(condition: m.Condition, turned: bool = False) -> m.Condition:
    """Return a condition with every `not` moved inwards, in front of conditions without parts."""
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
