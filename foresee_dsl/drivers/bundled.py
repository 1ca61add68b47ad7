"""The base class of the drivers `pdm`, `idm` and `frenetix`, and their memory. `reset` creates their whole state anew.

With ideal parts, the memory takes the truth in the place of tracked objects and of seen signals, and the true futures
of the others in the place of predictions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from foresee_dsl.drivers.parts import DriverPart, PlannedMotion, TrueActor, Truth
from foresee_dsl.drivers.protocol import (
    ActorClass,
    FloatArray,
    Mission,
    Observation,
    SignalColour,
    VehicleLimits,
)
from foresee_dsl.drivers.stepped import SteppedDriver, SteppedState
from foresee_dsl.drivers.tracking import KINDS, SignalMemory, Tracker, Tracks, object_table
from foresee_dsl.kernels import tracks as kernel
from foresee_dsl.kernels.arrays import Records

NO_FUTURES: FloatArray = np.empty((0, 0, 4))
"""The empty array of futures that is passed to kernels when the prediction is not ideal."""


@dataclass(frozen=True, slots=True)
class Memory:
    """The memory of a bundled driver.

    Attributes:
        tracker: remembers the other road users.
        signals: remembers the colours of the signals.
        truth: the truth of the run, for an ideal prediction; None if the prediction is not ideal.
    """

    tracker: Tracker
    signals: SignalMemory | TrueSignals
    truth: Truth | None = None

    def futures(self, tracks: Tracks, times_s: FloatArray) -> FloatArray:
        """Return the future motion of the tracked others, [A, T, 4] x, y, heading, speed, NaN where it is unknown.

        Without an ideal prediction it is `NO_FUTURES`.
        """
        if self.truth is None:
            return NO_FUTURES
        futures = np.full((len(tracks.numbers), len(times_s), 4), np.nan)
        for k, number in enumerate(tracks.numbers):
            future = self.truth.future(number, times_s)
            if future is not None:
                futures[k] = future
        return futures


def memory_of(ideal: frozenset[DriverPart], truth: Truth | None) -> Memory:
    """Return the memory of a driver with these ideal parts; the usual memory if no part is ideal."""
    if truth is None:
        return Memory(Tracker(), SignalMemory())
    return Memory(
        IdealTracker(truth) if DriverPart.TRACKING in ideal else Tracker(),
        TrueSignals(truth) if DriverPart.RULES in ideal else SignalMemory(),
        truth if DriverPart.PREDICTION in ideal else None,
    )


class TrueSignals:
    """The true colours of all signals, whether they are in view or not."""

    def __init__(self, truth: Truth) -> None:
        self._truth = truth

    def update(self, observation: Observation) -> Mapping[str, SignalColour]:
        """Return the true colours."""
        del observation
        return self._truth.signals()


@dataclass(slots=True)
class _Perceived:
    """An object that the sensors have reported: its class and size, and by how much its last position was wrong, m."""

    number: int
    kind: ActorClass
    length_m: float
    width_m: float
    error_x_m: float
    error_y_m: float


class IdealTracker(Tracker):
    """Tracks perceived objects with their true motion and identity; position and size stay as they were perceived."""

    def __init__(self, truth: Truth) -> None:
        super().__init__()
        self._truth = truth
        self._perceived: dict[int, _Perceived] = {}
        """The objects that the sensors have reported, by their first track number."""

    def update(self, observation: Observation) -> Tracks:
        """Process an observation; return all objects that the sensors have reported so far and that are present."""
        seen = object_table(observation)
        rows = {number: k for k, number in enumerate(seen.numbers)}
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        late_s = observation.time_s - measured_s
        present = []
        for actor in self._truth.actors():
            row = next((rows[number] for number in actor.tracks if number in rows), None)
            if row is not None:
                x, y, _, _, length, width = (float(value) for value in seen.measured[row, : kernel.MEASURED])
                then_x, then_y = _place_before(actor, late_s)
                number, kind = seen.numbers[row], seen.kinds[row]
                self._perceived[actor.tracks[0]] = _Perceived(number, kind, length, width, x - then_x, y - then_y)
            perceived = self._perceived.get(actor.tracks[0]) if actor.tracks else None
            if perceived is not None:
                present.append((perceived, actor))
        table: Records = np.array([_track(perceived, actor) for perceived, actor in present], kernel.TRACK)
        return Tracks(
            table,
            tuple(perceived.number for perceived, _ in present),
            tuple(perceived.kind for perceived, _ in present),
        )


def _place_before(actor: TrueActor, late_s: float) -> tuple[float, float]:
    """Return where an actor was a short time ago, m, computed from its present motion."""
    back_m = actor.speed_mps * late_s - actor.acceleration_mps2 * late_s**2 / 2
    heading = actor.heading_rad - actor.yaw_rate_rad_s * late_s / 2
    return actor.x - back_m * math.cos(heading), actor.y - back_m * math.sin(heading)


def _track(perceived: _Perceived, actor: TrueActor) -> tuple[float, ...]:
    return (
        actor.x + perceived.error_x_m, actor.y + perceived.error_y_m, actor.heading_rad, max(actor.speed_mps, 0.0),
        perceived.length_m, perceived.width_m, actor.acceleration_mps2, actor.yaw_rate_rad_s, 0.0,
        KINDS.get(perceived.kind, kernel.OTHER),
    )  # fmt: skip


class BundledState(SteppedState, Protocol):
    """The state of a bundled driver from one `reset` to the next."""

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None: ...

    def planned(self) -> PlannedMotion | None:
        """Return the acceleration and wheel angle that the last step planned; None before the first step."""
        ...


S = TypeVar("S", bound=BundledState)


class BundledDriver(SteppedDriver[S]):
    """A stepped driver with a memory, some of whose parts can be replaced by ideal ones."""

    state_type: type[S]
    """Type of the state; `begin` creates one from the mission, the vehicle and a memory."""
    parts: tuple[DriverPart, ...]
    """The parts of the driver that can be replaced by ideal ones."""

    _ideal: tuple[frozenset[DriverPart], Truth | None] = (frozenset(), None)

    def idealise(self, ideal: frozenset[DriverPart], truth: Truth) -> None:
        """Replace these parts by ideal ones from the next `reset` on."""
        self._ideal = ideal, truth

    def begin(self, mission: Mission, vehicle: VehicleLimits) -> S:
        """Return the state at the beginning of a mission, with the memory that the ideal parts require."""
        return self.state_type(mission, vehicle, memory_of(*self._ideal))

    def planned(self) -> PlannedMotion | None:
        """Return what the last step planned, before it is converted to pedals and wheel."""
        return self.state.planned()
