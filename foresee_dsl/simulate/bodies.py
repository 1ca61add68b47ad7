"""The body of a vehicle that SUMO drives: where its footprint is, given where SUMO has its front bumper.

SUMO turns a vehicle by what lies behind it on its lanes, which a description cannot hold, and moves it sideways in one
step when it changes lane. Here the front follows SUMO's, the rear axle is drawn behind it as a kinematic bicycle's is,
and a step to the side is driven off at a limited rate. All of it hangs on the last pose only, so that a run which
is rebuilt from a description goes on exactly as its parent did.
"""

from __future__ import annotations

import math
from dataclasses import replace

import shapely

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.compile.geometry import RoadNetwork
from foresee_dsl.compile.roads import Lane
from foresee_dsl.compile.starts import lane_kind
from foresee_dsl.simulate.state import Mobile, VehicleState
from foresee_dsl.simulate.trace import STEP_S

SIDEWAYS_MPS = 1.0
"""How fast a lane change moves sideways. Ours: 3.3 m in 3.3 s, within the 3 s to 5 s that lane changes take."""
SIDEWAYS_SHARE = 0.25
"""And at most this share of the speed, about 14 deg: a vehicle that stands does not slide."""
ROUNDING_M = 1e-2
"""An offset from the lane that rounding in a description can explain; it is corrected at once."""
JUMP_M = 0.5
"""A front that is this much further than its speed explains was moved by a lane change."""
SLOWEST_TURN_MPS = 0.5
"""Below this speed the steering angle is not read off the turning, which is noise then."""


class Body(Mobile):
    """A vehicle that SUMO drives.

    Attributes:
        rolls: SUMO drives it over the step before the first frame (`in_sumo`), as it would have in its parent.
    """

    __slots__ = ("_axle_m", "_beside", "_fx", "_fy", "_half_m", "_network", "_offset", "_raw_x", "_raw_y", "rolls")

    def __init__(self, actor: PlacedActor, network: RoadNetwork) -> None:
        """Start where the actor is placed."""
        super().__init__(actor)
        self._network = network
        self._half_m = actor.model.length_m / 2
        self._axle_m = actor.model.front_overhang_m + actor.model.wheelbase_m
        self._fx, self._fy = self._raw_x, self._raw_y = actor.x, actor.y
        self._offset = 0.0
        self.rolls = False
        self._beside = "", 0.0  # the lane that a place was looked up on last, and how far along
        if actor.lane:
            self._find_lane(network.lanes[actor.lane])

    def in_sumo(self) -> PlacedActor:
        """Return the actor as SUMO is to have it a step before the first frame: on the middle of its lane.

        SUMO would keep a distance from that for as long as the vehicle lives, and look for the nearest lane, which is
        another one at the beginning of a lane change. Where the lane begins, it is where it is at the first frame.
        """
        if not self.lane:
            return self.placed
        lane = self._network.lanes[self.lane]
        shape = shapely.LineString(lane.shape)
        now = float(shapely.line_locate_point(shape, shapely.Point(self._raw_x, self._raw_y)))
        # SUMO counts along the lane in its own length, which a map may give differently from the shape's.
        before = now - self.speed * STEP_S * shape.length / lane.length_m
        came_from = self._lane_before(lane) if before <= 0 else None
        if came_from is not None:  # it has just come over the end of that one
            left_m = self.speed * STEP_S - now * lane.length_m / shape.length
            lane, shape = came_from, shapely.LineString(came_from.shape)
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
        rear = self._fx - self.length * math.cos(self.heading), self._fy - self.length * math.sin(self.heading)
        ways = self._network.movements_into(lane.id, lane_kind(self.placed.model))
        if not ways or not route or route[0] != lane.edge:
            return route

        def away_m(via: tuple[str, ...]) -> float:
            return min((abs(self._network.lanes[one].line.project(*rear)[1]) for one in via), default=math.inf)

        return (min(ways, key=lambda way: away_m(way.via)).from_edge, *route)

    def _lane_before(self, lane: Lane) -> Lane | None:
        """Return the lane that leads to one inside a junction; None where there are several, or it is not inside."""
        ways = [m for m in self._network.movements if lane.id in m.via] if lane.internal else []
        before = {(m.from_lane, *m.via)[m.via.index(lane.id)] for m in ways}
        return self._network.lanes[before.pop()] if len(before) == 1 else None

    def _find_lane(self, nearest: Lane) -> None:
        """Find the lane that the vehicle follows, and the place on it that SUMO is to have it at."""
        # Who keeps beside the middle of its lane is not on its way to another one.
        near_s, lateral = nearest.line.project(self._fx, self._fy)
        lane = nearest if self.placed.line_m else self._heads_for(nearest, near_s, lateral)
        self.lane = lane.id
        line = shapely.LineString(lane.shape)
        centre = shapely.line_interpolate_point(
            line, shapely.line_locate_point(line, shapely.Point(self._fx, self._fy))
        )
        self._raw_x, self._raw_y = centre.x, centre.y
        if lane is not nearest:
            near_s, lateral = lane.line.project(self._fx, self._fy)
        self._beside = lane.id, near_s
        self._offset = lateral if abs(lateral) > ROUNDING_M else 0.0

    def _heads_for(self, nearest: Lane, s: float, lateral: float) -> Lane:
        """Return the lane that a vehicle between two lanes is changing to: the one that it turns towards.

        Up to the middle between them the nearest one is that which it leaves. It has turned away from that as far as
        half of what moving off its middle takes, at least.
        """
        side = 1 if lateral > 0 else -1
        slope = min(SIDEWAYS_SHARE, SIDEWAYS_MPS / max(self.speed, 0.1))
        takes = slope * (1.0 - math.exp(-abs(lateral) / (slope * self._axle_m)))
        lane_heading = nearest.line.at(max(s - self._axle_m, 0.0))[2]
        turned = side * math.remainder(self.heading - lane_heading, math.tau)
        beside = self._network.lanes.get(f"{nearest.edge}_{nearest.index + side}")
        if abs(lateral) <= ROUNDING_M or turned < takes / 2 or beside is None:
            return nearest
        return beside if lane_kind(self.placed.model) in beside.kinds else nearest

    def follow(self, state: VehicleState) -> None:
        """Go on to where SUMO has the vehicle after a step."""
        x, y, speed, self.acceleration, self.lane = state
        if (
            speed == self.speed == self.yaw_rate == self._offset == self.placed.line_m == 0.0
            and x == self._fx
            and y == self._fy
        ):
            return  # it stands, and has turned as far as it turns
        jump = math.hypot(x - self._raw_x, y - self._raw_y) > speed * STEP_S + JUMP_M
        if jump or self._offset or self.placed.line_m:
            cos, sin = self._direction(x, y)
            if jump:
                self._offset += (self._raw_y - y) * cos - (self._raw_x - x) * sin
            most = min(SIDEWAYS_MPS, SIDEWAYS_SHARE * speed) * STEP_S
            self._offset += max(-most, min(most, self.placed.line_m - self._offset))
            self._raw_x, self._raw_y = x, y
            x, y = x - self._offset * sin, y + self._offset * cos
        else:
            self._raw_x, self._raw_y = x, y
        self._draw(x, y, speed)

    def _direction(self, x: float, y: float) -> tuple[float, float]:
        """Cosine and sine of the lane's heading; not of SUMO's vehicle, which turns as its rear follows."""
        lane = self._network.lanes.get(self.lane)
        if lane is None:
            return math.cos(self.heading), math.sin(self.heading)
        s, _ = lane.line.project(x, y, self._beside[1] if self._beside[0] == self.lane else None)
        self._beside = self.lane, s
        heading = lane.line.at(s)[2]
        return math.cos(heading), math.sin(heading)

    def _draw(self, x: float, y: float, speed: float) -> None:
        """Move the front to a point; the rear axle is drawn towards it."""
        reach = self._axle_m
        rear_x = self._fx - reach * math.cos(self.heading)
        rear_y = self._fy - reach * math.sin(self.heading)
        heading = math.atan2(y - rear_y, x - rear_x)
        self.yaw_rate = math.remainder(heading - self.heading, math.tau) / STEP_S
        model = self.placed.model
        steer = math.atan(model.wheelbase_m * self.yaw_rate / max(speed, SLOWEST_TURN_MPS))
        self.steer = max(-model.max_steer_rad, min(model.max_steer_rad, steer))
        self._fx, self._fy = x, y
        self.heading = heading
        self.x = x - self._half_m * math.cos(heading)
        self.y = y - self._half_m * math.sin(heading)
        self.speed = speed
