"""Converts an observation to the input of the kernels: the ego and the others on the route, and the braking for
signals.

`pdm` and `idm` do all of this within one kernel each (`kernels.pdm.decision`, `kernels.idm`); `frenetix` calls the same
kernels in turn.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from foresee_dsl.drivers.pdm.route import DriverRoute
from foresee_dsl.drivers.protocol import EgoState, FloatArray, JunctionPassage, Observation, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker, Tracks
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.records import ACTOR, EGO, EgoRecord
from foresee_dsl.kernels.pdm.route import place_actors, place_ego

_STATE, _STATE_BEGINS = struct.Struct("5d"), EGO.fields["x"][1]  # type: ignore[index]
"""The layout of an ego's state, x to acceleration, and where it begins in the ego's record, in bytes."""


@dataclass(frozen=True)
class RoadSituation:
    """The input of one step: egos: [1] `EgoRecord`; actors: [A] `Actor`s; signals: the known colours."""

    route: DriverRoute
    vehicle: VehicleLimits
    observation: Observation
    egos: Records
    actors: Records
    signals: Mapping[str, SignalColour]

    @cached_property
    def ego(self) -> EgoRecord:
        """The ego's record as a named tuple."""
        return EgoRecord(*self.egos[0].item())


def read_situation(
    route: DriverRoute,
    vehicle: VehicleLimits,
    observation: Observation,
    tracks: Tracks | None = None,
    signals: Mapping[str, SignalColour] | None = None,
) -> RoadSituation:
    """Return the situation of this step, read from an observation.

    `tracks`: the tracked others; None: a new tracker reads them from this observation. `signals`: the known colours;
    None: the colours in the observation.
    """
    egos, tracks = ego_record(vehicle), Tracker().update(observation) if tracks is None else tracks
    write_state(egos.view(np.float64).data, observation.ego)
    place_ego(egos, route.points, route.coarse)
    actors = np.empty(len(tracks.table), ACTOR)
    place_actors(egos, tracks.table, route.points, actors)
    signals = observation.signals if signals is None else signals
    return RoadSituation(route, vehicle, observation, egos, actors, signals)


def ego_record(vehicle: VehicleLimits) -> Records:
    """Return an `EgoRecord` record [1] of a vehicle, with a state and position of zero."""
    grip = cfg.FRICTION_SHARE * vehicle.friction * GRAVITY_MPS2
    values = {
        "length": vehicle.length_m,
        "width": vehicle.width_m,
        "wheelbase": vehicle.wheelbase_m,
        "front": vehicle.wheelbase_m + vehicle.front_overhang_m,
        "centre": vehicle.rear_axle_m,
        "sharpest": math.tan(vehicle.steer_max_rad) / vehicle.wheelbase_m,
        "steer_max": vehicle.steer_max_rad,
        "grip": grip,
        "motor": vehicle.acceleration_mps2,
        "brakes": vehicle.emergency_braking_mps2,
        "strongest": min(vehicle.emergency_braking_mps2, grip),
    }
    egos = np.zeros(1, EGO)
    for name, value in values.items():
        egos[name] = value
    return egos


def write_state(numbers: memoryview, state: EgoState) -> None:
    """Write the vehicle's current state into its record; `numbers`: the record's memory as floats,
    `egos.view(np.float64).data`.

    `struct` takes a sixth of the time of one assignment to the view, and that a third of five assignments to fields.
    """
    _STATE.pack_into(
        numbers, _STATE_BEGINS, state.x, state.y, state.heading_rad, state.speed_mps, state.acceleration_mps2
    )


def signal_brakings(route: DriverRoute, strongest_mps2: float, signals: Mapping[str, SignalColour]) -> FloatArray:
    """Return the `signal_braking` of each junction, [J] m/s^2; the number is negative at a junction where the ego may
    go.
    """
    braking = [-1.0] * len(route.passages)
    for k, _ in route.signals:
        wish = signal_braking(route.passages[k], strongest_mps2, signals)
        if wish is not None:
            braking[k] = wish
    return np.array(braking)


def signal_braking(
    passage: JunctionPassage, strongest_mps2: float, signals: Mapping[str, SignalColour]
) -> float | None:
    """Return the hardest braking with which the ego stops at a junction's stop line, m/s^2; None if the signal lets it
    go.

    At a signal that it does not see, the ego is ready to stop.
    """
    if passage.signal is None:
        return None
    colour = signals.get(passage.signal)
    if colour == "red":
        return strongest_mps2
    if colour == "amber":
        return cfg.AMBER_BRAKING_MPS2
    return cfg.UNSEEN_BRAKING_MPS2 if colour is None else None
