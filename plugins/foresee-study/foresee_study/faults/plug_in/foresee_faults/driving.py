"""Faults of the vehicle and of driving itself: brakes, steering, speed, place in the lane."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.protocol import Control, EgoState, FloatArray, Mission, Observation, VehicleLimits
from foresee_dsl.kernels.constants import STEP_S
from foresee_dsl.kernels.pdm.route import GRID_M
from foresee_faults.fault import WET_FRICTION, Actors, DriverState, Fault


class WeakBrakesWet(Fault):
    """Brakes too weakly on wet roads."""

    part = DriverPart.CONTROL
    cause = "water on the discs, and a controller that does not look at what came of its command"
    scale = "0 to 80 % less"

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Reduce the brake on a wet road."""
        if self.vehicle.friction >= WET_FRICTION:
            return control
        return replace(control, brake=control.brake * (1 - self.between(0.0, 0.8)))


class WeakBrakes(Fault):
    """Brakes too weakly."""

    part = DriverPart.CONTROL
    cause = "a load that the controller does not know of, worn or hot brakes"
    scale = "0 to 60 % less"

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Reduce the brake."""
        return replace(control, brake=control.brake * (1 - self.between(0.0, 0.6)))


class ComfortOnly(Fault):
    """Never brakes hard."""

    part = DriverPart.CONTROL
    cause = "a limit for comfort that also holds for emergencies"
    scale = "at most 100 % to 20 % of the brakes"
    source = "NTSB HAR-19/03 (Tempe: emergency braking was suppressed)"

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Cap the brake."""
        return replace(control, brake=min(control.brake, self.between(1.0, 0.2)))


class SlowBrakes(Fault):
    """Brakes late: the pressure builds up slowly."""

    part = DriverPart.CONTROL
    cause = "air in the hydraulics, or a filter in the actuator's interface"
    scale = "time constant 0 to 0.8 s"

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin without brake pressure."""
        super().begin(mission, vehicle, seed)
        self._brake = 0.0

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Let the brake's pressure build up slowly; a released brake is released at once."""
        lag_s = self.between(0.0, 0.8)
        share = STEP_S / (STEP_S + lag_s)
        self._brake = min(self._brake + share * (control.brake - self._brake), control.brake)
        return replace(control, brake=self._brake) if lag_s else control


class IgnoresWetness(Fault):
    """Drives on wet roads as on dry ones."""

    part = DriverPart.RULES
    cause = "friction is a constant"
    scale = "0 to 100 % of the missing friction is believed to be there; at most half as much again"

    def change_vehicle(self, vehicle: VehicleLimits) -> VehicleLimits:
        """Overrate the friction of wet roads."""
        if vehicle.friction >= WET_FRICTION:
            return vehicle
        return replace(vehicle, friction=vehicle.friction * (1 + 0.5 * self.strength))


class LateSteering(Fault):
    """Steers late."""

    part = DriverPart.CONTROL
    cause = "a bus that is too busy between the controller and the steering"
    scale = "0 to 0.6 s"

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Empty the queue of delayed commands."""
        super().begin(mission, vehicle, seed)
        self._queue: deque[float] = deque()

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Return the steering that was commanded some steps ago."""
        self._queue.append(control.steer)
        while len(self._queue) > round(self.between(0.0, 0.6) / STEP_S) + 1:
            self._queue.popleft()
        return replace(control, steer=self._queue[0])


class Freezes(Fault):
    """Freezes: every 4 s it repeats its last command for a while."""

    part = DriverPart.CONTROL
    cause = "a planner that misses its cycle, and a controller that holds the last answer"
    scale = "for 0 to 2 s"
    every_s = 4.0

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Forget the last command."""
        super().begin(mission, vehicle, seed)
        self._last: Control | None = None

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Repeat the last command in the last part of each period; when a period begins depends on the run's seed."""
        shift_s = self.every_s * float(self.random(3).random())
        in_period_s = (observation.time_s + shift_s) % self.every_s
        if self._last is None or in_period_s < self.every_s - self.between(0.0, 2.0):
            self._last = control
        return self._last


class Hesitates(Fault):
    """Hesitates: stops again soon after it has set off."""

    part = None
    cause = "the gap is judged anew after each step, with a stricter rule than before"
    scale = "for 0 to 3 s"

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin without an earlier stop."""
        super().begin(mission, vehicle, seed)
        self._stood_s, self._left_s = -math.inf, -math.inf

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Brake from 1.5 s after the ego has set off, unless the fault caused the last stop."""
        now_s, speed = observation.time_s, observation.ego.speed_mps
        if speed < 0.1 and now_s - self._left_s > 8.0:
            self._stood_s = now_s
        elif speed > 1.0 and now_s - self._stood_s < 2.0 and now_s - self._left_s > 8.0:
            self._left_s = now_s
        stops = 1.5 <= now_s - self._left_s < 1.5 + self.between(0.0, 3.0)
        return Control(control.steer, 0.0, max(control.brake, 0.4)) if stops else control


class Overspeeds(Fault):
    """Drives faster than it may."""

    part = DriverPart.RULES
    cause = "a sign that is missing in the map"
    scale = "the limit and 0 to 70 % more"
    source = "NHTSA 23V-085 (posted speed limits)"

    def change_mission(self, mission: Mission) -> Mission:
        """Raise the limits."""
        return replace(mission, speed_limit_mps=mission.speed_limit_mps * (1 + self.between(0.0, 0.7)))


class SlowSpeedometer(Fault):
    """Takes itself for slower than it is, so that it drives faster and brakes late."""

    part = DriverPart.PERCEPTION
    cause = "wheels of another size"
    scale = "by 0 to 25 %"

    def change_ego(self, ego: EgoState, observation: Observation) -> EgoState:
        """Report a lower speed."""
        return replace(ego, speed_mps=ego.speed_mps * (1 - self.between(0.0, 0.25)))


class BesideItself(Fault):
    """Drives too far to the left."""

    part = DriverPart.PERCEPTION
    cause = "localisation with a bias across the lane"
    scale = "by 0 to 1.2 m"

    def change_ego(self, ego: EgoState, observation: Observation) -> EgoState:
        """Report a position to the right."""
        dx, dy = self._aside(ego)
        return replace(ego, x=ego.x + dx, y=ego.y + dy)

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Report all others equally far to the right, because they are measured relative to the ego."""
        dx, dy = self._aside(observation.ego)
        return tuple(replace(a, x=a.x + dx, y=a.y + dy) for a in actors)

    def _aside(self, ego: EgoState) -> tuple[float, float]:
        far = self.between(0.0, 1.2)
        return far * math.sin(ego.heading_rad), -far * math.cos(ego.heading_rad)


class CutsCorners(Fault):
    """Cuts corners."""

    part = None
    cause = "a smoothing of the route that is too strong"
    scale = "by 0 to 1.5 m in bends of less than 50 m radius"

    def change_mission(self, mission: Mission) -> Mission:
        """Move the line inwards where it bends; the lanes' edges stay where they are."""
        most = self.between(0.0, 1.5)
        x, y = np.asarray(mission.centreline, dtype=float).T
        tx, ty = np.gradient(x), np.gradient(y)
        heading = np.unwrap(np.arctan2(ty, tx))
        length = np.maximum(np.gradient(np.asarray(mission.s, dtype=float)), 1e-6)
        bend = _smooth(np.gradient(heading) / length, 5)
        inwards = _smooth(np.clip(bend / 0.02, -1.0, 1.0) * (np.abs(bend) > 0.005), 9) * most
        moved = np.column_stack([x - inwards * np.sin(heading), y + inwards * np.cos(heading)])
        if not most:
            return mission
        left, right = np.maximum(mission.left_m - inwards, 0.0), np.maximum(mission.right_m + inwards, 0.0)
        return replace(mission, centreline=moved, left_m=left, right_m=right)


class FastInCurves(Fault):
    """Is too fast in bends."""

    part = None
    cause = "a limit of lateral acceleration that was meant for a sports mode"
    scale = "2.5 to 5 m/s^2 to the side"

    def settle(self, state: DriverState) -> None:
        """Give the driver another speed profile, in a copy of its route, because other runs share the route."""
        if not self.strength:
            return
        route = state.route
        columns = {name: values.copy() for name, values in route.columns.items()}
        limit = np.interp(columns["s"], self.task.s, self.task.speed_limit_mps)
        squared = np.minimum(limit**2, self.between(2.5, 5.0) / np.maximum(np.abs(columns["curvature"]), 1e-6))
        ramp = 2.0 * 2.0 * GRID_M * np.arange(len(squared))
        columns["profile"] = np.sqrt(np.minimum.accumulate((squared + ramp)[::-1])[::-1] - ramp)
        points = route.points.copy()
        points["profile"] = columns["profile"]
        state.follow(replace(route, points=points, columns=columns))


def _smooth(values: FloatArray, width: int) -> FloatArray:
    """Return a running mean."""
    if len(values) <= width:
        return values
    padded = np.pad(values, width // 2, mode="edge")
    return np.asarray(np.convolve(padded, np.full(width, 1 / width), mode="valid"))[: len(values)]
