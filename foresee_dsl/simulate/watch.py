"""Watches conditions over time: `C for 2 s` remembers since when C holds."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from foresee_dsl.language.concrete import si_of
from foresee_dsl.language.conditions import parts
from foresee_dsl.language.model import Both, Condition, Either, Not, Sustained
from foresee_dsl.simulate.conditions import Conditions
from foresee_dsl.simulate.margins import Outcome, every, some
from foresee_dsl.simulate.trace import STEP_S

Note = Callable[[int, bool], None]
"""Told when what a `for` is about begins to hold, or ceases to: its place among the condition's `parts`, and which."""


class Watch:
    """One condition of one trigger, step or expectation. `look` has to be called at every frame that counts.

    Every part is looked at at every frame, even where `and` or `or` would not need it, so that what a `for` remembers
    does not hang on its neighbours.
    """

    def __init__(self, condition: Condition, conditions: Conditions, note: Note | None = None) -> None:
        """Begin to watch at the frame that is looked at first."""
        self._condition, self._conditions, self._note = condition, conditions, note
        self._windows = {
            number: _Window(part) for number, part in enumerate(parts(condition)) if isinstance(part, Sustained)
        }
        self._last: tuple[int, Outcome | None] | None = None

    def look(self) -> Outcome | None:
        """Return whether the condition holds at this frame and by how much; None where it cannot be said."""
        frame = self._conditions.frame
        if self._last is None or self._last[0] != frame:
            outcome, _ = self._look(self._condition, 0)
            self._last = (frame, outcome)
        return self._last[1]

    def holds(self) -> bool:
        """Whether the condition holds at this frame; what cannot be said does not."""
        outcome = self.look()
        return outcome is not None and outcome.held

    def _look(self, condition: Condition, number: int) -> tuple[Outcome | None, int]:
        """Return the outcome of a part and the number of the part after it (`parts` counts outer ones first)."""
        if isinstance(condition, Not):
            inner, after = self._look(condition.condition, number + 1)
            return None if inner is None else inner.negated(), after
        if isinstance(condition, Sustained):
            inner, after = self._look(condition.condition, number + 1)
            window = self._windows[number]
            changed = window.add(inner)
            if changed and self._note is not None:
                self._note(number, window.holds)
            return window.outcome(), after
        if isinstance(condition, Both | Either):
            found, after = [], number + 1
            for part in condition.conditions:
                outcome, after = self._look(part, after)
                found.append(outcome)
            return (every if isinstance(condition, Both) else some)(found), after
        return self._conditions.outcome(condition), number + 1


class _Window:
    """What a `for` remembers: the outcomes of its condition over the time that it asks for."""

    def __init__(self, condition: Sustained) -> None:
        self._frames = max(0, math.ceil(si_of(condition.duration) / STEP_S - 1e-6))
        self._seen: deque[Outcome | None] = deque(maxlen=self._frames + 1)
        self.holds = False

    def add(self, outcome: Outcome | None) -> bool:
        """Take the outcome of one more frame; True when it now holds and did not before, or the other way round."""
        self._seen.append(outcome)
        before, self.holds = self.holds, outcome is not None and outcome.held
        return before != self.holds

    def outcome(self) -> Outcome | None:
        """Return whether it has held for so long; None while the run (or the step) is not that old.

        Where it failed once the time does not matter: it has not.
        """
        missing = len(self._seen) <= self._frames
        return every(self._seen, unknown=missing)
