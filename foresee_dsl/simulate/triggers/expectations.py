"""Follows the `expect` lines of a scenario while it runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from foresee_dsl.language.model import Expect
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.printer import written as text_of
from foresee_dsl.language.traversal import si_of
from foresee_dsl.language.units import UNITS
from foresee_dsl.simulate.results.verdict import ExpectationResult
from foresee_dsl.simulate.triggers.condition_history import Watch
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.robustness import Outcome, every, some


class Expectations:
    """What is expected of a run; `look` once a frame, `results` at its end.

    `never` and `always` must hold at every frame at which they can be said, `eventually` at one (within its time).
    """

    def __init__(self, expects: Sequence[Expect], conditions: Conditions) -> None:
        """Expect these of the simulation that `conditions` watches."""
        self._watched = [_Watched(expect, conditions) for expect in expects]
        self._conditions = conditions

    def look(self, time_s: float, *, ego_hit: bool) -> None:
        """Look at a frame; `ego_hit`: the ego touches something (known already, so not computed again)."""
        self._conditions.ego_hit = ego_hit
        for watched in self._watched:
            watched.look(time_s)
        self._conditions.ego_hit = None

    def results(self) -> tuple[ExpectationResult, ...]:
        """Return how each turned out, in the scenario's order."""
        return tuple(watched.result() for watched in self._watched)


class _Watched:
    """One expectation; its margin is how far it was from the opposite."""

    def __init__(self, expect: Expect, conditions: Conditions) -> None:
        self._expect = expect
        self._watch = Watch(expect.condition, conditions)
        self._so_far: Outcome | None = None
        self._until = math.inf if expect.within is None else si_of(expect.within)

    def look(self, time_s: float) -> None:
        if time_s > self._until + 1e-9:
            return
        outcome = self._watch.look()
        if outcome is None:
            return
        if self._expect.mode == "never":
            outcome = outcome.negated()
        join = some if self._expect.mode == "eventually" else every
        self._so_far = outcome if self._so_far is None else join((self._so_far, outcome))

    def result(self) -> ExpectationResult:
        text, name = print_item(self._expect), self._expect.name or ""
        found = self._so_far
        if found is None:  # it could never be said
            return ExpectationResult(text, self._expect.mode != "eventually", name=name)
        decides = text_of(found.decides) if found.decides is not None else ""
        if not math.isfinite(found.margin):
            return ExpectationResult(text, found.held, decides=decides, name=name)
        margin = round(found.margin / (UNITS[found.unit].to_si if found.unit else 1.0), 6)
        return ExpectationResult(text, found.held, margin, found.unit, decides, name)
