"""Compares SelfOracle's alarms with events: precision and recall against near misses, and against failing mutants.

An alarm is a segment over the threshold. It warns of events between its beginning and `WARNS_S` after its end.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from foresee_study.selforacle.ranker import Segment
from scipy.stats import rankdata

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, criticality
from foresee_dsl.simulate.trace import STEP_S, Trace

NEAR_MISS_MPS2 = 3.35
"""Required braking that makes a near miss, m/s^2, as in `rides`."""
WARNS_S = 5.0
"""Longest time between an alarm's end and an event that it warns of, s: o_a, the half of a clip after its point."""
APART_S = 1.0
"""Moments that are closer to each other than this are one event, s."""


@dataclass(frozen=True)
class Event:
    """A near miss, or a moment whose clip had a failing mutant: first and last frame."""

    first: int
    last: int


@dataclass(frozen=True)
class Score:
    """Agreement of alarms and events.

    Attributes:
        alarms, right: number of alarms, and of those that warn of an event.
        events, warned: number of events, and of those with a warning.
        chance: share of all segments that lie before an event: the precision of random alarms.
        covered: share of all segments that are alarms.
        auc: area under the curve of the errors (0.5: no better than chance).
    """

    alarms: int
    right: int
    events: int
    warned: int
    chance: float
    covered: float
    auc: float

    def __str__(self) -> str:
        precision = self.right / self.alarms if self.alarms else float("nan")
        recall = self.warned / self.events if self.events else float("nan")
        return (
            f"{self.alarms} alarms, {self.right} right: precision {precision:.2f} (chance {self.chance:.2f}); "
            f"{self.events} events, {self.warned} warned of: recall {recall:.2f}; alarms are {self.covered:.1%} of all "
            f"segments; AUC {self.auc:.2f}"
        )


@dataclass
class Tally:
    """Counts over many runs."""

    errors: list[float] = field(default_factory=list)
    before: list[bool] = field(default_factory=list)
    alarms: int = 0
    right: int = 0
    events: int = 0
    warned: int = 0

    def add(self, segments: Sequence[Segment], threshold: float, events: Sequence[Event]) -> None:
        """Count a run."""
        for segment in segments:
            right = any(_warns(segment, event) for event in events)
            self.errors.append(segment.error)
            self.before.append(right)
            self.alarms += segment.error > threshold
            self.right += segment.error > threshold and right
        over = [segment for segment in segments if segment.error > threshold]
        self.events += len(events)
        self.warned += sum(any(_warns(segment, event) for segment in over) for event in events)

    def score(self) -> Score:
        """Return the figures."""
        before = np.array(self.before, np.bool_)
        auc = _auc(np.array(self.errors), before)
        share = self.alarms / max(len(before), 1)
        return Score(self.alarms, self.right, self.events, self.warned, float(before.mean()), share, auc)


def near_misses_of(trace: Trace) -> list[Event]:
    """Return the events of a run in which the ego needed to brake hard for an actor."""
    hard = np.zeros(trace.frames, np.bool_)
    for actor in range(1, len(trace.actors)):
        hard |= criticality(trace, actor)[CriticalityMeasure.DRAC] > NEAR_MISS_MPS2
    return events_of(np.flatnonzero(hard).tolist())


def events_of(frames: Iterable[int]) -> list[Event]:
    """Join frames that are close to each other into events."""
    events: list[Event] = []
    for frame in sorted(frames):
        if events and (frame - events[-1].last) * STEP_S <= APART_S:
            events[-1] = Event(events[-1].first, frame)
        else:
            events.append(Event(frame, frame))
    return events


def _warns(segment: Segment, event: Event) -> bool:
    return segment.first <= event.last and (event.first - segment.last) * STEP_S <= WARNS_S


def _auc(errors: FloatArray, before: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    """Return the probability that, of two segments, the one before an event has the larger error."""
    inside, outside = int(before.sum()), int((~before).sum())
    if not inside or not outside:
        return float("nan")
    return float((rankdata(errors)[before].sum() - inside * (inside + 1) / 2) / (inside * outside))
