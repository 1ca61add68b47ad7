"""The body of a vehicle that SUMO drives: where its footprint is, given where SUMO has its front bumper.

SUMO turns a vehicle by what lies behind it on its lanes, which a description cannot hold, and moves it sideways in one
step when it changes lane. Here the front follows SUMO's, the rear axle is drawn behind it as a kinematic bicycle's is,
and a step to the side is driven off at a limited rate. All of it hangs on the last pose only, so that a run which
is rebuilt from a description goes on exactly as its parent did.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.placement.starts import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.kernels.sumo_traffic import BESIDE_S, OFFSET, RAW_X, RAW_Y, SIDEWAYS_MPS, SIDEWAYS_SHARE
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.trace import STEP_S

ROUNDING_M = 1e-2
"""An offset from the lane that rounding in a description can explain; it is corrected at once."""


class SumoVehicle(Actor):
    """A vehicle that SUMO drives.

    Attributes:
        rolls: SUMO drives it over the step before the first frame (`in_sumo`), as it would have in its parent.
        memory: [7] what is remembered of the last step, see `kernels.sumo_traffic`.
    """

    __slots__ = ("_beside", "_network", "memory", "rolls")

    def __init__(self, actor: PlacedActor, network: RoadNetwork) -> None:
        """Start where the actor is placed."""
        super().__init__(actor)
        self._network = network
        self.memory = np.array((actor.x, actor.y, actor.x, actor.y, 0.0, math.nan, math.nan))
        self.rolls = False
        self._beside = "", 0.0  # the lane that its place was looked up on, and how far along
        if actor.lane:
            self._find_lane(network.lanes[actor.lane])

    @property
    def shape(self) -> tuple[float, ...]:
        """[5] what a kernel needs to know of it, see `kernels.sumo_traffic`."""
        model = self.placed.model
        reach = model.front_overhang_m + model.wheelbase_m
        return model.length_m / 2, reach, model.wheelbase_m, model.max_steer_rad, self.placed.line_m

    def in_sumo(self) -> PlacedActor:
        """Return the actor as SUMO is to have it a step before the first frame: on the middle of its lane.

        SUMO would keep a distance from that for as long as the vehicle lives, and look for the nearest lane, which is
        another one at the beginning of a lane change. Where the lane begins, it is where it is at the first frame.
        """
        if not self.lane:
            return self.placed
        lane = self._network.lanes[self.lane]
        shape = lane.centreline
        now = float(shapely.line_locate_point(shape, shapely.Point(self.memory[RAW_X], self.memory[RAW_Y])))
        # SUMO counts along the lane in its own length, which a map may give differently from the shape's.
        before = now - self.speed * STEP_S * shape.length / lane.length_m
        came_from = self._lane_before(lane) if before <= 0 else None
        if came_from is not None:  # it has just come over the end of that one
            left_m = self.speed * STEP_S - now * lane.length_m / shape.length
            lane, shape = came_from, came_from.centreline
            before = shape.length * (1 - left_m / lane.length_m)
        self.rolls = before > 0
        at = shapely.line_interpolate_point(shape, before if self.rolls else now)
        near_s = self._beside[1] if lane.id == self._beside[0] else None
        heading = lane.line.at(lane.line.project(at.x, at.y, near_s)[0])[2]
        route = self.placed.route
        if not lane.internal and (before if self.rolls else now) < self.length:
            route = self._with_edge_before(lane, route)
        return replace(self.placed, x=at.x, y=at.y, heading_rad=heading, lane=lane.id, route=route)

    def _with_edge_before(self, lane: Lane, route: tuple[str, ...]) -> tuple[str, ...]:
        """Return a route with the edge from which a vehicle came whose rear is inside the junction still.

        Otherwise SUMO takes it to be where the straightest way is, and whoever follows it there brakes or does not.
        """
        length, heading = self.length, self.heading
        rear = self.placed.x - length * math.cos(heading), self.placed.y - length * math.sin(heading)
        ways = self._network.movements_into(lane.id, lane_kind(self.placed.model))
        if not ways or not route or route[0] != lane.edge:
            return route

        def away_m(via: tuple[str, ...]) -> float:
            return min((abs(self._network.lanes[one].line.project(*rear)[1]) for one in via), default=math.inf)

        return (min(ways, key=lambda way: away_m(way.via)).from_edge, *route)

    def _lane_before(self, lane: Lane) -> Lane | None:
        """Return the lane that leads to one inside a junction; None where there are several, or it is not inside."""
        ways = self._network.movements_through(lane.id)
        before = {(m.from_lane, *m.via)[m.via.index(lane.id)] for m in ways}
        return self._network.lanes[before.pop()] if len(before) == 1 else None

    def _find_lane(self, nearest: Lane) -> None:
        """Find the lane that the vehicle follows, and the place on it that SUMO is to have it at."""
        # Who keeps beside the middle of its lane is not on its way to another one.
        x, y, memory = self.placed.x, self.placed.y, self.memory
        near_s, lateral = nearest.line.project(x, y)
        lane = nearest if self.placed.line_m else self._heads_for(nearest, near_s, lateral)
        self.lane = lane.id
        line = lane.centreline
        centre = shapely.line_interpolate_point(line, shapely.line_locate_point(line, shapely.Point(x, y)))
        memory[RAW_X], memory[RAW_Y] = centre.x, centre.y
        if lane is not nearest:
            near_s, lateral = lane.line.project(x, y)
        self._beside = lane.id, near_s
        memory[BESIDE_S] = near_s
        memory[OFFSET] = lateral if abs(lateral) > ROUNDING_M else 0.0

    def _heads_for(self, nearest: Lane, s: float, lateral: float) -> Lane:
        """Return the lane that a vehicle between two lanes is changing to: the one that it turns towards.

        Up to the middle between them the nearest one is that which it leaves. It has turned away from that as far as
        half of what moving off its middle takes, at least.
        """
        side = 1 if lateral > 0 else -1
        slope = min(SIDEWAYS_SHARE, SIDEWAYS_MPS / max(self.speed, 0.1))
        axle_m = self.placed.model.front_overhang_m + self.placed.model.wheelbase_m
        takes = slope * (1.0 - math.exp(-abs(lateral) / (slope * axle_m)))
        lane_heading = nearest.line.at(max(s - axle_m, 0.0))[2]
        turned = side * math.remainder(self.heading - lane_heading, math.tau)
        beside = self._network.lanes.get(f"{nearest.edge}_{nearest.index + side}")
        if abs(lateral) <= ROUNDING_M or turned < takes / 2 or beside is None:
            return nearest
        return beside if lane_kind(self.placed.model) in beside.kinds else nearest
