"""Says a condition again for a window that begins in the middle of a run.

Times count from the window's beginning, what is known of actors that are gone is worked in, and a `for` that had begun
goes on with what is left of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from foresee_dsl.language.concrete import si_of
from foresee_dsl.language.conditions import mentioned, parts
from foresee_dsl.language.model import (
    Both,
    Comparison,
    Condition,
    Either,
    Measure,
    Not,
    Point,
    Predicate,
    Quantity,
    Sustained,
    Within,
)
from foresee_dsl.language.phrases import place as text_of
from foresee_dsl.simulate.trace import STEP_S

Said = Condition | bool
"""A condition, or what it is known to be from the window's beginning on."""


@dataclass(frozen=True)
class Moment:
    """The beginning of a window.

    Attributes:
        time_s: in the run.
        gone: actors that have left.
        places: where the places on routes are, by their text: a route begins elsewhere now.
    """

    time_s: float
    gone: frozenset[str]
    places: Mapping[str, Point]


def restated(
    condition: Condition, moment: Moment, since: Mapping[int, float] | None = None, *, short: bool = False
) -> Said:
    """Return a condition as the window has to say it, exact to the frame.

    Args:
        condition: as its author wrote it.
        moment: the window's beginning.
        since: since when what a `for` is about holds, s in the run, by the place of the `for` among the condition's
            `parts`; absent where it does not hold. None for a condition that nobody has looked at yet.
        short: it only matters when the condition begins to hold, not at which frames after that; then a `for` that
            is all of it, or one side of an `or`, has a short text. What it says is true at one frame and then too
            early to say, which is not false: an `every` does not fire again.
    """
    return _Teller(moment, since).tell(condition, 0, positive=True, short=short)


class _Teller:
    def __init__(self, moment: Moment, since: Mapping[int, float] | None) -> None:
        self._moment, self._since = moment, since

    def tell(self, condition: Condition, number: int, *, positive: bool, short: bool) -> Said:
        """Say a part; `positive`: it stands under an even number of `not`."""
        if isinstance(condition, Not):
            inner = self.tell(condition.condition, number + 1, positive=not positive, short=False)
            return not inner if isinstance(inner, bool) else Not(condition=inner)
        if isinstance(condition, Sustained):
            return self._sustained(condition, number, positive=positive, short=short)
        if isinstance(condition, Both | Either):
            found, after = [], number + 1
            for part in condition.conditions:
                found.append(self.tell(part, after, positive=positive, short=short and isinstance(condition, Either)))
                after += sum(1 for _ in parts(part))
            return both(*found) if isinstance(condition, Both) else either(*found)
        return self._fact(condition, positive=positive)

    def _fact(self, condition: Condition, *, positive: bool) -> Said:
        if isinstance(condition, Within):
            point = self._moment.places.get(_place(condition))
            condition = condition if point is None else condition.model_copy(update={"of": point})
        if mentioned(condition) & self._moment.gone:
            if isinstance(condition, Predicate):
                return condition.what == "arrived"  # who has left has; it touches nobody
            return not positive  # it will never be said, so that it never makes the whole true
        if isinstance(condition, Comparison) and isinstance(condition.left, Measure) and condition.left.what == "time":
            return self._time(condition)
        return condition

    def _time(self, condition: Comparison) -> Said:
        left_s = si_of(condition.right) - self._moment.time_s
        if left_s < -1e-9 or (abs(left_s) <= 1e-9 and condition.op in (">=", "<")):
            return condition.op[0] == ">"
        return condition.model_copy(update={"right": seconds(left_s)})

    def _sustained(self, condition: Sustained, number: int, *, positive: bool, short: bool) -> Said:
        asked = _frames(si_of(condition.duration))
        inner = self.tell(condition.condition, number + 1, positive=positive, short=False)
        begun_s = None if self._since is None else self._since.get(number)
        held = 0 if begun_s is None else round((self._moment.time_s - begun_s) / STEP_S)
        left = max(asked - held, 0)
        if isinstance(inner, bool):
            if not inner or not left:
                return inner
            return at_least(left) if begun_s is not None else inner
        whole = condition.model_copy(update={"condition": inner})
        if held and short and not left:
            return whole  # an `every` that has fired: this is too early to say, which is not false, until it breaks
        if held and short:
            return Either(conditions=(Both(conditions=(_for(inner, left), before(left + 1))), whole))
        said = either(*_since_the_beginning(inner, left, asked), whole) if held else whole
        if positive or begun_s is None or begun_s <= 0:
            return said
        # Under `not`: before that it did not hold, so that until then it is false, and not only too early to say.
        return both(at_least(left), said) if left else said


def _since_the_beginning(inner: Condition, left: int, asked: int) -> list[Condition]:
    """Say "it has held since the window's beginning, and at least `left` frames of it", up to frame `asked`.

    `inner for b` at frame b says so for this frame. That this was so at frame b, seen from up to b frames later, is
    `not (not THAT) for b`; together with `inner for b` it says so up to frame 2b. Then the same again with 2b.
    """
    found: list[Condition] = []
    if not left:
        found.append(Both(conditions=(inner, before(1))))
    span = max(left, 1)
    then = Both(conditions=(_for(inner, span), before(span + 1)))
    while True:
        was_then = Not(condition=_for(Not(condition=then), span))
        up_to_twice = Both(conditions=(_for(inner, span), was_then))
        found.append(up_to_twice)
        if 2 * span + 1 >= asked:
            return found
        then = Both(conditions=(up_to_twice, at_least(2 * span)))
        span *= 2


def both(*conditions: Said) -> Said:
    """Return `and`, worked out as far as it is known."""
    left = tuple(c for c in conditions if not isinstance(c, bool))
    if not all(c for c in conditions if isinstance(c, bool)):
        return False
    return Both(conditions=left) if len(left) > 1 else (left[0] if left else True)


def either(*conditions: Said) -> Said:
    """Return `or`, worked out as far as it is known."""
    left = tuple(c for c in conditions if not isinstance(c, bool))
    if any(c for c in conditions if isinstance(c, bool)):
        return True
    return Either(conditions=left) if len(left) > 1 else (left[0] if left else False)


def before(frames: int) -> Comparison:
    """Return `time < TIME`."""
    return Comparison(left=Measure(what="time"), op="<", right=seconds(frames * STEP_S))


def at_least(frames: int) -> Comparison:
    """Return `time >= TIME`."""
    return Comparison(left=Measure(what="time"), op=">=", right=seconds(frames * STEP_S))


def seconds(value: float) -> Quantity:
    """Return a time with two decimals, which hold every multiple of the step exactly, or more where it needs them."""
    return Quantity.of(value, "time", 2 if abs(round(value, 2) - value) < 1e-7 else 6)


def _for(condition: Condition, frames: int) -> Sustained:
    return Sustained(condition=condition, duration=seconds(frames * STEP_S))


def _frames(time_s: float) -> int:
    """Return how many steps a time takes, as `simulate.watch` counts them."""
    return max(0, math.ceil(time_s / STEP_S - 1e-6))


def _place(condition: Within) -> str:
    return "" if condition.of.kind == "named" else text_of(condition.of, frozenset())
