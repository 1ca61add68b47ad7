"""A driver for foresee: keeps its lane, limit and distance, stops at red, and brakes for actors that come into its way.

Replace `step` by a call of your software. Coordinates: x east, y north, m; headings counter-clockwise from east, rad.
"""

import math

import numpy as np

from foresee_dsl.drivers.protocol import Control

BRAKING_MPS2 = 2.0  # comfortable; the pedal is pressed further if the ego is still too fast
GAP_M = 3.0  # to whatever it stops for
AHEAD_S = 2.0  # how far the motion of others is predicted


class MyDriver:
    """foresee makes a new object for each run, calls `reset` once, and `step` 20 times a simulated second."""

    name = "my_driver"
    version = "1"

    def reset(self, mission, vehicle, seed):  # noqa: ARG002 - for random choices, of which there are none
        """Begin a run: `mission` has the route to follow, `vehicle` the limits of the car."""
        self.mission, self.vehicle = mission, vehicle

    def step(self, observation):
        """Answer an observation: steer from -1 (right) to 1 (left), throttle and brake from 0 to 1."""
        ego, mission, car = observation.ego, self.mission, self.vehicle
        back_m = car.wheelbase_m + car.front_overhang_m - car.length_m / 2  # from the centre to the rear axle
        x, y = ego.x - back_m * math.cos(ego.heading_rad), ego.y - back_m * math.sin(ego.heading_rad)
        here_s = mission.s[self.nearest(x, y)]

        # Pure pursuit: the circle through the rear axle and a point ahead on the route.
        aim_x, aim_y = self.point(here_s + 4 + 0.5 * ego.speed_mps)
        turn = math.remainder(math.atan2(aim_y - y, aim_x - x) - ego.heading_rad, math.tau)
        wheels_rad = math.atan2(2 * car.wheelbase_m * math.sin(turn), math.hypot(aim_x - x, aim_y - y))

        far_x, far_y = self.point(here_s + 20)
        bend = abs(math.remainder(math.atan2(far_y - y, far_x - x) - ego.heading_rad, math.tau))
        limit_mps = float(np.interp(here_s, mission.s, mission.speed_limit_mps)) / (1 + 4 * bend)
        room_m = max(self.room(observation, here_s + back_m + car.length_m / 2), 0.0)
        missing_mps = min(limit_mps, math.sqrt(2 * BRAKING_MPS2 * room_m)) - ego.speed_mps
        return Control(
            steer=min(max(wheels_rad / car.steer_max_rad, -1.0), 1.0),
            throttle=min(max(missing_mps, 0.0), 1.0),
            brake=min(max(-missing_mps / 3, 0.0), 1.0),
        )

    def room(self, seen, front_s):
        """Return the distance from the ego's front to where it has to stop, m."""
        room_m = 1000.0
        for junction in self.mission.junctions:
            if seen.signals.get(junction.signal) in ("red", "amber") and junction.stop_s > front_s - 1:
                room_m = min(room_m, junction.stop_s - 1 - front_s)
        for actor in seen.actors:
            for ahead_s in np.arange(0.0, AHEAD_S + 0.1, 0.5):
                way_m = actor.speed_mps * ahead_s
                x, y = actor.x + way_m * math.cos(actor.heading_rad), actor.y + way_m * math.sin(actor.heading_rad)
                nearest = self.nearest(x, y)
                aside_m = math.dist(self.mission.centreline[nearest], (x, y))
                away_m = self.mission.s[nearest] - front_s
                in_way = aside_m < (actor.width_m + self.vehicle.width_m) / 2 + 0.4 and away_m > 0
                same_time = abs(away_m / max(seen.ego.speed_mps, 3.0) - ahead_s) < 1.5
                if in_way and (same_time or ahead_s == 0):
                    half_m = actor.length_m / 2 if ahead_s == 0 else 0.0
                    room_m = min(room_m, away_m - half_m - GAP_M)
        return room_m

    def nearest(self, x, y):
        """Return the index of the route's point nearest to a place."""
        offsets = self.mission.centreline - (x, y)
        return int((offsets * offsets).sum(axis=1).argmin())

    def point(self, s):
        """Return the point of the route at a length, m."""
        return tuple(float(np.interp(s, self.mission.s, self.mission.centreline[:, axis])) for axis in (0, 1))
