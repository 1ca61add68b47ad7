"""Records the states of all actors at every frame, and returns them as a trace at the end of the run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.actors.states import IntArray, StateTable
from foresee_dsl.simulate.signals import Signals
from foresee_dsl.simulate.trace import FIELDS, SPEED, STEP_S, ActorInfo, Event, Trace
from foresee_dsl.simulate.trigger_record import DirectorRecord


class Recorder:
    """Collects the frames of one run: call `frame` once a step, and `trace` at the end.

    Args:
        actors: all actors in the scene's order, the ego first. state_table: the table with their states.
        signals: the signals of the bundle, by junction.
    """

    def __init__(self, actors: Sequence[PlacedActor], state_table: StateTable, signals: Mapping[str, Signal]) -> None:
        self._actors, self._state_table = actors, state_table
        self._signals = tuple(signals.values())
        self._rows: list[FloatArray] = []
        self._lanes: list[IntArray] = []
        self._along: list[FloatArray] = []
        self._now_s: list[float] = []  # SUMO's time at each frame, s
        self._until_s = -math.inf  # the next time at which a signal may switch, s
        # For each change: first frame, stages, times at which the stages began.
        self._stages: list[tuple[int, list[int], list[float]]] = []
        self.events: list[Event] = []

    @Part.RECORDING.measured
    def event(self, time_s: float, actor: str, what: str, detail: dict[str, Any] | None = None) -> None:
        """Record an event: a change of an actor's behaviour."""
        self.events.append(Event(round(time_s, 6), actor, what, detail or {}))

    @property
    def frames(self) -> int:
        """The number of frames recorded so far."""
        return len(self._rows)

    def stands_since(self, index: int, slower_mps: float) -> float:
        """Return the time (s) from which an actor has been slower than `slower_mps` without a break; the next frame's
        time if it is not slower now.
        """
        count = 0
        for row in reversed(self._rows):
            if row.item(index, SPEED) >= slower_mps:
                break
            count += 1
        return max(len(self._rows) - count, 0) * STEP_S

    def frame(self, signals: Signals) -> FloatArray:
        """Record the states of all actors and signals; return the states ([A, 7] the columns of `Trace.states`), which
        must not be changed."""
        now_s = signals.now_s
        if now_s >= self._until_s:
            self._look_at_signals(signals)
        self._now_s.append(now_s)
        states, lanes, along = self._state_table.frame()
        self._rows.append(states)
        self._lanes.append(lanes)
        self._along.append(along)
        return states

    def look_again(self) -> None:
        """Read the signals at the next frame in any case, because one of them was switched outside its program."""
        self._until_s = -math.inf

    def _look_at_signals(self, signals: Signals) -> None:
        """Record the signals' stages from this frame on, and the times (in SUMO's clock) at which these stages
        began.
        """
        stages = [signals.stage_span(signal.tls) for signal in self._signals]
        self._until_s = min((until for *_, until in stages), default=math.inf)
        self._stages.append((len(self._now_s), [stage for stage, *_ in stages], [since for _, since, _ in stages]))

    @Part.RECORDING.measured
    def trace(self, waypoints: FloatArray, meta: dict[str, Any], director: DirectorRecord) -> Trace:
        """Return the trace of the run up to the current frame."""
        t, a, s = len(self._rows), len(self._actors), len(self._signals)
        # For each frame the index of its entry in `_stages`.
        at = np.searchsorted([first for first, *_ in self._stages], np.arange(t), side="right") - 1
        shape = len(self._stages), s
        stages = np.array([stages for _, stages, _ in self._stages], dtype=np.int16).reshape(shape)[at]
        since_s = np.array([since for *_, since in self._stages], dtype=np.float64).reshape(shape)[at]
        return Trace(
            time_s=np.round(np.arange(t) * STEP_S, 6),
            states=np.array(self._rows, dtype=np.float64).reshape(t, a, len(FIELDS)),
            lanes=np.array(self._lanes, dtype=np.int32).reshape(t, a),
            along=np.array(self._along, dtype=np.float64).reshape(t, a),
            stages=stages,
            elapsed=np.round(np.array(self._now_s)[:, None] - since_s, 6),
            waypoints=np.asarray(waypoints, dtype=np.float64),
            actors=tuple(_info(actor) for actor in self._actors),
            lane_ids=tuple(self._state_table.lane_ids),
            signals=tuple(signal.junction for signal in self._signals),
            signal_stages=tuple(signal.stages for signal in self._signals),
            events=tuple(self.events),
            meta=meta,
            director=director,
        )


def _info(actor: PlacedActor) -> ActorInfo:
    model = actor.model
    return ActorInfo(
        id=actor.id,
        kind=model.kind,
        model=model.name,
        length_m=model.length_m,
        width_m=model.width_m,
        wheelbase_m=model.wheelbase_m,
        route=actor.route if actor.control in ("ego", "sumo") or actor.joins else (),
        path=tuple((float(x), float(y)) for x, y in actor.path),
        cruise_mps=actor.cruise_mps,
    )
