"""Finds conditions whose result is certain before the run, because they never or always hold, and states the reason."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from foresee_dsl.language import model as m
from foresee_dsl.language.lints.arithmetic import interval_of_param
from foresee_dsl.language.logic import holds_for_some, implies_comparison, negated
from foresee_dsl.language.printer import value_text, written

_NEVER_NEGATIVE = ("time", "eta", "ttc", "ttc_along", "headway", "lateral")
_WIDEST_LANE_M = 10.0
"""Width of the widest lane that a road can have, m: an actor's offset from the middle of its lane is at most half of
this width."""
_SLACK = 1.02
"""Speeds up to this multiple of the model's maximum are attributed to rounding (ours; the simulation never exceeds the
maximum)."""


@dataclass(frozen=True)
class About:
    """What the lints know about an actor before the run.

    Attributes:
        moves: True if it has a route, a path or a track.
        top_mps: maximum speed of its model, m/s; None if the catalogue does not give it.
        model: name of its model.
        length_m: diagonal of its footprint, m; infinite if unknown.
        junctions: junctions that it may reach or start at; None if unknown.
        backwards: True if it may drive backwards, with a speed below 0.
    """

    moves: bool = True
    top_mps: float | None = None
    model: str = ""
    length_m: float = math.inf
    junctions: frozenset[str] | None = None
    backwards: bool = False


@dataclass(frozen=True)
class Limits:
    """What the lints know about a run before it starts: its duration in s and its actors; for requirements, also the
    scenario's parameters."""

    end_s: float
    actors: Mapping[str, About] = field(default_factory=dict)
    parameters: Mapping[str, m.Param] = field(default_factory=dict)


def never(condition: m.Condition, limits: Limits) -> str:
    """Return the reason why a condition cannot hold in any frame; an empty text if it may hold."""
    match condition:
        case m.Comparison():
            reason = _out_of_reach(condition, limits)
        case m.Equals():
            reason = _no_option(condition, limits)
        case m.Not():
            reason = always(condition.condition, limits)
        case m.Both(conditions=parts):
            reason = next(filter(None, (never(part, limits) for part in parts)), "") or _contradiction(parts)
        case m.Either(conditions=parts):
            reason = _of_all(never(part, limits) for part in parts)
        case m.Sustained():
            reason = _too_long(condition, limits) or never(condition.condition, limits)
        case m.Within(distance=m.Quantity() as distance) if distance.si < 0:
            reason = "a distance is never below 0 m"
        case _:
            reason = _cannot_concern(condition, limits)
    return reason


def always(condition: m.Condition, limits: Limits) -> str:
    """Return why a condition holds in every frame in which it is defined; an empty text if it may fail in one."""
    match condition:
        case m.Comparison():
            return _out_of_reach(negated(condition), limits)
        case m.Equals(left=m.Ref(name=name), right=word) if _options(limits.parameters.get(name)) == {word}:
            return f"'{name}' has no other value"
        case m.Not():
            return never(condition.condition, limits)
        case m.Both(conditions=parts):
            return _of_all(always(part, limits) for part in parts)
        case m.Either(conditions=parts):
            return next(filter(None, (always(part, limits) for part in parts)), "") or _no_way_out(parts)
    return ""


def earliest_s(condition: m.Condition) -> float:
    """Return a time before which a condition certainly does not hold, s."""
    match condition:
        case m.Comparison(left=m.Measure(what="time"), op=">" | ">=", right=m.Quantity() as right):
            return right.si
        case m.Both(conditions=parts):
            return max(earliest_s(part) for part in parts)
        case m.Either(conditions=parts):
            return min(earliest_s(part) for part in parts)
        case m.Sustained(duration=m.Quantity() as duration, since=None):
            return earliest_s(condition.condition) + duration.si
    return 0.0


def _of_all(reasons: Iterable[str]) -> str:
    """Return the first reason if every part of a condition has a reason; otherwise an empty text."""
    listed = list(reasons)
    return listed[0] if all(listed) else ""


def _too_long(condition: m.Sustained, limits: Limits) -> str:
    since, duration = condition.since, condition.duration
    before_s = -since.si if isinstance(since, m.Quantity) else 0.0
    late = isinstance(duration, m.Quantity) and duration.si - before_s > limits.end_s
    return f"the run lasts {limits.end_s:g} s" if late else ""


def _cannot_concern(condition: m.Condition, limits: Limits) -> str:
    """Return the reason why a fact cannot be true of its actor; an empty text if it can."""
    about = limits.actors.get(getattr(condition, "actor", None) or "")
    if about is None:
        return ""
    if not about.moves and (why := _needs_to_move(condition)):
        return why
    match condition:
        case m.InJunction(junction=str(junction)) | m.RunsRed(junction=str(junction)) | m.YieldsAt(junction=junction):
            if about.junctions is not None and junction not in about.junctions:
                return f"the route of '{condition.actor}' does not go over '{junction}'"
        case m.Ahead() | m.Behind() | m.SameLane() | m.Sees() | m.InSight() | m.YieldsAtCrossing():
            if condition.actor == condition.other:
                return f"'{condition.actor}' is compared with itself"
    return ""


def _needs_to_move(condition: m.Condition) -> str:
    """Return the reason why a fact cannot be true of an actor that stands; an empty text if it can."""
    match condition:
        case m.Predicate(what="arrived", actor=actor):
            return f"'{actor}' has no route or path, so it never arrives"
        case m.Shows(actor=actor):
            return f"'{actor}' has no route or path, so no signal applies to it"
        case m.RunsRed() | m.YieldsAtCrossing() | m.YieldsAt():
            return f"'{condition.actor}' has no route, so no rule of a junction applies to it"
    return ""


# ---- ranges ---------------------------------------------------------------------------------------------------------


def _out_of_reach(comparison: m.Comparison, limits: Limits) -> str:
    left, right = comparison.left, comparison.right
    if isinstance(left, m.Ref):
        return _out_of_range(comparison, left, limits)
    if not isinstance(left, m.Measure) or not isinstance(right, m.Quantity):
        return ""
    low, high, why = _range(left, limits)
    if holds_for_some(comparison.op, right.si, low, high):
        return ""
    if left.what == "time" and comparison.op in (">", ">="):
        return f"the run ends after {limits.end_s:g} s"
    if comparison.op in (">", ">="):
        return f"`{written(left)}` is never above {why}"
    return f"`{written(left)}` is never below {low:g}{' m' if low and left.what != 'relative_speed' else ''}"


def _range(left: m.Measure, limits: Limits) -> tuple[float, float, str]:
    """Return the smallest and the largest value that a measure can have, SI, and the largest in words."""
    actor, other = limits.actors.get(left.actor or ""), limits.actors.get(str(left.other or ""))
    backwards = actor is not None and actor.backwards
    not_negative = _NEVER_NEGATIVE if backwards else (*_NEVER_NEGATIVE, "speed")
    low = 0.0 if left.what in not_negative or (left.what == "distance" and other is not None) else -math.inf
    high, why = math.inf, ""
    if left.what == "time":
        high = limits.end_s
    elif left.what == "speed" and actor is not None:
        top = 0.0 if not actor.moves else actor.top_mps
        if top is not None:
            fastest = f"{top * 3.6:.4g} km/h, the maximum of {actor.model}"
            high, why = top * _SLACK, fastest if top else "0: it never moves"
    elif left.what == "offset":
        low, high, why = -_WIDEST_LANE_M / 2, _WIDEST_LANE_M / 2, f"{_WIDEST_LANE_M / 2:g} m, half of the widest lane"
    elif left.what == "overlap" and actor is not None and other is not None:
        high = min(actor.length_m, other.length_m)
        why = f"{high:.2f} m, the length of the shorter one"
    elif left.what == "relative_speed" and actor is not None and other is not None:
        tops = [0.0 if not a.moves else a.top_mps for a in (actor, other)]
        if None not in tops:
            high = sum(top or 0.0 for top in tops) * _SLACK
            low, why = -high if backwards else -(tops[1] or 0.0) * _SLACK, "the sum of both maximum speeds"
    return low, high, why


def _out_of_range(comparison: m.Comparison, left: m.Ref, limits: Limits) -> str:
    """Return the reason why a requirement excludes every value of its parameter; an empty text if it does not."""
    parameter, right = limits.parameters.get(left.name), comparison.right
    other = limits.parameters.get(right.name) if isinstance(right, m.Ref) else None
    mine = interval_of_param(parameter) if parameter is not None else None
    theirs = interval_of_param(other) if other is not None else None
    if isinstance(right, m.Quantity):
        theirs = right.si, right.si
    if parameter is None or mine is None or theirs is None:
        return ""
    bound = theirs[1] if comparison.op[0] == "<" else theirs[0]
    if holds_for_some(comparison.op, bound, *mine):
        return ""
    options = ", ".join(sorted(map(value_text, parameter.options or ())))
    values = written(parameter.range) if parameter.range is not None else options
    return f"'{left.name}' can be {values}"


def _no_option(condition: m.Equals, limits: Limits) -> str:
    name = condition.left.name
    options = _options(limits.parameters.get(name))
    if not options or condition.right in options:
        return ""
    return f"'{name}' can be {', '.join(sorted(options))}"


def _options(parameter: m.Param | None) -> set[str]:
    return {option for option in parameter.options or () if isinstance(option, str)} if parameter is not None else set()


# ---- parts that exclude each other ----------------------------------------------------------------------------------


def _contradiction(conditions: Sequence[m.Condition]) -> str:
    """Return in words which two parts of a condition exclude each other; an empty text if none do."""
    facts = list(_all_of(conditions))
    pairs = ((first, second) for k, first in enumerate(facts) for second in facts[:k])
    excluding = ((first, second) for first, second in pairs if _exclude(first, second))
    return next((f"`{written(second)}` and `{written(first)}` exclude each other" for first, second in excluding), "")


def _no_way_out(conditions: Sequence[m.Condition]) -> str:
    """Return in words which two parts of an `or` cover every possibility; an empty text if none do."""
    facts = [c for c in conditions if not isinstance(c, m.Not)]
    opposites = (c.condition for c in conditions if isinstance(c, m.Not) and c.condition in facts)
    return next((f"`{written(c)}` either holds or does not hold" for c in opposites), "")


def _all_of(conditions: Sequence[m.Condition]) -> Iterator[m.Condition]:
    for condition in conditions:
        if isinstance(condition, m.Both):
            yield from _all_of(condition.conditions)
        elif isinstance(condition, m.Not) and isinstance(condition.condition, m.Comparison):
            yield negated(condition.condition)
        else:
            yield condition


def _exclude(left: m.Condition, right: m.Condition) -> bool:
    if isinstance(left, m.Not) or isinstance(right, m.Not):
        inner, outer = (left.condition, right) if isinstance(left, m.Not) else (right.condition, left)  # type: ignore[union-attr]
        return inner == outer
    first, second = _compared(left), _compared(right)
    if first is not None and second is not None:
        return implies_comparison(first, negated(second))
    if isinstance(left, m.Shows) and isinstance(right, m.Shows):
        same = (left.actor, left.junction) == (right.actor, right.junction)
        return same and left.state != right.state and isinstance(left.state, str) and isinstance(right.state, str)
    if isinstance(left, m.InLane) and isinstance(right, m.InLane):
        numbers = isinstance(left.number, m.Quantity) and isinstance(right.number, m.Quantity)
        return numbers and (left.actor, left.road) == (right.actor, right.road) and left.number != right.number
    kinds = {type(left), type(right)}
    return kinds == {m.Ahead, m.Behind} and _pair(left) == _pair(right)


def _pair(condition: m.Condition) -> tuple[str, str]:
    return getattr(condition, "actor", ""), getattr(condition, "other", "")


def _compared(condition: m.Condition) -> m.Comparison | None:
    """Return a condition as a comparison of a measure with a number, also `a within 5 m of b`; None for any other
    condition."""
    if isinstance(condition, m.Within) and isinstance(condition.of, m.Named):
        left = m.Measure(what="distance", actor=condition.actor, other=condition.of.name)
        condition = m.Comparison(left=left, op="<=", right=condition.distance)
    if not isinstance(condition, m.Comparison) or not isinstance(condition.right, m.Quantity):
        return None
    return condition if isinstance(condition.left, m.Measure) else None
