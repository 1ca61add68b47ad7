"""The goal of a campaign for a rolled-out actor: its margin without a simulation, where it depends on the ego and one
actor only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Self, get_args

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.kernels.conditions import time_to_touch
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Comparison, Condition, Expect, Measure, Named, Not, Quantity, Within
from foresee_dsl.language.traversal import word_of
from foresee_dsl.simulate.results.metrics import ETA_SLOWEST_MPS

PairMeasure = Literal["distance", "ttc", "headway", "relative_speed"]
"""The measures that two footprints and two speeds decide; the others also need the roads or the run so far."""
BEYOND_M = 100.0
"""A time to collision is not computed for actors farther apart than this; it counts as infinite, m. Ours: at 50 km/h
towards each other they need 3.6 s."""


@dataclass(frozen=True)
class PairGoal:
    """A goal that compares a measure between the ego and one actor with a bound.

    Attributes:
        name: label of the expectation. actor: the actor.
        measure: the measure. of_ego: whether the ego is its first actor.
        bound: in SI units. above: whether the goal is kept above the bound.
    """

    name: str
    actor: str
    measure: PairMeasure
    of_ego: bool
    bound: float
    above: bool

    @classmethod
    def of(cls, case: TestCase) -> Self | None:
        """Return the goal of a test case; None if it has none, or one that a roll-out cannot compute."""
        expect = next((item for item in case.scenario.all(Expect) if case.goal and item.name == case.goal), None)
        if expect is None:
            return None
        actors = frozenset(actor.name for actor in case.scenario.actors)
        goal = cls._of(case.goal, expect.condition, actors)
        return goal.negated() if goal is not None and expect.mode == "never" else goal

    @classmethod
    def _of(cls, name: str, condition: Condition, actors: frozenset[str]) -> Self | None:
        match condition:
            case Not(condition=part):
                inner = cls._of(name, part, actors)
                return inner.negated() if inner is not None else None
            case Within(actor=actor, of=Named(name=other), distance=Quantity() as bound):
                pair = actor, word_of(other)
                return cls._between(name, "distance", pair, bound.si, above=False, actors=actors)
            case Comparison(left=Measure() as left, op=op, right=Quantity() as bound):
                pair = left.actor or "", word_of(left.other or "")
                return cls._between(name, left.what, pair, bound.si, above=op[0] == ">", actors=actors)
            case _:
                return None

    @classmethod
    def _between(
        cls, name: str, measure: str, pair: tuple[str, str], bound: float, *, above: bool, actors: frozenset[str]
    ) -> Self | None:
        what = next((kind for kind in get_args(PairMeasure) if kind == measure), None)
        first, second = pair
        other = second if first == "ego" else first
        if what is None or "ego" not in pair or other not in actors - {"ego"}:
            return None
        return cls(name, other, what, first == "ego", bound, above)

    def negated(self) -> Self:
        """Return the goal that is kept where this one is broken."""
        return replace(self, above=not self.above)

    def margins(self, egos: FloatArray, ego_mps: FloatArray, boxes: FloatArray, mps: FloatArray) -> FloatArray:
        """Return the margin of each of M pairs: positive if the goal is kept, NaN where an actor is absent, SI units.

        Args:
            egos, boxes: [M, 5] footprints of the ego and of the actor. ego_mps, mps: [M] their speeds.
        """
        value = self._values(egos, ego_mps, boxes, mps)
        return value - self.bound if self.above else self.bound - value

    def _values(self, egos: FloatArray, ego_mps: FloatArray, boxes: FloatArray, mps: FloatArray) -> FloatArray:
        if self.measure == "relative_speed":
            first, second = (ego_mps, mps) if self.of_ego else (mps, ego_mps)
            return first - second * np.cos(boxes[:, 2] - egos[:, 2])
        gaps: FloatArray = box_distance(egos, boxes)
        if self.measure == "distance":
            return gaps
        if self.measure == "headway":
            return gaps / np.maximum(ego_mps if self.of_ego else mps, ETA_SLOWEST_MPS)
        return _times_to_touch(egos, ego_mps, boxes, mps, gaps)


def _times_to_touch(
    egos: FloatArray, ego_mps: FloatArray, boxes: FloatArray, mps: FloatArray, gaps: FloatArray
) -> FloatArray:
    """Return the time to collision of each pair, s; infinite beyond `BEYOND_M`."""
    states = np.empty((2, 4))
    times = np.where(np.isnan(gaps), np.nan, np.inf)
    for k in np.flatnonzero(gaps <= BEYOND_M).tolist():
        states[0, :3], states[0, 3] = egos[k, :3], ego_mps[k]
        states[1, :3], states[1, 3] = boxes[k, :3], mps[k]
        times[k] = time_to_touch(states, np.array((egos[k, 3:], boxes[k, 3:])), 0, 1)
    return times
