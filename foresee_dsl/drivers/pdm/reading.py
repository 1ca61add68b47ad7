"""What the `pdm` driver makes of an observation, for drivers that decide in another way: who is where, and will be.

`pdm` itself does all of this within one kernel (`pdm_decision`); here each step is a call of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from foresee_dsl.drivers.pdm.foes import FOES, FoePath, FoeTable
from foresee_dsl.drivers.pdm.prediction import FRAMES, match, move_on
from foresee_dsl.drivers.pdm.route import IntArray, Projection, Route
from foresee_dsl.drivers.pdm.situation import (
    ACTORS,
    CAR,
    NOW,
    POSE,
    Actors,
    BoolArray,
    Car,
    EgoOnRoute,
    EgoPose,
    car_of,
    classes,
    look,
    near_junctions,
    to_centre,
)
from foresee_dsl.drivers.protocol import EgoState, FloatArray, Observation, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker, Tracks
from foresee_dsl.kernels.compiling import CUBE, FLAG_TABLE, FLAGS, FLOAT, FLOATS, INTS, TABLE, compiled


@dataclass(frozen=True)
class Situation:
    """One step's input, read.

    Attributes:
        now: the others on the route, [A]. own: [A], in the ego's lane, in its direction.
        reach_m: how far ahead predictions are put on the route. signals: the colours that are known.
    """

    route: Route
    vehicle: VehicleLimits
    observation: Observation
    pose: EgoPose
    ego: EgoOnRoute
    actors: Actors
    now: Projection
    own: BoolArray
    reach_m: float
    signals: Mapping[str, SignalColour]

    @cached_property
    def near_junctions(self) -> tuple[int, ...]:
        """The indices of the junctions that the ego is in or comes to."""
        return tuple(_near_junctions(self.ego.front_s, self.ego.rear_s, self.route.foe_table.junctions).tolist())


@dataclass(frozen=True)
class FoeMatches:
    """Who is on which foe's path.

    Attributes:
        foes: F of them. which: [F] their indices on the route. on: [A, F], on it or not.
        found: [3, A, F], length along it, speed along it, offset.
    """

    foes: tuple[FoePath, ...]
    which: IntArray
    on: BoolArray
    found: FloatArray

    @property
    def s(self) -> FloatArray:
        """Length along the path, m: [A, F]."""
        row: FloatArray = self.found[0]
        return row

    @property
    def speed(self) -> FloatArray:
        """Speed along the path, m/s: [A, F]."""
        row: FloatArray = self.found[1]
        return row

    @property
    def d(self) -> FloatArray:
        """Offset from the path, m: [A, F]."""
        row: FloatArray = self.found[2]
        return row


@dataclass(frozen=True)
class Prediction:
    """Footprints over the horizon, [A, T] each.

    Attributes:
        x, y, cos, sin: centre and heading. half_length: m, growing where speed is uncertain. s, d: on the route.
        reach_s, reach_d: half of the footprint's extent along and across the route. speed_s: m/s along the route.
    """

    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    half_length: FloatArray
    s: FloatArray
    d: FloatArray
    reach_s: FloatArray
    reach_d: FloatArray
    speed_s: FloatArray


def read_situation(
    route: Route,
    vehicle: VehicleLimits,
    observation: Observation,
    tracks: Tracks | None = None,
    signals: Mapping[str, SignalColour] | None = None,
    pose: EgoPose | None = None,
) -> Situation:
    """Read an observation.

    Args:
        route: where it goes. vehicle: the ego. observation: of this step.
        tracks: the others as they were tracked; None: what a tracker makes of the observation at first sight.
        signals: the colours that are known; None: those of the observation.
        pose: the rear axle on the route, where that was found already.
    """
    state, car = observation.ego, car_of(vehicle)
    pose = pose_on(route, state, vehicle) if pose is None else pose
    tracks = Tracker().update(observation) if tracks is None else tracks
    pedestrian, obstacle, speeds_up = classes(tracks.kinds)
    count = len(tracks.kinds)
    actors = Actors(np.empty((8, count)), pedestrian, obstacle)
    now = Projection(np.empty(count), np.empty(count), np.empty(count, dtype=np.int64))
    own = np.empty(count, dtype=bool)
    reach, front_s, rear_s = _look(tracks.table, speeds_up, route.table, route.origin_s, pose, car, actors, now, own)
    return Situation(
        route=route,
        vehicle=vehicle,
        observation=observation,
        pose=pose,
        ego=EgoOnRoute(front_s, rear_s, float(state.speed_mps), float(state.acceleration_mps2), car.strongest),
        actors=actors,
        now=now,
        own=own,
        reach_m=reach,
        signals=observation.signals if signals is None else signals,
    )


def pose_on(route: Route, state: EgoState, vehicle: VehicleLimits) -> EgoPose:
    """Put the rear axle on the route."""
    s, d, error = route.locate(state.x, state.y, state.heading_rad, to_centre(vehicle))
    return EgoPose(s=s, d=d, heading_error=error, speed=max(float(state.speed_mps), 0.0))


def match_foes(situation: Situation, foes: tuple[FoePath, ...]) -> FoeMatches:
    """Find who is on which foe's path; who is in the ego's lane is on none."""
    actors, table = situation.actors, situation.route.foe_table
    shape = (actors.number, len(foes))
    on, found = np.zeros(shape, dtype=bool), np.empty((3, *shape))
    which = np.array([f.index for f in foes], dtype=np.int64)
    if on.size:
        _match(actors, situation.own, which, table, on, found)
    return FoeMatches(foes, which, on, found)


def predict(situation: Situation, matches: FoeMatches) -> Prediction:
    """Roll everybody out over the horizon."""
    route, actors, now = situation.route, situation.actors, situation.now
    out = np.empty((len(fields(Prediction)), actors.number, FRAMES))
    if actors.number:
        road = route.foe_table, route.table, route.origin_s, situation.pose.s, situation.reach_m
        _predict(actors, now, matches.which, matches.on, matches.found, *road, out)
    return Prediction(*out)


@compiled(TABLE, FLOATS, TABLE, FLOAT, POSE, CAR, ACTORS, NOW, FLAGS)
def _look(
    tracked: FloatArray,
    speeds_up: FloatArray,
    route: FloatArray,
    origin_s: float,
    pose: EgoPose,
    car: Car,
    actors: Actors,
    now: Projection,
    own: BoolArray,
) -> tuple[float, float, float]:
    return look(tracked, speeds_up, route, origin_s, pose, car, actors, now, own)


@compiled(FLOAT, FLOAT, TABLE)
def _near_junctions(front_s: float, rear_s: float, junctions: FloatArray) -> IntArray:
    return near_junctions(front_s, rear_s, junctions)


@compiled(ACTORS, FLAGS, INTS, FOES, FLAG_TABLE, CUBE)
def _match(actors: Actors, own: BoolArray, which: IntArray, foes: FoeTable, on: BoolArray, found: FloatArray) -> None:
    match(actors, own, which, foes, on, found)


@compiled(ACTORS, NOW, INTS, FLAG_TABLE, CUBE, FOES, TABLE, FLOAT, FLOAT, FLOAT, CUBE)
def _predict(
    actors: Actors,
    now: Projection,
    which: IntArray,
    on: BoolArray,
    found: FloatArray,
    foes: FoeTable,
    route: FloatArray,
    origin_s: float,
    ego_s: float,
    reach_m: float,
    out: FloatArray,
) -> None:
    move_on(actors, now, which, on, found, foes, route, origin_s, ego_s, reach_m, out)
