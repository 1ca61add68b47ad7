"""Follows the `expect` lines of a scenario while it runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from foresee_dsl.language.model import Condition, Expect, Predicate, Ref
from foresee_dsl.language.printer import print_item
from foresee_dsl.simulate.conditions import Conditions, Outcome
from foresee_dsl.simulate.verdict import ExpectationResult


class Expectations:
    """What is expected of a run; `look` once a frame, `results` at its end.

    `never` and `always` must hold at every frame at which they can be said, `eventually` at one (within its time).
    """

    def __init__(self, expects: Sequence[Expect], conditions: Conditions) -> None:
        """Expect these of the cast that `conditions` watches."""
        self._watched = [_Watched(expect) for expect in expects]
        self._conditions = conditions

    def look(self, time_s: float, *, ego_hit: bool) -> None:
        """Look at a frame; `ego_hit`: the ego touches something (known already, so not computed again)."""
        for watched in self._watched:
            watched.look(time_s, self._outcome(watched.expect.condition, ego_hit=ego_hit))

    def results(self) -> tuple[ExpectationResult, ...]:
        """Return how each turned out, in the scenario's order."""
        return tuple(watched.result() for watched in self._watched)

    def _outcome(self, condition: Condition, *, ego_hit: bool) -> Outcome:
        if isinstance(condition, Predicate) and condition.what == "collision" and condition.actor == "ego":
            return ego_hit, math.nan
        return self._conditions.outcome(condition)


class _Watched:
    """One expectation; its margin is how far it was from the opposite."""

    def __init__(self, expect: Expect) -> None:
        self.expect = expect
        self._held = expect.mode != "eventually"
        self._margin = math.inf if self._held else -math.inf
        self._until = math.inf if expect.within is None or isinstance(expect.within, Ref) else expect.within.si

    def look(self, time_s: float, outcome: Outcome) -> None:
        if outcome is None or time_s > self._until + 1e-9:
            return
        holds, margin = outcome
        if self.expect.mode == "never":
            holds, margin = not holds, -margin
        if self.expect.mode == "eventually":
            self._held = self._held or holds
            self._margin = max(self._margin, margin)
        else:
            self._held = self._held and holds
            self._margin = min(self._margin, margin)

    def result(self) -> ExpectationResult:
        margin = round(self._margin, 6) if math.isfinite(self._margin) else None
        return ExpectationResult(print_item(self.expect), self._held, margin)
