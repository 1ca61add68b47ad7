"""Writes down every actor at every frame, and makes a trace of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.simulate.state import Mobile
from foresee_dsl.simulate.trace import FIELDS, STEP_S, ActorInfo, Event, Trace
from foresee_dsl.simulate.world import World

FloatArray = NDArray[np.float64]

_ABSENT = (math.nan,) * len(FIELDS)


class Recorder:
    """Collects frames of one run; `frame` once a step, `trace` at the end.

    Args:
        actors: in the scene's order, the ego first.
        signals: the bundle's, by junction.
    """

    def __init__(self, actors: Sequence[Mobile], signals: Mapping[str, Signal]) -> None:
        self._actors = actors
        self._signals = tuple(signals.values())
        self._rows: list[FloatArray] = []
        self._lanes: list[int] = []
        self._along: list[float] = []
        self._lane_index: dict[str, int] = {}
        self._stages: list[int] = []
        self._elapsed: list[float] = []
        self.events: list[Event] = []

    def event(self, time_s: float, actor: str, what: str, detail: dict[str, Any] | None = None) -> None:
        """Note something that changed how an actor behaves."""
        self.events.append(Event(round(time_s, 6), actor, what, detail or {}))

    def frame(self, world: World) -> FloatArray:
        """Write down where everybody is, and what the signals show.

        Returns:
            [A, 7] the columns of `Trace.states`; not to be changed.
        """
        values: list[float] = []
        lanes, along, index = self._lanes, self._along, self._lane_index
        for a in self._actors:
            if not a.present:
                values += _ABSENT
                lanes.append(-1)
                along.append(math.nan)
                continue
            values += (a.x, a.y, a.heading, a.speed, a.acceleration, a.yaw_rate, a.steer)
            lanes.append(index.setdefault(a.lane, len(index)) if a.lane else -1)
            along.append(a.along)
        for signal in self._signals:
            stage, elapsed = world.stage(signal.tls)
            self._stages.append(stage)
            self._elapsed.append(round(elapsed, 6))
        row = np.array(values, dtype=np.float64).reshape(-1, len(FIELDS))
        self._rows.append(row)
        return row

    def trace(self, waypoints: FloatArray, meta: dict[str, Any]) -> Trace:
        """Return the run so far."""
        t, a, s = len(self._rows), len(self._actors), len(self._signals)
        return Trace(
            time_s=np.round(np.arange(t) * STEP_S, 6),
            states=np.array(self._rows, dtype=np.float64).reshape(t, a, len(FIELDS)),
            lanes=np.array(self._lanes, dtype=np.int32).reshape(t, a),
            along=np.array(self._along, dtype=np.float64).reshape(t, a),
            stages=np.array(self._stages, dtype=np.int16).reshape(t, s),
            elapsed=np.array(self._elapsed, dtype=np.float64).reshape(t, s),
            waypoints=np.asarray(waypoints, dtype=np.float64),
            actors=tuple(_info(m.placed) for m in self._actors),
            lane_ids=tuple(self._lane_index),
            signals=tuple(signal.junction for signal in self._signals),
            signal_stages=tuple(signal.stages for signal in self._signals),
            events=tuple(self.events),
            meta=meta,
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
        route=actor.route if actor.control in ("ego", "sumo") else (),
        path=tuple((float(x), float(y)) for x, y in actor.path),
        cruise_mps=actor.cruise_mps,
    )
