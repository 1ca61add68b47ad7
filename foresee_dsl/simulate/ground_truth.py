"""The true state of a run, for ideal parts of a driver: the actors' states, the signals, and the others'
future motion.
"""

from __future__ import annotations

import numpy as np

from foresee_dsl.drivers.parts import PlannedMotion, TrueActor
from foresee_dsl.drivers.protocol import Control, SignalColour, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.sensing.perception import Sensing
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEP_S, YAW_RATE, Trace, X, Y

LEAST_FADE = 0.05
"""Lowest value of the share of the motor's acceleration that is left at a speed. The throttle for a planned
acceleration is computed by dividing by this share; near the top speed it approaches 0, and the throttle would be
infinite. Ours."""


class GroundTruth:
    """The truth at the current frame of a run; see `drivers.parts.Truth`."""

    def __init__(self, simulation: Simulation, sensing: Sensing, futures: Trace | None) -> None:
        """Prepare the truth of a run; `futures`: an earlier run, from which the others' future motion is taken, or
        None.
        """
        self._simulation, self._sensing, self._futures = simulation, sensing, futures
        self._others = simulation.actors[1:]
        self._columns = {info.id: k for k, info in enumerate(futures.actors)} if futures is not None else {}

    def actors(self) -> tuple[TrueActor, ...]:
        """Return the true states of all other actors that are present."""
        states, tracks = self._states(), self._tracks()
        actors = []
        for k, actor in enumerate(self._others):
            row = states[k + 1]
            if np.isnan(row[X]):
                continue
            model = actor.placed.model
            x, y, heading, speed, acceleration, yaw_rate = (
                float(row[column]) for column in (X, Y, HEADING, SPEED, ACCELERATION, YAW_RATE)
            )
            numbers = tuple(tracks.get(k, ()))
            size = model.length_m, model.width_m
            actors.append(TrueActor(numbers, model.kind, x, y, heading, speed, acceleration, yaw_rate, *size))
        return tuple(actors)

    def signals(self) -> dict[str, SignalColour]:
        """Return the colours of all signals of the mission, in view or not."""
        return self._sensing.true_signals()

    def future(self, track: int, ahead_s: FloatArray) -> FloatArray | None:
        """Return where an object will be at these times from now, [T, 4] x, y, heading, speed; None if that is unknown.

        The object is assumed to move, from its current place on, as in the run of `futures`; after the end of that run
        it keeps its speed.
        """
        index, trace = self._sensing.numbered.get(track), self._futures
        column = self._columns.get(self._others[index].id) if index is not None else None
        frame = self._simulation.frame
        if trace is None or column is None or index is None or frame >= trace.frames:
            return None
        columns = [X, Y, HEADING, SPEED]
        recorded, now = trace.states[:, column][:, columns], self._states()[index + 1, columns]
        if np.isnan(recorded[frame, 0]) or np.isnan(now[0]):
            return None
        wanted = frame + np.rint(np.asarray(ahead_s) / STEP_S).astype(np.int64)
        there = np.flatnonzero(~np.isnan(recorded[:, 0]))
        last = int(there[-1])
        future: FloatArray = recorded[np.minimum(wanted, last)].copy()
        future[:, :2] += now[:2] - recorded[frame, :2]
        beyond_m = np.maximum(wanted - last, 0) * STEP_S * future[:, 3]
        future[:, 0] += beyond_m * np.cos(future[:, 2])
        future[:, 1] += beyond_m * np.sin(future[:, 2])
        return None if np.isnan(future).any() else future

    def _states(self) -> FloatArray:
        states, _, _ = self._simulation.state_table.frame()
        return states

    def _tracks(self) -> dict[int, list[int]]:
        tracks: dict[int, list[int]] = {}
        for number, index in self._sensing.numbered.items():
            tracks.setdefault(index, []).append(number)
        return tracks


def control_for(plan: PlannedMotion, limits: VehicleLimits, speed_mps: float) -> Control:
    """Return the control that gives a vehicle that reacts at once the planned acceleration and wheel angle."""
    fade = max(1.0 - speed_mps / limits.max_speed_mps, LEAST_FADE)
    wanted = plan.acceleration_mps2
    throttle = max(wanted, 0.0) / max(limits.acceleration_mps2 * fade, 1e-6)
    return Control(
        steer=plan.steer_rad / limits.steer_max_rad,
        throttle=throttle,
        brake=max(-wanted, 0.0) / max(limits.emergency_braking_mps2, 1e-6),
    )
