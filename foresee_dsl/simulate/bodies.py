"""The body of a vehicle that SUMO drives: where its footprint is, given where SUMO has its front bumper.

SUMO turns a vehicle by what lies behind it on its lanes, which a description cannot hold, and moves it sideways in one
step when it changes lane. Here the front follows SUMO's, the rear axle is drawn behind it as a kinematic bicycle's is,
and a step to the side is driven off at a limited rate. All of it hangs on the last pose only, so that a run which
is rebuilt from a description goes on exactly as its parent did.
"""

from __future__ import annotations

import math

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.simulate.state import Mobile
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import VehicleState

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
    """A vehicle that SUMO drives."""

    __slots__ = ("_axle_m", "_fx", "_fy", "_half_m", "_offset", "_raw_x", "_raw_y")

    def __init__(self, actor: PlacedActor) -> None:
        """Start where the actor is placed."""
        super().__init__(actor)
        self._half_m = actor.model.length_m / 2
        self._axle_m = actor.model.front_overhang_m + actor.model.wheelbase_m
        self._fx, self._fy = self._raw_x, self._raw_y = actor.x, actor.y
        self._offset = 0.0

    def on_lane(self, centre: tuple[float, float] | None) -> None:
        """Say which point of its lane's centreline it was placed beside (`World.lane_centre`)."""
        if centre is None:
            return
        dx, dy = self._fx - centre[0], self._fy - centre[1]
        offset = dy * math.cos(self.heading) - dx * math.sin(self.heading)
        if abs(offset) > ROUNDING_M:
            self._offset = offset
            self._raw_x, self._raw_y = centre

    def follow(self, state: VehicleState) -> None:
        """Go on to where SUMO has the vehicle after a step."""
        x, y, lane_heading, speed, self.acceleration, self.lane = state
        jump = math.hypot(x - self._raw_x, y - self._raw_y) > speed * STEP_S + JUMP_M
        if jump or self._offset:
            cos, sin = math.cos(lane_heading), math.sin(lane_heading)
            if jump:
                self._offset += (self._raw_y - y) * cos - (self._raw_x - x) * sin
            most = min(SIDEWAYS_MPS, SIDEWAYS_SHARE * speed) * STEP_S
            self._offset = math.copysign(max(abs(self._offset) - most, 0.0), self._offset)
            self._raw_x, self._raw_y = x, y
            x, y = x - self._offset * sin, y + self._offset * cos
        else:
            self._raw_x, self._raw_y = x, y
        self._draw(x, y, speed)

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
