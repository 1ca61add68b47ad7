"""A planner for foresee: along its lane, with the limit and its distance, to a stop at red and for actors in its way.

It answers a trajectory; foresee's tracker turns it into steering, throttle and brake, and each run says how far the ego
was from it. Replace `step` by a call of your planner. Coordinates: x east, y north, m; headings counter-clockwise from
east, rad; times are those of the observation, s.
"""

import math

import numpy as np

from foresee_dsl.drivers.protocol import Trajectory

HORIZON_S, STEP_S = 4.0, 0.2  # of the trajectory
ACCELERATION_MPS2, BRAKING_MPS2, HARDEST_MPS2 = 1.5, 2.0, 7.0
GAP_M = 3.0  # to whatever it stops for
AHEAD_S = 2.5  # how far the motion of others is predicted


class MyPlanner:
    """foresee makes a new object for each run, calls `reset` once, and `step` 20 times a simulated second."""

    name = "my_planner"
    version = "1"

    def reset(self, mission, vehicle, seed):  # noqa: ARG002 - for random choices, of which there are none
        """Begin a run: `mission` has the route to follow, `vehicle` the limits of the car."""
        self.mission, self.vehicle = mission, vehicle

    def step(self, observation):
        """Return where the ego's middle shall be in the next seconds."""
        ego = observation.ego
        at_s = here_s = self.mission.s[self.nearest(ego.x, ego.y)]
        room_m = self.room(observation, here_s + self.vehicle.length_m / 2)
        speed_mps, places_s = ego.speed_mps, [here_s]
        for _ in range(round(HORIZON_S / STEP_S)):
            left_m = max(room_m - (at_s - here_s), 0.0)
            target_mps = min(self.limit_mps(at_s), math.sqrt(2 * BRAKING_MPS2 * left_m))
            change_mps = min(max(target_mps - speed_mps, -HARDEST_MPS2 * STEP_S), ACCELERATION_MPS2 * STEP_S)
            speed_mps = max(speed_mps + change_mps, 0.0)
            at_s += speed_mps * STEP_S
            places_s.append(at_s)
        times_s = observation.time_s + STEP_S * np.arange(len(places_s))
        return Trajectory(times_s, np.array([self.point(s) for s in places_s]))

    def limit_mps(self, s):
        """Return the speed limit at a length of the route, or less before and in a bend, m/s."""
        (x, y), (near_x, near_y), (far_x, far_y) = (self.point(s + ahead_m) for ahead_m in (0, 5, 20))
        now_rad, then_rad = math.atan2(near_y - y, near_x - x), math.atan2(far_y - near_y, far_x - near_x)
        bend = abs(math.remainder(then_rad - now_rad, math.tau))
        return float(np.interp(s, self.mission.s, self.mission.speed_limit_mps)) / (1 + 2 * bend)

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
