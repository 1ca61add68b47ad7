"""Drives a vehicle from the beginning of its steering perturbation: first with the offset for its duration, then back
to the lane.

Before the perturbation, SUMO drives the vehicle. A clip restores such a vehicle from its `BicycleState` and the time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import atan, atan2, cos, hypot, pi, sin, sqrt

import numpy as np

from foresee_dsl.compile.bundle import TimedValue
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.drivers.protocol import Control, VehicleLimits
from foresee_dsl.kernels.boxes import Mover
from foresee_dsl.simulate.actors.bend_speeds import PLANNED_SHARE, TURNS_WITH, approached
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.actors.target_selection import STRAYS_M, Target, TargetSelection

STOP_LINE_M = 0.5
"""The vehicle halts with its front this far before a stop line, and has passed the line when its front is this far
beyond it, m. Ours: SUMO's cars halt within 1 m of the line."""

SLOWING_S = 0.4
"""Time constant with which speed above a limit is reduced, s. Limits are looked up this time ahead, which makes up for
the delay. Ours: four times the lag of the brakes."""


@dataclass(frozen=True, slots=True)
class RecoverySettings:
    """Parameters of an actor that SUMO no longer drives. All values are ours unless stated otherwise.

    Attributes:
        lookahead_s, lookahead_min_m: look-ahead of pure pursuit, and its least length. Measured with a car and a bus
            14 m off their lane at 14 to 30 m/s: 0.5 s overshoots the lane by 5 m, 0.9 s by 1 m, 1.2 s by 0.5 m; from
            0.7 s to 1.2 s all are back in their lane within 8 s. A longer look-ahead cuts corners. The least length
            avoids oscillation at walking speed.
        recovery_mps2: lateral acceleration on the way back to the lane: 0.4 g, less than half of what dry tyres hold.
        headway_s, standstill_m: time gap and standing gap of the car-following model; they are SUMO's tau and minGap,
            so that the actor keeps the same gaps as before.
    """

    lookahead_s: float = 1.0
    lookahead_min_m: float = 5.0
    recovery_mps2: float = 4.0
    headway_s: float = 1.0
    standstill_m: float = 2.5


class LaneRecovery:
    """Drives an actor that SUMO drove before: it steers with an offset for a while, then returns to its lane.

    Steering: while the offset acts, the wheel angle is that of the lane's bend plus the offset, and the lateral error
    is not corrected; afterwards the actor steers by pure pursuit (Coulter, CMU-RI-TR-92-01). Speed: the actor follows
    the Intelligent Driver Model (Treiber et al., 2000), towards its cruising speed within the speed limits, and behind
    the nearest body in its way.

    Args: limits: the limits of the actor's vehicle.
        line: the centreline of its route.
        cruise_mps: speed where nothing hinders it, m/s.
        offset: share of the largest steering angle (left positive) for a time.
        line_m: lateral distance to the left of the line that it keeps, m.
    """

    def __init__(
        self,
        limits: VehicleLimits,
        line: RouteLine,
        *,
        cruise_mps: float,
        offset: TimedValue | None = None,
        line_m: float = 0.0,
    ) -> None:
        self.limits = limits
        self.bicycle = Bicycle(limits)
        self.line = line
        self.settings = RecoverySettings()
        self.cruise_mps, self.offset, self.line_m = cruise_mps, offset, line_m
        holds = self.bicycle.lateral_mps2
        self.recovery_mps2 = min(holds, self.settings.recovery_mps2)
        self._targets = TargetSelection(limits, line, line_m)
        self._marks: list[float] = line.s.tolist()
        self._allowed = _allowed_speed(line, min(self.recovery_mps2, TURNS_WITH * holds), limits.braking_mps2)
        self._curvature: list[float] = line.curvature.tolist()
        self._near_s: float | None = None

    def take_over(self, x: float, y: float, heading: float, speed: float, acceleration: float = 0.0) -> BicycleState:
        """Return the first state of an actor that SUMO moved until now; its wheels are at the angle of the
        lane's bend.
        """
        curvature = self._curvature[self._mark(self.line.project(x, y)[0])]
        steer = self.bicycle.steer_for(curvature)
        return BicycleState(x, y, heading, speed, acceleration, speed * curvature, steer)

    def done(self, state: BicycleState) -> bool:
        """Return whether the actor has reached the end of its route."""
        return self._along(state)[0] >= self._marks[-1] - 1e-6

    def step(
        self,
        state: BicycleState,
        time_s: float,
        others: Sequence[Mover],
        dt: float,
        *,
        stop_s: float | None = None,
        yields: bool = True,
    ) -> BicycleState:
        """Return the state `dt` seconds later.

        Args:
            state: the current state. others: the bodies around it, without itself; NaN where absent.
            stop_s: length along its line that its front may not pass (a red signal); None when it may go. A stop that
                it has passed or cannot brake for is ignored.
            yields: whether it brakes for actors about to cross its path; otherwise only for bodies already in it.
        """
        s, beside = self._along(state)
        offset = self._offset_now(time_s)
        steer = self._steering(state, offset, s, dt)
        strays = offset != 0 or abs(beside - self.line_m) > STRAYS_M
        targets = list(self._targets.targets(state, s, others, strays=strays, yields=yields))
        if stop_s is not None:
            targets.extend(self._line_ahead(state, stop_s - s - self.limits.length_m / 2))
        acceleration = self._pedals(state.speed, s, targets)
        return self.bicycle.step(state, self._control(state, steer, acceleration), dt)

    def _along(self, state: BicycleState) -> tuple[float, float]:
        self._near_s, left = self.line.project(state.x, state.y, self._near_s)
        return self._near_s, left

    def _offset_now(self, time_s: float) -> float:
        # Half a microsecond of tolerance, because times are sums of steps of 0.05 s, which are not exact in binary.
        if self.offset is None or not self.offset.from_s - 5e-7 <= time_s < self.offset.until_s - 5e-7:
            return 0.0
        return self.offset.value

    def _steering(self, state: BicycleState, offset: float, s: float, dt: float) -> float:
        """Return the angle of the front wheels (rad) that the steering turns to in this step."""
        limit = self.limits.steer_max_rad
        if offset:
            steer = self.bicycle.steer_for(self._curvature[self._mark(s)]) + offset * limit
            bound = self.bicycle.lateral_mps2
        else:
            steer, bound = self._pursuit(state, s), self.recovery_mps2
        # The bound must hold during the whole step, so it is computed with the highest speed that is possible at its
        # end.
        speed = state.speed + self.limits.acceleration_mps2 * dt
        limit = min(limit, atan(bound * self.limits.wheelbase_m / (speed * speed))) if speed > 0 else limit
        return max(-limit, min(limit, steer))

    def _pursuit(self, state: BicycleState, s: float) -> float:
        """Return the front wheel angle (rad) of the arc from the rear axle to the look-ahead point."""
        ahead = max(self.settings.lookahead_min_m, self.settings.lookahead_s * state.speed)
        x, y = self.bicycle.rear_axle(state)
        # `s` is that of the footprint's centre; the look-ahead distance is measured from the rear axle, which is behind
        # the centre.
        tx, ty, facing = self.line.at(s - self.bicycle.rear_axle_m + ahead)
        tx, ty = tx - self.line_m * sin(facing), ty + self.line_m * cos(facing)
        angle = wrap(atan2(ty - y, tx - x) - state.heading)
        distance = hypot(tx - x, ty - y)
        if abs(angle) > pi / 2:  # the look-ahead point is behind the axle: turn as hard as the bounds allow
            return self.limits.steer_max_rad if angle > 0 else -self.limits.steer_max_rad
        return atan(2 * self.limits.wheelbase_m * sin(angle) / distance)

    def _pedals(self, speed: float, s: float, targets: Iterable[Target]) -> float:
        """Return the acceleration (m/s^2) of the Intelligent Driver Model behind these targets."""
        limits = self.limits
        allowed = self._allowed[self._mark(s + speed * SLOWING_S)]
        wanted = max(0.1, min(self.cruise_mps, allowed, limits.max_speed_mps))
        if speed < wanted:
            free = limits.acceleration_mps2 * (1 - (speed / wanted) ** 4)
        else:  # just above the wanted speed the IDM brakes only weakly, so slow down with a time constant instead
            free = max((wanted - speed) / SLOWING_S, -limits.braking_mps2)
        acceleration = free
        for room, their_speed in targets:
            closing = speed * (speed - their_speed) / (2 * sqrt(limits.acceleration_mps2 * limits.braking_mps2))
            desired = self.settings.standstill_m + max(0.0, speed * self.settings.headway_s + closing)
            hindered = max(free, 0.0) - limits.acceleration_mps2 * (desired / max(room, 0.1)) ** 2
            acceleration = min(acceleration, hindered)
        return max(acceleration, -limits.emergency_braking_mps2)

    def _line_ahead(self, state: BicycleState, room: float) -> tuple[Target, ...]:
        """Return a stop line as a standing target; nothing if the line is behind the actor, or too near to stop at."""
        can_stop = state.speed**2 <= 2 * self.limits.emergency_braking_mps2 * (room + STOP_LINE_M)
        if room < -STOP_LINE_M or not can_stop:
            return ()
        # The car-following model stops `standstill_m` behind a body. At a line the front should stop nearer, at
        # `STOP_LINE_M`, so the target is placed behind the line.
        return (Target(room + self.settings.standstill_m - STOP_LINE_M, 0.0),)

    def _mark(self, s: float) -> int:
        """Return the index of the line's last point at or before this length."""
        return max(0, min(len(self._marks) - 1, bisect_right(self._marks, s) - 1))

    def _control(self, state: BicycleState, steer: float, acceleration: float) -> Control:
        limits = self.limits
        wheel = steer / limits.steer_max_rad if limits.steer_max_rad > 0 else 0.0
        if acceleration >= 0:
            can = limits.acceleration_mps2 * max(0.05, 1 - state.speed / limits.max_speed_mps)
            return Control(wheel, min(1.0, acceleration / can), 0.0)
        return Control(wheel, 0.0, min(1.0, -acceleration / limits.emergency_braking_mps2))


def _allowed_speed(line: RouteLine, lateral_mps2: float, braking_mps2: float) -> list[float]:
    """Return, for each point, the highest speed (m/s) from which the actor can still slow down for every later limit
    and bend.
    """
    bends = np.sqrt(lateral_mps2 / np.maximum(np.abs(line.curvature), 1e-9))
    return approached(np.minimum(line.speed_limit, bends).tolist(), line.s.tolist(), PLANNED_SHARE * braking_mps2)
