"""Follows conditions over time: for how long the condition of a `for` has held, and the `expect` lines of a scenario.

`truth_of` joins the truths of kinds by `and`, `or` and `not`, and evaluates the cheapest parts first.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from foresee_dsl.language.model import Both, Condition, Either, Expect, Not, Predicate, Sustained
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.printer import written as text_of
from foresee_dsl.language.traversal import parts, si_of
from foresee_dsl.language.units import UNITS
from foresee_dsl.simulate.results.goal import GoalSeries
from foresee_dsl.simulate.results.verdict import ExpectationResult
from foresee_dsl.simulate.trigger_record import HoldingTime, Runs, frames_of, frames_since
from foresee_dsl.simulate.triggers.conditions import ConditionOutcome, Conditions, every, some
from foresee_dsl.simulate.triggers.kinds import ConditionKind, Truth, has_parts, kind_class, kind_of
from foresee_dsl.simulate.triggers.measures import Cost

Note = Callable[[int, HoldingTime | None], None]
"""Function that is called when the condition of a `for` begins to hold, or (with None) ceases to hold; the number is
the place of the `for` in the watched condition's `parts`."""


class Watch:
    """Follows one condition of a trigger, step or expectation; call `look` at every frame that counts.

    Every part is evaluated at every frame, even if `and` or `or` is already decided, so that the history of a `for`
    does not depend on the parts beside it.
    """

    def __init__(self, condition: Condition, conditions: Conditions, note: Note | None = None) -> None:
        """Begin to follow a condition at the frame of the first `look`."""
        self._condition, self._conditions, self._note = condition, conditions, note
        self._windows: dict[int, _Window] = {}
        self._kinds: dict[int, ConditionKind[Any]] = {}
        self._last: tuple[int, ConditionOutcome | None] | None = None
        self.truth: Truth = truth_of(condition, conditions) or self._followed
        """Function that returns whether the condition holds at this frame, without its margin; None if it cannot be
        evaluated."""
        self._held: tuple[int, bool | None] = (-1, None)

    def look(self) -> ConditionOutcome | None:
        """Return whether the condition holds at this frame, and its margin; None if it cannot be evaluated."""
        frame = self._conditions.frame
        if self._last is None or self._last[0] != frame:
            outcome, _ = self._look(self._condition, 0, positive=True)
            self._last = (frame, outcome)
        return self._last[1]

    def holds(self) -> bool:
        """Return whether the condition holds at this frame; a condition that cannot be evaluated does not."""
        outcome = self.look()
        return outcome is not None and outcome.held

    def held(self) -> bool | None:
        """Return `truth` of this frame, computed at the first call in the frame."""
        frame = self._conditions.frame
        if self._held[0] != frame:
            self._held = frame, self.truth()
        return self._held[1]

    def _followed(self) -> bool | None:
        outcome = self.look()
        return None if outcome is None else bool(outcome.held)

    @property
    def runs(self) -> Runs:
        """Return, for each `for` whose condition holds now, how long it has held; the key is its place in `parts`."""
        return {number: window.run for number, window in self._windows.items() if window.run is not None}

    def _look(self, condition: Condition, number: int, *, positive: bool) -> tuple[ConditionOutcome | None, int]:
        """Return the outcome of a part, and the number of the part after it (in `parts`, an outer part comes before its
        inner ones).

        `positive`: whether the part stands under an even number of `not`.
        """
        if isinstance(condition, Not):
            inner, after = self._look(condition.condition, number + 1, positive=not positive)
            return None if inner is None else inner.negated(), after
        if isinstance(condition, Sustained):
            inner, after = self._look(condition.condition, number + 1, positive=positive)
            now_s = self._conditions.time_s
            if number not in self._windows:
                self._windows[number] = _Window(condition, now_s, unsaid=not positive)
            window = self._windows[number]
            changed = window.add(inner, now_s)
            if changed and self._note is not None:
                self._note(number, window.run)
            return window.outcome(), after
        if isinstance(condition, Both | Either):
            outcomes, after = [], number + 1
            for part in condition.conditions:
                outcome, after = self._look(part, after, positive=positive)
                outcomes.append(outcome)
            return (every if isinstance(condition, Both) else some)(outcomes), after
        if number not in self._kinds:
            self._kinds[number] = kind_of(condition, self._conditions)
        return self._kinds[number].outcome(), number + 1


class _Window:
    """The outcomes of the condition of a `for` over its required duration, up to the present frame.

    `now_s`: time of the first frame, s. `unsaid`: True if a frame without an outcome counts as one at which the
    condition holds.
    """

    def __init__(self, condition: Sustained, now_s: float, *, unsaid: bool) -> None:
        self._frames = frames_of(si_of(condition.duration))
        self._unsaid = unsaid
        self._seen: deque[ConditionOutcome | None] = deque(maxlen=self._frames + 1)
        self._since_s: float | None = None if condition.since is None else si_of(condition.since)
        if self._since_s is not None:
            self._seen.append(ConditionOutcome(False, decides=condition))
            held = frames_since(self._since_s, now_s)
            self._seen.extend([ConditionOutcome(True, decides=condition)] * min(held, self._frames + 1))
        self.run: HoldingTime | None = None

    def add(self, outcome: ConditionOutcome | None, now_s: float) -> bool:
        """Add the outcome of the next frame; return whether the condition began or ceased to hold."""
        before_s, self._since_s = self._since_s, None
        evaluated = before_s is not None or (bool(self._seen) and self._seen[-1] is not None)
        self._seen.append(outcome)
        before = self.run
        if not (self._unsaid if outcome is None else outcome.held):
            self.run = None
        elif before is None:
            self.run = HoldingTime(now_s if before_s is None else before_s, evaluated)
        return (before is None) != (self.run is None)

    def outcome(self) -> ConditionOutcome | None:
        """Return whether the condition has held for the duration; None while the run (or the `do` step) has not lasted
        for the duration yet and the condition has held in all of it.
        """
        missing = len(self._seen) <= self._frames
        return every(self._seen, unknown=missing)


class Expectations:
    """The `expect` lines of a run; call `look` once a frame and `results` at the end.

    `never` and `always` must hold at every frame with an outcome, `eventually` at one (within its time).
    """

    def __init__(self, expects: Sequence[Expect], conditions: Conditions, goal: str = "") -> None:
        """Follow expectations; of the one with the label `goal`, the margin at every frame is recorded."""
        self._watched = self._open = [_Watched(expect, conditions) for expect in expects]
        self._conditions = conditions
        self._goal = next(
            (_GoalHistory(expect, conditions) for expect in expects if goal and expect.name == goal), None
        )

    def look(self, time_s: float, *, ego_hit: bool) -> None:
        """Evaluate a frame; `ego_hit`: whether the ego touches another actor (already computed by the judge)."""
        self._conditions.record_contact(ego_hit=ego_hit)
        for watched in self._open:
            watched.look(time_s)
            if watched.settled:
                self._open = [other for other in self._open if other is not watched]
        if self._goal is not None:
            self._goal.look(time_s)

    @property
    def wait_for_contact_only(self) -> bool:
        """Return whether only a contact of the ego can still break an expectation; False if one is broken already, or
        if there is a goal, whose margin is recorded to the end.
        """
        return self._goal is None and all(watched.waits_for_contact_only for watched in self._watched)

    def results(self) -> tuple[ExpectationResult, ...]:
        """Return the result of each expectation, in the scenario's order."""
        return tuple(watched.result() for watched in self._watched)

    def goal(self) -> GoalSeries | None:
        """Return the margin of the goal at every frame; None if no expectation has its label."""
        return self._goal.series() if self._goal is not None else None


class _GoalHistory:
    """The margin of one expectation at every frame of a run.

    A collision that must not happen has no margin as a condition; here its margin is the distance to the nearest actor.
    """

    def __init__(self, expect: Expect, conditions: Conditions) -> None:
        self._expect, self._watch = expect, Watch(expect.condition, conditions)
        self._until = math.inf if expect.within is None else si_of(expect.within) + 1e-9
        simple = expect.mode == "never" and not has_parts(expect.condition)
        self._avoided = kind_of(expect.condition, conditions) if simple else None
        self._outcomes: list[ConditionOutcome | None] = []

    def look(self, time_s: float) -> None:
        """Add the margin of a frame."""
        outcome = self._watch.look() if time_s <= self._until else None
        if outcome is not None and self._expect.mode == "never":
            outcome = outcome.negated()
        margin_m = None if outcome is None or self._avoided is None else self._avoided.goal_margin()
        if outcome is not None and margin_m is not None:
            outcome = replace(outcome, margin=margin_m, unit="m", dimension="length")
        self._outcomes.append(outcome)

    def series(self) -> GoalSeries:
        """Return the margins in the dimension of the first frame that breaks the expectation; if none does, in the most
        frequent one. Margins of other dimensions cannot be compared with them and are left out.
        """
        numbers = [outcome for outcome in self._outcomes if outcome is not None and math.isfinite(outcome.margin)]
        broken = next((outcome.dimension for outcome in numbers if not outcome.held), None)
        counts = Counter(outcome.dimension for outcome in numbers)
        dimension = broken or next((name for name, _ in counts.most_common(1)), "")
        unit = next((outcome.unit for outcome in numbers if outcome.dimension == dimension), "")
        margins = [
            outcome.margin if outcome is not None and outcome.dimension == dimension else math.nan
            for outcome in self._outcomes
        ]
        return GoalSeries.of(self._expect, dimension, unit, margins)


_EGO_TOUCHES = Predicate(what="collision", actor="ego")


class _Watched:
    """One expectation of a run. Its margin is the distance from the value at which its result would be the opposite.

    Attributes:
        settled: whether its result cannot change any more.
    """

    def __init__(self, expect: Expect, conditions: Conditions) -> None:
        self._expect = expect
        self._watch = Watch(expect.condition, conditions)
        self._so_far: ConditionOutcome | None = None
        self._until = math.inf if expect.within is None else si_of(expect.within) + 1e-9
        self.settled = False
        kind = None if has_parts(expect.condition) else kind_class(expect.condition)
        self._fact = truth_of(expect.condition, conditions) if kind is not None and kind.without_memory else None
        self._settles = kind is not None and kind.settles
        self._was: bool | None = None
        self._of_contact = expect.mode == "never" and expect.condition == _EGO_TOUCHES

    def look(self, time_s: float) -> None:
        if time_s > self._until:
            self.settled = True
            return
        if self._fact is not None:
            held = self._fact()
            if held is None or held is self._was:
                return  # the same outcome as before, without a margin, leaves the result as it is
            self._was = held
        outcome = self._watch.look()
        if outcome is None:
            return
        if self._expect.mode == "never":
            outcome = outcome.negated()
        join = some if self._expect.mode == "eventually" else every
        self._so_far = outcome if self._so_far is None else join((self._so_far, outcome))
        # A fact that decides has no margin, so later frames cannot change it.
        decides = self._so_far is not None and self._so_far.held == (self._expect.mode == "eventually")
        self.settled = decides and self._settles

    @property
    def waits_for_contact_only(self) -> bool:
        """Return whether it holds, and only a contact of the ego can break it."""
        held = self._so_far is None or self._so_far.held
        return held and (self._of_contact or (self.settled and self._so_far is not None))

    def result(self) -> ExpectationResult:
        text, name = print_item(self._expect), self._expect.name or ""
        outcome = self._so_far
        if outcome is None:  # no frame had an outcome
            return ExpectationResult(text, self._expect.mode != "eventually", name=name)
        decides = text_of(outcome.decides) if outcome.decides is not None else ""
        if not math.isfinite(outcome.margin):
            return ExpectationResult(text, outcome.held, decides=decides, name=name)
        to_si = UNITS[outcome.unit].to_si if outcome.unit else 1.0
        value = round(outcome.value / to_si, 6) if math.isfinite(outcome.value) else None
        return ExpectationResult(
            text, outcome.held, round(outcome.margin / to_si, 6), outcome.unit, decides, name, value
        )


# --- without margins -------------------------------------------------------------------------------------------------


class _Costing(NamedTuple):
    truth: Truth
    cost: Cost


def truth_of(condition: Condition, run: Conditions) -> Truth | None:
    """Return a function that says whether a condition holds at the current frame.

    None for a condition with a `for`, which must be followed from frame to frame.
    """
    if any(isinstance(part, Sustained) for part in parts(condition)):
        return None
    return _costing(condition, run).truth


def _costing(condition: Condition, run: Conditions) -> _Costing:
    if isinstance(condition, Not):
        inner = _costing(condition.condition, run)
        return _Costing(partial(_opposite, inner.truth), inner.cost)
    if isinstance(condition, Both | Either):
        joined = sorted((_costing(part, run) for part in condition.conditions), key=lambda part: part.cost)
        every_step = tuple(part.truth for part in joined if part.cost == Cost.EVERY_STEP)
        rest = tuple(part.truth for part in joined if part.cost != Cost.EVERY_STEP)
        cost = Cost.EVERY_STEP if every_step else max(part.cost for part in joined)
        return _Costing(partial(_joined, every_step, rest, isinstance(condition, Either)), cost)
    kind = kind_of(condition, run)
    return _Costing(kind.truth, kind.cost)


def _opposite(truth: Truth) -> bool | None:
    held = truth()
    return None if held is None else not held


def _joined(every_step: tuple[Truth, ...], rest: tuple[Truth, ...], enough: bool) -> bool | None:
    """Join the parts of an `or` (`enough`: True) or an `and` (`enough`: False): a part whose truth is `enough` decides.

    `every_step`: parts that are evaluated in every step. `rest`: parts that are evaluated until one decides.
    """
    decided, unknown = False, False
    for truth in every_step:
        held = truth()
        decided, unknown = decided or held is enough, unknown or held is None
    if decided:
        return enough
    for truth in rest:
        held = truth()
        if held is enough:
            return enough
        unknown = unknown or held is None
    return None if unknown else not enough
