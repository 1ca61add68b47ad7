"""The vehicles that SUMO drives: computes their footprints from the positions of their front bumpers in SUMO.

SUMO derives a vehicle's heading from the lanes behind it, which a scene does not contain, and moves a vehicle sideways
in one step when it changes lane. Here the front follows SUMO's position, the rear axle follows the front as in a
kinematic bicycle, and the vehicle moves sideways at a limited rate where SUMO's position jumps. All of it depends only
on the last pose, so that a run rebuilt from a description continues exactly as its parent did.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import shapely

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane, cached, per_network
from foresee_dsl.kernels import sumo_traffic
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.bicycle import VehicleState
from foresee_dsl.kernels.lines import vertices
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.actors.bend_speeds import LaneBends
from foresee_dsl.simulate.actors.states import SimulatedActor, StateTable
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import VehicleStates, World

ROUNDING_M = 1e-2
"""An offset of a vehicle from its lane up to this, m, comes from rounding in a file and is corrected at once."""


class _PlaceInSumo(NamedTuple):
    """The place at which SUMO inserts a vehicle one step before the first frame; `rolls`: see `SumoVehicle`."""

    x: float
    y: float
    heading_rad: float
    lane: str
    route: tuple[str, ...]
    rolls: bool


class _PlaceOnLane(NamedTuple):
    """The lane that a placed vehicle follows: x, y of the nearest point of its centreline, the length along it, and the
    vehicle's offset to its left, m."""

    lane: str
    x: float
    y: float
    along_m: float
    offset_m: float


_MOST_PLACES = 2048
"""Maximum number of cached positions per network. Ours: the vehicles of a hundred test cases."""


@per_network
def _places_in_sumo(_: RoadNetwork) -> dict[tuple[Any, ...], _PlaceInSumo]:
    """Return the known places: in the mutants of a clip most vehicles begin at the same places."""
    return {}


@per_network
def _places_on_lanes(_: RoadNetwork) -> dict[tuple[Any, ...], _PlaceOnLane]:
    """Return the known places on lanes."""
    return {}


class SumoVehicle(SimulatedActor):
    """A vehicle that SUMO drives.

    Attributes:
        rolls: whether SUMO drives it in the step before the first frame (`in_sumo`), as it did in the parent run.
        record: its data for the kernels, a `SumoVehicleRecord`; an element of a table once it has joined one.
    """

    __slots__ = ("_beside", "_network", "record", "rolls")

    def __init__(self, actor: PlacedActor, network: RoadNetwork) -> None:
        """Place the vehicle as the scene says."""
        super().__init__(actor)
        self._network = network
        self.record: Any = np.array([self._first_record()], dtype_of(sumo_traffic.SumoVehicleRecord))[0]
        self.rolls = False
        self._beside = "", 0.0  # the lane on which the position was looked up, and the length along it, m
        if actor.lane:
            self._find_lane(network.lanes[actor.lane])

    @property
    def line_m(self) -> float:
        """Lateral distance to the left of its lane's centreline that the vehicle keeps, m."""
        return float(self.record["line"])

    @line_m.setter
    def line_m(self, left_m: float) -> None:
        self.record["line"] = left_m

    @property
    def beside_m(self) -> float:
        """Offset of the vehicle to the left of its position in SUMO, m."""
        return float(self.record["offset"])

    def _first_record(self) -> sumo_traffic.SumoVehicleRecord:
        model, x, y = self.placed.model, self.placed.x, self.placed.y
        return sumo_traffic.SumoVehicleRecord(
            row=0,
            half_length=model.length_m / 2,
            rear_axle=model.front_overhang_m + model.wheelbase_m,
            wheelbase=model.wheelbase_m,
            steer_max=model.max_steer_rad,
            line=self.placed.line_m,
            front_x=x,
            front_y=y,
            sumo_x=x,
            sumo_y=y,
            offset=0.0,
            lane_begin=0,
            lane_end=0,
            heading_s=math.nan,
            bends_s=math.nan,
            bends_begin=0,
            bends_end=0,
            slowest=math.inf,
            cruise=math.nan,
            limit=math.inf,
            ordered=math.nan,
        )

    def in_sumo(self) -> PlacedActor:
        """Return the actor as SUMO must insert it one step before the first frame: in the middle of its lane.

        SUMO would keep an offset from the middle until the vehicle leaves, and would choose the nearest lane; at the
        beginning of a lane change that is the lane which the vehicle leaves, not the one to which it changes. At the
        very beginning of a lane the vehicle does not roll and gets its position at the first frame. Where SUMO decides
        about the lateral position, the vehicle is inserted at the lateral position that the scene states, and does not
        roll, because SUMO would move it sideways in that step.
        """
        if not self.lane:
            return self.placed
        placed = self.placed
        key = self._key(self.lane, self.line_m, placed.route)
        position = cached(_places_in_sumo(self._network), key, _MOST_PLACES, self._place_in_sumo)
        x, y, heading, lane, route, self.rolls = position
        return replace(placed, x=x, y=y, heading_rad=heading, lane=lane, route=route)

    def _key(self, *more: object) -> tuple[object, ...]:
        """Return everything on which the vehicle's place depends, as the key of a cache."""
        placed = self.placed
        where = placed.x, placed.y, placed.heading_rad
        return (*more, self.speed, *where, placed.model, placed.passes, placed.sublanes)

    def _place_in_sumo(self) -> _PlaceInSumo:
        """See `in_sumo`."""
        lane = self._network.lanes[self.lane]
        shape = lane.centreline
        now = float(shapely.line_locate_point(shape, shapely.Point(self.record["sumo_x"], self.record["sumo_y"])))
        # SUMO scales positions along a lane to the lane's length attribute, which a map may set to a value that differs
        # from the length of the lane's shape.
        before = now - self.speed * STEP_S * shape.length / lane.length_m
        sublanes = self.placed.sublanes
        came_from = self._lane_before(lane) if before <= 0 and not sublanes else None
        if came_from is not None:  # the step before, its front was still on the previous lane
            left_m = self.speed * STEP_S - now * lane.length_m / shape.length
            lane, shape = came_from, came_from.centreline
            before = shape.length * (1 - left_m / lane.length_m)
        rolls = before > 0 and not sublanes
        at = shapely.line_interpolate_point(shape, before if rolls else now)
        near_s = self._beside[1] if lane.id == self._beside[0] else None
        heading = lane.line.at(lane.line.project(at.x, at.y, near_s)[0])[2]
        route = self.placed.route
        if not lane.internal and (before if rolls else now) < self.length:
            route = self._with_edge_before(lane, route)
        x, y = (float(self.record["sumo_x"]), float(self.record["sumo_y"])) if sublanes else (at.x, at.y)
        return _PlaceInSumo(x, y, heading, lane.id, route, rolls)

    def _with_edge_before(self, lane: Lane, route: tuple[str, ...]) -> tuple[str, ...]:
        """Return a route, with the edge before the junction put first if the vehicle's rear may still be inside it.

        Without that edge SUMO guesses that the vehicle came along the straightest approach, and the followers on that
        approach brake for a vehicle that is not there.
        """
        length, heading = self.length, self.heading
        rear = self.placed.x - length * math.cos(heading), self.placed.y - length * math.sin(heading)
        ways = self._network.movements_into(lane.id, lane_kind(self.placed.model))
        if not ways or not route or route[0] != lane.edge:
            return route

        def away_m(via: tuple[str, ...]) -> float:
            return min((abs(self._network.lanes[lane_id].line.project(*rear)[1]) for lane_id in via), default=math.inf)

        return (min(ways, key=lambda way: away_m(way.via)).from_edge, *route)

    def _lane_before(self, lane: Lane) -> Lane | None:
        """Return the only lane that leads into a lane inside a junction; None if several do, or the lane is not inside
        a junction.
        """
        ways = self._network.movements_through(lane.id)
        before = {(m.from_lane, *m.via)[m.via.index(lane.id)] for m in ways}
        return self._network.lanes[before.pop()] if len(before) == 1 else None

    def _find_lane(self, nearest: Lane) -> None:
        """Find the lane that the vehicle follows, and the vehicle's place on it; from the cache if possible."""
        record, key = self.record, self._key(nearest.id, self.placed.line_m)
        places = _places_on_lanes(self._network)
        position = cached(places, key, _MOST_PLACES, lambda: self._place_on_lane(nearest))
        self.lane, record["sumo_x"], record["sumo_y"], record["heading_s"], record["offset"] = position
        self._beside = position.lane, position.along_m

    def _place_on_lane(self, nearest: Lane) -> _PlaceOnLane:
        """See `_find_lane`."""
        # A vehicle that keeps a distance from the middle of its lane is not changing to another lane.
        x, y = self.placed.x, self.placed.y
        near_s, lateral = nearest.line.project(x, y)
        if self.placed.passes or (self.placed.sublanes and not self.placed.line_m):
            return _PlaceOnLane(nearest.id, x, y, near_s, 0.0)
        lane = nearest if self.placed.line_m else self._heads_for(nearest, near_s, lateral)
        line = lane.centreline
        centre = shapely.line_interpolate_point(line, shapely.line_locate_point(line, shapely.Point(x, y)))
        if lane is not nearest:
            near_s, lateral = lane.line.project(x, y)
        return _PlaceOnLane(lane.id, centre.x, centre.y, near_s, lateral if abs(lateral) > ROUNDING_M else 0.0)

    def _heads_for(self, nearest: Lane, s: float, lateral: float) -> Lane:
        """Return the lane that a vehicle between two lanes is changing to, judged by its heading.

        In the first half of a change, the nearest lane is the lane that the vehicle leaves. The vehicle counts as
        leaving the nearest lane if it has turned away from it by at least half the angle that its offset from the
        lane's middle requires.
        """
        side = 1 if lateral > 0 else -1
        slope = min(sumo_traffic.SIDEWAYS_SHARE, sumo_traffic.SIDEWAYS_MPS / max(self.speed, 0.1))
        axle_m = self.placed.model.front_overhang_m + self.placed.model.wheelbase_m
        takes = slope * (1.0 - math.exp(-abs(lateral) / (slope * axle_m)))
        lane_heading = nearest.line.at(max(s - axle_m, 0.0))[2]
        turned = side * math.remainder(self.heading - lane_heading, math.tau)
        beside = self._network.lanes.get(f"{nearest.edge}_{nearest.index + self._network.lanes_to(side)}")
        if abs(lateral) <= ROUNDING_M or turned < takes / 2 or beside is None:
            return nearest
        return beside if lane_kind(self.placed.model) in beside.kinds else nearest


class LaneTable(NamedTuple):
    """The lines of all lanes of a network.

    Attributes:
        spans: for each lane id, the index of the lane's first vertex and the index after its last one. vertices: the
            vertices of all lanes.
    """

    spans: dict[str, tuple[int, int]]
    vertices: Records


@per_network
def lane_table(network: RoadNetwork) -> LaneTable:
    """Return the lane table of a network."""
    spans, lines, begin = {}, [], 0
    for lane_id, lane in network.lanes.items():
        line = lane.line
        spans[lane_id] = begin, begin + len(line.xy)
        lines.append(vertices(line.xy, line.marks, line.angles))
        begin += len(line.xy)
    return LaneTable(spans, np.concatenate([vertices((), (), ()), *lines]))


class SumoTraffic:
    """The vehicles of a run that SUMO drives. A vehicle stops being one when it leaves or Python takes it over.

    Args:
        vehicles: the vehicles; each must have joined the state table. states: the state table of all actors. rows: rows
            of that table by id. world: SUMO's world. network: the roads. friction: tyre-road coefficient.
        cruise_mps: speed of each vehicle where nothing hinders it, by id, m/s.
    """

    def __init__(
        self,
        vehicles: Sequence[SumoVehicle],
        states: StateTable,
        rows: Mapping[str, int],
        world: World,
        network: RoadNetwork,
        friction: float,
        cruise_mps: Mapping[str, float],
    ) -> None:
        self._vehicles, self._world = tuple(vehicles), world
        self._numbers = {vehicle.id: number for number, vehicle in enumerate(vehicles)}
        self._records = np.array([vehicle.record for vehicle in vehicles], dtype_of(sumo_traffic.SumoVehicleRecord))
        self._ordered = self._records["ordered"]  # a view, because reading a record's field takes ten times as long
        self._states = states.states.reshape(-1).view(dtype_of(VehicleState))
        self._table = lane_table(network)
        self._bends = LaneBends(network, friction)
        self._changed = np.zeros(len(vehicles), dtype=np.int64)
        self._driven = np.arange(len(vehicles), dtype=np.int64)
        self._names: tuple[str, ...] = ()
        self._seen = self._driven
        for number, vehicle in enumerate(vehicles):
            vehicle.record = self._records[number]
            vehicle.record["row"], vehicle.record["cruise"] = rows[vehicle.id], cruise_mps[vehicle.id]
            self._set_lane(number, vehicle.lane)

    def slow_for_bends(self) -> None:
        """Tell SUMO, for the next step, the speed at which each vehicle can take the bends ahead.

        SUMO 1.28 itself slows vehicles down only for bends inside junctions, and does not consider that they may tip
        over.
        """
        changed = self._update_limits()
        if not changed:
            return
        with Part.WORLD:
            for number in changed:
                self._world.limit_speed(self._vehicles[number].id, self._ordered.item(number))

    def may_drive_mps(self) -> dict[str, float]:
        """Return the speed that bends allow each vehicle in the next step, m/s; infinite without a bend."""
        self._update_limits()
        self._ordered[:] = np.nan  # NaN: SUMO has not received these limits yet
        return {vehicle.id: float(vehicle.record["limit"]) for vehicle in self._vehicles}

    def set_cruise(self, vehicle: str, speed_mps: float) -> None:
        """Change the speed that a vehicle drives if nothing slows it down, m/s."""
        record = self._records[self._numbers[vehicle]]
        record["cruise"], record["ordered"] = speed_mps, np.nan

    def follow(self, vehicles: VehicleStates) -> tuple[str, ...]:
        """Move every vehicle to its position in SUMO after a step; return the ids of the vehicles that left."""
        names, numbers, changed = vehicles
        left: tuple[str, ...] = ()
        if names is not self._names:
            left = self._note_names(names)
        for vehicle, lane in changed:
            number = self._numbers[vehicle]
            if lane != self._vehicles[number].lane:
                self._vehicles[number].lane = lane
                self._set_lane(number, lane)
        sumo_traffic.follow(self._seen, numbers, self._records, self._states, self._table.vertices, STEP_S)
        return left

    def drop(self, vehicle: str) -> None:
        """Stop following a vehicle, because Python moves it from now on or it has left."""
        self._driven = self._driven[self._driven != self._numbers[vehicle]]
        # SUMO has no vehicle now and may never get another, and then `_note_names` would not be called.
        if not self._names:
            self._seen = self._driven

    def adopt(self, vehicle: str, lane: str, cruise_mps: float) -> None:
        """Follow a vehicle in SUMO from now on that Python moved until now."""
        number = self._numbers[vehicle]
        self._driven = np.append(self._driven[self._driven != number], number)
        self._vehicles[number].lane = lane
        self._set_lane(number, lane)
        self.set_cruise(vehicle, cruise_mps)

    def _update_limits(self) -> list[int]:
        """Compute the speed limits from bends; return the numbers of the vehicles whose limit in SUMO must change."""
        count = sumo_traffic.slow_for_bends(
            self._driven, self._records, self._states, self._table.vertices, self._bends.points, self._changed, STEP_S
        )
        changed: list[int] = self._changed[:count].tolist() if count else []
        return changed

    def _set_lane(self, number: int, lane: str) -> None:
        """Set the lane of a vehicle, and the bends ahead of it."""
        vehicle, record = self._vehicles[number], self._records[number]
        if record["lane_end"] > 0:  # a length along the last lane says nothing about the new lane
            record["heading_s"] = np.nan
        record["bends_s"] = np.nan
        record["lane_begin"], record["lane_end"] = self._table.spans.get(lane, (0, 0))
        ahead = self._bends.ahead(vehicle.id, vehicle.placed.model, lane, vehicle.placed.route)
        record["bends_begin"], record["bends_end"], record["slowest"] = ahead

    def _note_names(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Store the vehicles that SUMO has now; return the ids of those that it does not have any more."""
        self._names = names
        self._seen = np.array([self._numbers[name] for name in names], dtype=np.int64)
        here = set(names)
        left = tuple(self._vehicles[k].id for k in self._driven.tolist() if self._vehicles[k].id not in here)
        for name in left:
            self._vehicles[self._numbers[name]].present = False
            self.drop(name)
        return left
